"""Shapes of a misfit: those of the causes, drifts, and discrepancies without a named cause."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.jacobian import observe_tests
from mcstudy.diagnosis.layout import Layout
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.diagnosis.problem import Cause, Form, Problem
from mcstudy.diagnosis.regimes import covariates_of, separate_factors
from mcstudy.execution.workers import run_jobs

Array = NDArray[np.float64]

SMOOTH = 7
"""Cosines over the pulse of a smooth discrepancy."""
HIGHEST = 1500.0
"""Hz, highest frequency of a discrepancy that all tests share (below CFC 1000's corner)."""
MAX_FINE = 48
"""Cosines beyond the smooth ones, at most."""
SIZE = 0.05
"""Unit of a discrepancy, relative to the peak of the signal or to the scalar."""
DRIFT = 2.0
"""Unit of a drift in latents per standard deviation of its covariate."""
PULSE_DRIFT = 0.02
"""The same for the pulse, relative."""
ALL_TESTS = "all tests"
"""Factor of what is the same in all tests."""
ONE_PARAMETER = (-2.0, -1.0, -0.3, -0.1, 0.1, 0.3, 1.0, 2.0)
MORE_PARAMETERS = (-2.0, -1.0, 0.0, 1.0, 2.0)
FINE = tuple(np.linspace(-2.5, 2.5, 17))
BESIDE_FINE = (-1.5, 0.0, 1.5)
"""Latents of a cause's parameters at which it is tried, the third one at the last."""
LEVELS, CHANGES = (-1.0, -0.2, 0.0, 0.2, 1.0), (-1.0, -0.3, -0.1, 0.1, 0.3, 1.0)
"""Latents of a parameter with a trend, and of its change, at which it is tried."""
STANDARD_GRID = 3
"""Number of free parameters on the grid; further ones stay at their median."""


@dataclass(frozen=True)
class Template:
    """A cause at one size.

    Attributes
    ----------
    form : of the cause.
    scores : latents of its parameters.
    columns : (n,) whitened change of the data, one a test.
    """

    form: Form
    scores: Array
    columns: tuple[Array, ...]


@dataclass(frozen=True)
class Shapes:
    """Named columns (n, k), whitened, one table a test."""

    names: tuple[str, ...]
    columns: tuple[Array, ...]


def score_grid(form: Form, *, fine: bool = False) -> list[Array]:
    """Return the latents at which a form is tried; ``fine`` refines the first one's grid.

    The entries of a table, which follow its first parameter, move together. Of a trend, the
    parameter and its change are moved.
    """
    count = form.size
    if form.trend is not None:
        moved = form.trend.parameter
        return [
            np.array([level if k == moved else 0.0 for k in range(count - 1)] + [change])
            for level in (FINE[::4] if fine else LEVELS)
            for change in CHANGES
        ]
    if not form.named and count > STANDARD_GRID:
        return [
            np.array([a, *[b] * (count - 1)])
            for a in (FINE if fine else MORE_PARAMETERS)
            for b in MORE_PARAMETERS
        ]
    if count == 0:
        return [np.zeros(0)]
    if count == 1:
        levels = sorted({*FINE, *ONE_PARAMETER}) if fine else ONE_PARAMETER
        return [np.array([z]) for z in levels]
    first: Sequence[float] = FINE if fine else MORE_PARAMETERS
    others: Sequence[float] = BESIDE_FINE if fine else MORE_PARAMETERS
    axes = [first] + [others] * (min(count, STANDARD_GRID) - 1)
    axes = [*axes[:2], *((0.0,) if fine else BESIDE_FINE for _ in axes[2:])]
    axes += [(0.0,)] * (count - STANDARD_GRID)
    return [np.array(z) for z in np.stack(np.meshgrid(*axes), -1).reshape(-1, count)]


def cause_templates(
    problem: Problem,
    layouts: Sequence[Layout],
    fitted: Fit,
    forms: Sequence[Form],
    workers: int = 1,
) -> list[Template]:
    """Return the templates of forms about a fit; those whose runs fail are left out.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    fitted : Fit
        Fit to expand about.
    forms : sequence of Form
        Forms to add, one at a time.
    workers : int
        Processes, -1 for one a core.
    """
    taken = {form.cause for form in fitted.forms}
    new = [form for form in forms if form.cause not in taken]
    banks = run_jobs(partial(_templates_of, problem, layouts, fitted), new, workers)
    return [template for bank in banks for template in bank]


def _templates_of(
    problem: Problem, layouts: Sequence[Layout], fitted: Fit, form: Form
) -> list[Template]:
    """Return the templates of one form."""
    found = []
    for scores in score_grid(form):
        columns = change_of(problem, layouts, fitted, form, scores)
        if columns is not None and any(np.any(column) for column in columns):
            found.append(Template(form, scores, columns))
    return found


def change_of(
    problem: Problem, layouts: Sequence[Layout], fitted: Fit, form: Form, scores: Array
) -> tuple[Array, ...] | None:
    """Return the whitened change of each test by one more form about a fit; None if a run fails.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    fitted : Fit
        Fit to expand about.
    form : Form
        The one to add.
    scores : (k,) array
        Latents of its free parameters.

    Returns
    -------
    tuple of (n,) array or None
    """
    moved = Scores(np.concatenate([fitted.scores.shared, scores]), fitted.scores.own)
    found = observe_tests(problem, (*fitted.forms, form), layouts, moved)
    if found is None:
        return None
    return tuple(
        (layout.whitened(seen, own) - layout.whitened(before, own)) / layout.widths(before)
        for layout, seen, before, own in zip(
            layouts, found, fitted.observations, fitted.scores.own, strict=True
        )
    )


def drifts(layouts: Sequence[Layout], fitted: Fit, shared: Sequence[str]) -> Shapes:
    """Return every nuisance and every shared value drifting along every covariate.

    With them, recorded inputs that are off by the same in all tests: errors of single tests have
    mean zero, and a common one that they take hides where a template is not quite linear.

    Parameters
    ----------
    layouts : sequence of Layout
        Of the tests.
    fitted : Fit
        Fit whose Jacobian is used.
    shared : sequence of str
        Names of the shared values.
    """
    names = [f"{name} with {ALL_TESTS}" for name in layouts[0].test.doubtful]
    columns = [[DRIFT * slopes[:, k] for k in range(len(names))] for slopes in fitted.own_slopes]
    for covariate, factor in covariates_of(layouts).items():
        for k, name in enumerate(layouts[0].names):
            scattering = bool(layouts[0].scattering[k])
            names.append(f"{name} with {covariate}")
            for i, (layout, slopes) in enumerate(zip(layouts, fitted.own_slopes, strict=True)):
                unit = DRIFT
                if scattering:
                    sizes = layout.scatter_sizes(fitted.scatter)
                    unit = PULSE_DRIFT / sizes[k - layout.scattering.argmax()]
                columns[i].append(unit * factor[i] * slopes[:, k])
        for k, name in enumerate(shared):
            names.append(f"{name} with {covariate}")
            for i, slopes in enumerate(fitted.shared_slopes):
                columns[i].append(0.5 * DRIFT * factor[i] * slopes[:, k])
    return _stack(names, columns, fitted)


def smooth_discrepancy(layouts: Sequence[Layout], fitted: Fit) -> Shapes:
    """Return products of pulse and cosines: alone, and times what differs from test to test."""
    factors: Mapping[str, Array] = {
        ALL_TESTS: np.ones(len(layouts)),
        **separate_factors(layouts),
    }
    return _discrepancy(layouts, fitted, range(SMOOTH), factors, shaped=True)


def fine_discrepancy(layouts: Sequence[Layout], fitted: Fit) -> Shapes:
    """Return the finer cosines, the same in all tests."""
    length = max(layout.window[1] - layout.window[0] for layout in layouts)
    last = min(SMOOTH + MAX_FINE, int(2.0 * length * HIGHEST))
    factors = {ALL_TESTS: np.ones(len(layouts))}
    return _discrepancy(layouts, fitted, range(SMOOTH, last), factors, shaped=False)


def _discrepancy(
    layouts: Sequence[Layout],
    fitted: Fit,
    orders: range,
    factors: Mapping[str, Array],
    *,
    shaped: bool,
) -> Shapes:
    names = []
    columns: list[list[Array]] = [[] for _ in layouts]
    test = layouts[0].test
    for factor_name, factor in factors.items():
        for signal in test.signals:
            for order in orders:
                names.append(f"{signal.name} cosine {order} x {factor_name}")
                for i, layout in enumerate(layouts):
                    if shaped:
                        seen, own = fitted.observations[i], fitted.scores.own[i]
                        shape = layout.factor(signal.name, order, seen, own)
                    else:
                        shape = layout.cosine(signal.name, order)
                    columns[i].append(SIZE * factor[i] * shape)
        for scalar in test.scalars if shaped else ():
            names.append(f"{scalar.name} x {factor_name}")
            for i, layout in enumerate(layouts):
                unit = layout.unit_scalar(scalar.name, fitted.observations[i])
                columns[i].append(SIZE * factor[i] * unit)
    return _stack(names, columns, fitted)


def _stack(names: Sequence[str], columns: Sequence[Sequence[Array]], fitted: Fit) -> Shapes:
    tables = tuple(
        np.stack(part, axis=1) if part else np.zeros((r.size, 0))
        for part, r in zip(columns, fitted.residuals, strict=True)
    )
    return Shapes(tuple(names), tables)


def named_forms(causes: Sequence[Cause]) -> list[Form]:
    """Return the named forms of all causes."""
    return [form for cause in causes for form in cause.forms if form.named]
