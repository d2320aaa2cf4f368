"""The study file of a Sobol' study."""

from typing import Annotated, Any, Literal

from pydantic import Field, FiniteFloat, model_validator

from mcstudy.studyfile.schema import FactorReport, FactorStudy, StudyTable


class SaltelliDesign(StudyTable):
    """``[design]`` of a Sobol' study: base points, doubled up to the tolerance of the indices."""

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

    def design_topics(self) -> dict[str, Any]:
        """Return the parts of the design that affect the values of a run, by topic."""
        return super().design_topics() | {"design.second_order": self.design.second_order}
