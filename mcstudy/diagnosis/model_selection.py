"""Model selection: every cause refitted in all its forms, ranked by evidence, with an open set."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import special

from mcstudy.diagnosis.cause_fits import KEPT, fit_forms
from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.jacobian import shared_names
from mcstudy.diagnosis.layout import Layout
from mcstudy.diagnosis.linear_model import linearise, solve
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.diagnosis.problem import Cause, Form, Problem
from mcstudy.diagnosis.repeatability import rescale, settle, with_given_scatter
from mcstudy.diagnosis.screening import remaining
from mcstudy.diagnosis.shortlist import shortlist
from mcstudy.diagnosis.survey import FAR, scan_scatter, weight_of
from mcstudy.diagnosis.templates import (
    Template,
    cause_templates,
    drifts,
    fine_discrepancy,
    named_forms,
    smooth_discrepancy,
)
from mcstudy.execution.workers import run_jobs

DISTINCT = 3.0
"""Log evidence within which causes are indistinguishable, and below which none is named."""
WIDENING = 2.0
"""Log units of evidence for each of misfit that remains within which causes are indistinguishable
(calibrated on hidden sets of foreign forms)."""
STRUCTURE = 0.01
"""p-value below which the residuals of a fit have structure."""
NAMED_SHARE = 0.9
"""Explained share of the misfit above which a cause is named despite remaining structure (on hidden
sets filters of other families and saturations with recovery reach 91 to 99 %)."""
FREE_FACTOR, FREE_POWER = 0.4, 0.7
"""Largest misfit that a free form may leave, in log units, as a power of all the misfit: the larger
it is, the closer a free form follows the right cause (on hidden sets foreign forms of the right
cause leave at most two thirds of it, a rupture, which is in no catalogue, more than it)."""
FAR_BEHIND, HALF = 200.0, 0.5
"""Log units, and share of what the best form gains, by which a form may lie behind it before all
are compared at one repeatability."""
BEHIND_DEAR = 30.0
"""These log units where runs are dear: each form has its own most probable repeatability by
then, so that another one hardly takes it nearer to the best."""
ROUNDS = 3
"""Rounds in which the repeatability of the best form is estimated again."""


@dataclass(frozen=True)
class Candidate:
    """A cause with its best fit and log Bayes factor over the base model, averaged over forms.

    ``forms`` holds the log Bayes factor of each form by name, ``others`` the fits of its formulas
    other than the best one.
    """

    cause: Cause
    fitted: Fit
    form: Form
    log_evidence: float
    forms: dict[str, float]
    others: tuple[Fit, ...] = ()

    def names(self, explained: float) -> bool:
        """Return whether the cause is named where structure remains beside it.

        Parameters
        ----------
        explained : float
            Share of the misfit that it explains.
        """
        if explained < NAMED_SHARE:
            return False
        if not self.form.is_free:
            return True
        whole = self.log_evidence / explained
        most: float = FREE_FACTOR * whole**FREE_POWER
        return whole - self.log_evidence <= most


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


def rank_causes(
    problem: Problem,
    layouts: Sequence[Layout],
    base: Fit,
    causes: Sequence[Cause],
    workers: int,
    most: int,
    bank: Sequence[Template] | None = None,
    needed: float = 0.0,
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
    bank : sequence of Template, optional
        Templates of the causes about the base, where they are known.
    needed : float
        Log evidence that a cause must add. Where runs are dear, forms near the data that promise
        far less are not fitted.
    """
    unknowns = len(problem.unknowns)
    shared = base.scores.shared.copy()
    shared[:unknowns] = 0.0
    own = tuple(np.zeros_like(z) for z in base.scores.own)
    scan = scan_scatter(base)
    places = (Scores(shared, own), rescale(layouts, base, scan))
    found = (linearise(problem, layouts, base.forms, place, scan) for place in places)
    centres = [centre for centre in found if centre is not None]
    taken = {form.cause for form in base.forms}
    forms = [form for c in causes if c.name not in taken for form in c.forms]
    if problem.dear:
        if bank is None:
            bank = cause_templates(problem, layouts, base, named_forms(causes), workers)
        misfit = solve(centres[-1], centres[-1].residuals, 1.0)[1]
        samples = sum(r.size for r in centres[-1].residuals)
        weight = weight_of(samples, misfit)
        # Near the data a survey finds what the templates promise.
        floor = needed / KEPT if weight >= FAR else 0.0
        forms = shortlist(centres[-1], weight, bank, forms, floor)
    together = [forms]
    if problem.dear:
        # Tables and trends are dear, and not needed where a formula explains everything.
        formulas = [form for form in forms if form.named]
        together = [formulas, [form for form in forms if not form.named]]
    settled: list[Fit] = []
    for part in together:
        if not part or (settled and not _leaves_structure(problem, layouts, base, settled)):
            continue
        settled += fit_forms(
            problem, layouts, base, centres, scan, part, most=most, needed=needed, workers=workers
        )
    if not settled:
        return []
    top = max([base, *settled], key=lambda fitted: fitted.log_evidence)
    # What a fit from far away still left was taken for repeatability.
    for _ in range(ROUNDS):
        exact = with_given_scatter(problem, layouts, top.scatter, top, exact=True)
        again = settle(problem, layouts, exact)
        if again.log_evidence < top.log_evidence + DISTINCT:
            break
        top = again
    least_behind = BEHIND_DEAR if problem.dear else FAR_BEHIND
    behind = max(least_behind, HALF * (top.log_evidence - base.log_evidence))
    ahead = [found for found in settled if found.log_evidence > top.log_evidence - behind]
    refit = partial(with_given_scatter, problem, layouts, top.scatter, exact=True)
    base, *fits = run_jobs(refit, [base, *ahead], workers)
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
                tuple(f for entry, f in own_fits if entry.named and entry.name != form.name),
            )
        )
    return sorted(candidates, key=lambda candidate: -candidate.log_evidence)


def _leaves_structure(
    problem: Problem, layouts: Sequence[Layout], base: Fit, settled: Sequence[Fit]
) -> bool:
    """Return whether the best of some fits leaves structure in the residuals."""
    best = max(settled, key=lambda fitted: fitted.log_evidence)
    left = examine(problem, layouts, best, best.log_evidence - base.log_evidence)
    return left.p_value < STRUCTURE


def indistinguishable(candidates: Sequence[Candidate], left: float = 0.0) -> tuple[str, ...]:
    """Return the causes indistinguishable from the best one, with it; none if it is unique.

    Where the best one leaves structure, so may the difference of two causes be due to their forms:
    what a free discrepancy would still explain counts as the uncertainty of the evidence. Causes
    that explain nothing are left out all the same.

    Parameters
    ----------
    candidates : sequence of Candidate
        By evidence, best first.
    left : float
        Log units that a free discrepancy would still explain beside the best one.
    """
    apart = max(DISTINCT, WIDENING * left)
    limit = max(candidates[0].log_evidence - apart, 0.0)
    near = tuple(c.cause.name for c in candidates if c.log_evidence > limit)
    return near if len(near) > 1 else ()


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
