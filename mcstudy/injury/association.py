"""Association with the AIS: rank correlations with intervals, proportional-odds regression."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats

from mcstudy.statistics import REACH, Estimate

Array = NDArray[np.float64]

RESAMPLES = 200
STEEPEST = 50.0
"""Slope per standard deviation above which outcomes count as separated (assumed)."""


def rank_correlations(
    values: Array, levels: NDArray[np.int64], rng: np.random.Generator
) -> dict[str, Estimate]:
    """Return Spearman's rho and Kendall's tau-b with 95 % intervals.

    Intervals are normal with the bootstrap's standard deviation on Fisher's scale.

    Parameters
    ----------
    values : (n,) array
        Finite.
    levels : (n,) array of int
        AIS.
    rng : Generator
        Of the resamples.

    Raises
    ------
    ValueError
        If all levels are the same.
    """
    if np.unique(levels).size < 2:
        raise ValueError("all outcomes are the same")
    found = {}
    drawn = (rng.integers(0, values.size, values.size) for _ in range(RESAMPLES))
    # A resample with a single outcome has no correlation.
    parts = [part for part in drawn if np.unique(levels[part]).size > 1]
    for name, measure in (("spearman", _spearman), ("kendall", _kendall)):
        value = measure(values, levels)
        scores = _fisher(np.array([measure(values[part], levels[part]) for part in parts]))
        centre, reach = float(_fisher(np.array(value))), REACH * float(scores.std())
        low, high = np.tanh([centre - reach, centre + reach])
        found[name] = Estimate(value, float(low), float(high))
    return found


def _spearman(values: Array, levels: NDArray[np.int64]) -> float:
    return float(stats.spearmanr(values, levels).statistic)


def _kendall(values: Array, levels: NDArray[np.int64]) -> float:
    return float(stats.kendalltau(values, levels).statistic)


def _fisher(correlation: Array) -> Array:
    return np.asarray(np.arctanh(np.clip(correlation, -1.0 + 1e-12, 1.0 - 1e-12)))


@dataclass(frozen=True)
class OrdinalFit:
    """Proportional-odds regression: logit P(AIS > k) = slopes . z - cut_k, z standardised.

    Attributes
    ----------
    names : of the p predictors.
    slopes : (p,) per standard deviation of the predictor.
    errors : (p,) standard errors of the slopes.
    cuts : between the levels that occur.
    log_likelihood, null_log_likelihood : with and without predictors.
    """

    names: tuple[str, ...]
    slopes: Array
    errors: Array
    cuts: Array
    log_likelihood: float
    null_log_likelihood: float

    def odds_ratio(self, name: str) -> Estimate:
        """Return the odds ratio of a worse AIS per standard deviation of a predictor.

        Raises
        ------
        ValueError
            If the name is no predictor.
        """
        if name not in self.names:
            raise ValueError(f"{name!r} is no predictor, only {', '.join(self.names)}")
        k = self.names.index(name)
        slope, reach = self.slopes[k], REACH * self.errors[k]
        return Estimate(*(float(np.exp(slope + s * reach)) for s in (0.0, -1.0, 1.0)))


def fit_proportional_odds(predictors: Mapping[str, Array], levels: NDArray[np.int64]) -> OrdinalFit:
    """Return the maximum-likelihood proportional-odds regression (P. McCullagh, 1980).

    Parameters
    ----------
    predictors : mapping
        (n,) finite by name.
    levels : (n,) array of int
        AIS, at least two different values.

    Raises
    ------
    ValueError
        If all levels are the same, a predictor does not vary or is not finite, predictors are
        collinear, or they separate the levels completely.
    """
    names = tuple(predictors)
    columns = [np.asarray(predictors[name], dtype=float) for name in names]
    if not names or not np.all(np.isfinite(columns)):
        raise ValueError("predictors must be finite, one at least")
    table = np.stack(columns, axis=1)
    constant = [name for name, span in zip(names, np.ptp(table, axis=0), strict=True) if not span]
    if constant:
        raise ValueError(f"{', '.join(constant)} does not vary")
    classes, codes = np.unique(levels, return_inverse=True)
    if classes.size < 2:
        raise ValueError(f"all outcomes are AIS {classes[0]}")
    z = (table - table.mean(axis=0)) / table.std(axis=0)
    if np.linalg.matrix_rank(z) < len(names):
        raise ValueError("predictors repeat each other")
    shares = np.cumsum(np.bincount(codes))[:-1] / codes.size
    cuts = special.logit(shares)
    # First cut and logarithms of the gaps: this parametrisation keeps the cuts in order.
    start = np.concatenate([np.zeros(len(names)), cuts[:1], np.log(np.diff(cuts))])
    found = optimize.minimize(
        _ordinal_loss, start, args=(z, codes), jac=True, method="BFGS", options={"gtol": 1e-7}
    )
    p = len(names)
    if np.abs(found.x[:p]).max() > STEEPEST:
        raise ValueError("the predictors separate the outcomes completely: any slope fits")
    hessian = _numeric_hessian(found.x, z, codes)
    errors = np.sqrt(np.diag(np.linalg.pinv(hessian))[:p])
    null = np.concatenate([np.zeros(p), start[p:]])
    return OrdinalFit(
        names, found.x[:p], errors, _cuts(found.x[p:]), -float(found.fun),
        -float(_ordinal_loss(null, z, codes)[0]),
    )  # fmt: skip


def _cuts(free: Array) -> Array:
    return np.cumsum(np.concatenate([free[:1], np.exp(free[1:])]))


def _ordinal_loss(x: Array, z: Array, codes: NDArray[np.intp]) -> tuple[float, Array]:
    """Return minus the log likelihood and its gradient."""
    p = z.shape[1]
    cuts = _cuts(x[p:])
    shift = z @ x[:p]
    ends = np.concatenate([[-np.inf], cuts, [np.inf]])
    high, low = ends[codes + 1] - shift, ends[codes] - shift
    # P(level) = expit(high) - expit(low), from the tail without cancellation.
    flip = low > 0.0
    top, bottom = np.where(flip, -low, high), np.where(flip, -high, low)
    share = np.maximum(special.expit(top) - special.expit(bottom), 1e-300)
    slope_high = special.expit(high) * special.expit(-high) / share
    slope_low = special.expit(low) * special.expit(-low) / share
    by_shift = -(slope_high - slope_low)
    by_cut = np.zeros(cuts.size + 2)
    np.add.at(by_cut, codes + 1, slope_high)
    np.add.at(by_cut, codes, -slope_low)
    tail = np.cumsum(by_cut[1:-1][::-1])[::-1]
    by_free = tail * np.concatenate([[1.0], np.exp(x[p + 1 :])])
    gradient = np.concatenate([z.T @ by_shift, by_free])
    return -float(np.log(share).sum()), -gradient


def _numeric_hessian(x: Array, z: Array, codes: NDArray[np.intp]) -> Array:
    columns = []
    for k in range(x.size):
        step = np.zeros(x.size)
        step[k] = 1e-5 * max(1.0, abs(x[k]))
        up, down = (_ordinal_loss(x + s * step, z, codes)[1] for s in (1.0, -1.0))
        columns.append((up - down) / (2.0 * step[k]))
    hessian = np.stack(columns)
    return np.asarray(0.5 * (hessian + hessian.T))
