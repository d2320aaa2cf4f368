"""The input space: names, units, distributions and dependence of the uncertain inputs.

A point of the unit cube, or a vector of standard normal scores, maps to one set of values. Designs,
priors and posteriors use this module; it is independent of study files. A Gaussian copula makes
independent uniforms dependent, quantile functions map them to values.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcstudy import units as unit_conversion

Array = NDArray[np.float64]

MAX_SCORE = 8.0
"""Largest normal score, in size; quantiles are clipped there."""


class Marginal(Protocol):
    """A distribution of one input by its quantile function."""

    @property
    def unit(self) -> str:
        """Of its values."""

    @property
    def parents(self) -> tuple[str, ...]:
        """Inputs on whose value it depends."""

    def quantile(self, u: Array, given: Mapping[str, Array]) -> Array:
        """Return the values at probabilities ``u``, for values of the parents."""


@dataclass(frozen=True)
class InputSpace:
    """Inputs with their distributions and their dependence.

    Attributes
    ----------
    distributions : by name, d of them.
    units : by name, in which values are returned.
    correlations : triples of two names and the correlation of their normal scores.

    Raises
    ------
    ValueError
        If a unit does not fit, an input depends on one that is not there, or the correlations
        contradict each other.
    """

    distributions: Mapping[str, Marginal]
    units: Mapping[str, str]
    correlations: Sequence[tuple[str, str, float]] = ()
    _factor: Array = field(init=False, repr=False, compare=False)
    _scale: dict[str, float] = field(init=False, repr=False, compare=False)
    _order: list[str] = field(init=False, repr=False, compare=False)
    _tied: NDArray[np.bool_] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        scale = {
            name: unit_conversion.factor(entry.unit, self.units[name])
            for name, entry in self.distributions.items()
        }
        factor = copula_factor(list(self.distributions), self.correlations)
        object.__setattr__(self, "_scale", scale)
        object.__setattr__(self, "_factor", factor)
        object.__setattr__(self, "_order", sampling_order(self.distributions))
        # Whether each input is tied to one before it.
        object.__setattr__(self, "_tied", np.count_nonzero(factor, axis=1) > 1)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the inputs, in the order of the columns of a point."""
        return tuple(self.distributions)

    def transform(self, uniforms: Array) -> dict[str, Array]:
        """Return the values (n,) by name at points of the unit cube.

        Parameters
        ----------
        uniforms : (n, d) array
            In (0, 1), columns in the order of ``names``.

        Raises
        ------
        ValueError
            Naming the input whose values cannot be drawn.
        """
        # Uncorrelated inputs keep their uniforms bit for bit.
        columns = [uniforms[:, k] for k in range(uniforms.shape[1])]
        if self._tied.any():
            scores = special.ndtri(np.clip(uniforms, 1e-15, 1.0 - 1e-15))
            dependent = special.ndtr(scores @ self._factor.T)
            for k in np.flatnonzero(self._tied):
                columns[k] = dependent[:, k]
        return self._values(columns)

    def from_normal(self, scores: Array) -> dict[str, Array]:
        """Return the values (n,) by name at independent standard normal scores.

        Parameters
        ----------
        scores : (n, d) array
            Columns in the order of ``names``; clipped at +-8.
        """
        held = np.clip(scores, -MAX_SCORE, MAX_SCORE)
        if self._tied.any():
            held = held @ self._factor.T
        return self._values(list(special.ndtr(held).T))

    def _values(self, columns: Sequence[Array]) -> dict[str, Array]:
        """Return the values, in the units wanted, at the probabilities of each input."""
        position = {name: k for k, name in enumerate(self.distributions)}
        drawn: dict[str, Array] = {}
        for name in self._order:
            try:
                drawn[name] = self.distributions[name].quantile(columns[position[name]], drawn)
            except ValueError as error:
                raise ValueError(f"inputs.{name}: {error}") from None
        with np.errstate(over="ignore"):
            return {name: drawn[name] * self._scale[name] for name in self.distributions}


def value_at(space: InputSpace, score: float) -> float:
    """Return the value of the one input of a space at a standard normal score."""
    (values,) = space.from_normal(np.array([[score]])).values()
    return float(values[0])


def sampling_order(distributions: Mapping[str, Marginal]) -> list[str]:
    """Return the inputs so that each comes after those it depends on.

    Raises
    ------
    ValueError
        If an input depends on one that is not sampled, or on itself.
    """
    order: list[str] = []
    waiting = dict(distributions)
    while waiting:
        ready = [n for n, d in waiting.items() if all(p in order for p in d.parents)]
        if not ready:
            name, distribution = next(iter(waiting.items()))
            raise ValueError(
                f"inputs.{name} depends on {', '.join(distribution.parents)}, "
                "which must be sampled too and not depend on it"
            )
        order += ready
        for name in ready:
            del waiting[name]
    return order


def copula_factor(names: Sequence[str], correlations: Sequence[tuple[str, str, float]]) -> Array:
    """Return the Cholesky factor (d, d) of a Gaussian copula.

    Parameters
    ----------
    names : d sampled inputs.
    correlations : triples of two names and the correlation of their normal scores.

    Raises
    ------
    ValueError
        If a name is not sampled, a pair is repeated, or the matrix is not positive definite.
    """
    matrix = np.eye(len(names))
    seen = set()
    for first, second, value in correlations:
        for name in (first, second):
            if name not in names:
                raise ValueError(f"{name!r} is not a sampled input")
        pair = frozenset((first, second))
        if len(pair) == 1 or pair in seen:
            raise ValueError(f"the pair {first!r}, {second!r} is repeated or of one input")
        if not -1.0 < value < 1.0:
            raise ValueError(
                f"correlation {value:g} of {first!r}, {second!r} is not within -1 and 1"
            )
        seen.add(pair)
        i, j = names.index(first), names.index(second)
        matrix[i, j] = matrix[j, i] = value
    try:
        return np.asarray(np.linalg.cholesky(matrix))
    except np.linalg.LinAlgError:
        raise ValueError("the correlations contradict each other (not positive definite)") from None
