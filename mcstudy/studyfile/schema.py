"""Tables that study files of several kinds share: one class a table."""

import re
from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    NonNegativeInt,
    Strict,
    model_validator,
)

from mcstudy.sampling import designs
from mcstudy.sampling.factors import DUMMY
from mcstudy.studyfile.distributions import Distribution, Unit

LARGEST_DESIGN = 10_000_000
"""Largest number of runs of a study; their table fits in memory."""
LARGEST_SEED = 2**63 - 1
RUN_TIME = 600.0
"""s that one run may take by default before its process is ended."""
Options = dict[str, str | FiniteFloat | list[list[FiniteFloat]]]
"""Options of a model."""


class StudyTable(BaseModel):
    """A table of a study file: strict, and nothing unknown in it."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def check_folder_name(name: str, place: str = "") -> None:
    """Raise ``ValueError`` if a name, given at a place of the file, cannot name a folder."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,79}", name) or ".." in name:
        raise ValueError(
            f"{place}name {name!r} must be letters, digits, '_', '-' or '.', as it names a folder"
        )


class ModelChoice(StudyTable):
    """``[model]``: name and options such as ``vehicle`` or ``hood_curve``."""

    name: str
    options: Options = {}


class Value(StudyTable):
    """A fixed input: value and unit."""

    value: FiniteFloat
    unit: Unit = "1"


class Reference(StudyTable):
    """A reference value of an output, drawn and assessed beside the predictions."""

    output: str
    value: FiniteFloat
    unit: Unit = "1"
    label: str
    kind: Literal["observed", "limit", "simulated"] = "observed"


class Design(StudyTable):
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


class Dependence(StudyTable):
    """``[dependence]``: correlations of normal scores, pairs of inputs."""

    correlations: list[Annotated[tuple[str, str, FiniteFloat], Strict(False)]] = []


class OutputReport(StudyTable):
    """``[report]`` of any study of runs: its outputs (see ``report_outputs``)."""

    outputs: Annotated[list[str], Field(min_length=1)] | None = None


class Report(OutputReport):
    """``[report]`` of a Monte Carlo study: outputs to draw, references, histories kept."""

    histories: NonNegativeInt = 8
    references: list[Reference] = []


class AnyStudy(StudyTable):
    """Keys of every kind of study; ``kind`` names it."""

    format: Literal["mcstudy-study/1"]
    kind: str
    name: str
    title: str
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] = 0
    fixed: dict[str, Value] = {}

    @model_validator(mode="after")
    def _plain_name(self) -> "AnyStudy":
        check_folder_name(self.name)
        return self


class CommonStudy(AnyStudy):
    """Keys of every kind of study of one model."""

    model: ModelChoice
    effects: dict[str, dict[str, FiniteFloat]] = {}


class Limits(StudyTable):
    """Limits: the largest share of failed runs, and the longest time of one run (s)."""

    max_failure_rate: Annotated[float, Field(ge=0.0, le=1.0)] = 0.02
    run_time: Annotated[FiniteFloat, Field(ge=0.01, le=1e6)] = RUN_TIME


STRIP_TIMES = [0.0, 0.02, 0.04, 0.06, 0.08]
"""s after first contact at which a crash is drawn, as the case's paper does."""


class ComparisonRow(StudyTable):
    """A row of a table to print beside the simulated run."""

    label: str
    values: dict[str, FiniteFloat]
    kind: Literal["simulated", "observed"] = "simulated"


class ComparisonTable(StudyTable):
    """A table of outputs: title, outputs with the unit of the printed values, rows."""

    title: str
    units: dict[str, Unit]
    rows: list[ComparisonRow]


class SampledStudy(CommonStudy, Limits):
    """Keys of studies that sample the inputs of one model into one table of runs."""

    inputs: Annotated[dict[str, Distribution], Field(min_length=1)]
    dependence: Dependence = Dependence()
    report: OutputReport = OutputReport()

    @abstractmethod
    def design_topics(self) -> dict[str, Any]:
        """Return the design settings that change the numbers of a run, by topic."""


class DesignedStudy(SampledStudy):
    """Keys of studies whose runs are one design: a sample of the inputs."""

    design: Design = Design()

    def design_topics(self) -> dict[str, Any]:
        """Return the parts of the design that affect the values of a run, by topic."""
        return {
            "design.method": self.design.method,
            "design.replicate_size": self.design.size,
        }


class ModelsStudy(AnyStudy, Limits):
    """Keys of studies that run several models, by label, with the same inputs."""

    models: Annotated[Mapping[str, ModelChoice], Field(min_length=2)]
    inputs: Annotated[dict[str, Distribution], Field(min_length=1)]
    dependence: Dependence = Dependence()
    report: OutputReport = OutputReport()

    @model_validator(mode="after")
    def _plain_labels(self) -> "ModelsStudy":
        for label in self.models:
            check_folder_name(label, "models: ")
        return self


class FactorStudy(SampledStudy):
    """Keys of studies that exchange one factor, an input or a group, after the other."""

    groups: dict[str, Annotated[list[str], Field(min_length=1)]] = {}

    @model_validator(mode="after")
    def _grouped_once(self) -> "FactorStudy":
        for table, taken in (("inputs", [*self.inputs]), ("groups", [*self.groups])):
            if DUMMY in taken:
                raise ValueError(f"{table}.{DUMMY}: this name is reserved for the dummy factor")
        seen: dict[str, str] = {}
        for group, names in self.groups.items():
            if group in self.inputs:
                raise ValueError(f"groups.{group}: an input has this name already")
            for name in names:
                if name not in self.inputs:
                    raise ValueError(f"groups.{group}: {name!r} is not a sampled input")
                if name in seen:
                    raise ValueError(f"input {name!r} is in groups {seen[name]!r} and {group!r}")
                seen[name] = group
        return self

    def design_topics(self) -> dict[str, Any]:
        """Return the design settings that change the numbers of a run, by topic."""
        return {
            "kind": self.kind,
            "groups": {group: sorted(names) for group, names in self.groups.items()},
        }


class FactorReport(OutputReport):
    """``[report]`` of a factor study: outputs to rank, resamples of the intervals."""

    resamples: Annotated[int, Field(ge=100, le=100_000)] = 1000
