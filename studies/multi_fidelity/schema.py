"""The study file of a multi-fidelity study."""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, model_validator

from mcstudy import units
from mcstudy.injury.functions import risk_function
from mcstudy.studyfile.distributions import Unit
from mcstudy.studyfile.schema import (
    LARGEST_DESIGN,
    ModelChoice,
    ModelsStudy,
    OutputReport,
    StudyTable,
)


class FidelityModel(ModelChoice):
    """``[models.<label>]``: a model, and a finished study of it whose runs are taken over.

    ``cost`` is the time of a run (s); it is measured where it is not stated, so that another
    machine allots other numbers of runs.
    """

    reuse: str | None = None
    cost: Annotated[FiniteFloat, Field(gt=0.0)] | None = None


class Budget(StudyTable):
    """``[budget]``: computing time of one core, and how it is allotted.

    ``pilot`` runs of every model measure costs and correlations, ``output`` is the one whose mean
    the allotment serves best, ``reference`` the model whose distribution is estimated, by default
    the dearest.
    """

    cpu_time: Annotated[FiniteFloat, Field(gt=0.0)]
    unit: Unit = "s"
    output: str
    pilot: Annotated[int, Field(ge=4, le=LARGEST_DESIGN)] = 20
    replicates: Annotated[int, Field(ge=2, le=1000)] = 10
    reference: str | None = None

    @model_validator(mode="after")
    def _whole_replicates(self) -> "Budget":
        units.factor(self.unit, "s")
        if self.pilot % self.replicates or self.pilot < 2 * self.replicates:
            raise ValueError(
                f"pilot ({self.pilot}) must be 2 times replicates ({self.replicates}) or more, and "
                "a multiple of it"
            )
        return self

    @property
    def seconds(self) -> float:
        """The computing time in s."""
        return self.cpu_time * units.factor(self.unit, "s")


class Risk(StudyTable):
    """An entry of ``report.risks``: probability of an injury of an AIS level or worse."""

    function: str
    level: Annotated[int, Field(ge=1, le=6)]
    age: Annotated[FiniteFloat, Field(gt=0.0)] = 40.0

    @model_validator(mode="after")
    def _known(self) -> "Risk":
        risk_function(self.function).risk(self.level, 0.0)
        return self


class FidelityReport(OutputReport):
    """``[report]``: outputs, the limits whose exceedance is estimated, and injury risks."""

    limits: dict[str, Annotated[list[FiniteFloat], Field(min_length=1)]] = {}
    risks: list[Risk] = []


class FidelityStudy(ModelsStudy):
    """``kind = "multi-fidelity"``: the distribution of the dearest of several models."""

    kind: Literal["multi-fidelity"]
    models: Annotated[dict[str, FidelityModel], Field(min_length=2, max_length=6)]
    budget: Budget
    report: FidelityReport = FidelityReport()

    @model_validator(mode="after")
    def _known_reference(self) -> "FidelityStudy":
        named = self.budget.reference
        if named is not None and named not in self.models:
            raise ValueError(f"budget.reference: {named!r} is none of {', '.join(self.models)}")
        return self
