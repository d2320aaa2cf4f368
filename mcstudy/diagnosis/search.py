"""The diagnosis: model adequacy, the best cause, a second cause, or none of the catalogue."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcstudy.diagnosis.base_model import fit_base
from mcstudy.diagnosis.cause_pairs import best_pair
from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.jacobian import shared_names
from mcstudy.diagnosis.layout import Layout
from mcstudy.diagnosis.model_selection import (
    DISTINCT,
    STRUCTURE,
    WIDENING,
    Candidate,
    Remainder,
    examine,
    indistinguishable,
    rank_causes,
)
from mcstudy.diagnosis.problem import Cause, Problem
from mcstudy.diagnosis.screening import (
    LEVEL,
    Screening,
    is_at_bound,
    score_templates,
    screen,
)
from mcstudy.diagnosis.templates import (
    Template,
    cause_templates,
    drifts,
    fine_discrepancy,
    named_forms,
    smooth_discrepancy,
)
from mcstudy.diagnosis.trends import add_trends

DOUBTFUL = 0.1
"""p-value of the remaining structure below which it counts in the naming."""
SINGLES = 30
"""Forms that are refitted as a single cause."""
HOPELESS = 0.3
"""Share of the misfit that the first cause must explain for a second one to be sought."""
FURTHER, STILL = 3.5, 6.0
"""Template score, in standard errors, and misfit that a discrepancy would still explain, in log
units, that indicate a second cause after a first one whose residuals pass the general test."""

UNEXPLAINED = "unexplained"

Tell = Callable[[str], None]


def _silent(_text: str) -> None:
    """Ignore a progress message."""


@dataclass(frozen=True)
class Finding:
    """Result of a diagnosis.

    Attributes
    ----------
    layouts : of the tests.
    base : fit of the base model.
    bank : templates of the causes.
    screening : adequacy test of the base model.
    candidates : causes by evidence, best first; empty if the base is adequate.
    remainder : remaining structure of the best candidate.
    cause : name, ``unexplained``, or None if adequate.
    ambiguous : causes indistinguishable from the best one.
    second : the second cause, or None.
    second_ambiguous : causes indistinguishable from the second one.
    best : the fit to extend the model with, or None.
    flagged : whether structure remains beside the named causes.
    why : reason for the result, in words.
    """

    layouts: tuple[Layout, ...]
    base: Fit
    bank: tuple[Template, ...]
    screening: Screening
    candidates: tuple[Candidate, ...]
    remainder: Remainder | None
    cause: str | None
    ambiguous: tuple[str, ...]
    second: Candidate | None
    second_ambiguous: tuple[str, ...]
    best: Fit | None
    flagged: bool
    why: str

    @property
    def adequate(self) -> bool:
        """Whether the base model is adequate."""
        return self.cause is None


def names_of(
    cause: str | None,
    ambiguous: tuple[str, ...],
    second: str | None,
    second_ambiguous: tuple[str, ...],
) -> tuple[str, ...]:
    """Return all the names that an answer gives, ambiguous ones included.

    Parameters
    ----------
    cause, second : str or None
        As in ``Finding``, by name.
    ambiguous, second_ambiguous : tuple of str
        As in ``Finding``.
    """
    if cause is None or cause == UNEXPLAINED:
        return ()
    return (*(ambiguous or (cause,)), *(second_ambiguous or ((second,) if second else ())))


def search(
    problem: Problem,
    causes: Sequence[Cause],
    *,
    seed: int = 0,
    workers: int = 1,
    tell: Tell = _silent,
) -> Finding:
    """Return the diagnosis of a model against its tests.

    Parameters
    ----------
    problem : Problem
    causes : sequence of Cause
        Of the catalogue.
    seed : int
        Of the simulated data sets.
    workers : int
        Processes, -1 for one a core.
    tell : callable
        Receives progress messages.

    Raises
    ------
    UserError
        If the model cannot simulate one of the tests.
    """
    rng = np.random.default_rng(seed)
    causes = add_trends(causes, problem.tests)
    tell("fitting the base model")
    layouts, base = fit_base(problem)
    tell("testing its adequacy")
    bank = tuple(cause_templates(problem, layouts, base, named_forms(causes), workers))
    screening = screen(
        base,
        layouts,
        bank,
        drifts(layouts, base, shared_names(problem, ())),
        smooth_discrepancy(layouts, base),
        fine_discrepancy(layouts, base),
        rng,
    )
    empty = Finding(
        layouts, base, bank, screening, (), None, None, (), None, (), None, False,
        "the model explains the data within its uncertainty",
    )  # fmt: skip
    if not screening.alarm and not is_at_bound(base.scatter):
        return empty
    tell("the model is inadequate: fitting the causes")
    candidates = rank_causes(problem, layouts, base, causes, workers, SINGLES, bank)
    return _judge(problem, causes, empty, tuple(candidates), workers, tell)


def _judge(
    problem: Problem,
    causes: Sequence[Cause],
    empty: Finding,
    candidates: tuple[Candidate, ...],
    workers: int,
    tell: Tell,
) -> Finding:
    """Return the result for ranked candidates."""
    nothing = replace(empty, candidates=candidates, cause=UNEXPLAINED)
    if not candidates or candidates[0].log_evidence < DISTINCT:
        if empty.screening.contradictory:
            return replace(
                empty, candidates=candidates,
                why="the model explains the data within its uncertainty, although residuals have "
                "the same sign in more tests than by chance: no cause gains from it",
            )  # fmt: skip
        reason = _conflict(problem, empty) or "no cause of the catalogue explains the misfit"
        return replace(nothing, why=reason)
    best = candidates[0]
    left = examine(problem, empty.layouts, best.fitted, best.log_evidence)
    doubt = left.left if left.p_value < DOUBTFUL else 0.0
    drift, evidence = empty.screening.drift
    if evidence > best.log_evidence + DISTINCT and left.p_value < STRUCTURE:
        return replace(nothing, remainder=left, why=f"a slow change explains more: {drift}")
    alone = replace(
        nothing,
        remainder=left,
        cause=best.cause.name,
        ambiguous=indistinguishable(candidates, doubt),
        best=best.fitted,
        why="one cause explains the misfit",
    )
    clean = left.p_value >= STRUCTURE
    flagged = replace(
        alone, flagged=True, why="one cause explains most of the misfit; structure remains"
    )
    little = not clean and best.log_evidence < WIDENING * doubt
    bank = None
    if clean and left.left < STILL:
        bank = cause_templates(problem, empty.layouts, best.fitted, named_forms(causes), workers)
        if not _trace(best.fitted, empty.layouts, bank):
            return alone
    found, share = None, left.share
    if left.share >= HOPELESS:
        tell(f"looking for a second cause beside {best.cause.name}")
        found, beyond = best_pair(problem, causes, empty.layouts, candidates, left, workers, bank)
        # The repeatability takes part of what is left; a second cause may show that it did.
        share = min(share, best.log_evidence / (best.log_evidence + max(beyond, 0.0)))
    if found is not None:
        pair, rest, firsts = found
        explained = rest.p_value >= STRUCTURE
        return replace(
            alone,
            cause=pair.first.cause.name,
            ambiguous=firsts,
            remainder=rest,
            second=pair.seconds[0],
            second_ambiguous=indistinguishable(pair.seconds),
            best=pair.seconds[0].fitted,
            flagged=not explained,
            why="two causes explain the misfit together"
            if explained
            else "two causes explain most of the misfit; structure remains",
        )
    if little:
        return replace(
            nothing, remainder=left, why="more of the misfit remains than the best cause explains"
        )
    if clean:
        return alone
    if best.names(share):
        return flagged
    return replace(nothing, remainder=left, why="structure remains beside the best cause")


def _conflict(problem: Problem, found: Finding) -> str:
    """Return a sentence on the unknown that fits only far out in its prior; empty if there is none.

    Values that change the same data, as a mass and a force scale do, cannot be told apart then.
    """
    if found.screening.statistics[-1].p_value > LEVEL:
        return ""
    scores = found.base.scores.shared[: len(problem.unknowns)]
    k = int(np.argmax(np.abs(scores)))
    return (
        f"{problem.unknowns[k].name} fits only {abs(scores[k]):.1f} standard deviations out in its "
        "prior: it, or a recorded value that acts like it, is wrong"
    )


def _trace(fitted: Fit, layouts: Sequence[Layout], bank: Sequence[Template]) -> bool:
    """Return whether a template detects a further cause that the general test misses."""
    score, information = score_templates(fitted, layouts, bank)
    seen = information > 0.0
    return bool(np.any(np.abs(score[seen]) > FURTHER * np.sqrt(information[seen])))
