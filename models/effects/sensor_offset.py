"""The accelerometer is off zero, along the normal of the hood."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.headform.reading import Reading


def apply(reading: Reading, parameters: Mapping[str, float]) -> Reading:
    """Return what the accelerometer reads with the effect."""
    offset = np.array([parameters["offset"], 0.0])
    return replace(reading, acceleration=reading.acceleration + offset)
