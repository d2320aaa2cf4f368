"""Gaussian-process model discrepancy: the baseline without a named cause.

The discrepancy of a test is a sum of smooth shapes; the coefficient of each is a Gaussian process
over the recorded inputs. Size and length maximise the marginal likelihood.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.jacobian import Slopes
from mcstudy.diagnosis.layout import Layout, Scatter
from mcstudy.diagnosis.marginal import Marginal
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.diagnosis.templates import Shapes, smooth_discrepancy

Array = NDArray[np.float64]

SIZES = (0.03, 0.1, 0.3, 1.0, 3.0)
"""Standard deviations of a coefficient that are tried (1 is a twentieth of the pulse)."""
LENGTHS = (0.5, 1.0, 2.0, 5.0)
"""Lengths, in standard deviations of the inputs, that are tried."""
JITTER = 1e-8


@dataclass(frozen=True)
class Discrepancy:
    """A fitted Gaussian process.

    Attributes
    ----------
    names : recorded inputs that vary between tests.
    centre, scale : mean and standard deviation of these inputs.
    points : (tests, inputs) scaled inputs.
    size, length : standard deviation and length scale of the kernel.
    mean : (tests * shapes,) posterior mean of the coefficients.
    covariance : (tests * shapes, tests * shapes), posterior of the coefficients.
    shapes : number of shapes a test.
    """

    names: tuple[str, ...]
    centre: Array
    scale: Array
    points: Array
    size: float
    length: float
    mean: Array
    covariance: Array
    shapes: int

    def shapes_of(self, layouts: Sequence[Layout], fitted: Fit) -> tuple[Array, ...]:
        """Return the shapes (n, k) of every test of a fit, whitened."""
        return _plain(smooth_discrepancy(layouts, fitted)).columns

    def predict(self, layouts: Sequence[Layout]) -> tuple[list[Array], list[Array]]:
        """Return mean (k,) and covariance root (k, k) of the coefficients, one a test."""
        kernel = _kernel(self.points, self.points, self.size, self.length)
        kernel += JITTER * self.size**2 * np.eye(len(kernel))
        inverse = np.linalg.inv(kernel)
        means, roots = [], []
        coefficients = self.mean.reshape(len(self.points), self.shapes)
        for layout in layouts:
            point = (_inputs(layout, self.names) - self.centre) / self.scale
            cross = _kernel(point[None], self.points, self.size, self.length)[0]
            weight = cross @ inverse
            means.append(weight @ coefficients)
            left = max(self.size**2 - float(weight @ cross), 0.0)
            blocks = self.covariance.reshape(
                len(self.points), self.shapes, len(self.points), self.shapes
            )
            spread = np.einsum("i,iajb,j->ab", weight, blocks, weight)
            values, vectors = np.linalg.eigh(spread + left * np.eye(self.shapes))
            roots.append(vectors * np.sqrt(np.maximum(values, 0.0)))
        return means, roots


def fit_discrepancy(
    fitted: Fit, layouts: Sequence[Layout], shapes: Shapes, scatter: Scatter
) -> Discrepancy:
    """Return the Gaussian process of greatest marginal likelihood.

    Parameters
    ----------
    fitted : Fit
        Fit of the base model; its shared values are kept.
    layouts : sequence of Layout
        Of its tests.
    shapes : Shapes
        Smooth shapes, of which those that are the same in all tests are used.
    scatter : Scatter
        Repeatability beside the process.
    """
    fitted = _with_shared_kept(fitted)
    plain = _plain(shapes)
    count = len(plain.names)
    names = tuple(layouts[0].test.inputs)
    table = np.array([_inputs(layout, names) for layout in layouts])
    moving = table.std(axis=0) > 1e-9 * np.abs(table.mean(axis=0))
    names = tuple(np.array(names)[moving].tolist())
    centre, scale = table[:, moving].mean(axis=0), table[:, moving].std(axis=0)
    points = (table[:, moving] - centre) / scale
    information, score = _per_test(fitted, layouts, plain, count, scatter)
    best: tuple[float, float, float, Array, Array] | None = None
    for size, length in itertools.product(SIZES, LENGTHS):
        kernel = _kernel(points, points, size, length)
        kernel += JITTER * size**2 * np.eye(len(points))
        prior = np.kron(np.linalg.inv(kernel), np.eye(count))
        precision = prior + information
        covariance = np.asarray(np.linalg.inv(precision))
        mean = covariance @ score
        likelihood = 0.5 * float(score @ mean)
        likelihood += 0.5 * float(np.linalg.slogdet(prior)[1] - np.linalg.slogdet(precision)[1])
        if best is None or likelihood > best[0]:
            best = (likelihood, size, length, mean, covariance)
    assert best is not None
    return Discrepancy(names, centre, scale, points, best[1], best[2], best[3], best[4], count)


def _with_shared_kept(fitted: Fit) -> Fit:
    """Return a fit whose linear model has known shared values."""
    empty = tuple(table[:, :0] for table in fitted.slopes.shared)
    return replace(
        fitted,
        scores=Scores(np.zeros(0), fitted.scores.own),
        slopes=Slopes(fitted.slopes.doubtful, empty),
    )


def _plain(shapes: Shapes) -> Shapes:
    """Return the shapes that are not multiplied by a regime or covariate."""
    kept = [k for k, name in enumerate(shapes.names) if name.endswith("all tests")]
    return Shapes(
        tuple(shapes.names[k] for k in kept), tuple(table[:, kept] for table in shapes.columns)
    )


def _per_test(
    fitted: Fit, layouts: Sequence[Layout], plain: Shapes, count: int, scatter: Scatter
) -> tuple[Array, Array]:
    """Return information and score of a coefficient for each shape and test."""
    tests = len(layouts)
    columns = []
    for i, table in enumerate(plain.columns):
        wide = np.zeros((table.shape[0], tests * count))
        wide[:, i * count : (i + 1) * count] = table
        columns.append(wide)
    marginal = Marginal(fitted, layouts, columns)
    reduced = marginal.reduce(marginal.measured(), scatter)
    return reduced.information, reduced.score[0]


def _inputs(layout: Layout, names: Sequence[str]) -> Array:
    return np.array([layout.test.inputs[name] for name in names])


def _kernel(first: Array, second: Array, size: float, length: float) -> Array:
    square = np.sum((first[:, None] - second[None]) ** 2, axis=2)
    return np.asarray(size**2 * np.exp(-0.5 * square / length**2))
