"""Estimates of the dear model's distribution from nested runs of several models.

Everything is a mean: an exceedance that of an indicator, a variance that of squares, a quantile the
level at which an exceedance has a given value. Outputs that a run does not have (no head contact)
leave the mean of those that have one: a ratio of two means. Intervals come from leaving out one
replicate at a time (delete-a-group jackknife; Kott, J. Official Statistics 17, 2001), weights
included.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats

from mcstudy.multifidelity.allocation import MFMC, acv_weights
from mcstudy.statistics import CONFIDENCE, Estimate

Array = NDArray[np.float64]
Transform = Callable[[Array], Array]

TOLERANCE = 1e-4
"""Share of the range of the dear model's runs within which a quantile is found."""


@dataclass(frozen=True)
class NestedRuns:
    """Values of one output by several models on the first rows of one design.

    Row k belongs to replicate ``k % replicates``.

    Attributes
    ----------
    method : ``MFMC`` or ``ACV``; of one model alone both are plain Monte Carlo.
    values : (n_i,) by model, the dear one first; NaN where a run has no value. The numbers of rows
        are multiples of ``replicates`` and never fall.
    replicates : number of independent parts of the design, 2 or more.
    """

    method: str
    values: tuple[Array, ...]
    replicates: int

    def without(self, replicate: int) -> "NestedRuns":
        """Return the runs without one replicate."""
        kept = tuple(v[np.arange(v.size) % self.replicates != replicate] for v in self.values)
        return NestedRuns(self.method, kept, self.replicates - 1)

    @property
    def alone(self) -> "NestedRuns":
        """The runs of the dear model."""
        return NestedRuns(self.method, self.values[:1], self.replicates)


def nested_mean(method: str, columns: Sequence[Array]) -> float:
    """Return the mean of the dear model's column, with the others as control variates.

    Parameters
    ----------
    method : str
        ``MFMC`` or ``ACV``.
    columns : sequence of (n_i,) array
        By model, the dear one first, on the first rows of one design.
    """
    first = columns[0].size
    found = float(columns[0].mean())
    if len(columns) == 1 or first < 2:
        return found
    shared = np.atleast_2d(np.cov(np.stack([column[:first] for column in columns])))
    if method == MFMC:
        for k in range(1, len(columns)):
            if shared[k, k] > 0.0:
                weight = shared[0, k] / shared[k, k]
                before = columns[k][: columns[k - 1].size].mean()
                found += float(weight * (columns[k].mean() - before))
        return found
    ratios = np.array([column.size / first for column in columns])
    helping = [k for k in range(1, len(columns)) if ratios[k] > 1.0 and shared[k, k] > 0.0]
    if helping:
        chosen = [0, *helping]
        weights = acv_weights(shared[np.ix_(chosen, chosen)], ratios[chosen])
        for k, weight in zip(helping, weights, strict=True):
            found += float(weight * (columns[k][:first].mean() - columns[k].mean()))
    return found


def _ratio(runs: NestedRuns, transforms: Sequence[Transform]) -> float:
    """Return the mean of a function of the output over the runs that have one.

    Parameters
    ----------
    runs : NestedRuns
    transforms : sequence of callable
        Function of each model's values.
    """
    known = [np.isfinite(values) for values in runs.values]
    found = []
    for values, held, transform in zip(runs.values, known, transforms, strict=True):
        column = np.zeros(values.size)
        column[held] = transform(values[held])
        found.append(column)
    mean = nested_mean(runs.method, found)
    if all(held.all() for held in known):
        return mean
    share = nested_mean(runs.method, [held.astype(float) for held in known])
    return mean / share if share > 0.0 else math.nan


def _expect(runs: NestedRuns, transform: Transform) -> float:
    """Return the mean of one function of every model's output."""
    return _ratio(runs, [transform] * len(runs.values))


def _mean(runs: NestedRuns) -> float:
    centre = float(np.nanmean(runs.values[0]))
    return centre + _expect(runs, lambda y: y - centre)


def _variance(runs: NestedRuns) -> float:
    centre = float(np.nanmean(runs.values[0]))
    mean = _expect(runs, lambda y: y - centre)
    return _expect(runs, lambda y: (y - centre) ** 2) - mean**2


