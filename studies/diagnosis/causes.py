"""The catalogue of effects as causes of a diagnosis."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.problem import Cause, Form, Parameter
from mcstudy.studyfile.input_space import InputSpace
from models.effects.effect import Effect, Prior
from models.effects.registry import load_effect
from models.protocol import Input
from models.registry import load_model

Array = NDArray[np.float64]

FREE_FORM = "free_form"
"""Name of the forms that are tables over a cause's own coordinate."""


def causes_of(
    name: str, options: Mapping[str, Any] | None = None, *, accidents: bool = False
) -> tuple[Cause, ...]:
    """Return the causes that apply to a model.

    Parameters
    ----------
    name : str
        Name of the model.
    options : mapping, optional
        Its options.
    accidents : bool
        Whether the recorded values were estimated after an accident, not measured in a test.
    """
    model = load_model(name, options or {})
    everything = load_model(name, options or {}, {effect: {} for effect in model.effects})
    inputs = frozenset(item.name for item in everything.inputs)
    return tuple(_cause(load_effect(effect), inputs, accidents) for effect in model.effects)


def accident_causes_of(name: str, options: Mapping[str, Any] | None = None) -> tuple[Cause, ...]:
    """Return the causes of a model that accidents show: nothing was recorded with instruments.

    Parameters
    ----------
    name : str
        Name of the model.
    options : mapping, optional
        Its options.
    """
    causes = causes_of(name, options, accidents=True)
    return tuple(cause for cause in causes if stage_of(cause.name) != "signal")


def stage_of(cause: str) -> str:
    """Return the stage of a run at which a cause acts."""
    return load_effect(cause).stage


def _cause(effect: Effect, inputs: frozenset[str], accidents: bool) -> Cause:
    """Return an effect as a cause of a model with all its effects' parameters among the inputs."""
    held = [name for name in effect.parameters if effect.input_name(name) in inputs]
    forms = tuple(
        Form(
            cause=effect.name,
            name=form,
            fixed={name: value for name, value in fixed.items() if name in held},
            free=tuple(_parameter(effect, name, accidents) for name in held if name not in fixed),
            named=form != FREE_FORM,
        )
        for form, fixed in effect.forms.items()
        # A form takes all the parameters that it leaves free.
        if all(name in held for name in effect.parameters if name not in fixed)
    )
    return Cause(
        name=effect.name,
        title=effect.title,
        forms=forms,
        size=effect.size,
        varies_with=effect.varies_with,
        signature=effect.signature,
        confusable=effect.confusable,
        separated_by=effect.separated_by,
    )


def _parameter(effect: Effect, name: str, accidents: bool) -> Parameter:
    entry = effect.parameters[name]
    item = entry.input
    given = entry.in_accidents if accidents else entry.prior
    prior = InputSpace({name: EffectPrior(given, item)}, {name: item.unit})
    return Parameter(name, item.unit, item.meaning, prior, entry.none, given.distribution)


@dataclass(frozen=True)
class EffectPrior:
    """The prior of an effect's parameter, limited to the range of its input."""

    prior: Prior
    input: Input

    @property
    def unit(self) -> str:
        """Unit of its values."""
        return self.input.unit

    @property
    def parents(self) -> tuple[str, ...]:
        """None: it depends on no other input."""
        return ()

    def quantile(self, u: Array, given: Mapping[str, Array]) -> Array:
        """Return the values at probabilities ``u``."""
        return np.clip(self.prior.quantile(u), self.input.low, self.input.high)
