"""The road in the form that the compiled core uses."""

import math
from typing import NamedTuple

from models.criteria.units import STANDARD_GRAVITY


class Road(NamedTuple):
    """A plane, z = 0 in its own axes.

    Attributes
    ----------
    friction : float
        Coefficient of friction against the body.
    wet_from : float
        Distance along the car's travel from first contact beyond which the road is wet, m.
    wet_friction : float
        Coefficient of friction there.
    gravity_along, gravity_down : float
        Gravity components along the car's travel and into the road, m/s2.
    returned : float
        Factor on the share of the energy that the road contact returns to the body.
    """

    friction: float
    wet_from: float = math.inf
    wet_friction: float = 0.0
    gravity_along: float = 0.0
    gravity_down: float = STANDARD_GRAVITY
    returned: float = 1.0
