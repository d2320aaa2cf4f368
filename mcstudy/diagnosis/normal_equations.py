"""Normal equations of a fit: block-arrow, each test's own nuisances eliminated."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FLAT = 1e-3
"""Information in a direction of the shared latents, over the largest one, below which the direction
counts as unknown to the data."""
BISECTIONS = 40
"""Bisections of the damping of a move that is too long."""


@dataclass(frozen=True)
class Scores:
    """Standard-normal latents.

    Attributes
    ----------
    shared : (p,) of the shared values.
    own : (q,) of each test's nuisances.
    """

    shared: Array
    own: tuple[Array, ...]

    def of_tests(self, chosen: Sequence[int]) -> "Scores":
        """Return the latents of some of the tests."""
        return Scores(self.shared, tuple(self.own[i] for i in chosen))


@dataclass(frozen=True)
class Step:
    """A move of all latents, and the gain in log posterior that the linear model predicts."""

    move: Scores
    expected_gain: float


class NormalEquations:
    """The normal equations at a Jacobian; residuals come later, so that many share the work.

    Parameters
    ----------
    own : sequence of (n, q) array
        Whitened Jacobian in a test's own nuisances, one a test.
    shared : sequence of (n, p) array
        Whitened Jacobian in the shared latents, one a test.
    weight : float
        Weight of the data against the priors.

    Attributes
    ----------
    schur : (p, p), inverse covariance of the shared latents.
    log_determinant : of the inverse covariance of all latents.
    """

    def __init__(self, own: Sequence[Array], shared: Sequence[Array], weight: float = 1.0) -> None:
        self._weight = weight
        self._own, self._shared = tuple(own), tuple(shared)
        p = shared[0].shape[1]
        self.schur: Array = np.eye(p)
        self.log_determinant = 0.0
        self._inverses: list[Array] = []
        self._crosses: list[Array] = []
        for a, b in zip(own, shared, strict=True):
            block = np.eye(a.shape[1]) + weight**2 * (a.T @ a)
            cross = weight**2 * (a.T @ b)
            inverse = np.asarray(np.linalg.inv(block))
            self.schur += weight**2 * (b.T @ b) - cross.T @ inverse @ cross
            self.log_determinant += float(np.linalg.slogdet(block)[1])
            self._inverses.append(inverse)
            self._crosses.append(cross)
        if p:
            self.log_determinant += float(np.linalg.slogdet(self.schur)[1])

    def slide(self, scores: Scores) -> Step:
        """Return the move of the shared latents to the most probable ones that fit as well.

        Only directions are taken in which the data know a thousandth of the best known one, as
        where a mass and a force scale change the same acceleration.

        Parameters
        ----------
        scores : Scores
            Latents of the fit.
        """
        still = tuple(np.zeros_like(z) for z in scores.own)
        move = np.zeros_like(scores.shared)
        if move.size > 1:
            values, vectors = np.linalg.eigh(self.schur - np.eye(move.size))
            flat = vectors[:, values < FLAT * values[-1]]
            move = -flat @ (flat.T @ scores.shared)
        return Step(Scores(move, still), 0.5 * float(move @ move))

    def solve(self, residuals: Sequence[Array], scores: Scores) -> Step:
        """Return the move to the most probable latents of the linear model.

        Parameters
        ----------
        residuals : sequence of (n,) array
            Whitened, one a test.
        scores : Scores
            Latents that the residuals belong to.
        """
        right = -scores.shared.copy()
        gain = 0.0
        first = []
        for r, a, b, z, inverse, cross in zip(
            residuals, self._own, self._shared, scores.own, self._inverses, self._crosses,
            strict=True,
        ):  # fmt: skip
            pull = self._weight**2 * (a.T @ r) - z
            solved = inverse @ pull
            right += self._weight**2 * (b.T @ r) - cross.T @ solved
            gain += float(pull @ solved)
            first.append(solved)
        shared = np.asarray(np.linalg.solve(self.schur, right)) if right.size else right
        own = tuple(
            solved - inverse @ (cross @ shared)
            for solved, inverse, cross in zip(first, self._inverses, self._crosses, strict=True)
        )
        return Step(Scores(shared, own), 0.5 * (gain + float(right @ shared)))

    def within(self, move: Scores, longest: float) -> Scores:
        """Return the most probable move whose shared part has no component beyond a length.

        Where the data know a direction badly the linear model makes long moves along it. These are
        cut first (D. Marquardt, J. Soc. Ind. Appl. Math. 11, 1963), not all directions alike.

        Parameters
        ----------
        move : Scores
            Move without a limit, from ``solve``.
        longest : float
            Largest size of a component.
        """
        values, vectors = np.linalg.eigh(self.schur)
        pull = values * (vectors.T @ move.shared)

        def shortened(damping: float) -> Array:
            return np.asarray(vectors @ (pull / (values + damping)))

        def size(damping: float) -> float:
            return float(np.abs(shortened(damping)).max(initial=0.0))

        if size(0.0) <= longest:
            return move
        low, high = 0.0, float(values[-1])
        while size(high) > longest:
            low, high = high, 10.0 * high
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if size(middle) > longest else (low, middle)
        shared = shortened(high)
        own = tuple(
            z + inverse @ (cross @ (move.shared - shared))
            for z, inverse, cross in zip(move.own, self._inverses, self._crosses, strict=True)
        )
        return Scores(shared, own)
