"""Distributions of inputs.

Every distribution is a table of a study file with a quantile function. A design gives independent
uniforms; a Gaussian copula makes them dependent; quantile functions map them to values in the
file's unit, which the caller converts to the model's unit.
"""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    model_validator,
)
from scipy import special, stats

from mcstudy import units

Array = NDArray[np.float64]


SMALLEST_SHARE = 1e-20
"""Smallest probability that a truncation may leave (assumed)."""

_ABSURD = np.errstate(all="ignore")
"""Overflowing parameters give infinity or NaN, which lie outside every model's range."""
Positive = Annotated[FiniteFloat, Field(gt=0.0)]
Unit = Annotated[str, AfterValidator(units.canonical)]
"""A unit in any spelling; an unknown one is refused where it is used."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class _Distribution(_Table):
    unit: Unit = "1"

    @property
    def parents(self) -> tuple[str, ...]:
        """Inputs on whose value the distribution depends."""
        return ()


class Uniform(_Distribution):
    """Equally probable between ``low`` and ``high``."""

    distribution: Literal["uniform"]
    low: FiniteFloat
    high: FiniteFloat

    @model_validator(mode="after")
    def _ordered(self) -> "Uniform":
        if not self.low < self.high:
            raise ValueError(f"low ({self.low:g}) must be below high ({self.high:g})")
        return self

    @_ABSURD
    def quantile(self, u: Array, given: Mapping[str, Array]) -> Array:
        """Return the values at probabilities ``u``."""
        return self.low + (self.high - self.low) * u


class Triangular(_Distribution):
    """Triangle from ``low`` over ``mode`` to ``high``."""

    distribution: Literal["triangular"]
    low: FiniteFloat
    mode: FiniteFloat
    high: FiniteFloat

    @model_validator(mode="after")
    def _ordered(self) -> "Triangular":
        if not (self.low <= self.mode <= self.high and self.low < self.high):
            raise ValueError("low, mode and high must rise")
        return self

    @_ABSURD
    def quantile(self, u: Array, given: Mapping[str, Array]) -> Array:
        """Return the values at probabilities ``u``."""
        width = self.high - self.low
        shape = (self.mode - self.low) / width
        return np.asarray(stats.triang.ppf(u, shape, loc=self.low, scale=width))


class _Truncated(_Distribution):
    """A distribution by its normal score: ``value(z)``, increasing, with z standard normal."""

    low: FiniteFloat | None = None
    high: FiniteFloat | None = None

    @model_validator(mode="after")
    def _ordered(self) -> "_Truncated":
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"low ({self.low:g}) must be below high ({self.high:g})")
        return self

    def _between(self, u: Array, low_score: Array, high_score: Array) -> Array:
        """Return normal scores at probabilities ``u``, truncated to two scores."""
        # Above the mean work with the upper tail, whose probabilities do not round to one.
        upper = low_score > 0.0
        a = np.where(upper, -high_score, low_score)
        b = np.where(upper, -low_score, high_score)
        v = np.where(upper, 1.0 - u, u)
        low, high = special.ndtr(a), special.ndtr(b)
        score = special.ndtri(low + (high - low) * v)
        return np.asarray(np.where(upper, -score, score))

    def _bounded(self, values: Array) -> Array:
        """Return values clipped to the bounds, beyond which rounding may lie."""
        return np.asarray(np.clip(values, self.low, self.high))


class _Scored(_Truncated):
    """A truncated distribution whose normal score depends on the value alone."""

    @model_validator(mode="after")
    def _some_probability(self) -> "_Scored":
        if self.high is not None and special.ndtr(self._score(self.high)) < SMALLEST_SHARE:
            raise ValueError(f"no probability is left below high ({self.high:g})")
        if self.low is not None and special.ndtr(-self._score(self.low)) < SMALLEST_SHARE:
            raise ValueError(f"no probability is left above low ({self.low:g})")
        return self

    @abstractmethod
    def _score(self, value: float) -> float: ...

    @abstractmethod
    def _value(self, score: Array) -> Array: ...

    @_ABSURD
    def quantile(self, u: Array, given: Mapping[str, Array]) -> Array:
        """Return the values at probabilities ``u``."""
        low = -np.inf if self.low is None else self._score(self.low)
        high = np.inf if self.high is None else self._score(self.high)
        return self._bounded(self._value(self._between(u, np.asarray(low), np.asarray(high))))


class Normal(_Scored):
    """Normal, truncated where ``low`` or ``high`` is given."""

    distribution: Literal["normal"]
    mean: FiniteFloat
    sd: Positive

    @_ABSURD
    def _score(self, value: float) -> float:
        return (value - self.mean) / self.sd

    def _value(self, score: Array) -> Array:
        return self.mean + self.sd * score


class LogNormal(_Scored):
    """Log-normal by its median and the standard deviation of the logarithm."""

    distribution: Literal["lognormal"]
    median: Positive
    sigma: Positive

    @_ABSURD
    def _score(self, value: float) -> float:
        return float(np.log(value / self.median) / self.sigma) if value > 0.0 else -np.inf

    def _value(self, score: Array) -> Array:
        return np.asarray(self.median * np.exp(self.sigma * score))


class GrowthChart(_Truncated):
    """LMS distribution of a body measure given age: ``M (1 + L S z)^(1/L)``.

    ``age`` names the input that holds the age; ``at`` lists ages (in that input's unit in the
    file) and ``L``, ``M``, ``S`` the parameters there, interpolated linearly between. Truncated
    where ``low`` or ``high`` is given.
    """

    distribution: Literal["growth-chart"]
    age: str
    at: Annotated[list[FiniteFloat], Field(min_length=2)]
    L: list[FiniteFloat]
    M: list[Positive]
    S: list[Positive]

    @model_validator(mode="after")
    def _lengths(self) -> "GrowthChart":
        if not len(self.at) == len(self.L) == len(self.M) == len(self.S):
            raise ValueError("at, L, M and S must be of equal length")
        if np.any(np.diff(self.at) <= 0.0):
            raise ValueError("at must rise")
        return self

    @property
    def parents(self) -> tuple[str, ...]:
        """The age input."""
        return (self.age,)

    @_ABSURD
    def quantile(self, u: Array, given: Mapping[str, Array]) -> Array:
        """Return the values at probabilities ``u`` and the ages ``given``.

        Raises
        ------
        ValueError
            If an age lies outside the chart.
        """
        age = given[self.age]
        if np.any((age < self.at[0]) | (age > self.at[-1])):
            worst = age[(age < self.at[0]) | (age > self.at[-1])][0]
            raise ValueError(
                f"{self.age} = {worst:g} is outside the chart, {self.at[0]:g} to {self.at[-1]:g}"
            )
        L, M, S = (np.interp(age, self.at, p) for p in (self.L, self.M, self.S))
        curved = np.abs(L) > 1e-9
        power = np.where(curved, L, 1.0)

        def score(value: float | None, default: float) -> Array:
            if value is None:
                return np.full(age.shape, default)
            if value <= 0.0:
                return np.full(age.shape, -np.inf)
            ratio = value / M
            return np.where(curved, (ratio**power - 1.0) / (power * S), np.log(ratio) / S)

        z = self._between(u, score(self.low, -np.inf), score(self.high, np.inf))
        inside = np.maximum(1.0 + L * S * z, 0.0)
        values = M * np.where(curved, inside ** (1.0 / power), np.exp(S * z))
        return self._bounded(values)


Distribution = Annotated[
    Uniform | Triangular | Normal | LogNormal | GrowthChart, Field(discriminator="distribution")
]
