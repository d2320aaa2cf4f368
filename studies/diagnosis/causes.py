"""The catalogue of effects as causes of a diagnosis."""

from mcstudy.diagnosis.problem import Cause, Form, Parameter
from models.effects.effect import Effect
from models.effects.registry import effects_of, load_effect


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

    def quantile(probability: float) -> float:
        return min(max(float(entry.prior.quantile(probability)), item.low), item.high)

    return Parameter(name, item.unit, item.meaning, quantile, entry.none, entry.prior.distribution)
