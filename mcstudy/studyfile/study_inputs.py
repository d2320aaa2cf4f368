"""The inputs of a study in the units of its model: sampled, fixed, or nominal."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.errors import UserError
from mcstudy.simulator import Simulator
from mcstudy.studyfile.input_space import InputSpace
from mcstudy.studyfile.schema import FactorStudy, SampledStudy, Value

Array = NDArray[np.float64]


def fixed_values(fixed: Mapping[str, Value], model: Simulator) -> dict[str, float]:
    """Return fixed inputs in the model's units.

    Parameters
    ----------
    fixed : mapping
        Values and units by input, as ``[fixed]`` of a study file holds them.
    model : Simulator

    Raises
    ------
    UserError
        If a name, unit or value does not fit the model.
    """
    known = {item.name: item for item in model.inputs}
    values = {}
    for name, entry in fixed.items():
        place = f"fixed.{name}"
        if name not in known:
            raise UserError(f"{place}: {_unknown_input(name, model)}")
        item = known[name]
        values[name] = entry.value * _factor(entry.unit, item.unit, place)
        if not item.low <= values[name] <= item.high:
            raise UserError(
                f"{place}: {values[name]:g} {item.unit} is outside the valid range "
                f"{item.low:g} to {item.high:g} {item.unit}"
            )
    return values


def input_space(study: SampledStudy, model: Simulator) -> InputSpace:
    """Return the space of the inputs that a study samples, in the model's units.

    Raises
    ------
    UserError
        If names, units or dependence do not fit the model.
    """
    known = {item.name: item for item in model.inputs}
    for name in study.inputs:
        if name not in known:
            raise UserError(f"inputs.{name}: {_unknown_input(name, model)}")
        if name in study.fixed:
            raise UserError(f"fixed.{name}: the input is sampled in inputs.{name} as well")
    for name, entry in study.inputs.items():
        _factor(entry.unit, known[name].unit, f"inputs.{name}.unit")
    try:
        return InputSpace(
            study.inputs,
            {name: known[name].unit for name in study.inputs},
            study.dependence.correlations,
        )
    except ValueError as error:
        raise UserError(f"dependence: {error}") from None


def map_inputs(study: SampledStudy, model: Simulator, uniforms: Array) -> dict[str, Array]:
    """Return the (n,) values of every input of the model, in its units, for independent uniforms.

    Parameters
    ----------
    study : SampledStudy
    model : Simulator
    uniforms : (n, d) array
        In (0, 1), columns in the order of ``study.inputs``.

    Raises
    ------
    UserError
        If names, units, dependence or ranges do not fit the model.
    """
    space = input_space(study, model)
    try:
        sampled = space.transform(uniforms)
    except ValueError as error:
        raise UserError(str(error)) from None
    fixed = fixed_values(study.fixed, model)
    columns: dict[str, Array] = {}
    for item in model.inputs:
        if item.name in sampled:
            values = sampled[item.name]
            bad = ~((values >= item.low) & (values <= item.high))
            if bad.any():
                worst = values[bad][0]
                raise UserError(
                    f"inputs.{item.name}: draws {worst:g} {item.unit}, outside the model's range "
                    f"{item.low:g} to {item.high:g} {item.unit}; truncate it with low and high"
                )
            columns[item.name] = values
        else:
            columns[item.name] = np.full(len(uniforms), fixed.get(item.name, item.nominal))
    return columns


def dependent_pairs(study: SampledStudy) -> list[tuple[str, str]]:
    """Return the pairs of inputs that depend on each other."""
    pairs = [(a, b) for a, b, value in study.dependence.correlations if value != 0.0]
    return pairs + [(name, parent) for name, d in study.inputs.items() for parent in d.parents]


def check_independent(study: FactorStudy) -> None:
    """Raise ``UserError`` if inputs of different factors depend on each other."""
    member = {name: group for group, names in study.groups.items() for name in names}
    for first, second in dependent_pairs(study):
        # An input that is not sampled is refused when the dependence is checked.
        if first not in study.inputs or second not in study.inputs:
            continue
        if member.get(first, first) != member.get(second, second):
            raise UserError(
                f"dependence: {first!r} and {second!r} depend on each other, and a {study.kind} "
                "study exchanges one factor at a time: put both into one group, or run a "
                "monte-carlo study and 'mcstudy sensitivity' on its folder"
            )


def _unknown_input(name: str, model: Simulator) -> str:
    names = ", ".join(item.name for item in model.inputs)
    return f"model {model.name!r} has no input {name!r}; it has {names}"


def _factor(unit: str, target: str, place: str) -> float:
    try:
        return units.factor(unit, target)
    except ValueError as error:
        raise UserError(f"{place}: {error}") from None