def _exceedance(runs: NestedRuns, level: float) -> float:
    """Return the share of the dear model's runs above a level.

    A cheap model is asked for its own level, that which as many of the shared runs exceed: it may
    be off by a factor and rank the runs well nevertheless. Its indicator is as soft as the dear
    model's value scatters about its own, which is near the best control variate, the probability of
    the exceedance given the cheap value.
    """
    first = runs.values[0].size
    transforms = [_above(level)]
    dear = runs.values[0]
    ranked = np.sort(dear[np.isfinite(dear)])
    places = (np.arange(ranked.size) + 0.5) / ranked.size
    rank = float(np.interp(level, ranked, places))
    for values in runs.values[1:]:
        held = np.isfinite(dear) & np.isfinite(values[:first])
        cheap = values[:first][held]
        if cheap.size < 2 or not (spread := float(cheap.std())) > 0.0:
            transforms.append(np.zeros_like)
            continue
        linear = float(np.corrcoef(dear[held], cheap)[0, 1]) if dear[held].std() > 0.0 else 0.0
        width = spread * math.sqrt(1.0 - linear**2 + 1.0 / cheap.size)
        transforms.append(_softly_above(float(np.quantile(cheap, rank)), width))
    return _ratio(runs, transforms)


def _above(limit: float) -> Transform:
    return lambda y: (y > limit).astype(float)


def _softly_above(limit: float, width: float) -> Transform:
    return lambda y: np.asarray(special.ndtr((y - limit) / width))


@dataclass(frozen=True)
class Jackknife:
    """A statistic and its standard error: values of the whole and without each replicate."""

    value: float
    error: float
    degrees: int

    @property
    def interval(self) -> Estimate:
        """The value with its Student interval."""
        reach = float(stats.t.ppf(0.5 + CONFIDENCE / 2.0, self.degrees)) * self.error
        return Estimate(self.value, self.value - reach, self.value + reach)


def jackknife(runs: NestedRuns, statistic: Callable[[NestedRuns], float]) -> Jackknife:
    """Return a statistic with the standard error of leaving out one replicate at a time.

    Parameters
    ----------
    runs : NestedRuns
    statistic : callable
        Of nested runs.
    """
    count = runs.replicates
    left_out = np.array([statistic(runs.without(k)) for k in range(count)])
    squares = float(np.sum((left_out - left_out.mean()) ** 2))
    return Jackknife(statistic(runs), math.sqrt((count - 1) / count * squares), count - 1)


def estimate_mean(runs: NestedRuns) -> Estimate:
    """Return the mean of the dear model's output."""
    return jackknife(runs, _mean).interval


def estimate_sd(runs: NestedRuns) -> Estimate:
    """Return the standard deviation of the dear model's output; NaN if its variance is negative."""
    mean = jackknife(runs, _mean)
    found = jackknife(runs, _variance)
    # The squared mean is too large by the variance of the mean.
    corrected = Jackknife(found.value + mean.error**2, found.error, found.degrees).interval
    ends = (corrected.value, max(corrected.low, 0.0), max(corrected.high, 0.0))
    return Estimate(*(math.sqrt(end) if end >= 0.0 else math.nan for end in ends))


def estimate_exceedance(runs: NestedRuns, level: float) -> Estimate:
    """Return the probability that the dear model's output exceeds a level.

    Parameters
    ----------
    runs : NestedRuns
    level : float
        In the output's unit.
    """
    found = jackknife(runs, lambda part: _exceedance(part, level)).interval
    return Estimate(
        *(float(np.clip(end, 0.0, 1.0)) for end in (found.value, found.low, found.high))
    )


def estimate_average(runs: NestedRuns, transform: Transform) -> Estimate:
    """Return the mean of a function of the dear model's output, such as a risk curve.

    Parameters
    ----------
    runs : NestedRuns
    transform : callable
        Of (n,) values.
    """
    return jackknife(runs, lambda part: _expect(part, transform)).interval


def estimate_quantile(runs: NestedRuns, probability: float) -> Estimate:
    """Return a quantile of the dear model's output.

    Its interval holds the levels whose exceedance may be the quantile's (Woodruff, J. Am. Stat.
    Assoc. 47, 1952); an end beyond the largest or smallest run is NaN.

    Parameters
    ----------
    runs : NestedRuns
    probability : float
        In (0, 1).
    """
    dear = runs.values[0][np.isfinite(runs.values[0])]
    ends = float(dear.min()), float(dear.max())
    value = _level_of(runs, probability, ends)
    if not math.isfinite(value):
        return Estimate(math.nan, math.nan, math.nan)
    spread = jackknife(runs, lambda part: _exceedance(part, value))
    reach = float(stats.t.ppf(0.5 + CONFIDENCE / 2.0, spread.degrees)) * spread.error
    low, high = (_level_of(runs, probability + side * reach, ends) for side in (-1.0, 1.0))
    return Estimate(value, low, high)


def _level_of(runs: NestedRuns, probability: float, ends: tuple[float, float]) -> float:
    """Return the level that the dear model stays below with a probability; NaN beyond the ends."""

    def excess(level: float) -> float:
        return 1.0 - _exceedance(runs, level) - probability

    if not excess(ends[0]) < 0.0 < excess(ends[1]):
        return math.nan
    tolerance = TOLERANCE * (ends[1] - ends[0])
    return float(optimize.brentq(excess, *ends, xtol=tolerance))
