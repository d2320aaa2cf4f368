"""The study file of a model comparison."""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, model_validator

from mcstudy.studyfile.distributions import Distribution
from mcstudy.studyfile.schema import (
    STRIP_TIMES,
    AnyStudy,
    ComparisonTable,
    Dependence,
    Design,
    Limits,
    ModelChoice,
    OutputReport,
    check_folder_name,
)


class ComparisonReport(OutputReport):
    """``[report]`` of a comparison: outputs to compare, times at which nominal runs are drawn."""

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
            check_folder_name(label, "models: ")
        return self
