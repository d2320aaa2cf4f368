"""Published relations of throw distance and speed."""

import numpy as np
from numpy.typing import NDArray

from models.criteria.units import STANDARD_GRAVITY

Array = NDArray[np.float64]


def searle(distance: Array, friction: Array | float) -> tuple[Array, Array]:
    """Return Searle's lowest and highest speed (m/s) for a throw distance (m)."""
    highest = np.sqrt(2.0 * friction * STANDARD_GRAVITY * distance)
    return highest / np.sqrt(1.0 + np.square(friction)), highest


def toor_wrap(distance: Array) -> Array:
    """Return the speed (km/h) of Toor and Araszewski 2003 for wrap (recalled)."""
    return 9.84 * np.asarray(distance) ** 0.57


def toor_forward(distance: Array) -> Array:
    """Return the speed (km/h) of Toor and Araszewski 2003 for forward projection (recalled)."""
    return 8.25 * np.asarray(distance) ** 0.61


def happer_wrap(distance: Array) -> Array:
    """Return the speed (km/h) of Happer 2000 for wrap (recalled)."""
    return 13.3 * np.sqrt(distance) - 4.6


def wood_simms(distance: Array, factor: float = 3.6) -> Array:
    """Return the speed (m/s) of Wood, Simms and Walsh 2004; bounds 2.5 and 4.5 (recalled)."""
    return factor * np.sqrt(distance)
