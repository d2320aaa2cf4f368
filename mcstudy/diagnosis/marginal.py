"""The linear model about a fit with nuisances integrated out: score and information of any shape.

Tests are independent given the shared values, so everything follows from one Gram matrix a test
of its Jacobian and of the shapes asked about. Many simulated data sets cost one matrix product.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.layout import Layout, Scatter

Array = NDArray[np.float64]


FREEDOM = 5.0
"""Degrees of freedom of a test's repeatability in simulated data (assumed: outlying tests occur
more often than under normal scatter)."""
LEARNT = 0.2
"""Share of a prior variance that the data must take away for its latent to be judged."""


@dataclass(frozen=True)
class Reduced:
    """Shapes with all nuisances integrated out.

    Attributes
    ----------
    information : (m, m) Fisher information of the shapes.
    score : (d, m) score vectors of d data sets.
    log_likelihood : (d,) of the data without the shapes, up to a constant.
    shared : (d, p) most probable latents of the shared values without the shapes, each in standard
        deviations of what the priors expect of it; zero where the data say little.
    """

    information: Array
    score: Array
    log_likelihood: Array
    shared: Array


class Marginal:
    """The linear model about a fit, with shapes.

    Parameters
    ----------
    fitted : Fit
    layouts : sequence of Layout
        Of its tests.
    shapes : sequence of (n, m) array
        Whitened, one a test.
    """

    def __init__(self, fitted: Fit, layouts: Sequence[Layout], shapes: Sequence[Array]) -> None:
        self._scatter = fitted.scatter
        self._layouts = tuple(layouts)
        self._scattering = [layout.scattering for layout in layouts]
        self._shared = fitted.scores.shared.size
        self._gram, self._product = [], []
        for residual, own, shared, shape, z in zip(
            fitted.residuals, fitted.own_slopes, fitted.shared_slopes, shapes, fitted.scores.own,
            strict=True,
        ):  # fmt: skip
            table = np.concatenate([own, shared, shape], axis=1)
            # Residual at latents of zero, in the linear model.
            whole = residual + own @ z + shared @ fitted.scores.shared
            self._gram.append(table.T @ table)
            self._product.append((table.T @ whole)[None])

    @property
    def squares(self) -> Array:
        """Sums of squares (m,) of the shapes before nuisances are integrated out."""
        first = self._scattering[0].size + self._shared
        return np.asarray(sum(np.diag(gram)[first:] for gram in self._gram))

    def measured(self) -> list[Array]:
        """Return the products (1, k) of the measured data with the columns, a test."""
        return self._product

    def draw(self, count: int, scatter: Scatter, rng: np.random.Generator) -> list[Array]:
        """Return products (count, k) of data sets drawn from the model without shapes.

        Parameters
        ----------
        count : int
            Number of data sets.
        scatter : Scatter
            Size of the repeatability to draw with.
        rng : Generator
        """
        common = rng.standard_normal((count, self._shared))
        products = []
        for gram, scale, layout in zip(
            self._gram, self._scales(scatter), self._layouts, strict=True
        ):
            values, vectors = np.linalg.eigh(gram)
            root = vectors * np.sqrt(np.maximum(values, 0.0))
            noise = rng.standard_normal((count, values.size)) @ root.T
            q = scale.size
            own = rng.standard_normal((count, q))
            heavy = np.sqrt((FREEDOM - 2.0) / rng.chisquare(FREEDOM, (count, 1)))
            own = np.where(layout.scattering, own * heavy, own) * scale
            noise += own @ gram[:q] + common @ gram[q : q + self._shared]
            products.append(noise)
        return products

    def reduce(self, products: Sequence[Array], scatter: Scatter) -> Reduced:
        """Return the shapes with nuisances integrated out, at a given repeatability."""
        p = self._shared
        rest = self._gram[0].shape[0] - self._scattering[0].size
        information = np.zeros((rest, rest))
        score = np.zeros((products[0].shape[0], rest))
        quadratic = np.zeros(score.shape[0])
        log_determinant = 0.0
        for gram, product, scale in zip(self._gram, products, self._scales(scatter), strict=True):
            q = scale.size
            block = np.eye(q) + scale[:, None] * gram[:q, :q] * scale
            cross = scale[:, None] * gram[:q, q:]
            own = product[:, :q] * scale
            inverse = np.linalg.inv(block)
            information += gram[q:, q:] - cross.T @ inverse @ cross
            weighed = own @ inverse
            score += product[:, q:] - weighed @ cross
            quadratic += np.einsum("dk,dk->d", weighed, own)
            log_determinant += float(np.linalg.slogdet(block)[1])
        block = np.eye(p) + information[:p, :p]
        inverse = np.linalg.inv(block)
        cross, own = information[:p, p:], score[:, :p]
        quadratic += np.einsum("dk,kl,dl->d", own, inverse, own)
        log_determinant += float(np.linalg.slogdet(block)[1]) if p else 0.0
        # The most probable latent has the prior's variance less that of the posterior.
        known = 1.0 - np.diag(inverse)
        expected = np.where(known > LEARNT, np.sqrt(np.maximum(known, LEARNT)), np.inf)
        return Reduced(
            information=information[p:, p:] - cross.T @ inverse @ cross,
            score=score[:, p:] - own @ inverse @ cross,
            log_likelihood=0.5 * (quadratic - log_determinant),
            shared=(own @ inverse) / expected,
        )

    def _scales(self, scatter: Scatter) -> list[Array]:
        """Return the factors on each nuisance's Jacobian column for another repeatability."""
        scales = []
        for layout in self._layouts:
            scale = np.ones(layout.scattering.size)
            ratio = layout.scatter_sizes(scatter) / layout.scatter_sizes(self._scatter)
            scale[layout.scattering] = ratio
            scales.append(scale)
        return scales


def log_bayes_factor(information: Array, score: Array, size: float = 1.0) -> Array:
    """Return the log Bayes factor (d,) of shapes with coefficients N(0, size^2).

    Parameters
    ----------
    information : (m, m) array
        Fisher information of the shapes.
    score : (d, m) array
        Score vectors of d data sets.
    size : float
        Prior standard deviation of a coefficient.
    """
    values, vectors = np.linalg.eigh(information)
    values = np.maximum(values, 0.0)
    turned = score @ vectors
    gain = 0.5 * (turned**2 / (values + size**-2)).sum(axis=1)
    return np.asarray(gain - 0.5 * np.log1p(size**2 * values).sum())


def quadratic_form(information: Array, score: Array) -> tuple[Array, int]:
    """Return the sum of squares (d,) that shapes explain, and their rank."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / scale[:, None] / scale)
    kept = values > 1e-6 * values.max(initial=0.0)
    turned = (score / scale) @ vectors[:, kept]
    return np.asarray((turned**2 / values[kept]).sum(axis=1)), int(kept.sum())
