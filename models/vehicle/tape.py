"""A taut tape from the road over the front of a car, in side view."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EDGE_TANGENT = math.radians(40.0)
"""Slope of the straight edge that marks the hood's leading edge: 50 deg from the vertical
(EEVC WG17 bonnet leading edge reference line, recalled)."""


def tape_over(points: Array) -> Array:
    """Return the path (k, 2) of a taut tape from the road under the foremost point to the rearmost.

    Parameters
    ----------
    points : (n, 2) array
        x and z of a section, m.
    """
    path = [np.array([points[:, 0].max(), 0.0])]
    # Gift wrapping from the road upwards and rearwards.
    heading, last = 0.5 * math.pi, points[:, 0].min()
    while path[-1][0] > last + 1e-9:
        step = points - path[-1]
        size = np.hypot(step[:, 0], step[:, 1])
        angle = np.arctan2(step[:, 1], step[:, 0]) % (2.0 * math.pi)
        ahead = (size > 1e-9) & (angle >= heading - 1e-9) & (angle < heading + math.pi)
        if not ahead.any():
            break
        turned = np.where(ahead, angle, np.inf)
        nearest = np.lexsort((-size, np.round(turned, 9)))[0]
        heading = float(angle[nearest])
        path.append(points[nearest])
    return np.array(path)
