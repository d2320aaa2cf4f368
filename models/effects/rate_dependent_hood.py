"""The hood is stiffer when struck faster: a dashpot, or a share of the force that grows.

The share grows with a power of the rate while the hood is pushed in (G. Cowper, P. Symonds, Brown
University, 1957; with exponent 1 a relative viscosity), and is nothing at rest.
"""

from collections.abc import Mapping
from dataclasses import replace

from models.contact.headform import HeadformContact

ONSET = 0.002
"""m over which a dashpot fades in where the hood has none of its own (assumed: the force of a hood
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
