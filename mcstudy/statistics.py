"""Estimates with confidence intervals that the sampling design supports.

Independent samples get order-statistic intervals for quantiles and Wilson intervals for
probabilities. Latin hypercube and Sobol' samples are not independent; their intervals come from the
spread of the estimate between independent replicates (Student's t).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy import stats

from mcstudy.typed_json import Real

Array = NDArray[np.float64]

CONFIDENCE = 0.95
REACH = float(stats.norm.ppf(0.5 + CONFIDENCE / 2.0))
"""Standard deviations of a normal interval on either side."""
ROUNDING = 1e-12
"""Relative range below which values count as equal: sums round by less (assumed)."""


@dataclass(frozen=True)
class Estimate:
    """A value with its confidence interval; ``low`` and ``high`` are NaN where none exists."""

    value: Real
    low: Real
    high: Real

    @property
    def has_interval(self) -> bool:
        """Whether both ends of the interval exist."""
        return math.isfinite(self.low) and math.isfinite(self.high)

    def times(self, factor: float) -> "Estimate":
        """Return the estimate multiplied by a factor."""
        return Estimate(factor * self.value, factor * self.low, factor * self.high)


@dataclass(frozen=True)
class TooFew:
    """An output with fewer than two values.

    Attributes
    ----------
    unit : unit of the values.
    n : number of values.
    undefined : number of runs without a value.
    """

    unit: str
    n: int
    undefined: int


@dataclass(frozen=True)
class Distribution(TooFew):
    """An output's distribution: mean, standard deviation and quantiles by probability."""

    mean: Estimate
    sd: Estimate
    quantiles: Mapping[str, Estimate]


Described = Annotated[Distribution | TooFew, Field(union_mode="left_to_right")]
"""What ``describe`` gives."""


@dataclass(frozen=True)
class Step:
    """An estimate on the first n values."""

    n: int
    value: Real


def varies(values: Array) -> bool:
    """Return whether the finite values differ by more than rounding."""
    part = values[np.isfinite(values)]
    if part.size < 2:
        return False
    low, high = float(part.min()), float(part.max())
    # Halves: the difference of the largest numbers would overflow.
    return 0.5 * high - 0.5 * low > 0.5 * ROUNDING * max(abs(low), abs(high))


def by_size(values: Mapping[str, float]) -> list[str]:
    """Return the names of values, the largest first; NaN counts as zero."""
    return sorted(values, key=lambda name: -np.nan_to_num(values[name]))


def scale_of(values: Array) -> float:
    """Return the largest absolute finite value, rounded up to a power of two.

    Division by it keeps all digits, and squares then neither overflow nor vanish.
    """
    part = values[np.isfinite(values)]
    exponent = math.frexp(float(np.abs(part).max(initial=0.0)))[1]
    return math.ldexp(1.0, min(max(exponent, -1000), 1000))


def mean(values: Array, replicate: NDArray[np.int64] | None = None) -> Estimate:
    """Return the mean with a t interval.

    Parameters
    ----------
    values : (n,) array
        Finite.
    replicate : (n,) array of int or None
        Replicate of each sample; None if the samples are independent.
    """
    if replicate is not None:
        return _between(values, replicate, lambda p: float(p.mean()), float(values.mean()))
    return _t_interval(values, float(values.mean()))


def standard_deviation(values: Array, replicate: NDArray[np.int64] | None = None) -> Estimate:
    """Return the standard deviation with an interval.

    For independent samples it is a large-sample interval, from the variance of squared deviations.
    """
    value = float(values.std(ddof=1)) if values.size > 1 else np.nan
    if replicate is not None:
        return _between(values, replicate, lambda part: float(part.std(ddof=1)), value)
    if values.size < 3 or value == 0.0:
        return Estimate(value, np.nan, np.nan)
    squared = (values - values.mean()) ** 2
    error = float(squared.std(ddof=1)) / (2.0 * value * np.sqrt(values.size))
    reach = REACH * error
    return Estimate(value, value - reach, value + reach)


def quantile(
    values: Array, probability: float, replicate: NDArray[np.int64] | None = None
) -> Estimate:
    """Return a quantile with an order-statistic or between-replicate interval.

    Parameters
    ----------
    values : (n,) array
        Finite.
    probability : float
        Of the quantile, 0 to 1.
    replicate : (n,) array of int or None
        Replicate of each sample; None if the samples are independent.
    """
    value = float(np.quantile(values, probability))
    if replicate is not None:
        return _between(values, replicate, lambda p: float(np.quantile(p, probability)), value)
    n = values.size
    tail = (1.0 - CONFIDENCE) / 2.0
    low = int(stats.binom.ppf(tail, n, probability)) - 1
    high = int(stats.binom.ppf(1.0 - tail, n, probability))
    ordered = np.sort(values)
    return Estimate(
        value,
        float(ordered[low]) if low >= 0 else np.nan,
        float(ordered[high]) if high < n else np.nan,
    )


