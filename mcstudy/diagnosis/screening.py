"""Model adequacy: a p-value calibrated on data simulated from the model itself.

Five statistics look for five kinds of misfit: the catalogue's causes (largest score over the bank
of templates), drifts, a smooth discrepancy, a fine one that all tests share, and shared unknowns
that fit only far out in their priors. The smallest of their p-values is calibrated on the same
simulated data; the repeatability is re-estimated on each data set.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.layout import Layout, Scatter
from mcstudy.diagnosis.marginal import Marginal, Reduced, log_bayes_factor, quadratic_form
from mcstudy.diagnosis.templates import Shapes, Template

Array = NDArray[np.float64]

LEVEL = 0.04
"""p-value below which a model is inadequate."""
FLIP_LEVEL = 0.01
"""The same of the sign flips, which need no covariance; both together make 5 % of false alarms."""
DRAWS = 1000
"""Simulated data sets on which a p-value is calibrated."""
USUAL, SPREAD = 0.01, 1.2
"""Median and log standard deviation of the repeatability's prior (assumed: 0.3 to 3 %)."""
SMALLEST, LARGEST = 2e-4, 0.2
"""Bounds of the repeatability."""
AT_BOUND = 0.98
"""Share of the largest repeatability from which the bound counts as reached."""
NEAR = np.array([0.4, 0.55, 0.75, 1.0, 1.35, 1.8, 2.5])
"""Factors on the repeatability that are tried on simulated data."""
FREE = 10.0
"""Prior standard deviation of a discrepancy that is free while the repeatability is estimated."""
SEEN = 1e-4
"""Share of a shape's sum of squares that must remain beside nuisances to be detectable."""
FAINTEST = 0.01
"""Information below which it is not detectable."""
POWER = float(stats.norm.ppf(0.8))
"""Standard errors beyond a threshold at which the power is 80 %."""
FLIPS = 4000
"""Random sign flips of whole tests."""


@dataclass(frozen=True)
class Statistic:
    """A test statistic: name, value, its own p-value."""

    name: str
    value: float
    p_value: float


@dataclass(frozen=True)
class Screening:
    """Result of a model adequacy test.

    Attributes
    ----------
    p_value : calibrated, of the smallest of the statistics' p-values.
    statistics : by kind of misfit.
    scores : standardised score statistics of the templates, in standard errors.
    information : Fisher information of the templates.
    threshold : score, in standard errors, from which a template raises an alarm.
    flip_p_value : by flipping the signs of whole tests, which needs no covariance.
    drift : the drift with the largest log Bayes factor, and that factor.
    """

    p_value: float
    statistics: tuple[Statistic, ...]
    scores: Array
    information: Array
    threshold: float
    flip_p_value: float
    drift: tuple[str, float]

    @property
    def contradictory(self) -> bool:
        """Whether the sign flips alone call the model inadequate."""
        return self.p_value > LEVEL and self.flip_p_value <= FLIP_LEVEL

    @property
    def alarm(self) -> bool:
        """Whether the model is inadequate."""
        return self.p_value <= LEVEL or self.contradictory


def _errors(marginal: Marginal, information: Array) -> Array:
    """Return the standard errors of scores (m,), infinite for shapes that nuisances absorb."""
    left = np.diag(information)
    seen = left > np.maximum(SEEN * marginal.squares, FAINTEST)
    return np.where(seen, np.sqrt(np.maximum(left, FAINTEST)), np.inf)


def score_templates(
    fitted: Fit, layouts: Sequence[Layout], bank: Sequence[Template]
) -> tuple[Array, Array]:
    """Return score and information of templates, nuisances integrated out; zero if undetectable.

    Parameters
    ----------
    fitted : Fit
    layouts : sequence of Layout
        Of its tests.
    bank : sequence of Template
        m templates.

    Returns
    -------
    score, information : (m,) arrays
    """
    if not bank:
        return np.zeros(0), np.zeros(0)
    tables = [np.stack([t.columns[i] for t in bank], axis=1) for i in range(len(layouts))]
    marginal = Marginal(fitted, layouts, tables)
    reduced = marginal.reduce(marginal.measured(), fitted.scatter)
    seen = np.isfinite(_errors(marginal, reduced.information))
    return reduced.score[0] * seen, np.diag(reduced.information) * seen


