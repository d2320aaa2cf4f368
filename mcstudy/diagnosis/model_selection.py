"""Model selection: every cause refitted in all its forms, ranked by evidence, with an open set."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcstudy.diagnosis.fit import (
    Centre,
    Fit,
    FitError,
    Slopes,
    fit,
    linearise,
    residuals_at,
    shared_names,
    solve,
)
from mcstudy.diagnosis.layout import Layout, Scatter
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.diagnosis.problem import Cause, Form, Problem
from mcstudy.diagnosis.screening import estimate_scatter, remaining
from mcstudy.diagnosis.templates import (
    drifts,
    fine_discrepancy,
    score_grid,
    smooth_discrepancy,
)
from mcstudy.execution.workers import run_jobs

Array = NDArray[np.float64]

DISTINCT = 3.0
"""Log evidence within which causes are indistinguishable, and below which none is named."""
STRUCTURE = 0.01
"""p-value below which the residuals of a fit have structure."""
MAX_SHARE = 0.8
"""Explained share of the misfit above which a cause is named despite remaining structure."""
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
PRUNING_RATIO = 1.5
"""Factor on the best negative log posterior beyond which a form is pruned."""
STAGE_STEPS = 6
"""Steps of a first fit."""
SURVEYED = 10
"""Tests on which forms are surveyed: spread over the largest measured values, the upper half of
them more densely, where clearances, plateaus and saturation begin."""
DENSER = 0.6
"""Exponent of the ranks of these tests."""
MIN_COUNT = 6
"""Forms that are refitted whatever their expected gain."""


@dataclass(frozen=True)
class Candidate:
    """A cause with its best fit and log Bayes factor over the base model, averaged over forms."""

    cause: Cause
    fitted: Fit
    form: Form
    log_evidence: float
    forms: dict[str, float]


@dataclass(frozen=True)
class Remainder:
    """Remaining structure of a fit.

    Attributes
    ----------
    p_value : of the remaining structure.
    share : of the misfit that the fit explains.
    left : misfit that a free discrepancy would still explain, log units.
    drift : best drift, and its log Bayes factor.
    """

    p_value: float
    share: float
    left: float
    drift: tuple[str, float]


def settle(problem: Problem, layouts: Sequence[Layout], fitted: Fit) -> Fit:
    """Return a fit with its repeatability re-estimated.

    A discrepancy that all tests share, or that changes with their regime or order, stays free
    meanwhile: the repeatability has mean zero and may not absorb what is common.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    fitted : Fit
        Fit to start from.
    """
    scatter = estimate_scatter(fitted, layouts, smooth_discrepancy(layouts, fitted))
    start = rescale(layouts, fitted, scatter)
    return fit(problem, layouts, fitted.forms, start, scatter, fitted.slopes, exact=False)


def with_given_scatter(
    problem: Problem,
    layouts: Sequence[Layout],
    scatter: Scatter,
    fitted: Fit,
    *,
    exact: bool = False,
) -> Fit:
    """Return a fit with a given repeatability, so that it does not absorb a misfit.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    scatter : Scatter
        Repeatability to use.
    fitted : Fit
        Fit to start from.
    exact : bool
        Whether the final Jacobian must be that of the most probable latents.
    """
    if scatter == fitted.scatter and not exact:
        return fitted
    start = rescale(layouts, fitted, scatter)
    return fit(problem, layouts, fitted.forms, start, scatter, fitted.slopes, exact=exact)


def rescale(layouts: Sequence[Layout], fitted: Fit, scatter: Scatter) -> Scores:
    """Return a fit's latents for another repeatability; the pulses stay the same within +-3.

    Parameters
    ----------
    layouts : sequence of Layout
        Of the tests.
    fitted : Fit
    scatter : Scatter
        Repeatability to rescale to.
    """
    own = []
    for layout, scores in zip(layouts, fitted.scores.own, strict=True):
        moved = scores.copy()
        ratio = layout.scatter_sizes(fitted.scatter) / layout.scatter_sizes(scatter)
        moved[layout.scattering] = np.clip(scores[layout.scattering] * ratio, -3.0, 3.0)
        own.append(moved)
    return Scores(fitted.scores.shared, tuple(own))


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
    """

    form: Form
    scatter: Scatter
    weight: float
    misfit: float
    promise: float
    starts: tuple[tuple[Scores, Slopes], ...]

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
    least = min(solve(centre, centre.residuals, 1.0)[1] for centre in few)
    weight = min(1.0, float(np.sqrt(0.5 * samples / least)))
    best: list[tuple[float, Scores, Slopes]] = []
    changes = 0.0
    lowest = expected = np.inf
    for centre, whole in zip(few, centres, strict=True):
        without = solve(centre, centre.residuals, weight)[1]
        lowest = min(lowest, without)
        tried: list[tuple[float, Scores]] = []
        for scores in score_grid(form, fine=weight < FAR):
            start = Scores(np.concatenate([centre.scores.shared, scores]), centre.scores.own)
            residuals = residuals_at(part, places, (*forms, form), start, scatter)
            if residuals is None:
                continue
            for found, before in zip(residuals, centre.residuals, strict=True):
                changes = max(changes, float(np.sum((found - before) ** 2)))
            solved, misfit = solve(centre, residuals, weight)
            halfway = [0.5 * (r + b) for r, b in zip(residuals, centre.residuals, strict=True)]
            gain = _gain(without, solve(centre, halfway, weight)[1], misfit)
            expected = min(expected, without - gain)
            shared = np.clip(solved.shared, -MAX_START, MAX_START)
            own = list(whole.scores.own)
            for i, z in zip(chosen, solved.own, strict=True):
                own[i] = z
            held = tuple(np.clip(z, -MAX_START, MAX_START) for z in own)
            cost = misfit + 0.5 * float(scores @ scores) / times
            tried.append((cost, Scores(np.concatenate([shared, scores]), held)))
        if tried:
            best.append((*min(tried, key=lambda entry: entry[0]), whole.slopes))
    if changes < UNSEEN:
        return None
    best.sort(key=lambda entry: entry[0])
    starts = tuple((start, slopes) for _, start, slopes in best)
    # Steps of the grid are too large for a small effect in data of little noise.
    reached = min(best[0][0], expected) if weight >= FAR else best[0][0]
    promise = max(lowest - expected, 0.0)
    return Survey(form, scatter, weight, times * reached, times * promise, starts)


