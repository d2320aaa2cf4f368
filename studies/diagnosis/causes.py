"""The catalogue of effects as causes of a diagnosis."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.problem import Cause, Form, Parameter
from mcstudy.studyfile.input_space import InputSpace
from models.effects.effect import Effect, Prior
from models.effects.registry import effects_of, load_effect
from models.protocol import Input

Array = NDArray[np.float64]


def causes_of(model: str) -> tuple[Cause, ...]:
    """Return the causes that apply to a model."""
    return tuple(_cause(load_effect(name)) for name in effects_of(model))


def stage_of(cause: str) -> str:
    """Return the stage of a run at which a cause acts."""
    return load_effect(cause).stage


def _cause(effect: Effect) -> Cause:
    forms = tuple(
        Form(
            cause=effect.name,
            name=form,
            fixed=dict(fixed),
            free=tuple(_parameter(effect, name) for name in effect.parameters if name not in fixed),
        )
        for form, fixed in effect.forms.items()
    )
    return Cause(
        name=effect.name,
        title=effect.title,
        forms=forms,
        size=effect.size,
        signature=effect.signature,
        confusable=effect.confusable,
        separated_by=effect.separated_by,
    )


def _parameter(effect: Effect, name: str) -> Parameter:
    entry = effect.parameters[name]
    item = entry.input
    prior = InputSpace({name: EffectPrior(entry.prior, item)}, {name: item.unit})
    return Parameter(name, item.unit, item.meaning, prior, entry.none, entry.prior.distribution)


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
