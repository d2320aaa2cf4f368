"""Simulated tests of a model at given latents, and the parts of their Jacobian that take runs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.layout import Layout, Scatter
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.diagnosis.problem import Form, Observation, Problem
from mcstudy.studyfile.input_space import value_at

Array = NDArray[np.float64]

SHARED_STEP, OWN_STEP = 0.05, 0.5
"""Steps of finite differences, in latents: of shared values and of a test's own nuisances."""
ROUGH_STEP = 0.3
"""The first of them where the model jumps between neighbouring inputs."""
CHANGE, STEP_RANGE = 30.0, (0.01, 0.3)
"""Norm of the whitened change of the data over which a shared value is differentiated once its
column is known, and bounds of the step."""


@dataclass(frozen=True)
class Slopes:
    """Whitened Jacobian blocks that take runs, one a test.

    Attributes
    ----------
    doubtful : (n, doubtful inputs), in the recorded inputs with an uncertainty.
    shared : (n, p), in the shared latents.
    """

    doubtful: tuple[Array, ...]
    shared: tuple[Array, ...]


def shared_names(problem: Problem, forms: Sequence[Form]) -> list[str]:
    """Return the names of the shared values: unknowns, then ``<cause>.<parameter>``."""
    return [u.name for u in problem.unknowns] + [
        f"{form.cause}.{name}" for form in forms for name in form.latents
    ]


def form_latents(problem: Problem, forms: Sequence[Form]) -> Iterator[tuple[Form, slice]]:
    """Yield each form and the places of its latents among the shared ones."""
    first = len(problem.unknowns)
    for form in forms:
        yield form, slice(first, first + form.size)
        first += form.size


@dataclass(frozen=True)
class _Common:
    """Values that all tests share: unknowns, and parameters of effects by cause.

    Forms with a trend come with their latents, as their parameters differ from test to test.
    """

    unknowns: dict[str, float]
    effects: dict[str, dict[str, float]]
    trending: tuple[tuple[Form, Array], ...]


def _common(problem: Problem, forms: Sequence[Form], shared: Array) -> _Common:
    count = len(problem.unknowns)
    unknowns = {
        unknown.name: value_at(unknown.prior, float(score))
        for unknown, score in zip(problem.unknowns, shared[:count], strict=True)
    }
    effects = {}
    trending = []
    for form, place in form_latents(problem, forms):
        effects[form.cause] = form.values(shared[place])
        if form.trend is not None:
            trending.append((form, shared[place]))
    return _Common(unknowns, effects, tuple(trending))


def _observe(problem: Problem, common: _Common, layout: Layout, own: Array) -> Observation | None:
    inputs = layout.inputs(own, problem.ranges)
    inputs.update(common.unknowns)
    effects = common.effects
    if common.trending:
        effects = effects | {f.cause: f.values(z, layout.test) for f, z in common.trending}
    return problem.simulate(inputs, effects)


def observe_tests(
    problem: Problem, forms: Sequence[Form], layouts: Sequence[Layout], scores: Scores
) -> list[Observation] | None:
    """Return the simulated tests; None if a run fails.

    Parameters
    ----------
    problem : Problem
    forms : sequence of Form
    layouts : sequence of Layout
    scores : Scores
        Latents to simulate at.
    """
    common = _common(problem, forms, scores.shared)
    found = []
    for layout, own in zip(layouts, scores.own, strict=True):
        seen = _observe(problem, common, layout, own)
        if seen is None:
            return None
        found.append(seen)
    return found


def residuals_at(
    problem: Problem,
    layouts: Sequence[Layout],
    forms: Sequence[Form],
    scores: Scores,
    scatter: Scatter,
    wide: Sequence[Observation],
) -> tuple[Array, ...] | None:
    """Return the whitened residuals (n,) of every test; None if a run fails.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
    forms : sequence of Form
    scores : Scores
        Latents to simulate at.
    scatter : Scatter
    wide : sequence of Observation
        Simulated tests whose factors on standard deviations apply.
    """
    seen = observe_tests(problem, forms, layouts, scores)
    if seen is None:
        return None
    return tuple(
        layout.residual(part, own, scatter, like.widening)
        for layout, part, own, like in zip(layouts, seen, scores.own, wide, strict=True)
    )


def expand_tests(
    layouts: Sequence[Layout],
    seen: Sequence[Observation],
    scores: Scores,
    slopes: Slopes,
    scatter: Scatter,
) -> tuple[list[Array], list[Array]]:
    """Return residuals (n,) and Jacobians (n, q) in the tests' own nuisances, whitened.

    Parameters
    ----------
    layouts : sequence of Layout
    seen : sequence of Observation
    scores : Scores
        Latents that they were simulated at.
    slopes : Slopes
    scatter : Scatter
    """
    residuals, owns = [], []
    for layout, observation, own, doubtful in zip(
        layouts, seen, scores.own, slopes.doubtful, strict=True
    ):
        residual, analytic = layout.expand(observation, own, scatter)
        residuals.append(residual)
        owns.append(np.concatenate([doubtful, analytic], axis=1))
    return residuals, owns


