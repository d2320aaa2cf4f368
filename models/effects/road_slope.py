"""Road slope: the road falls or rises along the car's travel."""

import math
from collections.abc import Mapping

from models.contact.road import Road
from models.criteria.units import STANDARD_GRAVITY


def apply(road: Road, parameters: Mapping[str, float]) -> Road:
    """Return the road with the effect."""
    angle = parameters["angle"]
    return road._replace(
        gravity_along=STANDARD_GRAVITY * math.sin(angle),
        gravity_down=STANDARD_GRAVITY * math.cos(angle),
    )