def estimate_scatter(fitted: Fit, layouts: Sequence[Layout], shapes: Shapes | None) -> Scatter:
    """Return the most probable size of the repeatability.

    Parameters
    ----------
    fitted : Fit
    layouts : sequence of Layout
        Of its tests.
    shapes : Shapes or None
        Discrepancy common to all tests that is left free, so that it is not taken for
        repeatability; None for none.
    """
    tables = [np.zeros((r.size, 0)) for r in fitted.residuals] if shapes is None else shapes.columns
    marginal = Marginal(fitted, layouts, tables)
    products = marginal.measured()

    def loss(logarithms: Array) -> float:
        scatter = _scatter_at(logarithms)
        return -float(_restricted(marginal.reduce(products, scatter))[0]) - _log_prior(scatter)

    start = np.log([fitted.scatter.level, fitted.scatter.shape])
    found = optimize.minimize(
        loss, start, method="Nelder-Mead", options={"xatol": 0.02, "fatol": 0.02, "maxfev": 120}
    )
    return _scatter_at(found.x)


def is_at_bound(scatter: Scatter) -> bool:
    """Return whether a repeatability has reached its upper bound."""
    return max(scatter.level, scatter.shape) >= AT_BOUND * LARGEST


def _scatter_at(logarithms: Array) -> Scatter:
    level, shape = np.exp(np.clip(logarithms, np.log(SMALLEST), np.log(LARGEST)))
    return Scatter(float(level), float(shape))


def _log_prior(scatter: Scatter) -> float:
    scores = np.log(np.array([scatter.level, scatter.shape]) / USUAL) / SPREAD
    return -0.5 * float(scores @ scores)


def _restricted(reduced: Reduced) -> Array:
    """Return the log likelihood (d,) with free shapes."""
    free = log_bayes_factor(reduced.information, reduced.score, FREE)
    return np.asarray(reduced.log_likelihood + free)


def screen(
    fitted: Fit,
    layouts: Sequence[Layout],
    bank: Sequence[Template],
    drift: Shapes,
    smooth: Shapes,
    fine: Shapes,
    rng: np.random.Generator,
) -> Screening:
    """Return the adequacy test of a fit against the data.

    Parameters
    ----------
    fitted : Fit
    layouts : sequence of Layout
        Of its tests.
    bank : sequence of Template
        Templates of the causes about the fit.
    drift, smooth, fine : Shapes
        Drifts and discrepancies about the fit.
    rng : Generator
    """
    tables = _tables(bank, drift, smooth, fine, len(layouts))
    marginal = Marginal(fitted, layouts, tables)
    sizes = [len(bank), len(drift.names), len(smooth.names), len(fine.names)]
    edges = np.cumsum([0, *sizes])
    parts = [slice(a, b) for a, b in itertools.pairwise(edges)]
    measured = marginal.reduce(marginal.measured(), fitted.scatter)
    errors = _errors(marginal, measured.information)
    found = _statistics(measured, parts, errors)[0]
    null = _null(marginal, fitted.scatter, parts, rng)
    count = found.size
    own = [_upper_share(null[:, k], found[k : k + 1])[0] for k in range(count)]
    ranks = np.stack([_upper_share(null[:, k], null[:, k]) for k in range(count)], axis=1)
    smallest = ranks.min(axis=1)
    p_value = float((1 + np.sum(smallest <= min(own))) / (smallest.size + 1))
    cut = float(np.quantile(smallest, LEVEL))
    threshold = float(np.quantile(null[:, 0], 1.0 - cut)) if bank else np.inf
    bank_part, drift_part = parts[:2]
    names = ("cause", "drift", "smooth discrepancy", "fine discrepancy", "priors of the unknowns")
    return Screening(
        p_value=p_value,
        statistics=tuple(
            Statistic(name, float(found[k]), float(own[k])) for k, name in enumerate(names)
        ),
        scores=measured.score[0, bank_part] / errors[bank_part],
        information=np.diag(measured.information)[bank_part],
        threshold=threshold,
        flip_p_value=_flip(fitted, bank, rng),
        drift=_best_drift(measured, drift_part, drift.names),
    )


def _best_drift(reduced: Reduced, part: slice, names: Sequence[str]) -> tuple[str, float]:
    """Return the drift with the largest log Bayes factor, and that factor."""
    found = [
        (float(log_bayes_factor(reduced.information[k : k + 1, k : k + 1],
                                reduced.score[:, k : k + 1])[0]), name)
        for k, name in zip(range(part.start, part.stop), names, strict=True)
    ]  # fmt: skip
    evidence, name = max(found, key=lambda entry: entry[0], default=(0.0, ""))
    return name, evidence


