"""Predictive gain of an extended model on held-out tests.

Whole tests are held out, never samples of them. Three predictions are scored: the base model, the
extended one, and the base model with a Gaussian-process discrepancy, which fits a misfit without
a named cause (M. Kennedy, A. O'Hagan, J. R. Stat. Soc. B 63:425, 2001).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.discrepancy import Discrepancy, fit_discrepancy
from mcstudy.diagnosis.fit import Fit, FitError, fit
from mcstudy.diagnosis.jacobian import Slopes, expand_tests, observe_tests
from mcstudy.diagnosis.layout import Layout, Scatter
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.diagnosis.problem import Problem
from mcstudy.diagnosis.repeatability import settle
from mcstudy.diagnosis.screening import estimate_scatter
from mcstudy.diagnosis.templates import smooth_discrepancy
from mcstudy.statistics import Estimate, crps

Array = NDArray[np.float64]
Quantity = Callable[[Array, Array], float]
"""Maps time (s) and values of a signal to a number, such as HIC15."""
Quantities = Mapping[str, tuple[str, str, Quantity]]
"""Unit, signal and function by name."""

FOLDS = 6
TINY = 1e-12
DRAWS = 200
RESAMPLES = 2000
BEYOND = 0.2
"""Share of the tests, the fastest or the slowest, that are held out together."""
INTERVAL = 0.9
"""Probability of the predictive intervals whose coverage is counted."""
MODELS = ("base", "extended", "gaussian_process")


@dataclass(frozen=True)
class Gain:
    """A predictive score of the three models; smaller is better but for log score and coverage.

    Attributes
    ----------
    score : its name; ``coverage_`` is the share of tests within the 90 % intervals.
    region : where the held-out tests lie: ``inside`` the regime of those that were used, ``above``
        or ``below`` it.
    unit : of the score.
    base, extended, gaussian_process : means over the held-out tests.
    difference : extended against base, positive if better, with its interval.
    against_process : extended against the Gaussian process, likewise.
    relative : difference over the base's score.
    """

    score: str
    region: str
    unit: str
    base: float
    extended: float
    gaussian_process: float
    difference: Estimate
    against_process: Estimate
    relative: Estimate


@dataclass(frozen=True)
class _Prediction:
    """Prediction of one test, whitened: mean (n,), covariance factor (n, k) without noise."""

    mean: Array
    factor: Array


def measure_gain(
    problem: Problem,
    layouts: Sequence[Layout],
    base: Fit,
    extended: Fit,
    quantities: Quantities,
    seed: int,
) -> list[Gain]:
    """Return the scores of held-out tests, inside the tested regime and beyond it.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of all tests.
    base, extended : Fit
        Fits to all tests.
    quantities : mapping
        Unit, signal and function by name.
    seed : int
        Of folds and draws.
    """
    # Both models may take what they get wrong for scatter, so that neither is overconfident.
    base, extended = (settle(problem, layouts, f, absorbing=True) for f in (base, extended))
    rng = np.random.default_rng(seed)
    count = len(layouts)
    order = rng.permutation(count)
    folds = [order[k :: min(FOLDS, count)] for k in range(min(FOLDS, count))]
    found = _score(problem, layouts, base, extended, quantities, folds, rng)
    gains = _compare(found, "inside", quantities, rng)
    for region, held in _ends(layouts).items():
        found = _score(problem, layouts, base, extended, quantities, [held], rng)
        gains += _compare(found, region, quantities, rng)
    return gains


def _ends(layouts: Sequence[Layout]) -> dict[str, NDArray[np.int64]]:
    """Return the fastest and the slowest tests, if the impact speed differs."""
    speeds = np.array([layout.test.inputs.get("impact_speed", 0.0) for layout in layouts])
    size = round(BEYOND * speeds.size)
    if np.ptp(speeds) == 0.0 or size < 2:
        return {}
    order = np.argsort(speeds, kind="stable")
    return {"above": order[-size:], "below": order[:size]}


Scored = dict[str, dict[str, list[float]]]
"""Values of the held-out tests by score and model."""


def _score(
    problem: Problem,
    layouts: Sequence[Layout],
    base: Fit,
    extended: Fit,
    quantities: Quantities,
    folds: Sequence[NDArray[np.int64]],
    rng: np.random.Generator,
) -> Scored:
    scored: Scored = {}
    for held in folds:
        kept = np.setdiff1d(np.arange(len(layouts)), held)
        try:
            trained = {
                "base": _train(problem, layouts, base, kept),
                "extended": _train(problem, layouts, extended, kept),
            }
        except FitError:
            continue
        part = [layouts[i] for i in kept]
        plain = _untouched(problem, part, trained["base"])
        blank = _untouched(problem, [layouts[i] for i in held], _of_tests(base, held))
        if plain is None or blank is None:
            continue
        shapes = smooth_discrepancy(part, plain)
        # Repeatability beside the discrepancy that the process explains.
        calm = estimate_scatter(plain, part, shapes)
        process = fit_discrepancy(plain, part, shapes, calm)
        # Common random numbers for all three, so that differences are free of sampling noise.
        seeds = rng.integers(2**32, size=held.size)
        for name in MODELS:
            kind, whole = ("extended", extended) if name == "extended" else ("base", base)
            predicted = _predict(problem, layouts, trained[kind], whole, held)
            if predicted is None:
                continue
            if name == "gaussian_process":
                places = [layouts[i] for i in held]
                predicted = _corrected(places, blank, predicted, process, calm)
            for i, prediction, seed in zip(held, predicted, seeds, strict=True):
                own = np.random.default_rng(seed)
                for key, value in _judge(layouts[i], base, i, prediction, quantities, own).items():
                    scored.setdefault(key, {}).setdefault(name, []).append(value)
    return scored


def _of_tests(whole: Fit, chosen: NDArray[np.int64]) -> Fit:
    """Return a fit restricted to some of its tests."""
    return replace(
        whole,
        scores=Scores(whole.scores.shared, tuple(whole.scores.own[i] for i in chosen)),
        slopes=Slopes(
            tuple(whole.slopes.doubtful[i] for i in chosen),
            tuple(whole.slopes.shared[i] for i in chosen),
        ),
        observations=tuple(whole.observations[i] for i in chosen),
        residuals=tuple(whole.residuals[i] for i in chosen),
        own_slopes=tuple(whole.own_slopes[i] for i in chosen),
    )


def _train(problem: Problem, layouts: Sequence[Layout], whole: Fit, kept: NDArray[np.int64]) -> Fit:
    """Return a fit to some of the tests, started from the fit to all."""
    part = replace(problem, tests=tuple(problem.tests[i] for i in kept))
    known = _of_tests(whole, kept)
    places = [layouts[i] for i in kept]
    return fit(part, places, whole.forms, known.scores, whole.scatter, known.slopes, exact=False)


def _untouched(problem: Problem, places: Sequence[Layout], fitted: Fit) -> Fit | None:
    """Return a fit with its tests' own nuisances at zero; None if a run fails.

    Nuisances of a wrong model absorb its misfit, which must not be extrapolated.
    """
    scores = Scores(fitted.scores.shared, tuple(np.zeros(len(place.names)) for place in places))
    seen = observe_tests(problem, fitted.forms, places, scores)
    if seen is None:
        return None
    residuals, own = expand_tests(places, seen, scores, fitted.slopes, fitted.scatter)
    return replace(
        fitted, scores=scores, observations=tuple(seen),
        residuals=tuple(residuals), own_slopes=tuple(own),
    )  # fmt: skip


def _predict(
    problem: Problem,
    layouts: Sequence[Layout],
    trained: Fit,
    whole: Fit,
    held: Sequence[int] | NDArray[np.int64],
) -> list[_Prediction] | None:
    """Return predictions of held-out tests, own nuisances at their priors."""
    places = [layouts[i] for i in held]
    own = tuple(np.zeros(len(place.names)) for place in places)
    seen = observe_tests(problem, trained.forms, places, Scores(trained.scores.shared, own))
    if seen is None:
        return None
    root = np.linalg.cholesky(trained.covariance) if trained.covariance.size else np.zeros((0, 0))
    return [
        _Prediction(
            place.whitened(observation, zero),
            _spread_of(
                np.concatenate([whole.own_slopes[i], whole.shared_slopes[i] @ root], axis=1),
                place.widths(whole.observations[i]),
                place.widths(observation),
            ),
        )
        for i, place, observation, zero in zip(held, places, seen, own, strict=True)
    ]


def _spread_of(slopes: Array, known: Array, widths: Array) -> Array:
    """Return the covariance factor (n, k) over the stated deviations.

    Parameters
    ----------
    slopes : (n, p) array
        Slopes over wider deviations.
    known : (n,) array
        Factors on those deviations.
    widths : (n,) array
        Factors on the noise of the prediction; what exceeds the stated one adds columns.
    """
    wider = np.flatnonzero(widths > 1.0)
    more = np.zeros((widths.size, wider.size))
    more[wider, np.arange(wider.size)] = np.sqrt(widths[wider] ** 2 - 1.0)
    return np.concatenate([known[:, None] * slopes, more], axis=1)


def _corrected(
    places: Sequence[Layout],
    blank: Fit,
    predicted: Sequence[_Prediction],
    process: Discrepancy,
    calm: Scatter,
) -> list[_Prediction]:
    """Return predictions with the Gaussian process added, and its own repeatability.

    ``blank`` is the base model of the same tests, their own nuisances at zero.
    """
    shapes = process.shapes_of(places, blank)
    means, roots = process.predict(places)
    return [
        _Prediction(
            prediction.mean + shape @ mean,
            np.concatenate(
                [prediction.factor * _calmed(place, blank, prediction, calm), shape @ root], axis=1
            ),
        )
        for place, shape, prediction, mean, root in zip(
            places, shapes, predicted, means, roots, strict=True
        )
    ]


def _calmed(layout: Layout, base: Fit, prediction: _Prediction, calm: Scatter) -> Array:
    """Return the factors on the columns of a covariance factor for another repeatability."""
    scale = np.ones(prediction.factor.shape[1])
    own = scale[: layout.scattering.size]
    own[layout.scattering] = layout.scatter_sizes(calm) / layout.scatter_sizes(base.scatter)
    return scale


def _judge(
    layout: Layout,
    base: Fit,
    row: int,
    prediction: _Prediction,
    quantities: Quantities,
    rng: np.random.Generator,
) -> dict[str, float]:
    """Return the scores of one prediction of one test."""
    own = base.scores.own[row]
    measured = base.residuals[row] + layout.simulated(base.observations[row], own, base.scatter)
    off = measured - prediction.mean
    found = {"log_score": _log_density(off, prediction.factor)}
    noise = rng.standard_normal((DRAWS, off.size))
    spread = rng.standard_normal((DRAWS, prediction.factor.shape[1])) @ prediction.factor.T
    draws = prediction.mean + spread + noise
    if layout.test.signals:
        for signal, part in layout.unwhiten(off).items():
            inside = (layout.window[0] <= _time(layout, signal)) & (
                _time(layout, signal) <= layout.window[1]
            )
            found[f"rmse_{signal}"] = float(np.sqrt(np.mean(part[inside] ** 2)))
        truth = layout.unwhiten(measured)
        pictures = [layout.unwhiten(draw) for draw in draws]
        for name, (_, signal, quantity) in quantities.items():
            time = _time(layout, signal)
            values = np.array([quantity(time, picture[signal]) for picture in pictures])
            target = quantity(time, truth[signal])
            found[f"crps_{name}"] = _crps(values, target)
            found[f"rmse_{name}"] = float(abs(np.median(values) - target))
            found[f"coverage_{name}"] = _covers(values, target)
    first = off.size - len(layout.test.scalars)
    for k, scalar in enumerate(layout.test.scalars):
        if np.isfinite(scalar.sd):
            values = draws[:, first + k] * scalar.sd
            found[f"crps_{scalar.name}"] = _crps(values, scalar.value)
            found[f"coverage_{scalar.name}"] = _covers(values, scalar.value)
            found[f"rmse_{scalar.name}"] = float(abs(off[first + k]) * scalar.sd)
    return found


def _time(layout: Layout, signal: str) -> Array:
    return next(s.time for s in layout.test.signals if s.name == signal)


def _log_density(off: Array, factor: Array) -> float:
    """Return the log density of N(0, I + F F^T), without its constant."""
    block = np.eye(factor.shape[1]) + factor.T @ factor
    pull = factor.T @ off
    quadratic = float(off @ off - pull @ np.linalg.solve(block, pull))
    return -0.5 * (quadratic + float(np.linalg.slogdet(block)[1]))


def _crps(draws: Array, target: float) -> float:
    """Return the continuous ranked probability score of a sample."""
    return crps(draws, np.full(draws.size, 1.0 / draws.size), target)


def _covers(draws: Array, target: float) -> float:
    """Return 1 if the central interval of a sample covers a value, else 0."""
    low, high = np.quantile(draws, [0.5 * (1.0 - INTERVAL), 0.5 * (1.0 + INTERVAL)])
    return float(low <= target <= high)


def _compare(
    scored: Scored,
    region: str,
    quantities: Quantities,
    rng: np.random.Generator,
) -> list[Gain]:
    gains = []
    for score, by_model in scored.items():
        if set(by_model) != set(MODELS):
            continue
        tables = {name: np.array(values) for name, values in by_model.items()}
        rows = rng.integers(tables["base"].size, size=(RESAMPLES, tables["base"].size))
        base, extended, process = (float(_mean(tables[model], score)) for model in MODELS)
        name = score.partition("_")[2]
        gains.append(
            Gain(
                score=score,
                region=region,
                unit=quantities[name][0]
                if name in quantities and not score.startswith("coverage")
                else "",
                base=base,
                extended=extended,
                gaussian_process=process,
                difference=_better(tables["extended"], tables["base"], score, rows),
                against_process=_better(
                    tables["extended"], tables["gaussian_process"], score, rows
                ),
                relative=_better(tables["extended"], tables["base"], score, rows, relative=True),
            )
        )
    return gains


def _mean(values: Array, score: str) -> Array:
    """Return the mean of a score over tests: of squares where it is a root mean square."""
    if score.startswith("rmse"):
        return np.asarray(np.sqrt(np.mean(values**2, axis=-1)))
    return np.asarray(np.mean(values, axis=-1))


def _better(
    ours: Array, theirs: Array, score: str, rows: NDArray[np.int64], *, relative: bool = False
) -> Estimate:
    """Return the improvement of a score with a paired bootstrap interval."""
    sign = 1.0 if score == "log_score" or score.startswith("coverage") else -1.0

    def gain(mine: Array, other: Array) -> Array:
        difference = sign * (_mean(mine, score) - _mean(other, score))
        return (
            difference / np.maximum(np.abs(_mean(other, score)), TINY) if relative else difference
        )

    value = float(gain(ours, theirs))
    low, high = np.quantile(gain(ours[rows], theirs[rows]), [0.025, 0.975])
    return Estimate(value, float(low), float(high))
