"""The hood is stiffer when struck faster: a dashpot, a power of the rate, or both."""

from collections.abc import Mapping
from dataclasses import replace

from models.headform.reading import HeadformContact


def apply(contact: HeadformContact, parameters: Mapping[str, float]) -> HeadformContact:
    """Return the contact with the effect."""
    return replace(
        contact,
        damping=contact.damping + parameters["damping"],
        rate_exponent=contact.rate_exponent + parameters["exponent"],
    )
