"""The signal went through another filter class than the one stated."""

from collections.abc import Mapping
from dataclasses import replace

from models.effects.reading import Reading


def apply(reading: Reading, parameters: Mapping[str, float]) -> Reading:
    """Return what the accelerometer reads with the effect."""
    used = parameters["channel_class"]
    return replace(reading, channel_class=used if used > 0.0 else reading.channel_class)
