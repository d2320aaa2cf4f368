"""How many runs each model gets from a budget.

All models run the first rows of one design, the cheap ones more of them: the samples are nested.
Two estimators share that layout. Multi-fidelity Monte Carlo (Peherstorfer, Willcox and Gunzburger,
SIAM J. Sci. Comput. 38, 2016) has a closed-form allocation, but only for models whose costs fall
fast enough with their correlation. Approximate control variates (Gorodetsky, Geraci, Eldred and
Jakeman, J. Comput. Phys. 408, 2020) have no such condition; their allocation is found numerically.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

Array = NDArray[np.float64]

MFMC, ACV, ALONE = "multi-fidelity Monte Carlo", "approximate control variates", "Monte Carlo"
LEAST_RUNS = 2
"""Runs that every chosen model has at least."""
LARGEST_RATIO = 1e6
"""Runs of a cheap model for one of the dear model, at most."""
CLEARLY = 1.5
"""Variance of multi-fidelity Monte Carlo over that of control variates that makes them worthwhile
(assumed)."""
HIGHEST = 1.0 - 1e-6
"""Squared correlation beyond which a pilot sample cannot tell two models apart (assumed)."""
STARTS = (2.0, 20.0, 200.0)
"""Ratios of runs from which the numerical allocation starts."""


@dataclass(frozen=True)
class Allocation:
    """Runs of each model.

    Attributes
    ----------
    method : ``MFMC``, ``ACV``, or ``ALONE`` if no cheap model helps.
    models : numbers of the models that are used, the dear one first, then by falling correlation.
    runs : of these models, in their order, never falling.
    cost : of all the runs, in the budget's unit.
    variance : predicted variance of the mean of the dear model.
    variance_alone : the same if the whole budget were spent on the dear model.
    """

    method: str
    models: tuple[int, ...]
    runs: tuple[int, ...]
    cost: float
    variance: float
    variance_alone: float


def allocate(covariance: Array, costs: Array, budget: float, *, multiple: int = 1) -> Allocation:
    """Return the runs of each model that give the smallest predicted variance of the dear mean.

    Every set of cheap models is tried, with the closed form of multi-fidelity Monte Carlo where its
    condition holds, and with approximate control variates. These are taken where they leave clearly
    less variance: their weights need more of the pilot.

    Parameters
    ----------
    covariance : (k, k) array
        Of the models' outputs for the same inputs, the dear model first.
    costs : (k,) array
        Of one run of each model.
    budget : float
        In the unit of the costs.
    multiple : int
        Number of replicates, which share the runs of every model evenly.

    Raises
    ------
    ValueError
        If an output of the dear model does not vary, or the budget does not pay for two runs of it
        in every replicate.
    """
    if not covariance[0, 0] > 0.0:
        raise ValueError("the output of the dearest model does not vary in the pilot runs")
    least = LEAST_RUNS * multiple
    if budget < least * costs[0]:
        raise ValueError(
            f"the budget of {budget:g} s pays for {int(budget / costs[0])} runs of the dearest "
            f"model at {costs[0]:g} s; it takes {least}"
        )
    alone = covariance[0, 0] * costs[0] / budget
    whole = _rounded([budget / costs[0]], multiple)
    best = Allocation(
        ALONE, (0,), whole, whole[0] * float(costs[0]), covariance[0, 0] / whole[0], float(alone)
    )
    cheap = [k for k in range(1, len(costs)) if covariance[k, k] > 0.0]
    correlation = covariance[0] / np.sqrt(covariance[0, 0] * np.diag(covariance).clip(1e-300))
    for size in range(1, len(cheap) + 1):
        for chosen in itertools.combinations(cheap, size):
            order = (0, *sorted(chosen, key=lambda k: -abs(correlation[k])))
            for method, factor in ((MFMC, 1.0), (ACV, CLEARLY)):
                found = _of_models(method, order, covariance, costs, budget, multiple, float(alone))
                if found is not None and factor * found.variance < best.variance:
                    best = found
    return best


def _of_models(
    method: str,
    order: tuple[int, ...],
    covariance: Array,
    costs: Array,
    budget: float,
    multiple: int,
    alone: float,
) -> Allocation | None:
    """Return the allocation of one set of models, None if there is none or it does not pay."""
    part = covariance[np.ix_(order, order)]
    price = costs[list(order)]
    ratios = mfmc_ratios(part, price) if method == MFMC else _acv_ratios(part, price)
    if ratios is None:
        return None
    first = budget / float(price @ ratios)
    if first < LEAST_RUNS * multiple:
        # The dear model keeps its least number of runs; the cheap ones share what is left.
        first = float(LEAST_RUNS * multiple)
        left = (budget - first * price[0]) / float(price[1:] @ ratios[1:])
        if left < first:
            return None
        ratios = np.concatenate([[1.0], np.maximum(ratios[1:] * left / first, 1.0)])
    runs = _rounded((first * ratios).tolist(), multiple)
    variance = predicted_variance(method, part, runs)
    return Allocation(method, order, runs, float(price @ np.array(runs)), variance, alone)


def _rounded(runs: Sequence[float], multiple: int) -> tuple[int, ...]:
    """Return whole numbers of runs a replicate, times the replicates, that never fall."""
    found: list[int] = []
    for value in runs:
        least = found[-1] if found else LEAST_RUNS * multiple
        found.append(max(least, multiple * math.floor(value / multiple + 1e-9)))
    return tuple(found)


def mfmc_ratios(covariance: Array, costs: Array) -> Array | None:
    """Return the runs of each model over those of the dear one, by the closed form.

    Parameters
    ----------
    covariance : (k, k) array
        The dear model first, the others by falling correlation with it.
    costs : (k,) array

    Returns
    -------
    (k,) array, or None where the condition on costs and correlations fails
        Theorem 3.4 of Peherstorfer, Willcox and Gunzburger.
    """
    rho = _squares(covariance)
    steps = rho - np.append(rho[1:], 0.0)
    if np.any(steps <= 0.0):
        return None
    for i in range(1, len(costs)):
        if not costs[i - 1] / costs[i] > steps[i - 1] / steps[i]:
            return None
    return np.asarray(np.sqrt(costs[0] * steps / (costs * steps[0])))


def predicted_variance(method: str, covariance: Array, runs: Sequence[int]) -> float:
    """Return the variance of the estimated mean of the dear model, with the best weights.

    Parameters
    ----------
    method : str
        ``MFMC`` or ``ACV``.
    covariance : (k, k) array
        The dear model first.
    runs : sequence of int
        Of each model.
    """
    n = np.asarray(runs, dtype=float)
    if method == MFMC:
        gains = (1.0 / n[:-1] - 1.0 / n[1:]) * _squares(covariance)[1:]
        return float(covariance[0, 0] * (1.0 / n[0] - gains.sum()))
    return float(covariance[0, 0] / n[0] * _unexplained(covariance, n / n[0]))


def acv_weights(covariance: Array, ratios: Array) -> Array:
    """Return the weights (k - 1,) of the approximate control variates of nested samples.

    Parameters
    ----------
    covariance : (k, k) array
        The dear model first.
    ratios : (k,) array
        Runs of each model over those of the dear one; above 1 for all others.

    Notes
    -----
    The estimator is the mean of the dear model plus the sum of the weights times the difference of
    a cheap model's mean over the dear one's rows and over all its own.
    """
    shared, between = _overlap(covariance, ratios)
    # A cheap model that adds nothing to the others leaves the system singular.
    found = np.linalg.lstsq(shared, between, rcond=1e-10)[0]
    return np.asarray(-found)


def _overlap(covariance: Array, ratios: Array) -> tuple[Array, Array]:
    """Return C o F and diag(F) o c of the ACV-MF estimator (Gorodetsky and others, eq. 25)."""
    least = np.minimum.outer(ratios[1:], ratios[1:])
    shares = (least - 1.0) / least
    return covariance[1:, 1:] * shares, np.diag(shares) * covariance[0, 1:]


def _unexplained(covariance: Array, ratios: Array) -> float:
    """Return the share of the dear mean's variance that control variates leave."""
    helping = np.append(True, ratios[1:] > 1.0)
    part, r = covariance[np.ix_(helping, helping)], ratios[helping]
    if r.size == 1:
        return 1.0
    between = _overlap(part, r)[1]
    explained = -float(between @ acv_weights(part, r)) / covariance[0, 0]
    return max(1.0 - float(explained), 0.0)


def _acv_ratios(covariance: Array, costs: Array) -> Array:
    """Return the runs of each model over those of the dear one that minimise the variance."""

    def loss(logs: Array) -> float:
        ratios = np.append(1.0, np.exp(np.clip(logs, 0.0, np.log(LARGEST_RATIO))))
        return float(np.log(costs @ ratios) + np.log(_unexplained(covariance, ratios) + 1e-12))

    found = [
        optimize.minimize(
            loss, np.full(len(costs) - 1, np.log(start)), method="Nelder-Mead",
            options={"xatol": 1e-3, "fatol": 1e-6, "maxiter": 2000},
        )
        for start in STARTS
    ]  # fmt: skip
    best = min(found, key=lambda entry: float(entry.fun)).x
    return np.append(1.0, np.exp(np.clip(best, 0.0, np.log(LARGEST_RATIO))))


def _squares(covariance: Array) -> Array:
    """Return the squared correlations (k,) with the dear model."""
    found = covariance[0] ** 2 / (covariance[0, 0] * np.diag(covariance))
    found[1:] = np.minimum(found[1:], HIGHEST)
    return np.asarray(found)
