"""Definition of an effect: a named cause with parameters, priors and an action on a model.

An effect that is switched on adds its parameters to the model's inputs, named
``<effect>_<parameter>``, so that an extended model is an ordinary model: its parameters are fixed
or sampled like any other input. An effect acts at one stage of a run:

- ``inputs``: on the values of the model's inputs, before anything is built;
- ``curve``: on the loading curve of the hood that the head strikes;
- ``contact``: on the other properties of the contact (rate dependence, moving mass) and the guide
  of the rig;
- ``braking``, ``posture``, ``road``: on the car's motion, the pedestrian's posture and the road of
  a crash;
- ``signal``: on the accelerometer reading.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from models.protocol import Input

Array = NDArray[np.float64]

STAGES = ("inputs", "curve", "contact", "braking", "posture", "road", "signal")


@dataclass(frozen=True)
class Prior:
    """Prior of a parameter.

    Attributes
    ----------
    distribution : {"lognormal", "normal", "uniform"}
        With the parameters median and sigma of the logarithm, mean and standard deviation, or
        lower and upper bound.
    first, second : float
        The two parameters of the distribution.
    """

    distribution: str
    first: float
    second: float

    def __str__(self) -> str:
        return f"{self.distribution} {self.first:g}, {self.second:g}"

    def quantile(self, probability: Array | float) -> Array:
        """Return the quantiles at the given probabilities."""
        z = np.asarray(special.ndtri(probability))
        if self.distribution == "lognormal":
            return np.asarray(self.first * np.exp(self.second * z))
        if self.distribution == "normal":
            return np.asarray(self.first + self.second * z)
        return np.asarray(self.first + (self.second - self.first) * np.asarray(probability))

    def log_density(self, value: float) -> float:
        """Return the log density at a value, minus infinity outside the support."""
        if self.distribution == "lognormal":
            return float(stats.lognorm.logpdf(value, self.second, scale=self.first))
        if self.distribution == "normal":
            return float(stats.norm.logpdf(value, self.first, self.second))
        return float(stats.uniform.logpdf(value, self.first, self.second - self.first))


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect.

    Attributes
    ----------
    input : Input
        The parameter as an input of a model; its nominal value is taken where it is left out.
    prior : Prior
    none : float
        Null value, at which the effect vanishes.
    models : tuple of str
        Models that have the parameter; the others run at its nominal value.
    in_accidents : Prior
        Prior where the recorded values were estimated after an accident, not measured in a test.
    """

    input: Input
    prior: Prior
    none: float
    models: tuple[str, ...]
    in_accidents: Prior


@dataclass(frozen=True)
class Effect:
    """An effect.

    Attributes
    ----------
    name, title : str
        Of the cause.
    stage : str
        One of ``STAGES``.
    models : tuple of str
        Models to which it applies.
    parameters : mapping of str to Parameter
        By name.
    size : str
        Parameter that sets the size of the effect.
    forms : mapping
        Functional forms by name; each fixes the values of some parameters.
    varies_with : tuple of str
        Covariates along which the size may change from test to test: recorded inputs, or ``order``
        for every column of the tests that is no input.
    signature : str
        How the effect shows in the data.
    confusable : tuple of str
        Effects with a similar signature.
    separated_by : str
        Measurement that distinguishes them.
    source : str
        Source of its form and numbers.
    apply : callable
        Maps the subject of the stage and the parameters by name to the changed subject.
    nonlinear : bool
        Whether a reading with the effect is not proportional to the true acceleration.
    """

    name: str
    title: str
    stage: str
    models: tuple[str, ...]
    parameters: Mapping[str, Parameter]
    size: str
    forms: Mapping[str, Mapping[str, float]]
    varies_with: tuple[str, ...]
    signature: str
    confusable: tuple[str, ...]
    separated_by: str
    source: str
    apply: Callable[[Any, Mapping[str, float]], Any]
    nonlinear: bool = False

    def input_name(self, parameter: str) -> str:
        """Return the name that a parameter has among a model's inputs."""
        return f"{self.name}_{parameter}"
