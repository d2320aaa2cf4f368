"""Rank-based first-order index from any sample.

Sort the runs by an input: what the outputs of neighbours share is what that input explains
(F. Gamboa, P. Gremaud, T. Klein, A. Lagnoux, Bernoulli 28, 2022; S. Chatterjee's coefficient).
"""

import numpy as np
from numpy.typing import NDArray

from mcstudy.statistics import REACH, scale_of

Array = NDArray[np.float64]

PARTS, PARTITIONS = 5, 20
"""Disjoint parts of the sample whose scatter gives the interval, and how often they are drawn anew
(assumed)."""


def rank_first_order(values: Array, outputs: Array, rng: np.random.Generator) -> Array:
    """Return the first-order index of each input with a 95 % interval, shape (3, d).

    Parameters
    ----------
    values : (n, d). outputs : (n,), finite. rng : of the parts.
    """
    # Squares of scaled outputs neither overflow nor vanish; an index does not feel the scale.
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
