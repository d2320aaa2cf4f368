"""Contours: an output against an input, as families of curves with bands.

What reconstruction offices read speeds from: throw distance over speed, by friction or by where the
car struck. The curves are quantiles of neighbouring runs, so that no form is assumed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.typed_json import Real

Array = NDArray[np.float64]

GRID = 40
"""Points of a curve."""
NEAREST, LEAST = 0.08, 40
"""Share of a group's runs about a point, and their least number."""
LEVELS = (0.05, 0.5, 0.95)
"""Quantiles of low end, middle and high end of a band."""


@dataclass(frozen=True)
class Family:
    """A curve with its band: label, input, and quantiles of the output there."""

    label: str
    x: Sequence[Real]
    low: Sequence[Real]
    middle: Sequence[Real]
    high: Sequence[Real]


def find_families(
    x: Array, y: Array, by: Array, labels: Sequence[str], edges: Array
) -> list[Family]:
    """Return the curves of an output over an input, by groups of a third quantity.

    Parameters
    ----------
    x, y, by : (n,) arrays
        Input, output, and the quantity that is grouped; runs without one are left out.
    labels : sequence of str
        Of the groups.
    edges : (groups + 1,) array
        Ends of the groups.

    Raises
    ------
    ValueError
        If a group has too few runs.
    """
    known = np.isfinite(x) & np.isfinite(y) & np.isfinite(by)
    found = []
    for label, low, high in zip(labels, edges[:-1], edges[1:], strict=True):
        inside = known & (by >= low) & (by <= high)
        if inside.sum() < LEAST:
            raise ValueError(f"{label}: only {inside.sum()} runs, {LEAST} are needed")
        own, values = x[inside], y[inside]
        first, last = np.quantile(own, [0.02, 0.98])
        grid = np.linspace(float(first), float(last), GRID)
        count = max(int(NEAREST * own.size), LEAST)
        rows = np.array([_local(own, values, at, count) for at in grid])
        found.append(Family(label, grid.tolist(), *rows.T.tolist()))
    return found


def _local(x: Array, y: Array, at: float, count: int) -> Array:
    """Return quantiles of y at a point, neighbours moved along a straight line to it."""
    near = np.argpartition(np.abs(x - at), count - 1)[:count]
    off, values = x[near] - at, y[near]
    slope = np.polyfit(off, values, 1)[0] if np.ptp(off) > 0.0 else 0.0
    return np.asarray(np.quantile(values - slope * off, LEVELS))
