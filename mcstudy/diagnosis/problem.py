"""Input of a diagnosis: tests, their uncertain quantities, and a model to simulate them with.

All uncertain quantities are expressed as standard-normal latents (*scores* in the code); the
quantile function of a prior maps a latent to a value. So all priors have the same form, and a
parameter cannot leave its range.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mcstudy.studyfile.input_space import InputSpace, value_at

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Signal:
    """A measured channel of a test, in the model's unit.

    Attributes
    ----------
    name : as in the model.
    time : (n,) s.
    values : (n,) in the channel's unit.
    sd : standard deviation of the noise.
    correlation : of neighbouring samples of the noise.
    """

    name: str
    time: Array
    values: Array
    sd: float
    correlation: float = 0.0


@dataclass(frozen=True)
class Scalar:
    """A measured scalar in the model's unit.

    Attributes
    ----------
    name : as in the model.
    value : as measured.
    sd : standard uncertainty, infinite if missing.
    scatters : whether it also has a test-to-test repeatability.
    roughness : part of ``sd`` that is due to jumps of the model between neighbouring inputs.
    """

    name: str
    value: float
    sd: float
    scatters: bool = True
    roughness: float = 0.0


@dataclass(frozen=True)
class Test:
    """A measured test.

    Attributes
    ----------
    name : id.
    inputs : every input that is recorded or fixed, as recorded.
    doubtful : standard uncertainty of the recorded inputs that have one.
    signals : measured channels, independent of each other and of the scalars.
    scalars : measured scalars, independent of each other.
    derived : scalars that follow from the signals; used for validation, not as evidence.
    covariates : candidates that a slow change may follow, at least the order of the tests.
    """

    name: str
    inputs: Mapping[str, float]
    doubtful: Mapping[str, float]
    signals: tuple[Signal, ...]
    scalars: tuple[Scalar, ...]
    derived: tuple[Scalar, ...]
    covariates: Mapping[str, float]

    # Keeps pytest from collecting it.
    __test__ = False


@dataclass(frozen=True)
class Unknown:
    """An unknown that all tests share: name of the input, and its prior."""

    name: str
    prior: InputSpace


@dataclass(frozen=True)
class Parameter:
    """A parameter of a cause.

    Attributes
    ----------
    name : of the parameter.
    unit : of its value.
    meaning : in words.
    prior : input space of this parameter alone.
    none : null value, at which the cause has no effect.
    family : of the prior: ``lognormal``, ``normal`` or ``uniform``.
    """

    name: str
    unit: str
    meaning: str
    prior: InputSpace
    none: float
    family: str


@dataclass(frozen=True)
class Trend:
    """A parameter that changes from test to test along a covariate.

    Attributes
    ----------
    covariate : a covariate or a recorded input of the tests.
    parameter : number of the parameter among the free ones.
    centre, scale : mean and standard deviation of the covariate.
    """

    covariate: str
    parameter: int
    centre: float
    scale: float

    def place(self, test: Test) -> float:
        """Return the covariate of a test in standard deviations from its mean."""
        value = test.covariates.get(self.covariate, test.inputs.get(self.covariate, self.centre))
        return (value - self.centre) / self.scale


@dataclass(frozen=True)
class Form:
    """A functional form of a cause.

    Attributes
    ----------
    cause : name of the cause.
    name : of the form.
    fixed : values of parameters that the form fixes.
    free : parameters that are fitted.
    trend : change of one of them along a covariate; the last latent is its size, in latents of the
        parameter per standard deviation of the covariate.
    named : whether the form is a formula of the field, not a table or a trend that stands for any.
    """

    cause: str
    name: str
    fixed: Mapping[str, float]
    free: tuple[Parameter, ...]
    trend: Trend | None = None
    named: bool = True

    @property
    def is_free(self) -> bool:
        """Whether the form is a table that stands for any formula of its cause."""
        return not self.named and self.trend is None

    @property
    def size(self) -> int:
        """Number of latents."""
        return len(self.free) + (self.trend is not None)

    @property
    def latents(self) -> tuple[str, ...]:
        """Names of the latents."""
        names = tuple(parameter.name for parameter in self.free)
        if self.trend is None:
            return names
        return (*names, f"{names[self.trend.parameter]} with {self.trend.covariate}")

    def values(self, scores: Sequence[float] | Array, test: Test | None = None) -> dict[str, float]:
        """Return the parameters by name at latents, of a test where they change along a trend."""
        latents = [float(z) for z in scores]
        if self.trend is not None:
            change = latents.pop()
            if test is not None:
                latents[self.trend.parameter] += change * self.trend.place(test)
        free = {p.name: value_at(p.prior, z) for p, z in zip(self.free, latents, strict=True)}
        return {**self.fixed, **free}


@dataclass(frozen=True)
class Cause:
    """A named cause.

    Attributes
    ----------
    name, title : of the cause.
    forms : its functional forms.
    size : parameter that sets its size.
    signature : how it shows in the data.
    confusable : causes with a similar signature.
    separated_by : measurement that distinguishes them.
    varies_with : covariates along which the size may change from test to test; see
        ``mcstudy.diagnosis.trends``.
    """

    name: str
    title: str
    forms: tuple[Form, ...]
    size: str
    signature: str
    confusable: tuple[str, ...]
    separated_by: str
    varies_with: tuple[str, ...] = ()


@dataclass(frozen=True)
class Observation:
    """Outputs of a simulated test: (time, values) by signal, values by scalar.

    ``widening`` holds the factors on the standard deviation of scalars that scatter more, or less,
    than the measured data state, by name; ``responses`` the change of a signal per relative change
    of what the sensor felt, by name, where the signal is not proportional to that.
    """

    signals: Mapping[str, tuple[Array, Array]]
    scalars: Mapping[str, float]
    widening: Mapping[str, float] = field(default_factory=dict)
    responses: Mapping[str, Array] = field(default_factory=dict)

    def response(self, signal: str) -> tuple[Array, Array]:
        """Return times and change of a signal per relative change of what its sensor felt."""
        time, values = self.signals[signal]
        return time, self.responses.get(signal, values)


class Simulate(Protocol):
    """Simulates one test; None if the run fails."""

    def __call__(
        self, inputs: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]
    ) -> Observation | None:
        """Return the test as the channels would record it."""


@dataclass(frozen=True)
class Problem:
    """Tests, unknowns that they share, the model, and the inputs' valid ranges.

    ``dear`` says whether a run takes so long that fewer forms of causes are tried.
    """

    tests: tuple[Test, ...]
    unknowns: tuple[Unknown, ...]
    simulate: Simulate
    ranges: Mapping[str, tuple[float, float]]
    dear: bool = False

    def nominal_inputs(self, test: Test) -> dict[str, float]:
        """Return the inputs of a test as recorded, and the medians of the unknowns."""
        return dict(test.inputs) | {u.name: value_at(u.prior, 0.0) for u in self.unknowns}
