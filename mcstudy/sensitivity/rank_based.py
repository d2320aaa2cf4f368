"""Rank-based first-order index from any sample.

With runs sorted by an input, the covariance of neighbouring outputs is the variance it explains
(F. Gamboa, P. Gremaud, T. Klein, A. Lagnoux, Bernoulli 28, 2022; S. Chatterjee's coefficient).
"""

import numpy as np
from numpy.typing import NDArray

from mcstudy.statistics import REACH, scale_of

Array = NDArray[np.float64]

PARTS, PARTITIONS = 5, 20
"""Disjoint parts of the sample whose variance gives the interval, and number of random partitions
(assumed)."""


def rank_first_order(values: Array, outputs: Array, rng: np.random.Generator) -> Array:
    """Return the first-order index of each input with a 95 % interval, shape (3, d).

    Parameters
    ----------
    values : (n, d) array
    outputs : (n,) array
        Finite.
    rng : Generator
        Of the partitions.
    """
    # Squares of scaled outputs neither overflow nor vanish; the index is scale-invariant.
    outputs = outputs / scale_of(outputs)
    found = _estimate(values, outputs)
    variances = []
    for _ in range(PARTITIONS):
        parts = np.array_split(rng.permutation(outputs.size), PARTS)
        estimates = np.stack([_estimate(values[part], outputs[part]) for part in parts])
        variances.append(estimates.var(axis=0, ddof=1) / PARTS)
    reach = REACH * np.sqrt(np.mean(variances, axis=0))
    return np.stack([found, found - reach, found + reach])


def _estimate(values: Array, outputs: Array) -> Array:
    if np.ptp(outputs) == 0.0:
        return np.full(values.shape[1], np.nan)
    centred = outputs - outputs.mean()
    variance = float(centred @ centred)
    ordered = centred[np.argsort(values, axis=0, kind="stable")]
    return np.asarray((ordered * np.roll(ordered, -1, axis=0)).sum(axis=0) / variance)
