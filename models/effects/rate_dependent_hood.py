"""Rate-dependent hood: the force grows with the rate of penetration, by a dashpot or a factor.

The factor's increase is a power of the rate during loading (G. Cowper, P. Symonds, Brown
University, 1957; with exponent 1 a relative viscosity), and is zero at rest.
"""

from collections.abc import Mapping
from dataclasses import replace

from models.contact.headform import HeadformContact

ONSET = 0.002
"""m over which a dashpot tapers in where the hood has none of its own (assumed: the force of a hood
has no jump at first touch)."""


def apply(contact: HeadformContact, parameters: Mapping[str, float]) -> HeadformContact:
    """Return the contact with the effect."""
    return replace(
        contact,
        damping=contact.damping + parameters["damping"],
        onset=contact.onset if contact.damping > 0.0 else ONSET,
        rate_share=parameters["share"],
        rate_exponent=parameters["exponent"],
    )