def probability(hits: NDArray[np.bool_], replicate: NDArray[np.int64] | None = None) -> Estimate:
    """Return the share of hits with a Wilson or between-replicate interval.

    The between-replicate interval is widened to the Wilson one where all replicates agree, as they
    do for rare events.
    """
    n, k = hits.size, int(hits.sum())
    test = stats.binomtest(k, n).proportion_ci(CONFIDENCE, method="wilson")
    wilson = Estimate(k / n, float(test.low), float(test.high))
    if replicate is None:
        return wilson
    found = _between(hits.astype(np.float64), replicate, lambda part: float(part.mean()), k / n)
    if not np.isfinite(found.low) or found.high - found.low == 0.0:
        return wilson
    return Estimate(found.value, max(found.low, 0.0), min(found.high, 1.0))


def describe(
    values: Array, unit: str = "1", replicate: NDArray[np.int64] | None = None
) -> Distribution | TooFew:
    """Return mean, standard deviation and quantiles of the finite values, with intervals.

    Values that do not vary have a standard deviation of zero, and no interval.

    Parameters
    ----------
    values : (n,) array
        NaN where undefined.
    unit : str
        Of the values.
    replicate : (n,) array of int or None
        Replicate of each sample; None if the samples are independent.
    """
    finite = np.isfinite(values)
    part = values[finite]
    groups = None if replicate is None else replicate[finite]
    size, undefined = int(part.size), int((~finite).sum())
    if size < 2:
        return TooFew(unit, size, undefined)
    chosen = (0.05, 0.25, 0.5, 0.75, 0.95)
    if not varies(part):
        one, nothing = Estimate(float(part[0]), np.nan, np.nan), Estimate(0.0, np.nan, np.nan)
        return Distribution(unit, size, undefined, one, nothing, {f"{p:g}": one for p in chosen})
    scale = scale_of(part)
    part = part / scale
    return Distribution(
        unit, size, undefined, mean(part, groups).times(scale),
        standard_deviation(part, groups).times(scale),
        {f"{p:g}": quantile(part, p, groups).times(scale) for p in chosen},
    )  # fmt: skip


def convergence(values: Array, estimator: Callable[[Array], float]) -> list[Step]:
    """Return the estimator on the first n/8, n/4, n/2 and n values."""
    finite = values[np.isfinite(values)]
    sizes = [finite.size // k for k in (8, 4, 2, 1)]
    return [Step(size, estimator(finite[:size])) for size in sizes if size >= 8]


def between_replicates(estimates: Array, pooled: float) -> Estimate:
    """Return a pooled estimate with the t interval of the estimates of independent replicates.

    Parameters
    ----------
    estimates : (r,) array
        One a replicate.
    pooled : float
        Estimate from all replicates together.
    """
    return _t_interval(estimates, pooled)


def _between(
    values: Array,
    replicate: NDArray[np.int64],
    estimator: Callable[[Array], float],
    pooled: float,
) -> Estimate:
    parts = [values[replicate == r] for r in np.unique(replicate)]
    estimates = np.array([estimator(part) for part in parts if part.size > 1])
    return _t_interval(estimates, pooled)


def _t_interval(values: Array, centre: float) -> Estimate:
    if values.size < 2:
        return Estimate(centre, np.nan, np.nan)
    error = float(values.std(ddof=1)) / np.sqrt(values.size)
    reach = float(stats.t.ppf(0.5 + CONFIDENCE / 2.0, values.size - 1)) * error
    return Estimate(centre, centre - reach, centre + reach)


def crps(values: Array, weights: Array, true: float) -> float:
    """Return the continuous ranked probability score of weighted draws (Gneiting, Raftery 2007).

    Parameters
    ----------
    values, weights : (j,) arrays
        Draws, and weights that sum to one.
    true : float
        What happened.
    """
    order = np.argsort(values)
    x, w = values[order], weights[order]
    summed = np.cumsum(w)
    # Mean distance of two draws: 2 sum of F (1 - F) over the gaps.
    apart = 2.0 * float(np.sum(summed[:-1] * (1.0 - summed[:-1]) * np.diff(x)))
    return float(w @ np.abs(x - true)) - 0.5 * apart
