"""Sensor gain: the accelerometer reading is too high or too low by a constant factor."""

from collections.abc import Mapping
from dataclasses import replace

from models.effects.reading import Reading


def apply(reading: Reading, parameters: Mapping[str, float]) -> Reading:
    """Return the accelerometer reading with the effect."""
    return replace(reading, acceleration=reading.acceleration * parameters["factor"])
