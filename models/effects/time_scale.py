"""Time scale: the recorder's clock runs fast or slow."""

from collections.abc import Mapping
from dataclasses import replace

from models.effects.reading import Reading


def apply(reading: Reading, parameters: Mapping[str, float]) -> Reading:
    """Return the accelerometer reading with the effect."""
    return replace(reading, clock=reading.clock * parameters["factor"])
