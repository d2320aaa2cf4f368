"""Rank-based first-order index from any sample.

Sort the runs by an input: what the outputs of neighbours share is what that input explains
(F. Gamboa, P. Gremaud, T. Klein, A. Lagnoux, Bernoulli 28, 2022; S. Chatterjee's coefficient).
"""

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]

SUBSAMPLES = 100
"""Half samples whose scatter gives the interval (assumed)."""


def rank_first_order(values: Array, outputs: Array, rng: np.random.Generator) -> Array:
    """Return the first-order index of each input with a 95 % interval, shape (3, d).

    Parameters
    ----------
    values : (n, d). outputs : (n,), finite. rng : of the half samples.
    """
    found = _estimate(values, outputs)
    half = outputs.size // 2
    parts = [rng.permutation(outputs.size)[:half] for _ in range(SUBSAMPLES)]
    halves = np.stack([_estimate(values[part], outputs[part]) for part in parts])
    # A half sample scatters about the whole one as much as the whole one about the truth.
    error = np.sqrt(np.mean((halves - found) ** 2, axis=0))
    reach = float(stats.norm.ppf(0.975)) * error
    return np.stack([found, found - reach, found + reach])


def _estimate(values: Array, outputs: Array) -> Array:
    centred = outputs - outputs.mean()
    variance = float(centred @ centred)
    if variance == 0.0:
        return np.full(values.shape[1], np.nan)
    ordered = centred[np.argsort(values, axis=0, kind="stable")]
    return np.asarray((ordered * np.roll(ordered, -1, axis=0)).sum(axis=0) / variance)
