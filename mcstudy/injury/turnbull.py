"""Turnbull's non-parametric estimate of the risk.

Self-consistent shares of the innermost intervals (B. Turnbull, Journal of the Royal Statistical
Society B 38, 1976); for data that are only left- and right-censored the same as isotonic regression
of injury on the stimulus.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from mcstudy.injury.observations import Observations

Array = NDArray[np.float64]

MAX_STEPS = 2_000
TOLERANCE = 1e-9
"""Largest change of a share in a step at which the iteration has converged."""


@dataclass(frozen=True)
class StepRisk:
    """A non-parametric risk curve: it rises somewhere within each interval.

    Attributes
    ----------
    low, high : (m,) intervals of the stimulus in which risk rises.
    share : (m,) rise of the risk in each interval.
    """

    low: Array
    high: Array
    share: Array

    def steps(self) -> tuple[Array, Array]:
        """Return stimulus and risk of the curve that rises at the end of each interval."""
        held = np.isfinite(self.high)
        x = np.concatenate([[0.0], np.repeat(self.high[held], 2)])
        risk = np.concatenate([[0.0], np.cumsum(self.share[held])])
        return x, np.repeat(risk, 2)[:-1]


def estimate_steps(observations: Observations) -> StepRisk:
    """Return Turnbull's estimate.

    Parameters
    ----------
    observations : Observations, as ``observe`` gives them.
    """
    low, high = observations.low, observations.high
    exact = observations.exact
    if not exact.any() and np.all((low == 0.0) | np.isinf(high)):
        return _isotonic(observations)
    left, right = _innermost(low, high)
    point = left == right
    # A case's interval is open below: it holds no point at its lower bound, but its own if exact.
    above = np.where(point, left > low[:, None], left >= low[:, None])
    inside = above & (right <= high[:, None])
    inside[exact] = point & (left == high[exact][:, None])
    weight = observations.weights / observations.weights.sum()
    share = np.full(left.size, 1.0 / left.size)
    for _ in range(MAX_STEPS):
        once = _redistribute(inside, weight, share)
        twice = _redistribute(inside, weight, once)
        if float(np.max(np.abs(twice - once))) < TOLERANCE:
            return StepRisk(left, right, twice)
        share = _extrapolate(inside, weight, share, once, twice)
    return StepRisk(left, right, share)


def _redistribute(inside: NDArray[np.bool_], weight: Array, share: Array) -> Array:
    """Return the shares after one step of self-consistency."""
    return np.asarray(share * (inside.T @ (weight / (inside @ share))))


def _extrapolate(
    inside: NDArray[np.bool_], weight: Array, share: Array, once: Array, twice: Array
) -> Array:
    """Return the extrapolation of two self-consistency steps, or the second if more likely.

    Squared extrapolation of R. Varadhan and C. Roland, Scandinavian Journal of Statistics 35, 2008.
    """
    step, bend = once - share, (twice - once) - (once - share)
    size = float(np.linalg.norm(bend))
    if size == 0.0:
        return twice
    length = max(1.0, float(np.linalg.norm(step)) / size)
    far = np.maximum(share + 2.0 * length * step + length**2 * bend, 0.0)
    far /= far.sum()
    held = inside @ far
    if held.min() > 0.0 and weight @ np.log(held) >= weight @ np.log(inside @ twice):
        return far
    return twice


def _isotonic(observations: Observations) -> StepRisk:
    """Return the estimate of cases that are only left- or right-censored, in one pass."""
    order = np.lexsort((~observations.injured, observations.stimulus))
    x = observations.stimulus[order]
    risk = np.clip(
        optimize.isotonic_regression(
            observations.injured[order].astype(float), weights=observations.weights[order]
        ).x,
        0,
        1,
    )
    rises = np.flatnonzero(np.diff(risk, prepend=0.0) > 0.0)
    below = np.where(rises > 0, x[rises - 1], 0.0)
    low, high = np.append(below, x[-1]), np.append(x[rises], np.inf)
    share = np.append(np.diff(risk[rises], prepend=0.0), 1.0 - risk[-1])
    kept = share > 0.0
    return StepRisk(low[kept], high[kept], share[kept])


def _innermost(low: Array, high: Array) -> tuple[Array, Array]:
    """Return Turnbull's intervals: a lower bound directly followed by an upper bound."""
    # Ties: exact cases first, then ends of intervals, which contain the value, then beginnings,
    # which do not.
    marks = sorted(
        [(a, 0 if a == b else 3, "low") for a, b in zip(low, high, strict=True)]
        + [(b, 1 if a == b else 2, "high") for a, b in zip(low, high, strict=True)]
    )
    found = [
        (first[0], second[0])
        for first, second in pairwise(marks)
        if first[2] == "low" and second[2] == "high"
    ]
    left, right = np.array(sorted(set(found))).T
    return left, right
