"""Two causes together: which second cause explains what a first one leaves, if any does."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcstudy.diagnosis.layout import Layout
from mcstudy.diagnosis.model_selection import (
    DISTINCT,
    STRUCTURE,
    Candidate,
    Remainder,
    examine,
    indistinguishable,
    rank_causes,
)
from mcstudy.diagnosis.problem import Cause, Problem
from mcstudy.diagnosis.screening import score_templates
from mcstudy.diagnosis.templates import Template, cause_templates, named_forms

SECOND = 6.0
"""Log evidence that a second cause must add."""
SECONDS = 12
"""Forms that are refitted as a second cause."""
FAINT_SHARE = 0.003
"""Share of the first cause's log evidence that a second one must add: even the best form of a large
effect leaves a small residual."""
ENOUGH = 0.8
"""Share of what a free discrepancy would explain beside the first cause that a second one must add
where the residuals of the first do not pass the general test."""
NOTABLE = 0.1
"""The same where the residuals of both causes have structure."""
NEARLY_ALL = 0.99
"""Share of the misfit that two causes must explain where structure remains."""
MAX_SECONDS = 2
"""Largest number of indistinguishable second causes; with more of them none is named."""
RIVAL = 0.5
"""Share of the best log evidence above which another cause is tried as the first of two."""
PAIRS = 2
"""Causes, best first, with which a second one is tried."""


def _needed(sole: float, alone: Remainder) -> float:
    """Return the log evidence that a second cause must add beside a first one of evidence sole."""
    rest = 0.0 if alone.p_value >= STRUCTURE else ENOUGH * alone.left
    return max(SECOND, FAINT_SHARE * sole, rest)


@dataclass(frozen=True)
class CausePair:
    """Two causes together: the first, and the second ones by evidence."""

    first: Candidate
    seconds: list[Candidate]

    @property
    def log_evidence(self) -> float:
        """Log evidence of both together, averaged over the forms of each."""
        return self.first.log_evidence + self.seconds[0].log_evidence

    @property
    def second(self) -> str:
        """Name of the second cause."""
        return self.seconds[0].cause.name


def _pairs_of_other_forms(
    problem: Problem,
    causes: Sequence[Cause],
    layouts: Sequence[Layout],
    first: Candidate,
    reached: float,
    workers: int,
) -> list[CausePair]:
    """Return pairs of other forms of the first cause, where they promise more than was reached.

    Alone, a form may be best that imitates a part of the second cause, as a gradual saturation does
    a gain below one.

    Parameters
    ----------
    first : Candidate
        The first cause.
    reached : float
        Log evidence of the best pair of its best form.
    """
    pairs = []
    for other in first.others:
        evidence = first.forms[other.forms[-1].name]
        bank = cause_templates(problem, layouts, other, named_forms(causes), workers)
        score, information = score_templates(other, layouts, bank)
        seen = information > 0.0
        promise = float(np.max(0.5 * score[seen] ** 2 / information[seen], initial=0.0))
        if evidence + promise <= reached:
            continue
        alike = replace(first, fitted=other, form=other.forms[-1], log_evidence=evidence)
        seconds = rank_causes(
            problem, layouts, other, causes, workers, SECONDS, bank, reached - evidence
        )
        if seconds:
            pairs.append(CausePair(alike, seconds))
    return pairs


def best_pair(
    problem: Problem,
    causes: Sequence[Cause],
    layouts: Sequence[Layout],
    candidates: Sequence[Candidate],
    alone: Remainder,
    workers: int,
    bank: Sequence[Template] | None,
) -> tuple[tuple[CausePair, Remainder, tuple[str, ...]] | None, float]:
    """Return the pair of causes that explains the misfit, None if no second cause is warranted.

    With its remaining structure, and first causes that do equally well with the same second one;
    and the log evidence of the best pair beyond that of the first cause, warranted or not.

    Parameters
    ----------
    alone : Remainder
        Remaining structure of the first cause alone.
    bank : sequence of Template or None
        Templates about it, where they are known.
    """
    pairs: list[CausePair] = []
    for first in candidates[:PAIRS]:
        if first.log_evidence < RIVAL * candidates[0].log_evidence:
            continue
        seconds = rank_causes(
            problem, layouts, first.fitted, causes, workers, SECONDS,
            bank if first is candidates[0] else None,
            min(_needed(first.log_evidence, alone), NOTABLE * first.log_evidence),
        )  # fmt: skip
        if seconds:
            pairs.append(CausePair(first, seconds))
    if alone.p_value < STRUCTURE and not problem.dear:
        reached = max((p.log_evidence for p in pairs), default=candidates[0].log_evidence)
        pairs += _pairs_of_other_forms(problem, causes, layouts, candidates[0], reached, workers)
    if not pairs:
        return None, 0.0
    best = max(pairs, key=lambda pair: pair.log_evidence)
    sole = candidates[0].log_evidence
    beyond = best.log_evidence - sole
    near = [p for p in pairs if p.log_evidence > best.log_evidence - DISTINCT]
    if any(len(indistinguishable(pair.seconds)) > MAX_SECONDS for pair in near):
        return None, beyond
    left = examine(problem, layouts, best.seconds[0].fitted, best.log_evidence)
    enough = beyond >= _needed(sole, alone)
    if left.p_value < STRUCTURE:
        # The form of a large effect is never quite right: what it leaves may be a rest.
        most = left.left <= (1.0 - ENOUGH) * alone.left
        enough = (enough and most) or (left.share >= NEARLY_ALL and beyond >= NOTABLE * sole)
    if not enough:
        return None, beyond
    # Two forms of one cause are one name.
    firsts = tuple(dict.fromkeys(p.first.cause.name for p in near if p.second == best.second))
    return (best, left, firsts if len(firsts) > 1 else ()), beyond
