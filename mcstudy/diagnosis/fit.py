"""Maximum a posteriori fit of a model with all its uncertain quantities, and its evidence.

Gauss-Newton finds the most probable values of the shared unknowns, of a cause's parameters and of
every test's own nuisances; the Jacobian is block-arrow, so tests are eliminated one by one. The
evidence is Laplace's approximation.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.jacobian import (
    Slopes,
    expand_tests,
    observe_tests,
    simulate_slopes,
)
from mcstudy.diagnosis.layout import Layout, Scatter
from mcstudy.diagnosis.normal_equations import NormalEquations, Scores
from mcstudy.diagnosis.problem import Form, Observation, Problem
from mcstudy.studyfile.input_space import MAX_SCORE

Array = NDArray[np.float64]

MAX_STEPS, MAX_EXACT = 12, 30
"""Steps of a fit, and of an exact one: along confounded values it comes near slowly."""
CONVERGED = 0.05
"""Expected gain in log posterior below which a fit has converged."""
NEAR, MIN_SLIDE = 2.0, 0.3
"""Expected gain below which confounded values are moved along each other, and the least gain in log
prior that is worth it."""
LINEAR = 0.7
"""Achieved share of the expected gain above which the Jacobian is reused."""
LONGEST = 1.5
"""Largest move of a shared latent in one step."""
TRIES, BOUNDED, SHORTER = 6, 4, 0.35
"""Moves that are tried in a step, those of them that are bounded in length, and the ratio of the
lengths of one and the next."""


@dataclass(frozen=True)
class Fit:
    """A maximum a posteriori fit.

    Attributes
    ----------
    forms : causes switched on.
    scatter : size of the repeatability.
    scores : most probable standard-normal latents.
    observations : simulated tests at those latents.
    slopes : Jacobian blocks that take runs.
    residuals : (n,) whitened, one a test.
    own_slopes : (n, q) whitened Jacobian in the test's own nuisances, one a test.
    covariance : (p, p) posterior covariance of the shared latents.
    log_evidence : up to a constant that all fits of the same data share.
    misfit : negative log posterior, half the sum of squares of residuals and latents.
    """

    forms: tuple[Form, ...]
    scatter: Scatter
    scores: Scores
    observations: tuple[Observation, ...]
    slopes: Slopes
    residuals: tuple[Array, ...]
    own_slopes: tuple[Array, ...]
    covariance: Array
    log_evidence: float
    misfit: float

    @property
    def shared_slopes(self) -> tuple[Array, ...]:
        """Whitened Jacobian (n, p) in the shared latents, one a test."""
        return self.slopes.shared


class FitError(Exception):
    """A model run failed at the start of the fit."""


def start_scores(layouts: Sequence[Layout], shared: int) -> Scores:
    """Return latents of zero, the prior medians."""
    return Scores(np.zeros(shared), tuple(np.zeros(len(layout.names)) for layout in layouts))


def fit(
    problem: Problem,
    layouts: Sequence[Layout],
    forms: Sequence[Form],
    start: Scores,
    scatter: Scatter,
    known: Slopes | None = None,
    *,
    exact: bool = True,
    weight: float = 1.0,
    most: int | None = None,
) -> Fit:
    """Return the maximum a posteriori fit near a start.

    The Jacobian is recomputed only where the linear model predicts too little of the gain.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
    forms : sequence of Form
    start : Scores
    scatter : Scatter
    known : Slopes, optional
        Jacobian of a nearby fit, to begin with; columns of the last form may be missing.
    exact : bool
        Whether the final Jacobian must be that of the most probable latents.
    weight : float
        Weight of the data against the priors; below 1 it tempers the likelihood, so that a fit from
        far away does not end in a wrong local optimum.
    most : int, optional
        Largest number of steps, by default ``MAX_STEPS``, or ``MAX_EXACT`` of an exact fit.

    Raises
    ------
    FitError
        If a run fails at the start.
    """
    forms = tuple(forms)
    if most is None:
        most = MAX_EXACT if exact else MAX_STEPS
    scores = start
    seen = observe_tests(problem, forms, layouts, scores)
    if seen is None:
        raise FitError("a run fails at the start of the fit")
    misfit = misfit_of(layouts, seen, scores, scatter, weight)
    slopes, fresh, simulated, stuck = known, False, known is None, False
    latest: Slopes | None = None
    if known is not None and known.shared[0].shape[1] < scores.shared.size:
        slopes = simulate_slopes(problem, forms, layouts, scores, seen, scatter, known)
    for step in range(most + 1):
        if slopes is None:
            slopes = simulate_slopes(
                problem, forms, layouts, scores, seen, scatter,
                sizes=_sizes(latest), central=exact,
            )  # fmt: skip
            fresh = simulated = True
        latest = slopes
        residuals, own = expand_tests(layouts, seen, scores, slopes, scatter)
        system = NormalEquations(own, slopes.shared, weight)
        planned = system.solve(residuals, scores)
        last = step == most
        better = None
        if planned.expected_gain < NEAR and not (last or stuck):
            # Finite differences hide the directions that change no data.
            slide = system.slide(scores)
            stuck = slide.expected_gain < MIN_SLIDE
            if not stuck:
                better = _descend(
                    problem, forms, layouts, scores, _shares(slide.move), scatter, misfit, weight
                )
                stuck = better is None or misfit - better[2] < CONVERGED
            if better is not None:
                scores, seen, misfit = better
                fresh = False
                continue
        promising = planned.expected_gain >= CONVERGED
        if promising and not last:
            better = _descend(
                problem, forms, layouts, scores, _shorter(system, planned.move), scatter, misfit,
                weight,
            )  # fmt: skip
        if better is None:
            wanted = exact or planned.expected_gain >= NEAR or (promising and not simulated)
            if fresh or last or not wanted:
                break
            slopes = None
            continue
        moved, seen, lower = better
        if misfit - lower < LINEAR * planned.expected_gain:
            slopes = None
        scores, misfit, fresh = moved, lower, False
    assert slopes is not None
    return Fit(
        forms=forms,
        scatter=scatter,
        scores=scores,
        observations=tuple(seen),
        slopes=slopes,
        residuals=tuple(residuals),
        own_slopes=tuple(own),
        covariance=np.asarray(np.linalg.inv(system.schur)),
        log_evidence=-misfit - 0.5 * system.log_determinant,
        misfit=misfit,
    )


def log_widening(layouts: Sequence[Layout], seen: Sequence[Observation]) -> float:
    """Return the sum of the logarithms of the factors on the deviations of scalars.

    Parameters
    ----------
    layouts : sequence of Layout
    seen : sequence of Observation
        Simulated tests.
    """
    return sum(
        float(np.log(layout.widths(observation)).sum())
        for layout, observation in zip(layouts, seen, strict=True)
        if observation.widening
    )


def misfit_of(
    layouts: Sequence[Layout],
    seen: Sequence[Observation],
    scores: Scores,
    scatter: Scatter,
    weight: float,
) -> float:
    """Return the negative log posterior at latents.

    Parameters
    ----------
    layouts : sequence of Layout
    seen : sequence of Observation
        Tests simulated there.
    scores : Scores
        Latents.
    scatter : Scatter
    weight : float
        Weight of the data against the priors.
    """
    residuals = (
        layout.residual(observation, own, scatter)
        for layout, observation, own in zip(layouts, seen, scores.own, strict=True)
    )
    return half_squares(residuals, scores, weight) + weight**2 * log_widening(layouts, seen)


def half_squares(residuals: Iterable[Array], scores: Scores, weight: float) -> float:
    """Return half the sum of squares of residuals and latents.

    Parameters
    ----------
    residuals : iterable of (n,) array
        Whitened, one a test.
    scores : Scores
        Latents.
    weight : float
        Weight of the data against the priors.
    """
    total = float(scores.shared @ scores.shared)
    for residual, own in zip(residuals, scores.own, strict=True):
        total += weight**2 * float(residual @ residual) + float(own @ own)
    return 0.5 * total


def _sizes(slopes: Slopes | None) -> Array | None:
    """Return the norms (p,) of the shared columns of a Jacobian."""
    if slopes is None:
        return None
    squares = np.sum([np.sum(table**2, axis=0) for table in slopes.shared], axis=0)
    return np.asarray(np.sqrt(squares))


def _shares(move: Scores) -> Iterator[Scores]:
    """Yield shorter and shorter shares of a move."""
    longest = float(np.abs(move.shared).max(initial=0.0))
    share = min(1.0, LONGEST / longest) if longest > 0.0 else 1.0
    for _ in range(TRIES):
        yield _scaled(move, share)
        share *= SHORTER


def _shorter(system: NormalEquations, move: Scores) -> Iterator[Scores]:
    """Yield moves within shorter and shorter lengths, the last ones shares of the shortest."""
    longest = min(LONGEST, float(np.abs(move.shared).max(initial=0.0)))
    held = move
    for k in range(TRIES):
        if k < BOUNDED:
            held = system.within(move, longest * SHORTER**k)
            yield held
        else:
            yield _scaled(held, SHORTER ** (k + 1 - BOUNDED))


def _scaled(move: Scores, share: float) -> Scores:
    return Scores(share * move.shared, tuple(share * z for z in move.own))


def _descend(
    problem: Problem,
    forms: Sequence[Form],
    layouts: Sequence[Layout],
    scores: Scores,
    moves: Iterator[Scores],
    scatter: Scatter,
    misfit: float,
    weight: float,
) -> tuple[Scores, list[Observation], float] | None:
    """Return more probable latents after the first of the moves that improves, or None.

    With the simulated tests there and the negative log posterior.
    """
    for move in moves:
        trial = Scores(
            np.clip(scores.shared + move.shared, -MAX_SCORE, MAX_SCORE),
            tuple(z + d for z, d in zip(scores.own, move.own, strict=True)),
        )
        seen = observe_tests(problem, forms, layouts, trial)
        if seen is not None:
            value = misfit_of(layouts, seen, trial, scatter, weight)
            if value < misfit:
                return trial, seen, value
    return None
