"""Joint coverage of posteriors of several quantities by distances to random points.

P. Lemos and others, Sampling-based accuracy testing of posterior estimators (TARP), 2023.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mcstudy.posterior.inference import Draws, Posterior
from mcstudy.sampling import seeds

Array = NDArray[np.float64]


def measure_joint_coverage(
    posterior: Posterior, names: Sequence[str], *, count: int = 500, seed: int = 0
) -> tuple[float, float]:
    """Return the Kolmogorov distance of the joint coverage from uniform, and its p-value.

    Parameters
    ----------
    posterior : Posterior
    names : sequence of str
        Quantities besides the target.
    count : int
        Runs that are left out.
    seed : int
        Of their choice and of the random points.
    """
    rng = seeds.generator(seed, seeds.EVIDENCE, 2)
    rows = posterior.simulated.rows
    known = np.ones(rows.size, dtype=bool)
    for name in names:
        known &= np.isfinite(posterior.bank.values[name][rows])
    weights = posterior.prior[rows] * known
    places = rng.choice(rows.size, count, p=weights / weights.sum())
    columns = [posterior.target, *names]
    table = np.stack([posterior.bank.values[name] for name in columns], axis=1)
    usable = np.isfinite(table).all(axis=1)
    low, high = (np.quantile(table[usable], level, axis=0) for level in (0.005, 0.995))
    unit = np.where(high > low, high - low, 1.0)
    scaled = (table - low) / unit
    ranks = np.empty(count)
    for k, place in enumerate(places):
        draws = posterior.given_set(int(place))
        own = _points(draws, scaled, low[0], unit[0])
        held = np.isfinite(own).all(axis=1)
        reference = rng.uniform(size=len(columns))
        far = np.linalg.norm(scaled[rows[place]] - reference)
        apart = np.linalg.norm(own[held] - reference, axis=1)
        share = draws.weights[held] / draws.weights[held].sum()
        ranks[k] = float(share[apart < far].sum())
    found = stats.kstest(ranks, "uniform")
    return float(found.statistic), float(found.pvalue)


def _points(draws: Draws, scaled: Array, low: float, unit: float) -> Array:
    """Return the draws (j, d) of all quantities, the target as adjusted."""
    own = scaled[draws.runs].copy()
    own[:, 0] = (draws.values - low) / unit
    return own
