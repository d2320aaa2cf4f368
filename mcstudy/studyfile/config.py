"""Study files: TOML, checked before anything runs."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from mcstudy import units
from mcstudy.errors import UserError, on_one_line
from mcstudy.files import parse_toml, read_study_text
from mcstudy.sampling import designs
from mcstudy.simulator import Simulator
from mcstudy.studyfile.distributions import (
    copula_factor,
    sample_values,
    sampling_order,
)
from mcstudy.studyfile.schema import (
    CommonStudy,
    ComparisonRow,
    ComparisonTable,
    FactorStudy,
    InjuryStudy,
    ModelComparison,
    MonteCarloStudy,
    MorrisStudy,
    Reconstruction,
    SampledStudy,
    SobolStudy,
    Study,
)

__all__ = [
    "CommonStudy",
    "ComparisonRow",
    "ComparisonTable",
    "FactorStudy",
    "InjuryStudy",
    "ModelComparison",
    "MonteCarloStudy",
    "MorrisStudy",
    "Reconstruction",
    "SampledStudy",
    "SobolStudy",
    "Study",
]

Array = NDArray[np.float64]

LONGEST = 200
"""Characters of a message, above which it is cut."""
_MIXED = {"options": "a text, a number or a list of pairs of numbers",
          "fixed": "a number or a list of pairs of numbers"}  # fmt: skip
"""What the tables hold whose values may be of several types."""
_STUDY: TypeAdapter[Study] = TypeAdapter(Annotated[Study, Field(discriminator="kind")])


def load_study(path: Path | str) -> Study:
    """Read and check a study file.

    Raises
    ------
    UserError
        If the file cannot be read or something in it is wrong; the message names the file and the
        place in it.
    """
    return parse_study(read_study_text(path), str(path))


def parse_study(text: str, source: str = "study") -> Study:
    """Check the text of a study file; see ``load_study``."""
    table = parse_toml(text, source)
    try:
        return _STUDY.validate_python(table)
    except ValidationError as error:
        raise UserError(f"{source}: {first_problem(error, table)}") from None


def first_problem(error: ValidationError, table: Mapping[str, Any]) -> str:
    """Return the first problem of a table, on one line, with its place in the file.

    Parameters
    ----------
    error : of the check. table : as it was read.
    """
    problem = error.errors(include_url=False)[0]
    kind = problem["type"]
    parts, typed = _place_in(table, problem["loc"], missing=kind == "missing")
    place = on_one_line(".".join(parts) or "study", LONGEST)
    mixed = next((part for part in parts if part in _MIXED), None)
    if mixed is not None and typed >= parts.index(mixed) + 2:
        place = on_one_line(".".join(parts[: parts.index(mixed) + 2]), LONGEST)
        return f"{place}: must be {_MIXED[mixed]}"
    if kind == "extra_forbidden":
        return f"{place}: unknown key"
    if kind == "missing":
        return f"{place}: missing"
    message = on_one_line(problem["msg"].removeprefix("Value error, "), LONGEST)
    given = problem.get("input")
    shown = (
        f" (given {on_one_line(repr(given), 60)})" if isinstance(given, str | int | float) else ""
    )
    return f"{place}: {message}{shown}"


def _place_in(
    table: Any, location: tuple[int | str, ...], *, missing: bool
) -> tuple[list[str], int]:
    """Return the parts of a location that the file has, and after how many another stood last.

    Pydantic puts the chosen kind of study and of distribution into a location, and the type that
    it tried; the file does not have them. What is missing is the last part.
    """
    parts: list[str] = []
    other = 0
    for k, part in enumerate(location):
        inside = (
            part in table
            if isinstance(table, Mapping)
            else isinstance(table, Sequence) and isinstance(part, int) and part < len(table)
        )
        if inside:
            table = table[part]
            parts.append(str(part))
        elif missing and k == len(location) - 1:
            parts.append(str(part))
        else:
            other = len(parts)
    return parts, other


def fixed_values(study: CommonStudy, model: Simulator) -> dict[str, float]:
    """Return the fixed inputs in the model's units.

    Raises
    ------
    UserError
        If a name, unit or value does not fit the model.
    """
    known = {item.name: item for item in model.inputs}
    values = {}
    for name, entry in study.fixed.items():
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


def sample_inputs(study: MonteCarloStudy, model: Simulator) -> dict[str, Array]:
    """Return the (n,) values of every input of the model, in its units.

    Raises
    ------
    UserError
        If names, units, dependence or ranges do not fit the model.
    """
    uniforms = designs.draw(
        study.design.method, study.design.n, study.design.size, len(study.inputs), study.seed
    )
    return map_inputs(study, model, uniforms)


def map_inputs(study: SampledStudy, model: Simulator, uniforms: Array) -> dict[str, Array]:
    """Return the (n,) values of every input of the model, in its units, for independent uniforms.

    Parameters
    ----------
    study : with inputs and their dependence. model : Simulator.
    uniforms : (n, d) in (0, 1), columns in the order of ``study.inputs``.

    Raises
    ------
    UserError
        If names, units, dependence or ranges do not fit the model.
    """
    known = {item.name: item for item in model.inputs}
    for name in study.inputs:
        if name not in known:
            raise UserError(f"inputs.{name}: {_unknown_input(name, model)}")
        if name in study.fixed:
            raise UserError(f"fixed.{name}: the input is sampled in inputs.{name} as well")
    scale = {
        name: _factor(entry.unit, known[name].unit, f"inputs.{name}.unit")
        for name, entry in study.inputs.items()
    }
    try:
        sampling_order(study.inputs)
        factor = copula_factor(list(study.inputs), study.dependence.correlations)
    except ValueError as error:
        raise UserError(f"dependence: {error}") from None
    try:
        sampled = sample_values(uniforms, study.inputs, factor)
    except ValueError as error:
        raise UserError(str(error)) from None
    fixed = fixed_values(study, model)
    columns: dict[str, Array] = {}
    for item in model.inputs:
        if item.name in sampled:
            with np.errstate(over="ignore"):
                values = sampled[item.name] * scale[item.name]
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


def dependent_pairs(study: MonteCarloStudy | FactorStudy) -> list[tuple[str, str]]:
    """Return the pairs of inputs that depend on each other."""
    pairs = [(a, b) for a, b, value in study.dependence.correlations if value != 0.0]
    return pairs + [(name, parent) for name, d in study.inputs.items() for parent in d.parents]


def check_independent(study: FactorStudy) -> None:
    """Raise ``UserError`` if inputs of different factors depend on each other."""
    member = {name: group for group, names in study.groups.items() for name in names}
    for first, second in dependent_pairs(study):
        # What is not sampled at all is refused with the dependence itself.
        if first not in study.inputs or second not in study.inputs:
            continue
        if member.get(first, first) != member.get(second, second):
            raise UserError(
                f"dependence: {first!r} and {second!r} depend on each other, and a {study.kind} "
                "study exchanges one factor at a time: put both into one group, or run a "
                "monte-carlo study and 'mcstudy sensitivity' on its folder"
            )


USUAL_OUTPUTS = ("hic15", "throw_distance", "wad")


def report_outputs(study: SampledStudy, model: Simulator) -> list[str]:
    """Return the outputs that a study's report draws.

    Raises
    ------
    UserError
        If the model lacks one of them.
    """
    if study.report.outputs is None:
        known = [item.name for item in model.outputs]
        return [name for name in USUAL_OUTPUTS if name in known] or known[:3]
    check_outputs(study.report.outputs, model, "report.outputs")
    return study.report.outputs


def check_outputs(names: Sequence[str], model: Simulator, place: str) -> None:
    """Raise ``UserError`` if the model lacks one of the outputs, or one is named twice."""
    known = [item.name for item in model.outputs]
    for name in names:
        if names.count(name) > 1:
            raise UserError(f"{place}: names {name!r} twice")
        if name not in known:
            raise UserError(
                f"{place}: model {model.name!r} has no output {name!r}; it has {', '.join(known)}"
            )


def numbers_digest(study: SampledStudy, model: Simulator) -> dict[str, str]:
    """Return, by topic, what changes the numbers of a study, as canonical JSON.

    Two studies whose digests are equal give the same row for the same run id; n is left out
    because a larger design begins with the smaller one.
    """
    table = study.model_dump(mode="json")
    topics = {
        "model": [table["model"], model.version],
        "seed": table["seed"],
        "dependence": table["dependence"],
        "inputs": list(table["inputs"]),
    }
    if isinstance(study, MonteCarloStudy):
        topics["design.method"] = study.design.method
        topics["design.replicate_size"] = study.design.size
    else:
        topics["kind"] = study.kind
        topics["groups"] = {group: sorted(names) for group, names in table["groups"].items()}
        if isinstance(study, SobolStudy):
            topics["design.second_order"] = study.design.second_order
        else:
            topics["design.levels"] = study.design.levels
            topics["design.grid"] = "shifted"
    topics |= {f"inputs.{name}": entry for name, entry in table["inputs"].items()}
    topics |= {f"fixed.{name}": entry for name, entry in table["fixed"].items()}
    topics |= {f"effects.{name}": entry for name, entry in table["effects"].items()}
    return {key: json.dumps(value, sort_keys=True) for key, value in topics.items()}


def hash_of(topics: dict[str, str]) -> str:
    """Return the hash of ``numbers_digest``."""
    return hashlib.sha256(json.dumps(topics, sort_keys=True).encode()).hexdigest()


def _unknown_input(name: str, model: Simulator) -> str:
    names = ", ".join(item.name for item in model.inputs)
    return f"model {model.name!r} has no input {name!r}; it has {names}"


def _factor(unit: str, target: str, place: str) -> float:
    try:
        return units.factor(unit, target)
    except ValueError as error:
        raise UserError(f"{place}: {error}") from None
