"""The study file of a reconstruction."""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from mcstudy.studyfile.schema import STRIP_TIMES, CommonStudy, ComparisonTable


class Reconstruction(CommonStudy):
    """``kind = "reconstruction"``: one nominal run, printed and drawn."""

    kind: Literal["reconstruction"]
    tables: list[ComparisonTable] = []
    strip_times: Annotated[list[FiniteFloat], Field(min_length=1)] = STRIP_TIMES
