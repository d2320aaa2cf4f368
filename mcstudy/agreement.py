"""Agreement of two methods on the same inputs, and model-form uncertainty.

Every input row is run by every method, so the method is a categorical factor crossed with all other
inputs, and the variance of an output splits exactly into three shares: the method alone, the inputs
alone, and their interaction.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mcstudy.sampling import seeds
from mcstudy.statistics import REACH, ROUNDING, Estimate, between_replicates, scale_of, varies
from mcstudy.typed_json import Real

Array = NDArray[np.float64]
Parts = NDArray[np.int64]

BINS = 20
"""Bins of equal count in which the methods' difference is averaged along an input."""
DUMMIES = 20
"""Dummies whose largest value is the noise line: one input in twenty passes it by chance."""


@dataclass(frozen=True)
class Agreement:
    """Agreement of a method with a reference method on the same inputs.

    Correlations are NaN where a method's values do not vary beyond rounding.

    Attributes
    ----------
    pairs : number of runs with a value of both.
    correlation, rank_correlation, concordance : Pearson's, Spearman's and Lin's coefficient.
    bias : mean of method minus reference.
    spread : standard deviation of method minus reference.
    lower, upper : limits of agreement, between which 95 % of normal differences lie.
    outside : share of the differences beyond them.
    slope : of the difference against the mean of both.
    """

    pairs: int
    correlation: Estimate
    rank_correlation: Estimate
    concordance: Estimate
    bias: Estimate
    spread: Estimate
    lower: Estimate
    upper: Estimate
    outside: Real
    slope: Estimate


@dataclass(frozen=True)
class VarianceSplit:
    """Shares of an output's variance over methods, equally weighted, and inputs; they sum to 1.

    They are NaN where the output does not vary beyond rounding.

    Attributes
    ----------
    method : main effect of the method.
    inputs : effect of all inputs, averaged over the methods.
    together : interaction of method and inputs.
    total : variance of the output.
    """

    method: Estimate
    inputs: Estimate
    together: Estimate
    total: Real


@dataclass(frozen=True)
class Sources:
    """Sources of disagreement.

    Attributes
    ----------
    gains : gain in rank correlation without the disagreement along each input, by input.
    noise : largest gain of unrelated dummies.
    """

    gains: Mapping[str, Real]
    noise: Real


def without_rounding(reference: Array, method: Array) -> Array:
    """Return a method's values, or the reference's where all differ by rounding alone."""
    size = np.maximum(np.abs(reference), np.abs(method))
    return reference if np.all(np.abs(method - reference) <= ROUNDING * size) else method


def compare(reference: Array, method: Array, parts: Parts) -> Agreement:
    """Return the agreement of a method with a reference.

    Parameters
    ----------
    reference, method : (n,) array
        Finite values on the same inputs.
    parts : (n,) array of int
        Independent part of the design that each run belongs to.

    Raises
    ------
    ValueError
        If there are fewer than three pairs.

    Notes
    -----
    Limits of agreement by J. M. Bland and D. G. Altman, Lancet 327 (1986); concordance by
    L. I. Lin, Biometrics 45 (1989). Intervals are t intervals between the parts, of correlations on
    Fisher's scale.
    """
    if reference.size < 3:
        raise ValueError(f"a comparison takes three pairs or more, given {reference.size}")
    both = np.stack([reference, method], axis=1)
    # Squares of scaled values neither overflow nor vanish.
    scale = scale_of(both)
    both = both / scale

    def known(statistic: Callable[[Array], float]) -> Estimate:
        return _between(statistic, both, parts)

    def correlated(statistic: Callable[[Array], float]) -> Estimate:
        found = _between(lambda p: float(np.arctanh(_inside(statistic(p)))), both, parts)
        return Estimate(statistic(both), float(np.tanh(found.low)), float(np.tanh(found.high)))

    lower, upper = known(lambda p: _limit(p, -REACH)), known(lambda p: _limit(p, REACH))
    difference = both[:, 1] - both[:, 0]
    outside = (difference < lower.value) | (difference > upper.value)
    return Agreement(
        pairs=int(reference.size),
        correlation=correlated(_pearson),
        rank_correlation=correlated(_spearman),
        concordance=correlated(_concordance),
        bias=known(lambda p: float(np.mean(p[:, 1] - p[:, 0]))).times(scale),
        spread=known(lambda p: float(np.std(p[:, 1] - p[:, 0], ddof=1))).times(scale),
        lower=lower.times(scale),
        upper=upper.times(scale),
        outside=float(outside.mean()),
        slope=known(_slope),
    )


