"""Hood inertia: the headform accelerates a mass of the hood over the first millimetres.

The mass moved up to penetration x, ``mass * (1 - exp(-(x / depth)^2))``, has the headform's speed,
so the headform loses momentum to it (an inelastic impact, spread over the penetration). The mass
stays with the headform until they separate.
"""

from collections.abc import Mapping
from dataclasses import replace

from models.contact.headform import HeadformContact


def apply(contact: HeadformContact, parameters: Mapping[str, float]) -> HeadformContact:
    """Return the contact with the effect."""
    return replace(contact, moved_mass=parameters["mass"], moved_depth=parameters["depth"])
