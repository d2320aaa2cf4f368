"""What the tests of several models and parts build."""

import math

import numpy as np
from hypothesis import HealthCheck, settings
from numpy.typing import NDArray

from models.contact.law import ForceCurve
from models.pedestrian.anthropometry import build_body

Array = NDArray[np.float64]

GRAVITY = 9.80665
CHILD = build_body(7.0, 1.22, 23.2, 3.26)
"""The reference body of the data files: all scales are 1."""


def quiet(examples: int) -> settings:
    """Return settings of a repeatable search."""
    return settings(
        derandomize=True, deadline=None, database=None, max_examples=examples,
        suppress_health_check=[HealthCheck.too_slow],
    )  # fmt: skip


def six(matrix: Array) -> tuple[float, ...]:
    """Return xx, xy, xz, yy, yz, zz."""
    return tuple(float(matrix[i, j]) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))


def turned(angle: float) -> Array:
    """Return the matrix of a turn in the plane."""
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def law(knots: list[list[float]] | Array, ratio: float = 7.0, damping: float = 0.0) -> ForceCurve:
    """Return a loading curve of knots m, N."""
    table = np.asarray(knots, dtype=np.float64)
    return ForceCurve(table[:, 0].copy(), table[:, 1].copy(), ratio, damping)
