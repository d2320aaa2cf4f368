"""The study file of a Morris study."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from mcstudy.sensitivity.blocks import MIN_BLOCKS
from mcstudy.studyfile.schema import FactorReport, FactorStudy, StudyTable


class MorrisDesign(StudyTable):
    """``[design]`` of a Morris study: trajectories and levels of the grid."""

    n: Annotated[int, Field(ge=MIN_BLOCKS, le=100_000)] = 50
    levels: Annotated[int, Field(ge=4, le=20)] = 4

    @model_validator(mode="after")
    def _even(self) -> "MorrisDesign":
        if self.levels % 2:
            raise ValueError(f"levels ({self.levels}) must be even, or the grid is biased")
        return self


class MorrisStudy(FactorStudy):
    """``kind = "morris"``: screening of many factors."""

    kind: Literal["morris"]
    design: MorrisDesign = MorrisDesign()
    report: FactorReport = FactorReport()

    def design_topics(self) -> dict[str, Any]:
        """Return the parts of the design that affect the values of a run, by topic."""
        levels = {"design.levels": self.design.levels, "design.grid": "shifted"}
        return super().design_topics() | levels
