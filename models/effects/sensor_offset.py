"""The accelerometer is off zero, along the normal of the hood."""

from collections.abc import Mapping
from dataclasses import replace

from models.headform.reading import Reading


def apply(reading: Reading, parameters: Mapping[str, float]) -> Reading:
    """Return what the accelerometer reads with the effect."""
    return replace(reading, acceleration=reading.acceleration + (parameters["offset"], 0.0))
