"""Skin compliance: the headform's skin deforms elastically in series with the hood.

The penetration of the skin is a power of the force: 1 for a linear spring, 2/3 for a sphere pressed
into an elastic half space (H. Hertz, J. reine angew. Math. 92:156, 1882).
"""

from collections.abc import Mapping
from dataclasses import replace

from models.contact.headform import HeadformContact


def apply(contact: HeadformContact, parameters: Mapping[str, float]) -> HeadformContact:
    """Return the contact with the effect."""
    return replace(
        contact,
        skin_compliance=contact.skin_compliance + parameters["compliance"],
        skin_power=parameters["power"],
    )
