"""Sensor saturation: the accelerometer clips at its range, or saturates gradually.

A reading ``a`` becomes ``a / (1 + |a / limit|^sharpness)^(1 / sharpness)``; for a sharpness of 50
and more it is clipped.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.effects.reading import Reading

CLIPPING = 50.0
"""Sharpness from which the signal is clipped."""


def apply(reading: Reading, parameters: Mapping[str, float]) -> Reading:
    """Return the accelerometer reading with the effect."""
    limit, sharpness = parameters["limit"], parameters["sharpness"]
    a = reading.acceleration
    if sharpness >= CLIPPING:
        return replace(reading, acceleration=np.clip(a, -limit, limit))
    knee = (1.0 + np.abs(a / limit) ** sharpness) ** (1.0 / sharpness)
    return replace(reading, acceleration=a / knee)
