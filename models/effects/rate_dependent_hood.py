"""Rate-dependent hood: the force grows with the rate of penetration, by a dashpot or a factor.

The factor's increase is a power of the rate during loading (G. Cowper, P. Symonds, Brown
University, 1957; with exponent 1 a relative viscosity), and is zero at rest. In the free form a
power of the rate adds a force that is linear between penetrations.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.contact.headform import HeadformContact

ONSET = 0.002
"""m over which a dashpot tapers in where the hood has none of its own (assumed: the force of a hood
has no jump at first touch)."""
PLACES = (0.0, 0.002, 0.005, 0.01, 0.02, 0.04)
"""Penetrations (m) of the free form, the first without force."""
FORCES = ("at_2_mm", "at_5_mm", "at_10_mm", "at_20_mm", "at_40_mm")


def apply(contact: HeadformContact, parameters: Mapping[str, float]) -> HeadformContact:
    """Return the contact with the effect."""
    changed = replace(
        contact,
        damping=contact.damping + parameters["damping"],
        onset=contact.onset if contact.damping > 0.0 else ONSET,
        rate_share=parameters["share"],
        rate_exponent=parameters["exponent"],
    )
    added = np.array([0.0, *(parameters[name] for name in FORCES)])
    if not np.any(added):
        return changed
    return replace(changed, rate_force=np.stack([np.array(PLACES), added], axis=1))