def split_variance(values: Array, parts: Parts) -> VarianceSplit:
    """Return the variance split of an output.

    Parameters
    ----------
    values : (n, methods) array
        Finite; every input row run by every method.
    parts : (n,) array of int
        Independent part of the design that each row belongs to.

    Notes
    -----
    With ``Y(m, x)``: ``V = Var_m(E_x Y) + Var_x(E_m Y) + rest``. The spread of the methods' means
    is corrected for the sampling of the inputs, and an estimate below zero is zero.
    """
    if not varies(values):
        unknown = Estimate(np.nan, np.nan, np.nan)
        return VarianceSplit(unknown, unknown, unknown, 0.0)
    scale = scale_of(values)
    values = values / scale
    total = scale * scale * float(np.sum(_components(values)))

    def share(k: int) -> Estimate:
        def statistic(part: Array) -> float:
            components = _components(part)
            whole = float(components.sum())
            return float(components[k]) / whole if whole > 0.0 else np.nan

        found = _between(statistic, values, parts)
        return Estimate(found.value, max(found.low, 0.0), min(found.high, 1.0))

    return VarianceSplit(share(0), share(1), share(2), total)


def sources_of_disagreement(
    reference: Array, method: Array, inputs: Array, seed: int
) -> tuple[Array, float]:
    """Return the gain in rank correlation if the disagreement along each input is removed.

    Parameters
    ----------
    reference, method : (n,) array
        Finite values on the same inputs.
    inputs : (n, d) array
    seed : int
        Of the dummies.

    Returns
    -------
    gains : (d,) array
        Rank correlation with the mean difference of ranks along each input removed, minus the rank
        correlation.
    noise : float
        Largest gain of twenty dummies.

    Notes
    -----
    Where a method does not vary there is no rank correlation, and all are NaN.
    """
    if not (varies(reference) and varies(method)):
        return np.full(inputs.shape[1], np.nan), np.nan
    one, two = stats.rankdata(reference), stats.rankdata(method)
    rng = seeds.generator(seed, seeds.AGREEMENT)
    columns = np.column_stack([inputs, rng.random((reference.size, DUMMIES))])
    plain = _pearson(np.stack([one, two], axis=1))
    gains = np.array([_without(one, two, column) - plain for column in columns.T])
    d = inputs.shape[1]
    return gains[:d], float(gains[d:].max())


def _without(one: Array, two: Array, column: Array) -> float:
    """Return the correlation with the mean difference along a column removed."""
    order = np.argsort(column, kind="stable")
    taken = np.empty_like(two)
    for part in np.array_split(order, BINS):
        taken[part] = two[part] - (two[part] - one[part]).mean()
    return _pearson(np.stack([one, taken], axis=1))


def _components(values: Array) -> Array:
    """Return the variances (3,): of the method, of the inputs, of their interaction."""
    n = len(values)
    within = float(np.mean(values.var(axis=1)))
    means = values.mean(axis=0)
    of_inputs = float(np.var(values.mean(axis=1), ddof=1))
    # Sampling adds 1/n of the interaction to the variance of the methods' means.
    spread = float(np.var(means))
    together = max((within - spread) * n / (n - 1), 0.0)
    of_method = max(spread - together / n, 0.0)
    return np.array([of_method, of_inputs, together])


def _between(statistic: Callable[[Array], float], values: Array, parts: Parts) -> Estimate:
    held = [values[parts == part] for part in np.unique(parts)]
    estimates = np.array([statistic(part) for part in held if len(part) > 2])
    return between_replicates(estimates[np.isfinite(estimates)], statistic(values))


def _inside(value: float) -> float:
    """Return a correlation that Fisher's transform can take."""
    return float(np.clip(value, -1.0 + 1e-12, 1.0 - 1e-12))


def _pearson(pair: Array) -> float:
    if not (varies(pair[:, 0]) and varies(pair[:, 1])):
        return np.nan
    return float(np.corrcoef(pair[:, 0], pair[:, 1])[0, 1])


def _spearman(pair: Array) -> float:
    # Ranks would amplify differences that are rounding alone.
    if not (varies(pair[:, 0]) and varies(pair[:, 1])):
        return np.nan
    return _pearson(np.stack([stats.rankdata(column) for column in pair.T], axis=1))


def _concordance(pair: Array) -> float:
    one, two = pair[:, 0], pair[:, 1]
    # Two constants have no correlation, whatever their distance.
    if not (varies(one) or varies(two)):
        return np.nan
    apart = one.var() + two.var() + (one.mean() - two.mean()) ** 2
    return float(2.0 * np.mean((one - one.mean()) * (two - two.mean())) / apart)


def _limit(pair: Array, reach: float) -> float:
    difference = pair[:, 1] - pair[:, 0]
    return float(difference.mean() + reach * difference.std(ddof=1))


def _slope(pair: Array) -> float:
    middle, difference = pair.mean(axis=1), pair[:, 1] - pair[:, 0]
    if not varies(middle):
        return np.nan
    spread = float(middle.var())
    return float(np.mean((middle - middle.mean()) * (difference - difference.mean())) / spread)
