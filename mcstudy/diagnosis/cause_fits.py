"""Forms of causes fitted to the tests: surveyed, fitted, and their repeatability estimated."""

from collections.abc import Sequence
from functools import partial
from typing import TypeVar

from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.layout import Layout, Scatter
from mcstudy.diagnosis.linear_model import Centre, solve
from mcstudy.diagnosis.problem import Form, Problem
from mcstudy.diagnosis.repeatability import settle
from mcstudy.diagnosis.survey import CLOSE, Survey, approach, may_win, survey, temper
from mcstudy.execution.workers import run_jobs

_Found = TypeVar("_Found", Survey, Fit)

PRUNING_RATIO = 1.5
"""Factor on the best negative log posterior beyond which a form is pruned."""
LITTLE = 0.1
"""Share of what the best form gains that another one must gain to be fitted on."""
KEPT = 2.0
"""Factor by which a form near the data may add more than it promises."""
MAX_CAUSES = 5
"""Causes, far from the data, of which all forms are fitted."""
MIN_COUNT, MIN_DEAR = 6, 2
"""Forms that are refitted whatever their expected gain, and of models whose runs are dear."""


def fit_forms(
    problem: Problem,
    layouts: Sequence[Layout],
    base: Fit,
    centres: Sequence[Centre],
    scan: Scatter,
    forms: Sequence[Form],
    *,
    most: int,
    needed: float,
    workers: int,
) -> list[Fit]:
    """Return fits of a base extended by each of the forms that promise enough.

    Each has its own most probable repeatability.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    base : Fit
        Fit of the model to extend.
    centres : sequence of Centre
        Points at which the base is linearised, its fit last.
    scan : Scatter
        Repeatability of the survey.
    forms : sequence of Form
        To add, one at a time.
    most : int
        Largest number of forms that are fitted, the most promising ones.
    needed : float
        Log evidence that a cause must add, where runs are dear.
    workers : int
        Processes, -1 for one a core.
    """
    scans = run_jobs(partial(survey, problem, layouts, base.forms, centres, scan), forms, workers)
    seen = sorted((s for s in scans if s is not None), key=lambda s: s.misfit)
    best = max((s.promise for s in seen), default=0.0)
    if problem.dear and needed > 0.0:
        seen = [s for s in seen if s.far or KEPT * s.promise > needed]
    least = MIN_DEAR if problem.dear else MIN_COUNT
    promising = [
        s for k, s in enumerate(seen[:most]) if k < least or may_win(s, seen[0].misfit, best)
    ]
    # Far from the data one form of a cause may start badly and end best.
    fully = [s for s in promising if not problem.dear or may_win(s, seen[0].misfit, best)]
    chosen = list(dict.fromkeys(s.form.cause for s in fully))[:MAX_CAUSES]
    held = {(s.form.cause, s.form.name) for s in promising}
    promising += [
        s
        for s in seen
        if s.far and s.form.cause in chosen and (s.form.cause, s.form.name) not in held
    ]
    if not promising:
        return []
    tempered = run_jobs(partial(temper, problem, layouts, base.forms), promising, workers)
    nearer = [s for s in tempered if s is not None]
    if nearer and nearer[0].far:
        nearer = _gaining(nearer, solve(centres[-1], centres[-1].residuals, nearer[0].weight)[1])
    without = solve(centres[-1], centres[-1].residuals, 1.0)[1]
    first = run_jobs(partial(approach, problem, layouts, base.forms, without), nearer, workers)
    reached = [found for found in first if found is not None]
    lowest = min((found.misfit for found in reached), default=0.0)
    # Forms far behind the best are pruned before their repeatability is re-estimated.
    kept = [found for found in reached if found.misfit < PRUNING_RATIO * lowest + CLOSE]
    kept = _gaining(kept, without)
    return run_jobs(partial(settle, problem, layouts), kept, workers)


def _gaining(found: Sequence[_Found], without: float) -> list[_Found]:
    """Return those that gain a share of what the best one does; all where little is gained.

    Parameters
    ----------
    found : sequence of Survey or of Fit
        With their misfits.
    without : float
        Misfit without any of them.
    """
    best = min((entry.misfit for entry in found), default=0.0)
    behind = max(CLOSE, (1.0 - LITTLE) * (without - best))
    return [entry for entry in found if entry.misfit <= best + behind]
