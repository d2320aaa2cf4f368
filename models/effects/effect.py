"""What an effect is: a cause with a name, parameters with priors, and what it does to a model.

An effect that is switched on adds its parameters to the model's inputs, named
``<effect>_<parameter>``, so that an extended model is an ordinary one: its parameters are fixed or
sampled like any other input. It acts at one stage of a run:

- ``inputs``: on the values of the model's inputs, before anything is built;
- ``curve``: on the loading curve of the hood that the head strikes;
- ``contact``: on what the contact does beside its curve (rate, moving mass);
- ``braking``, ``posture``, ``road``: on the car's motion, the person's posture and the road of a
  crash;
- ``signal``: on what the accelerometer reads.
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
    distribution : ``lognormal`` (median, sigma of the logarithm), ``normal`` (mean, standard
        deviation) or ``uniform`` (low, high).
    first, second : its two numbers.
    """

    distribution: str
    first: float
    second: float

    def __str__(self) -> str:
        return f"{self.distribution} {self.first:g}, {self.second:g}"

    def quantile(self, probability: Array | float) -> Array:
        """Return the values at probabilities."""
        z = np.asarray(special.ndtri(probability))
        if self.distribution == "lognormal":
            return np.asarray(self.first * np.exp(self.second * z))
        if self.distribution == "normal":
            return np.asarray(self.first + self.second * z)
        return np.asarray(self.first + (self.second - self.first) * np.asarray(probability))

    def log_density(self, value: float) -> float:
        """Return the log density at a value, minus infinity outside."""
        if self.distribution == "lognormal":
            return float(stats.lognorm.logpdf(value, self.second, scale=self.first))
        if self.distribution == "normal":
            return float(stats.norm.logpdf(value, self.first, self.second))
        return float(stats.uniform.logpdf(value, self.first, self.second - self.first))


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect: as an input of a model, with its prior and the value for none.

    Attributes
    ----------
    none : value at which the effect does nothing.
    """

    input: Input
    prior: Prior
    none: float


@dataclass(frozen=True)
class Effect:
    """An effect.

    Attributes
    ----------
    name, title : of the cause. stage : one of ``STAGES``. models : that it applies to.
    parameters : by name. size : the parameter that says how large the effect is.
    forms : functional forms by name; each fixes the values of some parameters.
    signature : where it shows. confusable : effects that look alike.
    separated_by : the measurement that tells them apart. source : of its form and numbers.
    apply : what the stage hands over and the parameters by name, to the same thing changed.
    """

    name: str
    title: str
    stage: str
    models: tuple[str, ...]
    parameters: Mapping[str, Parameter]
    size: str
    forms: Mapping[str, Mapping[str, float]]
    signature: str
    confusable: tuple[str, ...]
    separated_by: str
    source: str
    apply: Callable[[Any, Mapping[str, float]], Any]

    def input_name(self, parameter: str) -> str:
        """Return the name that a parameter has among a model's inputs."""
        return f"{self.name}_{parameter}"
