"""What a study file may hold: one class a table, one class a kind of study."""

import re
from typing import Annotated, Literal

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
from mcstudy.sensitivity.blocks import FEWEST_BLOCKS
from mcstudy.studyfile.distributions import Distribution, Unit

LARGEST_DESIGN = 10_000_000
"""Runs that one study may have; their table fits a machine's memory."""
LARGEST_SEED = 2**63 - 1
RUN_TIME = 600.0
"""s that one run may take by default before its process is ended."""
Options = dict[str, str | FiniteFloat | list[list[FiniteFloat]]]
"""Options of a model."""


class StudyTable(BaseModel):
    """A table of a study file: strict, and nothing unknown in it."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def _check_folder_name(name: str, place: str = "") -> None:
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
    """A known value of an output, drawn and judged beside the predictions."""

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


class Report(StudyTable):
    """``[report]``: outputs to draw (see ``report_outputs``), references, histories kept."""

    outputs: Annotated[list[str], Field(min_length=1)] | None = None
    histories: NonNegativeInt = 8
    references: list[Reference] = []


class AnyStudy(StudyTable):
    """What every kind of study has."""

    format: Literal["mcstudy-study/1"]
    name: str
    title: str
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] = 0
    fixed: dict[str, Value] = {}

    @model_validator(mode="after")
    def _plain_name(self) -> "AnyStudy":
        _check_folder_name(self.name)
        return self


class CommonStudy(AnyStudy):
    """What every kind of study of one model has."""

    model: ModelChoice
    effects: dict[str, dict[str, FiniteFloat]] = {}


class Limits(StudyTable):
    """How much may go wrong: the share of runs that may fail, and s that one run may take."""

    max_failure_rate: Annotated[float, Field(ge=0.0, le=1.0)] = 0.02
    run_time: Annotated[FiniteFloat, Field(ge=0.01, le=1e6)] = RUN_TIME


class MonteCarloStudy(CommonStudy, Limits):
    """``kind = "monte-carlo"``: sample inputs, run, describe the outputs."""

    kind: Literal["monte-carlo"]
    design: Design = Design()
    inputs: Annotated[dict[str, Distribution], Field(min_length=1)]
    dependence: Dependence = Dependence()
    report: Report = Report()


STRIP_TIMES = [0.0, 0.02, 0.04, 0.06, 0.08]
"""s after first contact at which a crash is drawn, as the case's paper does."""


class ComparisonRow(StudyTable):
    """A row of a table to print beside our run."""

    label: str
    values: dict[str, FiniteFloat]
    kind: Literal["simulated", "observed"] = "simulated"


class ComparisonTable(StudyTable):
    """A table of outputs: title, outputs with the unit of the printed values, rows."""

    title: str
    units: dict[str, Unit]
    rows: list[ComparisonRow]


class Reconstruction(CommonStudy):
    """``kind = "reconstruction"``: one nominal run, printed and drawn."""

    kind: Literal["reconstruction"]
    tables: list[ComparisonTable] = []
    strip_times: Annotated[list[FiniteFloat], Field(min_length=1)] = STRIP_TIMES


class FactorStudy(CommonStudy, Limits):
    """What kinds of study have that exchange one factor, an input or a group, after the other."""

    kind: str
    inputs: Annotated[dict[str, Distribution], Field(min_length=1)]
    dependence: Dependence = Dependence()
    groups: dict[str, Annotated[list[str], Field(min_length=1)]] = {}

    @model_validator(mode="after")
    def _grouped_once(self) -> "FactorStudy":
        for table, taken in (("inputs", [*self.inputs]), ("groups", [*self.groups])):
            if DUMMY in taken:
                raise ValueError(
                    f"{table}.{DUMMY}: this name is the factor's that stands for no input"
                )
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


class FactorReport(StudyTable):
    """``[report]`` of such a study: outputs to rank, resamples of the intervals."""

    outputs: Annotated[list[str], Field(min_length=1)] | None = None
    resamples: Annotated[int, Field(ge=100, le=100_000)] = 1000


class SaltelliDesign(StudyTable):
    """``[design]`` of a Sobol' study: base points, doubled until the indices are known."""

    n: Annotated[int, Field(ge=64, le=2**20)] = 1024
    start: Annotated[int, Field(ge=64, le=2**20)] = 128
    tolerance: Annotated[FiniteFloat, Field(gt=0.0)] | None = None
    second_order: bool = False

    @model_validator(mode="after")
    def _powers(self) -> "SaltelliDesign":
        for name in ("n", "start"):
            value = getattr(self, name)
            if value & (value - 1):
                raise ValueError(f"{name} ({value}) must be a power of two")
        return self


class SobolStudy(FactorStudy):
    """``kind = "sobol"``: how much of the variance of each output each factor explains."""

    kind: Literal["sobol"]
    design: SaltelliDesign = SaltelliDesign()
    report: FactorReport = FactorReport()


class MorrisDesign(StudyTable):
    """``[design]`` of a Morris study: trajectories and levels of the grid."""

    n: Annotated[int, Field(ge=FEWEST_BLOCKS, le=100_000)] = 50
    levels: Annotated[int, Field(ge=4, le=20)] = 4

    @model_validator(mode="after")
    def _even(self) -> "MorrisDesign":
        if self.levels % 2:
            raise ValueError(f"levels ({self.levels}) must be even, or the grid is biased")
        return self


