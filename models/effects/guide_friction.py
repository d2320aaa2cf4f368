"""Guide friction: a guide of the drop rig rubs on the headform, in either direction.

Before contact, into the hood and out of it the guide slows the headform, so the accelerometer reads
the friction where a free headform would feel nothing. The force goes with a power of the speed: 0
for dry friction, 1 for grease.
"""

from collections.abc import Mapping
from dataclasses import replace

from models.contact.headform import HeadformContact


def apply(contact: HeadformContact, parameters: Mapping[str, float]) -> HeadformContact:
    """Return the contact with the effect."""
    return replace(contact, guide_force=parameters["force"], guide_exponent=parameters["exponent"])
