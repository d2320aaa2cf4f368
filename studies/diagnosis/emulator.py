"""The mean outcome of accidents as quadratic surfaces: fast enough for a diagnosis."""

import functools
import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import chi2

from mcstudy.diagnosis.problem import Form, Observation
from mcstudy.studyfile.input_space import value_at

Array = NDArray[np.float64]

RIDGE = 1e-3
"""Ridge penalty on a coefficient, as a share of the runs."""
CUBIC, MOST_TERMS = 3, 40
"""Degree of the change by a cause, and the largest number of its terms."""
GRID = np.linspace(-4.0, 4.0, 161)
"""Standard-normal latents at which a prior's quantile is inverted."""
SHRINKAGE = 0.5
"""Prior standard deviation of a coefficient of a logarithm of a factor on scatter (assumed)."""
SIGNIFICANT = 0.001
"""p-value of a likelihood ratio from which on a scatter counts as grown."""
WIDEST = 4.0
"""Largest factor on the scatter, and the inverse of the least."""
MOST_LOG = 10.0
"""Bound of a logarithm of a scatter during its fit."""


@dataclass(frozen=True)
class Scaling:
    """Variables of a surface: logarithms of those that are always positive, scaled.

    Throw distance goes with a power of the speed: its logarithm is nearly straight over that of the
    speed, and scatters alike at all speeds.

    Attributes
    ----------
    names : of the d variables.
    logarithmic : (d,) whether the logarithm is taken.
    centre, scale : (d,) mean and standard deviation.
    """

    names: tuple[str, ...]
    logarithmic: NDArray[np.bool_]
    centre: Array
    scale: Array

    @classmethod
    def of(cls, columns: Mapping[str, Array], names: tuple[str, ...]) -> "Scaling":
        """Return the scaling of variables by their values (n,)."""
        table = np.stack([columns[name] for name in names], axis=1)
        logarithmic = table.min(axis=0) > 0.0
        table[:, logarithmic] = np.log(table[:, logarithmic])
        return cls(names, logarithmic, table.mean(axis=0), table.std(axis=0))

    def points(self, columns: Mapping[str, Array]) -> Array:
        """Return the scaled variables (n, d)."""
        table = np.stack([np.asarray(columns[name], dtype=float) for name in self.names], axis=1)
        least = np.finfo(float).tiny
        table[:, self.logarithmic] = np.log(np.maximum(table[:, self.logarithmic], least))
        return np.asarray((table - self.centre) / self.scale)


@dataclass(frozen=True)
class Surface:
    """A quadratic surface: its variables, and coefficients (terms, outputs)."""

    scaling: Scaling
    coefficients: Array


@dataclass(frozen=True)
class Change:
    """Change by a form of a cause, in its latents and the scaled variables.

    Attributes
    ----------
    form : Form
        Form of a cause.
    centred : bool
        Whether the change is zero at latents of zero.
    coefficients : (terms, outputs) array
        Of the terms by ``change_terms``.
    widening : (terms, outputs) array
        Coefficients of the logarithm of the factor on the scatter, of ``widening_terms``.
    """

    form: Form
    centred: bool
    coefficients: Array
    widening: Array

    @functools.cached_property
    def _grids(self) -> dict[str, Array]:
        """Values of the free parameters on ``GRID``."""
        return {
            p.name: np.array([value_at(p.prior, float(z)) for z in GRID]) for p in self.form.free
        }

    def scores(self, parameters: Mapping[str, float]) -> Array:
        """Return the standard-normal latents (k,) of the free parameters."""
        return np.array(
            [np.interp(parameters[name], grid, GRID) for name, grid in self._grids.items()]
        )


class Emulator:
    """Simulates the mean outcome of accidents.

    Parameters
    ----------
    name : str
        Name of the model.
    outputs : sequence of str
        Outputs of the surfaces, in order.
    surface : Surface
        Of the base model.
    changes : sequence of Change
        By the forms of the causes.
    wanted : collection of str
        Measured outputs.
    """

    def __init__(
        self,
        name: str,
        outputs: Sequence[str],
        surface: Surface,
        changes: Sequence[Change],
        wanted: Collection[str],
    ) -> None:
        self.name, self.outputs = name, tuple(outputs)
        self._surface, self._changes = surface, tuple(changes)
        self._wanted = tuple(wanted)

    def widened(self, _filters: Mapping[str, float], scalars: Collection[str]) -> "Emulator":
        """Return the emulator with more outputs; it has no signals."""
        return Emulator(
            self.name, self.outputs, self._surface, self._changes, (*self._wanted, *scalars)
        )

    def __call__(
        self, inputs: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]
    ) -> Observation | None:
        """Return the mean outcome of an accident."""
        given = {name: np.array([inputs[name]]) for name in self._surface.scaling.names}
        point = self._surface.scaling.points(given)
        values = quadratic_terms(point)[0] @ self._surface.coefficients
        log_factors = np.zeros(len(self.outputs))
        for cause, parameters in effects.items():
            change = self._change(cause, parameters)
            if change is not None:
                scores = change.scores(parameters)
                terms = change_terms(scores[None], point, centred=change.centred)
                values = values + terms[0] @ change.coefficients
                log_factors += widening_terms(scores[None])[0] @ change.widening
        most = np.log(WIDEST)
        factors = np.exp(np.clip(log_factors, -most, most))
        found = dict(zip(self.outputs, zip(values, factors, strict=True), strict=True))
        return Observation(
            {},
            {name: float(found[name][0]) for name in self._wanted},
            {name: float(found[name][1]) for name in self._wanted if found[name][1] != 1.0},
        )

    def _change(self, cause: str, parameters: Mapping[str, float]) -> Change | None:
        for change in self._changes:
            fixed = change.form.fixed.items()
            if change.form.cause == cause and all(parameters[k] == v for k, v in fixed):
                return change
        return None


