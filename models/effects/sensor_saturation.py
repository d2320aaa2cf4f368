"""The accelerometer clips what is beyond its range."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.headform.reading import Reading


def apply(reading: Reading, parameters: Mapping[str, float]) -> Reading:
    """Return what the accelerometer reads with the effect."""
    limit = parameters["limit"]
    return replace(reading, acceleration=np.clip(reading.acceleration, -limit, limit))
