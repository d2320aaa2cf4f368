"""Sensor filter: the signal was filtered with another class than the stated one."""

from collections.abc import Mapping
from dataclasses import replace

from models.effects.reading import Reading


def apply(reading: Reading, parameters: Mapping[str, float]) -> Reading:
    """Return the accelerometer reading with the effect."""
    used = parameters["channel_class"]
    return replace(reading, channel_class=used if used > 0.0 else reading.channel_class)
