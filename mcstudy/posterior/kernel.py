"""Kernel posterior of one quantity: neighbours of the summary, weighted and shifted.

The neighbours' values are shifted along a local straight line to the observed summary (M. Beaumont,
W. Zhang, D. Balding, Genetics 162:2025, 2002).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SHARE, LEAST = 0.05, 80
"""Share of the runs that are neighbours, and their least number."""


@dataclass(frozen=True)
class Neighbours:
    """Weighted draws of a posterior.

    Attributes
    ----------
    places : (j,) int array
        Simulated sets of evidence, in the order of the arrays of the kernel.
    weights : (j,) array
        They sum to one.
    shifted : (j,) array
        Target, shifted to the observed summary.
    """

    places: Index
    weights: Array
    shifted: Array


class Kernel:
    """Posteriors of a target by a scalar summary.

    Parameters
    ----------
    summary, target : (m,) arrays
        Of the simulated sets of evidence; the target on an unbounded scale.
    rows : (m,) int array
        Run of each set.
    weights : (m,) array
        Prior weight of each set.
    share : float
        Share of the sets that are neighbours.
    """

    def __init__(
        self, summary: Array, target: Array, rows: Index, weights: Array, share: float = SHARE
    ) -> None:
        self._order = np.argsort(summary, kind="stable")
        self._summary = summary[self._order]
        self._target, self._rows = target[self._order], rows[self._order]
        self._weights = weights[self._order]
        copies = len(rows) / max(np.unique(rows).size, 1)
        count = max(share * len(rows), LEAST * copies)
        self._count = int(min(count, len(rows)))

    def at(self, observed: float, without: int | None = None) -> Neighbours:
        """Return the posterior at an observed summary.

        Parameters
        ----------
        observed : float
            Summary of the evidence.
        without : int, optional
            Run that is left out.
        """
        s = self._summary
        place = int(np.searchsorted(s, observed))
        low, high = max(place - self._count, 0), min(place + self._count, s.size)
        near = np.abs(s[low:high] - observed)
        wanted = min(self._count, near.size)
        reach = float(np.partition(near, wanted - 1)[wanted - 1]) * (1.0 + 1e-9) + 1e-300
        chosen = low + np.flatnonzero(near < reach)
        if without is not None:
            chosen = chosen[self._rows[chosen] != without]
        off = s[chosen] - observed
        weights = self._weights[chosen] * (1.0 - (off / reach) ** 2)
        weights = np.maximum(weights, 0.0)
        weights /= weights.sum()
        target = self._target[chosen]
        middle = float(weights @ off)
        spread = float(weights @ (off - middle) ** 2)
        slope = float(weights @ ((off - middle) * target)) / spread if spread > 0.0 else 0.0
        return Neighbours(self._order[chosen], weights, target - slope * off)


def weighted_quantile(values: Array, weights: Array, levels: Array | float) -> Array:
    """Return quantiles of weighted draws, straight between their middles.

    Parameters
    ----------
    values, weights : (j,) arrays
        Draws, and weights that sum to one.
    levels : (l,) array or float
        Probabilities.
    """
    order = np.argsort(values, kind="stable")
    summed = np.cumsum(weights[order]) - 0.5 * weights[order]
    return np.asarray(np.interp(levels, summed, values[order]))


def effective_size(weights: Array) -> float:
    """Return the effective number of weighted draws (L. Kish, 1965)."""
    total = float(weights.sum())
    return total**2 / float(weights @ weights) if total > 0.0 else 0.0
