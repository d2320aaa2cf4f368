"""Study files: TOML, checked before anything runs."""

import hashlib
import json
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    NonNegativeInt,
    Strict,
    TypeAdapter,
    ValidationError,
    model_validator,
)

from mcstudy import designs, units
from mcstudy.errors import UserError
from mcstudy.inputs import (
    DISTRIBUTION_NAMES,
    Distribution,
    copula_factor,
    sample_values,
    sampling_order,
)
from mcstudy.simulator import Simulator

Array = NDArray[np.float64]

FORMAT = "mcstudy-study/1"

LARGEST_DESIGN = 10_000_000
"""Runs that one study may have; their table fits a machine's memory."""
LARGEST_SEED = 2**63 - 1


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class ModelChoice(_Table):
    """``[model]``: name and options such as ``vehicle`` or ``hood_curve``."""

    name: str
    options: dict[str, str | FiniteFloat | list[list[FiniteFloat]]] = {}


class Value(_Table):
    """A fixed input: value and unit."""

    value: FiniteFloat
    unit: str = "1"


class Reference(_Table):
    """A known value of an output, drawn and judged beside the predictions."""

    output: str
    value: FiniteFloat
    unit: str = "1"
    label: str
    kind: Literal["observed", "limit", "simulated"] = "observed"


class Design(_Table):
    """``[design]``: method, size and replicates."""

    method: Literal["monte-carlo", "latin-hypercube", "sobol"] = "latin-hypercube"
    n: Annotated[int, Field(gt=0, le=LARGEST_DESIGN)] = 2000
    replicate_size: Annotated[int, Field(gt=0, le=LARGEST_DESIGN)] | None = None

    @model_validator(mode="after")
    def _multiple(self) -> "Design":
        size = self.size
        if self.method == "monte-carlo" and size != 1:
            raise ValueError("replicate_size does not apply to monte-carlo: leave it out")
        if self.method != "monte-carlo" and size < 2:
            raise ValueError("replicate_size must be 2 or more: intervals come from replicates")
        if self.method == "sobol" and size & (size - 1):
            raise ValueError(f"replicate_size ({size}) of a sobol design must be a power of two")
        if self.n % size:
            raise ValueError(
                f"n ({self.n}) must be a multiple of replicate_size ({size}), "
                f"e.g. {size * max(1, round(self.n / size))}"
            )
        return self

    @property
    def size(self) -> int:
        """Samples of one replicate."""
        return self.replicate_size or designs.DEFAULT_REPLICATE_SIZE[self.method]


class Dependence(_Table):
    """``[dependence]``: correlations of normal scores, pairs of inputs."""

    correlations: list[Annotated[tuple[str, str, FiniteFloat], Strict(False)]] = []


class Report(_Table):
    """``[report]``: outputs to draw (see ``report_outputs``), references, histories kept."""

    outputs: Annotated[list[str], Field(min_length=1)] | None = None
    histories: NonNegativeInt = 8
    references: list[Reference] = []


class _Common(_Table):
    format: Literal["mcstudy-study/1"]
    name: str
    title: str
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] = 0
    model: ModelChoice
    fixed: dict[str, Value] = {}

    @model_validator(mode="after")
    def _plain_name(self) -> "_Common":
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,79}", self.name) or ".." in self.name:
            raise ValueError(
                f"name {self.name!r} must be letters, digits, '_', '-' or '.', as it names a folder"
            )
        return self


class MonteCarloStudy(_Common):
    """``kind = "monte-carlo"``: sample inputs, run, describe the outputs."""

    kind: Literal["monte-carlo"]
    design: Design = Design()
    inputs: Annotated[dict[str, Distribution], Field(min_length=1)]
    dependence: Dependence = Dependence()
    max_failure_rate: Annotated[float, Field(ge=0.0, le=1.0)] = 0.02
    report: Report = Report()


class ComparisonRow(_Table):
    """A row of a table to print beside our run."""

    label: str
    values: dict[str, FiniteFloat]


class ComparisonTable(_Table):
    """A table of outputs: title, outputs with the unit of the printed values, rows."""

    title: str
    units: dict[str, str]
    rows: list[ComparisonRow]