def _spread(layouts: Sequence[Layout]) -> list[int]:
    """Return the tests of a survey, in order."""
    if len(layouts) <= SURVEYED:
        return list(range(len(layouts)))
    heights = [
        max((float(np.abs(s.values).max()) for s in layout.test.signals), default=float(i))
        for i, layout in enumerate(layouts)
    ]
    places = np.linspace(0.0, 1.0, SURVEYED) ** DENSER
    ranks = np.unique((places * (len(layouts) - 1)).round().astype(int))
    return sorted(int(i) for i in np.argsort(heights)[ranks])


def _gain(none: float, half: float, whole: float) -> float:
    """Return the drop of a parabola through the loss at none, half and all of a change."""
    curvature = 2.0 * (none + whole - 2.0 * half)
    slope = whole - none - curvature
    return slope**2 / (4.0 * curvature) if slope < 0.0 < curvature else 0.0


def _may_win(surveyed: Survey, misfit: float, promise: float) -> bool:
    """Return whether a form may still beat those with the best loss and expected gain."""
    if surveyed.far:
        return surveyed.misfit < WORSE * misfit + CLOSE
    return MODEST * surveyed.promise + SLIGHT > promise


def approach(
    problem: Problem, layouts: Sequence[Layout], forms: tuple[Form, ...], surveyed: Survey
) -> Fit | None:
    """Return a first fit of a model extended by one form; None if it cannot run.

    From far away the likelihood is tempered, and less so as the fit comes near.

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
    forms = (*forms, surveyed.form)
    best: Fit | None = None
    for start, slopes in surveyed.starts:
        try:
            for stage in (surveyed.weight, np.sqrt(surveyed.weight)) if surveyed.far else ():
                found = fit(
                    problem, layouts, forms, start, surveyed.scatter, slopes,
                    exact=False, weight=stage, most=STAGE_STEPS,
                )  # fmt: skip
                slopes = found.slopes
                # Nuisances absorbed the misfit of wrong shared values: they are reset.
                start = Scores(found.scores.shared, tuple(np.zeros_like(z) for z in start.own))
            found = fit(
                problem, layouts, forms, start, surveyed.scatter, slopes,
                exact=False, most=STAGE_STEPS,
            )  # fmt: skip
        except FitError:
            continue
        if best is None or found.log_evidence > best.log_evidence:
            best = found
    return best


def rank_causes(
    problem: Problem,
    layouts: Sequence[Layout],
    base: Fit,
    causes: Sequence[Cause],
    workers: int,
    most: int,
) -> list[Candidate]:
    """Return the causes by evidence above a base's, best first.

    All are compared at one repeatability, that of the best of them: a wrong cause would take what
    it leaves for scatter. Causes that change nothing that was measured, or cannot run, are left
    out.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    base : Fit
        Fit of the model to extend, with its forms.
    causes : sequence of Cause
        Causes to add, one at a time.
    workers : int
        Processes, -1 for one a core.
    most : int
        Largest number of forms that are refitted, the most promising ones.
    """
    unknowns = len(problem.unknowns)
    shared = base.scores.shared.copy()
    shared[:unknowns] = 0.0
    own = tuple(np.zeros_like(z) for z in base.scores.own)
    scan = _scan_scatter(base)
    places = (Scores(shared, own), rescale(layouts, base, scan))
    found = (linearise(problem, layouts, base.forms, place, scan) for place in places)
    centres = [centre for centre in found if centre is not None]
    taken = {form.cause for form in base.forms}
    forms = [form for c in causes if c.name not in taken for form in c.forms]
    scans = run_jobs(partial(survey, problem, layouts, base.forms, centres, scan), forms, workers)
    seen = sorted((s for s in scans if s is not None), key=lambda s: s.misfit)
    best = max((s.promise for s in seen), default=0.0)
    promising = [
        s for k, s in enumerate(seen[:most]) if k < MIN_COUNT or _may_win(s, seen[0].misfit, best)
    ]
    first = run_jobs(partial(approach, problem, layouts, base.forms), promising, workers)
    reached = [found for found in first if found is not None]
    least = min((found.misfit for found in reached), default=0.0)
    # Forms far behind the best are pruned before their repeatability is re-estimated.
    kept = [found for found in reached if found.misfit < PRUNING_RATIO * least + CLOSE]
    settled = run_jobs(partial(settle, problem, layouts), kept, workers)
    scatter = max([base, *settled], key=lambda fitted: fitted.log_evidence).scatter
    refit = partial(with_given_scatter, problem, layouts, scatter, exact=True)
    base, *fits = run_jobs(refit, [base, *settled], workers)
    candidates = []
    for cause in causes:
        own_fits = [
            (fitted.forms[-1], fitted) for fitted in fits if fitted.forms[-1].cause == cause.name
        ]
        if not own_fits:
            continue
        evidence = np.array([fitted.log_evidence for _, fitted in own_fits]) - base.log_evidence
        form, fitted = own_fits[int(np.argmax(evidence))]
        candidates.append(
            Candidate(
                cause,
                fitted,
                form,
                # Pruned forms count in the average: their evidence is negligible.
                float(special.logsumexp(evidence) - np.log(len(cause.forms))),
                {entry.name: float(v) for (entry, _), v in zip(own_fits, evidence, strict=True)},
            )
        )
    return sorted(candidates, key=lambda candidate: -candidate.log_evidence)


def _scan_scatter(base: Fit) -> Scatter:
    """Return the repeatability with which forms are tried beside a base."""
    level, shape = (
        float(np.clip(size, LEAST_SCAN, most))
        for size, most in ((base.scatter.level, SCAN.level), (base.scatter.shape, SCAN.shape))
    )
    return Scatter(level, shape)


def examine(problem: Problem, layouts: Sequence[Layout], extended: Fit, gained: float) -> Remainder:
    """Return the remaining structure of an extended fit and the share of the misfit it explains.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    extended : Fit
        Fit of the extended model.
    gained : float
        Log evidence of the extension.
    """
    names = shared_names(problem, extended.forms)
    p_value, left, drift = remaining(
        extended,
        layouts,
        drifts(layouts, extended, names),
        smooth_discrepancy(layouts, extended),
        fine_discrepancy(layouts, extended),
    )
    gained, left = max(gained, 0.0), max(left, 0.0)
    whole = gained + left
    return Remainder(p_value, gained / whole if whole > 0.0 else 1.0, left, drift)
