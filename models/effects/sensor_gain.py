"""The accelerometer reads too high or too low by one factor."""

from collections.abc import Mapping
from dataclasses import replace

from models.effects.reading import Reading


def apply(reading: Reading, parameters: Mapping[str, float]) -> Reading:
    """Return what the accelerometer reads with the effect."""
    return replace(reading, acceleration=reading.acceleration * parameters["factor"])