class MorrisStudy(FactorStudy):
    """``kind = "morris"``: which of many factors matter at all."""

    kind: Literal["morris"]
    design: MorrisDesign = MorrisDesign()
    report: FactorReport = FactorReport()


class MechanismChoice(StudyTable):
    """``[mechanisms.<name>]``: risk functions between which nobody can choose, with weights."""

    functions: Annotated[dict[str, Annotated[FiniteFloat, Field(gt=0.0)]], Field(min_length=1)]


class Front(StudyTable):
    """``[fronts.<name>]``: a car front, the share of impacts that it has, its model options."""

    share: Annotated[FiniteFloat, Field(gt=0.0)] = 1.0
    options: Options = {}


class Scenario(StudyTable):
    """``[scenarios.<name>]``: what is changed against the study as it stands."""

    title: Annotated[str, Field(min_length=1)]
    inputs: dict[str, Distribution] = {}
    fixed: dict[str, Value] = {}


class ObservedInjury(StudyTable):
    """``[[observed]]``: an injury of the real case."""

    label: Annotated[str, Field(min_length=1)]
    mechanism: str
    level: Annotated[int, Field(ge=1, le=6)]


class Limit(StudyTable):
    """``[limit]``: a limit of an output that is judged as a classifier of injury."""

    output: str = "hic15"
    value: FiniteFloat = 700.0
    level: Annotated[int, Field(ge=1, le=6)] = 3


REFERENCE, AS_IT_STANDS = "reference", "as it stands"
"""Name and title of the scenario of an injury study that changes nothing."""
HEAD = "head"
"""All mechanisms of injury together."""


class InjuryStudy(CommonStudy, Limits):
    """``kind = "injury"``: from runs to AIS outcomes, for scenarios and car fronts."""

    kind: Literal["injury"]
    design: Design = Design()
    inputs: Annotated[dict[str, Distribution], Field(min_length=1)]
    dependence: Dependence = Dependence()
    age: Annotated[FiniteFloat, Field(gt=0.0, lt=130.0)] | None = None
    mechanisms: Annotated[dict[str, MechanismChoice], Field(min_length=1)]
    together: Literal["dependent", "independent"] = "dependent"
    fronts: dict[str, Front] = {}
    scenarios: dict[str, Scenario] = {}
    observed: list[ObservedInjury] = []
    limit: Limit = Limit()

    @model_validator(mode="after")
    def _consistent(self) -> "InjuryStudy":
        for table, names in (("fronts", [*self.fronts]), ("scenarios", [*self.scenarios])):
            for name in names:
                _check_folder_name(name, f"{table}: ")
        if HEAD in self.mechanisms:
            raise ValueError(f"mechanisms.{HEAD}: this name is that of all mechanisms together")
        titles = [AS_IT_STANDS, *(s.title for s in self.scenarios.values())]
        for title in titles:
            if titles.count(title) > 1:
                raise ValueError(f"scenarios: two have the title {title!r}")
        if REFERENCE in self.scenarios:
            raise ValueError(f"scenarios.{REFERENCE}: this name is the study's as it stands")
        for name, scenario in self.scenarios.items():
            for key in scenario.fixed:
                if key in scenario.inputs:
                    raise ValueError(f"scenarios.{name}: {key} is both sampled and fixed")
                children = [k for k, entry in self.inputs.items() if key in entry.parents]
                if children:
                    raise ValueError(
                        f"scenarios.{name}.fixed.{key}: {children[0]} depends on it; give it a "
                        f"narrow distribution in scenarios.{name}.inputs.{key} instead"
                    )
            for key in scenario.inputs:
                if key not in self.inputs:
                    raise ValueError(
                        f"scenarios.{name}.inputs.{key}: only inputs that the study samples can "
                        "be sampled otherwise; use fixed"
                    )
        for k, entry in enumerate(self.observed):
            if entry.mechanism not in self.mechanisms:
                raise ValueError(
                    f"observed[{k}]: there is no mechanism {entry.mechanism!r}, only "
                    f"{', '.join(self.mechanisms)}"
                )
        return self


class ComparisonReport(StudyTable):
    """``[report]`` of a comparison: outputs to compare, times at which nominal runs are drawn."""

    outputs: Annotated[list[str], Field(min_length=1)] | None = None
    strip_times: Annotated[list[FiniteFloat], Field(min_length=1)] = STRIP_TIMES


class ModelComparison(AnyStudy, Limits):
    """``kind = "model-comparison"``: the same inputs through two or more models."""

    kind: Literal["model-comparison"]
    models: Annotated[dict[str, ModelChoice], Field(min_length=2)]
    design: Design = Design()
    inputs: Annotated[dict[str, Distribution], Field(min_length=1)]
    dependence: Dependence = Dependence()
    report: ComparisonReport = ComparisonReport()
    tables: list[ComparisonTable] = []

    @model_validator(mode="after")
    def _plain_labels(self) -> "ModelComparison":
        for label in self.models:
            _check_folder_name(label, "models: ")
        return self


Study = MonteCarloStudy | Reconstruction | SobolStudy | MorrisStudy | InjuryStudy | ModelComparison
SampledStudy = MonteCarloStudy | SobolStudy | MorrisStudy
