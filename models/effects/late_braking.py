"""The car brakes only some time after it has struck."""

from collections.abc import Mapping

from models.vehicle.motion import CarMotion


def apply(motion: CarMotion, parameters: Mapping[str, float]) -> CarMotion:
    """Return the motion of the car with the effect."""
    return motion._replace(onset=parameters["delay"])
