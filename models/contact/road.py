"""The road as the compiled core takes it."""

import math
from typing import NamedTuple

from models.criteria.units import STANDARD_GRAVITY


class Road(NamedTuple):
    """A plane, z = 0 in its own axes.

    Attributes
    ----------
    friction : against the body. wet_from : m along the car's travel from first contact, beyond
        which it is ``wet_friction``.
    gravity_along, gravity_down : m/s2, gravity along the car's travel and into the road.
    returned : factor on the share of the energy that the body gets back from the road.
    """

    friction: float
    wet_from: float = math.inf
    wet_friction: float = 0.0
    gravity_along: float = 0.0
    gravity_down: float = STANDARD_GRAVITY
    returned: float = 1.0
