"""The effects that a model has switched on, in catalogue order."""

import functools
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

from models.effects.effect import Effect
from models.effects.registry import EFFECTS, load_effect
from models.protocol import Input

Subject = TypeVar("Subject")


@dataclass(frozen=True)
class EffectChain:
    """Effects in order, and the inputs that they add to a model.

    Attributes
    ----------
    effects : tuple of Effect
        Effects that are switched on.
    inputs : tuple of Input
        Their parameters, with the given values as nominal values.
    """

    effects: tuple[Effect, ...] = ()
    inputs: tuple[Input, ...] = ()

    def act(self, stage: str, subject: Subject, values: Mapping[str, float]) -> Subject:
        """Return the subject of a stage after all effects of the stage have been applied in order.

        Parameters
        ----------
        stage : str
            One of ``models.effects.effect.STAGES``.
        subject : object
            What the stage produces, e.g. a loading curve.
        values : mapping of str to float
            All inputs by name.
        """
        for effect, names in self._stages.get(stage, ()):
            subject = effect.apply(
                subject, {name: values.get(key, usual) for name, key, usual in names}
            )
        return subject

    def acting(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the inputs that change a run, not only how it is recorded, by name.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name.
        """
        return {name: value for name, value in values.items() if name not in self._recorded}

    @functools.cached_property
    def _recorded(self) -> frozenset[str]:
        """Parameters of effects on the signal."""
        return frozenset(
            effect.input_name(name)
            for effect in self.effects
            if effect.stage == "signal"
            for name in effect.parameters
        )

    @functools.cached_property
    def _stages(self) -> dict[str, list[tuple[Effect, list[tuple[str, str, float]]]]]:
        """Effects by stage, each with its parameters, their names as inputs and usual values."""
        stages: dict[str, list[tuple[Effect, list[tuple[str, str, float]]]]] = {}
        for effect in self.effects:
            names = [
                (name, effect.input_name(name), parameter.input.nominal)
                for name, parameter in effect.parameters.items()
            ]
            stages.setdefault(effect.stage, []).append((effect, names))
        return stages


def build_chain(
    model: str,
    chosen: Mapping[str, Mapping[str, float]] | None,
    without: Collection[str] = (),
) -> EffectChain:
    """Return the chain of the effects that are switched on.

    Parameters
    ----------
    model : str
        Name of the model.
    chosen : mapping, optional
        Parameter values by effect; those left out take their default, or the prior's median.
    without : collection of str
        Names ``<effect>_<parameter>`` of parameters that this variant of the model does not have.

    Raises
    ------
    ValueError
        If an effect or a parameter is unknown, does not apply to the model or is out of range.
    """
    chosen = chosen or {}
    for name in chosen:
        if name not in EFFECTS:
            raise ValueError(f"no effect {name!r}; there are {', '.join(EFFECTS)}")
    effects = tuple(load_effect(name) for name in EFFECTS if name in chosen)
    inputs = []
    for effect in effects:
        if model not in effect.models:
            raise ValueError(
                f"effect {effect.name!r} does not apply to model {model!r}, only to "
                f"{', '.join(effect.models)}"
            )
        given = chosen[effect.name]
        parameters = {
            name: parameter
            for name, parameter in effect.parameters.items()
            if model in parameter.models and effect.input_name(name) not in without
        }
        for name in given:
            if name not in parameters:
                known = ", ".join(parameters)
                raise ValueError(f"effect {effect.name!r} has no parameter {name!r}, only {known}")
        for name, parameter in parameters.items():
            item = parameter.input
            nominal = float(given.get(name, item.nominal))
            if not item.low <= nominal <= item.high:
                raise ValueError(
                    f"effects.{effect.name}.{name}: {nominal:g} {item.unit} is outside "
                    f"{item.low:g} to {item.high:g} {item.unit}"
                )
            inputs.append(replace(item, name=effect.input_name(name), nominal=nominal))
    return EffectChain(effects, tuple(inputs))