def quadratic_terms(points: Array) -> Array:
    """Return one, the variables, their squares and products, (n, terms)."""
    n, d = points.shape
    products = [points[:, i] * points[:, j] for i in range(d) for j in range(i, d)]
    return np.column_stack([np.ones(n), points, *products])


def change_terms(scores: Array, points: Array, *, centred: bool) -> Array:
    """Return the terms of a change: powers of the latents, alone and times the variables.

    Cubic in all of them where these are few terms, else quadratic in the latents.

    Parameters
    ----------
    scores : (n, k) array
        Standard-normal latents of the parameters.
    points : (n, d) array
        Scaled variables.
    centred : bool
        Whether the change is zero at latents of zero.
    """
    both = np.concatenate([np.ones((len(points), 1)), scores, points], axis=1)
    places = _change_places(scores.shape[1], points.shape[1], centred)
    return np.asarray(both[:, places].prod(axis=2))


@functools.cache
def _change_places(k: int, d: int, centred: bool) -> NDArray[np.int64]:
    """Return the factors of each term (terms, 3): 0 for one, then the latents, the variables."""
    latents, variables = range(1, k + 1), range(k + 1, k + d + 1)
    found = [
        chosen
        for degree in range(1, CUBIC + 1)
        for chosen in itertools.combinations_with_replacement((*latents, *variables), degree)
        if not centred or chosen[0] <= k
    ]
    if len(found) > MOST_TERMS:
        squares = itertools.combinations_with_replacement(latents, 2)
        found = [*((j,) for j in latents), *squares, *itertools.product(latents, variables)]
        found += [] if centred else [(j,) for j in variables]
    if not centred:
        found.insert(0, ())
    return np.array([chosen + (0,) * (CUBIC - len(chosen)) for chosen in found])


def fit_terms(terms: Array, outputs: Array) -> tuple[Array, Array]:
    """Return coefficients (terms, m) of outputs (n, m), NaN left out, and residuals (n, m)."""
    coefficients = np.zeros((terms.shape[1], outputs.shape[1]))
    left = np.full_like(outputs, np.nan)
    for k in range(outputs.shape[1]):
        good = np.isfinite(outputs[:, k])
        part = terms[good]
        square = part.T @ part + RIDGE * good.sum() * np.eye(part.shape[1])
        # The intercept is not penalised.
        square[0, 0] -= RIDGE * good.sum()
        coefficients[:, k] = np.linalg.solve(square, part.T @ outputs[good, k])
        left[good, k] = outputs[good, k] - part @ coefficients[:, k]
    return coefficients, left


def widening_terms(scores: Array) -> Array:
    """Return the terms (n, 1 + 2 k) of a logarithm of a factor on scatter: latents, squares."""
    return np.concatenate([np.ones((len(scores), 1)), scores, scores**2], axis=1)


def fit_widening(terms: Array, before: Array, after: Array) -> Array:
    """Return the coefficients (terms,) of the logarithm of the growth of a scatter.

    The most probable ones for normal deviations of the same runs with and without a change: where
    both share their deviations, their errors cancel. Zero unless the growth is significant.

    Parameters
    ----------
    terms : (n, terms) array
        From ``widening_terms``.
    before, after : (n,) array
        Deviations without and with the change, NaN where a run failed.
    """
    known = np.isfinite(before) & np.isfinite(after)
    terms, before, after = terms[known], before[known], after[known]
    size = float(np.sqrt(np.mean(before**2)))
    if size == 0.0:
        return np.zeros(terms.shape[1])
    own, grown = _log_scatter(terms, before / size), _log_scatter(terms, after / size)
    gained = _cost(own, terms, after / size)[0] - _cost(grown, terms, after / size)[0]
    if gained < 0.5 * chi2.isf(SIGNIFICANT, terms.shape[1]):
        return np.zeros(terms.shape[1])
    return grown - own


def _log_scatter(terms: Array, deviations: Array) -> Array:
    """Return the most probable coefficients of the logarithm of a standard deviation."""
    start = np.zeros(terms.shape[1])
    return np.asarray(minimize(_cost, start, (terms, deviations), "BFGS", jac=True).x)


def _cost(coefficients: Array, terms: Array, deviations: Array) -> tuple[float, Array]:
    """Return the negative log posterior of deviations, up to a constant, and its gradient."""
    logs = terms @ coefficients
    squares = (deviations * np.exp(-np.clip(logs, -MOST_LOG, MOST_LOG))) ** 2
    # The level itself has a flat prior.
    shrunk = np.concatenate([[0.0], coefficients[1:]]) / SHRINKAGE**2
    cost = float(np.sum(logs) + 0.5 * np.sum(squares) + 0.5 * shrunk @ coefficients)
    return cost, np.asarray(terms.T @ (1.0 - squares) + shrunk)
