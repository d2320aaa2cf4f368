"""The mean outcome of accidents as quadratic surfaces: fast enough for a diagnosis."""

import functools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.problem import Form, Observation
from mcstudy.studyfile.input_space import value_at

Array = NDArray[np.float64]

RIDGE = 1e-3
"""Ridge penalty on a coefficient, as a share of the runs."""
GRID = np.linspace(-4.0, 4.0, 161)
"""Standard-normal latents at which a prior's quantile is inverted."""


@dataclass(frozen=True)
class Surface:
    """A quadratic surface: centre and scale of the variables, coefficients (terms, outputs)."""

    names: tuple[str, ...]
    centre: Array
    scale: Array
    coefficients: Array

    def point(self, values: Mapping[str, float]) -> Array:
        """Return the scaled variables (d,)."""
        given = np.array([values[name] for name in self.names])
        return np.asarray((given - self.centre) / self.scale)


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
    """

    form: Form
    centred: bool
    coefficients: Array

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
        point = self._surface.point(inputs)
        values = quadratic_terms(point[None])[0] @ self._surface.coefficients
        for cause, parameters in effects.items():
            change = self._change(cause, parameters)
            if change is not None:
                scores = change.scores(parameters)
                terms = change_terms(scores[None], point[None], centred=change.centred)
                values = values + terms[0] @ change.coefficients
        by_name = dict(zip(self.outputs, values, strict=True))
        return Observation({}, {name: float(by_name[name]) for name in self._wanted})

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

    Parameters
    ----------
    scores : (n, k) array
        Standard-normal latents of the parameters.
    points : (n, d) array
        Scaled variables.
    centred : bool
        Whether the change is zero at latents of zero.
    """
    n, k = scores.shape
    columns = [] if centred else [np.ones((n, 1)), points]
    for j in range(k):
        z = scores[:, j : j + 1]
        columns += [z, z**2, z * points]
    columns += [scores[:, i : i + 1] * scores[:, j : j + 1] for i in range(k) for j in range(i)]
    return np.concatenate(columns, axis=1)


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
