"""Sensor offset: the accelerometer has a zero offset along its first axis.

For a headform the first axis is the normal of the hood.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.effects.reading import Reading


def apply(reading: Reading, parameters: Mapping[str, float]) -> Reading:
    """Return the accelerometer reading with the effect."""
    offset = np.zeros(reading.acceleration.shape[1])
    offset[0] = parameters["offset"]
    return replace(reading, acceleration=reading.acceleration + offset)