def simulate_slopes(
    problem: Problem,
    forms: Sequence[Form],
    layouts: Sequence[Layout],
    scores: Scores,
    seen: Sequence[Observation],
    scatter: Scatter,
    known: Slopes | None = None,
    *,
    sizes: Array | None = None,
    central: bool = False,
) -> Slopes:
    """Return the Jacobian blocks that take runs, by finite differences.

    Parameters
    ----------
    problem : Problem
    forms : sequence of Form
    layouts : sequence of Layout
    scores : Scores
        Latents to differentiate at.
    seen : sequence of Observation
        Tests simulated there.
    scatter : Scatter
    known : Slopes, optional
        Blocks that are kept; missing shared columns come last.
    sizes : (p,) array, optional
        Norms of the shared columns, as far as known: the differences are taken over changes of the
        data of one size, so that confounded values err alike.
    central : bool
        Whether the differences are central: one-sided ones give confounded values, which change
        the same data, a difference that is not there.
    """
    residuals = [
        layout.residual(observation, own, scatter)
        for layout, observation, own in zip(layouts, seen, scores.own, strict=True)
    ]
    doubtful = (
        known.doubtful
        if known
        else _doubtful(
            problem,
            _common(problem, forms, scores.shared),
            layouts,
            scores,
            residuals,
            scatter,
            central=central,
        )
    )
    shared = [np.zeros((residual.size, scores.shared.size)) for residual in residuals]
    rough = any(np.any(layout.roughness) for layout in layouts)
    there_already = 0
    if known:
        there_already = known.shared[0].shape[1]
        for table, kept in zip(shared, known.shared, strict=True):
            table[:, :there_already] = kept
    for k in range(there_already, scores.shared.size):
        size = ROUGH_STEP if rough else SHARED_STEP
        if sizes is not None and sizes[k] > 0.0:
            size = float(np.clip(CHANGE / sizes[k], *STEP_RANGE))
        ends = []
        for step in (size, -size):
            moved_shared = scores.shared.copy()
            moved_shared[k] += step
            # Deviations are held, as in a weighted least-squares fit.
            moved_to = Scores(moved_shared, scores.own)
            found = residuals_at(problem, layouts, forms, moved_to, scatter, seen)
            if found is not None:
                ends.append((step, found))
                if not central:
                    break
        for i, (layout, table) in enumerate(zip(layouts, shared, strict=True)):
            own_ends = [(step, found[i]) for step, found in ends]
            table[:, k] = _difference(layout, own_ends, residuals[i])
    return Slopes(tuple(doubtful), tuple(shared))


def _doubtful(
    problem: Problem,
    common: _Common,
    layouts: Sequence[Layout],
    scores: Scores,
    residuals: Sequence[Array],
    scatter: Scatter,
    *,
    central: bool,
) -> tuple[Array, ...]:
    """Return the Jacobians in the inputs that are recorded with an uncertainty."""
    tables = []
    for layout, own, residual in zip(layouts, scores.own, residuals, strict=True):
        table = np.zeros((residual.size, len(layout.test.doubtful)))
        for k in range(table.shape[1]):
            ends = []
            for step in (OWN_STEP, -OWN_STEP):
                moved = own.copy()
                moved[k] += step
                there = _observe(problem, common, layout, moved)
                if there is not None:
                    ends.append((step, layout.residual(there, moved, scatter)))
                    if not central:
                        break
            table[:, k] = _difference(layout, ends, residual)
        tables.append(table)
    return tuple(tables)


def _difference(layout: Layout, ends: Sequence[tuple[float, Array]], here: Array) -> Array:
    """Return the slope (n,) between residuals at two steps, one-sided where only one side runs."""
    if not ends:
        return np.zeros_like(here)
    (high, above), (low, below) = ends if len(ends) == 2 else (ends[0], (0.0, here))
    return _without_jumps(layout, (below - above) / (high - low), abs(high - low))


def _without_jumps(layout: Layout, slope: Array, step: float) -> Array:
    """Return a slope (n,) shrunk where it may be a jump of the model over a step.

    The factor is that of a value that is known with an error (W. James, C. Stein, 4th Berkeley
    Symposium, 1961, positive part, for each value alone).
    """
    error = np.sqrt(2.0) * layout.roughness / step
    if not np.any(error):
        return slope
    with np.errstate(divide="ignore", invalid="ignore"):
        kept = np.maximum(0.0, 1.0 - (error / slope) ** 2)
    return np.where(error > 0.0, np.nan_to_num(kept) * slope, slope)
