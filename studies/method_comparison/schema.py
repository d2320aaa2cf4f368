"""The study file of a method comparison."""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, model_validator

from mcstudy.studyfile.schema import (
    STRIP_TIMES,
    AnyStudy,
    ComparisonTable,
    ModelChoice,
    check_folder_name,
)


class MethodComparison(AnyStudy):
    """``kind = "method-comparison"``: one set of inputs through two or more models."""

    kind: Literal["method-comparison"]
    models: Annotated[dict[str, ModelChoice], Field(min_length=2)]
    tables: Annotated[list[ComparisonTable], Field(min_length=1)]
    strip_times: Annotated[list[FiniteFloat], Field(min_length=1)] = STRIP_TIMES

    @model_validator(mode="after")
    def _plain_labels(self) -> "MethodComparison":
        for label in self.models:
            check_folder_name(label, "models: ")
        return self
