"""A model linearised at a point: the most probable latents of many data sets at once."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.jacobian import Slopes, expand_tests, observe_tests, simulate_slopes
from mcstudy.diagnosis.layout import Layout, Scatter
from mcstudy.diagnosis.normal_equations import NormalEquations, Scores
from mcstudy.diagnosis.problem import Form, Problem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Centre:
    """A model linearised at a point.

    Attributes
    ----------
    scores : latents of the point.
    residuals : (n,) whitened, one a test.
    slopes : Jacobian blocks that take runs.
    own_slopes : (n, q) whitened Jacobian in the test's own nuisances, one a test.
    """

    scores: Scores
    residuals: tuple[Array, ...]
    slopes: Slopes
    own_slopes: tuple[Array, ...]

    def equations(self, weight: float) -> NormalEquations:
        """Return the normal equations at a weight of the data, cached."""
        if weight not in self._made:
            self._made[weight] = NormalEquations(self.own_slopes, self.slopes.shared, weight)
        return self._made[weight]

    def of_tests(self, chosen: Sequence[int]) -> "Centre":
        """Return the linearised model of some of its tests."""
        return Centre(
            self.scores.of_tests(chosen),
            tuple(self.residuals[i] for i in chosen),
            Slopes(
                tuple(self.slopes.doubtful[i] for i in chosen),
                tuple(self.slopes.shared[i] for i in chosen),
            ),
            tuple(self.own_slopes[i] for i in chosen),
        )

    @functools.cached_property
    def _made(self) -> dict[float, NormalEquations]:
        return {}


def linearise(
    problem: Problem,
    layouts: Sequence[Layout],
    forms: Sequence[Form],
    scores: Scores,
    scatter: Scatter,
) -> Centre | None:
    """Return the linearised model; None if a run fails.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
    forms : sequence of Form
    scores : Scores
        Latents to linearise at.
    scatter : Scatter
    """
    seen = observe_tests(problem, forms, layouts, scores)
    if seen is None:
        return None
    slopes = simulate_slopes(problem, forms, layouts, scores, seen, scatter)
    residuals, own = expand_tests(layouts, seen, scores, slopes, scatter)
    return Centre(scores, tuple(residuals), slopes, tuple(own))


def solve(centre: Centre, residuals: Sequence[Array], weight: float) -> tuple[Scores, float]:
    """Return the most probable latents of the linear model and their negative log posterior.

    Parameters
    ----------
    centre : Centre
    residuals : sequence of (n,) array
        Whitened, one a test.
    weight : float
        Weight of the data against the priors.
    """
    planned = centre.equations(weight).solve(residuals, centre.scores)
    own = tuple(z + d for z, d in zip(centre.scores.own, planned.move.own, strict=True))
    squares = weight**2 * sum(float(r @ r) for r in residuals)
    squares += float(centre.scores.shared @ centre.scores.shared)
    squares += sum(float(z @ z) for z in centre.scores.own)
    moved = Scores(centre.scores.shared + planned.move.shared, own)
    return moved, 0.5 * squares - planned.expected_gain