class Reconstruction(_Common):
    """``kind = "reconstruction"``: one nominal run, printed and drawn."""

    kind: Literal["reconstruction"]
    tables: list[ComparisonTable] = []
    strip_times: Annotated[list[FiniteFloat], Field(min_length=1)] = [0.0, 0.02, 0.04, 0.06, 0.08]


Study = MonteCarloStudy | Reconstruction
_STUDY: TypeAdapter[Study] = TypeAdapter(Annotated[Study, Field(discriminator="kind")])


def load_study(path: Path | str) -> Study:
    """Read and check a study file.

    Raises
    ------
    UserError
        If the file cannot be read or something in it is wrong; the message names the file and the
        place in it.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: cannot be read ({error})") from None
    return parse_study(text, str(path))


def parse_study(text: str, source: str = "study") -> Study:
    """Check the text of a study file; see ``load_study``."""
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{source}: not valid TOML: {_one_line(error)}") from None
    try:
        return _STUDY.validate_python(table)
    except ValidationError as error:
        raise UserError(f"{source}: {first_problem(error)}") from None


def first_problem(error: ValidationError) -> str:
    """Return the first problem of a table, on one line, with its place."""
    problem = error.errors(include_url=False)[0]
    parts = [str(part) for part in problem["loc"]]
    # Pydantic puts the chosen kind of study and of distribution into the place; the file does not.
    if parts and parts[0] in ("monte-carlo", "reconstruction"):
        parts = parts[1:]
    if len(parts) > 2 and parts[0] == "inputs" and parts[2] in DISTRIBUTION_NAMES:
        del parts[2]
    mixed = len(parts) > 2 and parts[:2] == ["model", "options"]
    if mixed:
        parts = parts[:3]
    place = _one_line(".".join(parts) or "study")
    if mixed:
        return f"{place}: must be a text, a number or a list of pairs of numbers"
    kind = problem["type"]
    if kind == "extra_forbidden":
        return f"{place}: unknown key"
    if kind == "missing":
        return f"{place}: missing"
    message = _one_line(problem["msg"].removeprefix("Value error, "))
    given = problem.get("input")
    shown = f" (given {_one_line(repr(given))})" if isinstance(given, str | int | float) else ""
    return f"{place}: {message}{shown}"


def _one_line(text: object, longest: int = 200) -> str:
    """Return a text on one line, cut where it is long."""
    line = " ".join(str(text).split())
    return line if len(line) <= longest else line[:longest] + "..."


def fixed_values(study: Study, model: Simulator) -> dict[str, float]:
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
    uniforms = designs.draw(
        study.design.method, study.design.n, study.design.size, len(study.inputs), study.seed
    )
    try:
        sampled = sample_values(uniforms, study.inputs, factor)
    except ValueError as error:
        raise UserError(str(error)) from None
    fixed = fixed_values(study, model)
    columns: dict[str, Array] = {}
    for item in model.inputs:
        if item.name in sampled:
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
            columns[item.name] = np.full(study.design.n, fixed.get(item.name, item.nominal))
    return columns


USUAL_OUTPUTS = ("hic15", "throw_distance", "wad")


def report_outputs(study: MonteCarloStudy, model: Simulator) -> list[str]:
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
    """Raise ``UserError`` if the model lacks one of the outputs."""
    known = [item.name for item in model.outputs]
    for name in names:
        if name not in known:
            raise UserError(
                f"{place}: model {model.name!r} has no output {name!r}; it has {', '.join(known)}"
            )


def numbers_digest(study: MonteCarloStudy, model: Simulator) -> dict[str, str]:
    """Return, by topic, what changes the numbers of a study, as canonical JSON.

    Two studies whose digests are equal give the same row for the same run id; n is left out
    because a larger design begins with the smaller one.
    """
    table = study.model_dump(mode="json")
    topics = {
        "model": [table["model"], model.version],
        "seed": table["seed"],
        "design.method": table["design"]["method"],
        "design.replicate_size": study.design.size,
        "dependence": table["dependence"],
        "inputs": list(table["inputs"]),
    }
    topics |= {f"inputs.{name}": entry for name, entry in table["inputs"].items()}
    topics |= {f"fixed.{name}": entry for name, entry in table["fixed"].items()}
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