def remaining(
    fitted: Fit, layouts: Sequence[Layout], drift: Shapes, smooth: Shapes, fine: Shapes
) -> tuple[float, float, tuple[str, float]]:
    """Return p-value, misfit that a discrepancy would explain (log units), and best drift.

    The p-value is the smallest of three chi-square p-values, times three (Bonferroni).

    Parameters
    ----------
    fitted : Fit
    layouts : sequence of Layout
        Of its tests.
    drift, smooth, fine : Shapes
        Drifts and discrepancies about the fit.
    """
    tables = _tables((), drift, smooth, fine, len(layouts))
    marginal = Marginal(fitted, layouts, tables)
    reduced = marginal.reduce(marginal.measured(), fitted.scatter)
    edges = np.cumsum([0, len(drift.names), len(smooth.names), len(fine.names)])
    p_values, left = [], 0.0
    info, score = reduced.information, reduced.score
    drift_part = slice(edges[0], edges[1])
    errors = _errors(marginal, info)
    largest = float(np.abs(score[0, drift_part] / errors[drift_part]).max(initial=0.0))
    p_values.append(min(1.0, 2.0 * stats.norm.sf(largest) * max(len(drift.names), 1)))
    for k in (1, 2):
        part = slice(edges[k], edges[k + 1])
        value, rank = quadratic_form(info[part, part], score[:, part])
        p_values.append(float(stats.chi2(max(rank, 1)).sf(value[0])))
        left = max(left, float(value[0]) - rank)
    best = _best_drift(reduced, drift_part, drift.names)
    return min(1.0, 3.0 * min(p_values)), 0.5 * left, best


def _tables(
    bank: Sequence[Template], drift: Shapes, smooth: Shapes, fine: Shapes, tests: int
) -> list[Array]:
    tables = []
    for i in range(tests):
        own = [template.columns[i][:, None] for template in bank]
        shapes = [drift.columns[i], smooth.columns[i], fine.columns[i]]
        tables.append(np.concatenate([*own, *shapes], axis=1))
    return tables


def _statistics(reduced: Reduced, parts: Sequence[slice], errors: Array) -> Array:
    """Return the five statistics (d, 5)."""
    columns = []
    for part in parts[:2]:
        standard = np.abs(reduced.score[:, part] / errors[part])
        columns.append(standard.max(axis=1, initial=0.0))
    columns += [
        quadratic_form(reduced.information[part, part], reduced.score[:, part])[0]
        for part in parts[2:]
    ]
    columns.append(np.abs(reduced.shared).max(axis=1, initial=0.0))
    return np.stack(columns, axis=1)


def _null(
    marginal: Marginal, scatter: Scatter, parts: Sequence[slice], rng: np.random.Generator
) -> Array:
    """Return the statistics (DRAWS, 5) of data simulated from the model."""
    products = marginal.draw(DRAWS, scatter, rng)
    smooth = parts[2]
    best = np.full(DRAWS, -np.inf)
    statistics = np.zeros((DRAWS, len(parts) + 1))
    for level, shape in itertools.product(NEAR, NEAR):
        tried = Scatter(scatter.level * level, scatter.shape * shape)
        reduced = marginal.reduce(products, tried)
        likelihood = reduced.log_likelihood + _log_prior(tried)
        likelihood += log_bayes_factor(
            reduced.information[smooth, smooth], reduced.score[:, smooth], FREE
        )
        better = likelihood > best
        best[better] = likelihood[better]
        errors = _errors(marginal, reduced.information)
        part = replace(reduced, score=reduced.score[better], shared=reduced.shared[better])
        if better.any():
            statistics[better] = _statistics(part, parts, errors)
    return statistics


def _upper_share(null: Array, values: Array) -> Array:
    """Return the share of the null at or above each value."""
    ordered = np.sort(null)
    above = ordered.size - np.searchsorted(ordered, values - 1e-12 * np.abs(values), side="left")
    return np.asarray((1 + above) / (ordered.size + 1))


def _flip(fitted: Fit, bank: Sequence[Template], rng: np.random.Generator) -> float:
    """Return the p-value of the bank when the signs of whole tests are flipped.

    It needs no covariance, but cannot be small where the misfit is in few tests.
    """
    if not bank:
        return 1.0
    contributions = np.array(
        [
            [float(template.columns[i] @ fitted.residuals[i]) for template in bank]
            for i in range(len(fitted.residuals))
        ]
    )
    scale = np.sqrt(np.maximum((contributions**2).sum(axis=0), 1e-300))
    signs = rng.choice([-1.0, 1.0], size=(FLIPS, contributions.shape[0]))
    null = np.abs(signs @ (contributions / scale)).max(axis=1)
    found = float(np.abs(contributions.sum(axis=0) / scale).max())
    return float((1 + np.sum(null >= found - 1e-12)) / (FLIPS + 1))
