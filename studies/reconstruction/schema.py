"""The study file of a reconstruction."""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, field_validator

from mcstudy.studyfile.schema import (
    STRIP_TIMES,
    CommonStudy,
    ComparisonTable,
    ModelChoice,
    StudyTable,
)


class Variant(StudyTable):
    """``[[variants]]``: a model that takes the same inputs, and its label."""

    label: Annotated[str, Field(min_length=1, max_length=80)]
    model: ModelChoice


class Reconstruction(CommonStudy):
    """``kind = "reconstruction"``: one nominal run, printed and drawn."""

    kind: Literal["reconstruction"]
    tables: list[ComparisonTable] = []
    variants: list[Variant] = []
    strip_times: Annotated[list[FiniteFloat], Field(min_length=1)] = STRIP_TIMES

    @field_validator("variants")
    @classmethod
    def _labels_differ(cls, variants: list[Variant]) -> list[Variant]:
        labels = [variant.label for variant in variants]
        for label in labels:
            if labels.count(label) > 1:
                raise ValueError(f"the label {label!r} stands twice")
        return variants
