"""The study file of a model comparison."""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from mcstudy.studyfile.schema import (
    STRIP_TIMES,
    ComparisonTable,
    Design,
    ModelsStudy,
    OutputReport,
)


class ComparisonReport(OutputReport):
    """``[report]`` of a comparison: outputs to compare, times at which nominal runs are drawn."""

    strip_times: Annotated[list[FiniteFloat], Field(min_length=1)] = STRIP_TIMES


class ModelComparison(ModelsStudy):
    """``kind = "model-comparison"``: the same inputs through two or more models."""

    kind: Literal["model-comparison"]
    design: Design = Design()
    report: ComparisonReport = ComparisonReport()
    tables: list[ComparisonTable] = []
