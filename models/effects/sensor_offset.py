"""The accelerometer is off zero along its first axis, a headform's the normal of the hood."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.effects.reading import Reading


def apply(reading: Reading, parameters: Mapping[str, float]) -> Reading:
    """Return what the accelerometer reads with the effect."""
    offset = np.zeros(reading.acceleration.shape[1])
    offset[0] = parameters["offset"]
    return replace(reading, acceleration=reading.acceleration + offset)
