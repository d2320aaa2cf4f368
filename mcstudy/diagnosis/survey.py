"""Survey of a form: where it may start from, what it promises, and a first fit from there."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.fit import Fit, FitError, fit, half_squares, log_widening, misfit_of
from mcstudy.diagnosis.jacobian import Slopes, observe_tests
from mcstudy.diagnosis.layout import Layout, Scatter
from mcstudy.diagnosis.linear_model import Centre, solve
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.diagnosis.problem import Form, Problem
from mcstudy.diagnosis.shortlist import drop_of_parabola
from mcstudy.diagnosis.templates import score_grid

Array = NDArray[np.float64]

SCAN = Scatter(0.02, 0.02)
"""Repeatability with which the base model is fitted before it is estimated, and the largest with
which forms are tried."""
LEAST_SCAN = 0.003
"""Smallest repeatability with which forms are tried."""
UNSEEN = 0.05
"""Whitened sum of squares below which a form changes nothing that was measured."""
FAR = 0.7
"""Weight of the data below which a fit starts far from the data."""
MAX_START = 3.0
"""Largest latent, in size, that a fit starts from."""
CLOSE, WORSE = 60.0, 1.4
"""Log units and factor by which a form far from the data may fit worse than the best."""
MODEST, SLIGHT = 4.0, 6.0
"""Factor and log units by which a form near the data may promise less gain than the best."""
RIVAL_START = 1.5
"""Factor on the misfit of the best start within which another one is tried too."""
SPARE = 2
"""Further starts of a form whose fit falls short of what it promises."""
KEPT = 0.5
"""Share of the expected gain below which a fit falls short of it."""
STAGE_STEPS = 6
"""Steps of a first fit."""
SURVEYED = 10
"""Tests on which forms are surveyed: spread over the largest measured values, the upper half of
them more densely, where clearances, plateaus and saturation begin. Tests without signals, whose
scalars scatter, are surveyed all."""
DENSER = 0.6
"""Exponent of the ranks of these tests."""


def scan_scatter(base: Fit) -> Scatter:
    """Return the repeatability with which forms are tried beside a base."""
    level, shape = (
        float(np.clip(size, LEAST_SCAN, most))
        for size, most in ((base.scatter.level, SCAN.level), (base.scatter.shape, SCAN.shape))
    )
    return Scatter(level, shape)


def weight_of(samples: int, misfit: float) -> float:
    """Return the weight of the data at which a misfit is as large as that of noise.

    Parameters
    ----------
    samples : int
        Number of the data.
    misfit : float
        Negative log posterior.
    """
    return min(1.0, float(np.sqrt(0.5 * samples / misfit)))


@dataclass(frozen=True)
class _Trial:
    """Latents that a fit may start from: as moved by the linear model, and before.

    With the misfit of the linear model at the one, and on the surveyed tests at the other.
    """

    cost: float
    moved: Scores
    still: Scores
    slopes: Slopes
    still_misfit: float


@dataclass(frozen=True)
class Survey:
    """Result of a prior grid scan of a form.

    Attributes
    ----------
    form : the form that was scanned.
    scatter : repeatability of the survey.
    weight : of the data; the larger the misfit without the form, the smaller.
    misfit : negative log posterior at the best start, or what the expected gain makes of it.
    promise : expected gain in log posterior if only the size of the form were free.
    starts : latents to start from, with nearby Jacobians, best first.
    spare : others, for a fit that falls short of the promise.
    """

    form: Form
    scatter: Scatter
    weight: float
    misfit: float
    promise: float
    starts: tuple[tuple[Scores, Slopes], ...]
    spare: tuple[_Trial, ...] = ()

    @property
    def far(self) -> bool:
        """Whether a fit starts far from the data."""
        return self.weight < FAR


def survey(
    problem: Problem,
    layouts: Sequence[Layout],
    forms: tuple[Form, ...],
    centres: Sequence[Centre],
    scatter: Scatter,
    form: Form,
) -> Survey | None:
    """Return the prior grid scan of a form, nuisances solved for in the linear model.

    None if the form changes nothing that was measured, or cannot run.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    forms : tuple of Form
        Forms of the model without the one to add.
    centres : sequence of Centre
        Points to linearise at: a misfit draws the most probable latents of a wrong model away from
        those of the right one.
    scatter : Scatter
        Repeatability of the survey.
    form : Form
        The one to add.
    """
    chosen = _spread(layouts)
    part = replace(problem, tests=tuple(problem.tests[i] for i in chosen))
    places = [layouts[i] for i in chosen]
    few = [centre.of_tests(chosen) for centre in centres]
    times = len(layouts) / len(chosen)
    samples = sum(r.size for r in few[0].residuals)
    misfits = [solve(centre, centre.residuals, 1.0)[1] for centre in few]
    weight = weight_of(samples, min(misfits))
    if weight >= FAR:
        # Near the data the better of the points is enough.
        k = int(np.argmin(misfits))
        few, centres = [few[k]], [centres[k]]
    # A threshold between two coarse levels may be without effect at the one and hide the data at
    # the other.
    fine = weight < FAR or (form.size == 1 and not problem.dear)
    best: list[_Trial] = []
    rest: list[_Trial] = []
    changes = 0.0
    lowest = expected = np.inf
    for centre, whole in zip(few, centres, strict=True):
        without = solve(centre, centre.residuals, weight)[1]
        lowest = min(lowest, without)
        tried: dict[float, _Trial] = {}
        for scores in score_grid(form, fine=fine):
            start = Scores(np.concatenate([centre.scores.shared, scores]), centre.scores.own)
            seen = observe_tests(part, (*forms, form), places, start)
            if seen is None:
                continue
            residuals = [
                place.residual(observation, own, scatter)
                for place, observation, own in zip(places, seen, start.own, strict=True)
            ]
            wider = weight**2 * log_widening(places, seen)
            for found, before in zip(residuals, centre.residuals, strict=True):
                changes = max(changes, float(np.sum((found - before) ** 2)))
            solved, misfit = solve(centre, residuals, weight)
            misfit += wider
            halfway = [0.5 * (r + b) for r, b in zip(residuals, centre.residuals, strict=True)]
            half = solve(centre, halfway, weight)[1] + 0.5 * wider
            gain = drop_of_parabola(without, half, misfit)
            expected = min(expected, without - gain)
            shared = np.clip(solved.shared, -MAX_START, MAX_START)
            own = list(whole.scores.own)
            for i, z in zip(chosen, solved.own, strict=True):
                own[i] = z
            held = tuple(np.clip(z, -MAX_START, MAX_START) for z in own)
            cost = misfit + 0.5 * float(scores @ scores) / times
            moved = Scores(np.concatenate([shared, scores]), held)
            still = Scores(start.shared, whole.scores.own)
            # One start a value of the first parameter, where or when the cause sets in.
            place = float(scores[0]) if scores.size else 0.0
            if place not in tried or cost < tried[place].cost:
                at_rest = half_squares(residuals, start, weight) + wider
                tried[place] = _Trial(cost, moved, still, whole.slopes, at_rest)
        ranked = sorted(tried.values(), key=lambda entry: entry.cost)
        best += ranked[:1]
        rest += ranked[1:]
    if changes < UNSEEN:
        return None
    best.sort(key=lambda entry: entry.cost)
    rest.sort(key=lambda entry: entry.cost)
    cheapest = best[0].cost
    if weight >= FAR and not problem.dear:
        # Nuisances that took a misfit on mislead the linear model: runs decide between the starts.
        def by_runs(entry: _Trial) -> float:
            moved = entry.moved.of_tests(chosen)
            run = _misfit_by_runs(part, places, (*forms, form), scatter, weight, moved)
            return min(run, entry.still_misfit)

        ranked = sorted(best + rest, key=by_runs)
        best, rest = ranked[:1], ranked[1:]
    confirm = partial(_confirm, problem, layouts, (*forms, form), scatter, weight)
    starts = tuple(
        (confirm(entry), entry.slopes) for entry in best if entry.cost < RIVAL_START * best[0].cost
    )
    # Steps of the grid are too large for a small effect in data of little noise.
    reached = min(cheapest, expected) if weight >= FAR else cheapest
    promise = max(lowest - expected, 0.0)
    spare = tuple(rest[:SPARE])
    return Survey(form, scatter, weight, times * reached, times * promise, starts, spare)


def _misfit_by_runs(
    problem: Problem,
    layouts: Sequence[Layout],
    forms: tuple[Form, ...],
    scatter: Scatter,
    weight: float,
    scores: Scores,
) -> float:
    """Return the misfit of a model at latents by runs; infinity if one of them fails."""
    seen = observe_tests(problem, forms, layouts, scores)
    return np.inf if seen is None else misfit_of(layouts, seen, scores, scatter, weight)


def _confirm(
    problem: Problem,
    layouts: Sequence[Layout],
    forms: tuple[Form, ...],
    scatter: Scatter,
    weight: float,
    tried: _Trial,
) -> Scores:
    """Return the start with the smaller misfit by runs: as moved by the linear model or before.

    The model leads astray where a parameter lies near the end of its range, or the move is long.
    """
    by_runs = partial(_misfit_by_runs, problem, layouts, forms, scatter, weight)
    return min((tried.moved, tried.still), key=by_runs)


def _spread(layouts: Sequence[Layout]) -> list[int]:
    """Return the tests of a survey, in order."""
    if len(layouts) <= SURVEYED or not layouts[0].test.signals:
        return list(range(len(layouts)))
    heights = [
        max(float(np.abs(s.values).max()) for s in layout.test.signals) for layout in layouts
    ]
    places = np.linspace(0.0, 1.0, SURVEYED) ** DENSER
    ranks = np.unique((places * (len(layouts) - 1)).round().astype(int))
    return sorted(int(i) for i in np.argsort(heights)[ranks])


def may_win(surveyed: Survey, misfit: float, promise: float) -> bool:
    """Return whether a form may still beat those with the best loss and expected gain."""
    if surveyed.far:
        return surveyed.misfit < WORSE * misfit + CLOSE
    return MODEST * surveyed.promise + SLIGHT > promise


def temper(
    problem: Problem, layouts: Sequence[Layout], forms: tuple[Form, ...], surveyed: Survey
) -> Survey | None:
    """Return a survey whose starts have been refitted to tempered data, where they lie far away.

    Its misfit is that of the best of them; None if none can run.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    forms : tuple of Form
        Forms of the model without the one to add.
    surveyed : Survey
        Prior grid scan of the form to add.
    """
    if not surveyed.far:
        return surveyed
    found = []
    for start, slopes in surveyed.starts:
        try:
            fitted = fit(
                problem, layouts, (*forms, surveyed.form), start, surveyed.scatter, slopes,
                exact=False, weight=surveyed.weight, most=STAGE_STEPS,
            )  # fmt: skip
        except FitError:
            continue
        found.append((fitted.misfit, _without_nuisances(fitted), fitted.slopes))
    if not found:
        return None
    found.sort(key=lambda entry: entry[0])
    starts = tuple((start, slopes) for _, start, slopes in found)
    return replace(surveyed, misfit=found[0][0], starts=starts)


def approach(
    problem: Problem,
    layouts: Sequence[Layout],
    forms: tuple[Form, ...],
    without: float,
    surveyed: Survey,
) -> Fit | None:
    """Return a first fit of a model extended by one form; None if it cannot run.

    Far from the data the likelihood is tempered less and less as the fit comes near.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    forms : tuple of Form
        Forms of the model without the one to add.
    without : float
        Misfit of the model without it.
    surveyed : Survey
        Of the form to add, after ``temper``.
    """
    forms = (*forms, surveyed.form)
    best: Fit | None = None
    for start, slopes in surveyed.starts:
        found = _come_near(problem, layouts, forms, surveyed, start, slopes)
        if found is not None and (best is None or found.log_evidence > best.log_evidence):
            best = found
    enough = without - KEPT * surveyed.promise
    for tried in () if surveyed.far else surveyed.spare:
        if best is not None and best.misfit <= enough:
            break
        start = _confirm(problem, layouts, forms, surveyed.scatter, surveyed.weight, tried)
        found = _come_near(problem, layouts, forms, surveyed, start, tried.slopes)
        if found is not None and (best is None or found.log_evidence > best.log_evidence):
            best = found
    return best


def _come_near(
    problem: Problem,
    layouts: Sequence[Layout],
    forms: tuple[Form, ...],
    surveyed: Survey,
    start: Scores,
    slopes: Slopes,
) -> Fit | None:
    """Return a first fit from a start, or None if it cannot run."""
    try:
        if surveyed.far:
            found = fit(
                problem, layouts, forms, start, surveyed.scatter, slopes,
                exact=False, weight=float(np.sqrt(surveyed.weight)), most=STAGE_STEPS,
            )  # fmt: skip
            start, slopes = _without_nuisances(found), found.slopes
        return fit(
            problem, layouts, forms, start, surveyed.scatter, slopes,
            exact=False, most=STAGE_STEPS,
        )  # fmt: skip
    except FitError:
        return None


def _without_nuisances(found: Fit) -> Scores:
    """Return the shared latents of a fit; nuisances absorbed the misfit of wrong ones."""
    return Scores(found.scores.shared, tuple(np.zeros_like(z) for z in found.scores.own))
