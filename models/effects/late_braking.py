"""Late braking: the car begins to brake only some time after the impact."""

from collections.abc import Mapping

from models.vehicle.motion import CarMotion


def apply(motion: CarMotion, parameters: Mapping[str, float]) -> CarMotion:
    """Return the car's motion with the effect."""
    return motion._replace(onset=parameters["delay"])
