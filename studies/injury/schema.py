"""The study file of an injury study."""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, model_validator

from mcstudy.studyfile.distributions import Distribution
from mcstudy.studyfile.schema import (
    CommonStudy,
    Dependence,
    Design,
    Limits,
    Options,
    StudyTable,
    Value,
    check_folder_name,
)

REFERENCE, AS_IT_STANDS = "reference", "reference scenario"
"""Name and title of the scenario of an injury study without changes."""
HEAD = "head"
"""All mechanisms of injury together."""


class MechanismChoice(StudyTable):
    """``[mechanisms.<name>]``: alternative risk functions with weights."""

    functions: Annotated[dict[str, Annotated[FiniteFloat, Field(gt=0.0)]], Field(min_length=1)]


class Front(StudyTable):
    """``[fronts.<name>]``: a car front, its share of the impacts and its model options."""

    share: Annotated[FiniteFloat, Field(gt=0.0)] = 1.0
    options: Options = {}


class Scenario(StudyTable):
    """``[scenarios.<name>]``: changes against the reference scenario."""

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
                check_folder_name(name, f"{table}: ")
        if HEAD in self.mechanisms:
            raise ValueError(f"mechanisms.{HEAD}: this name is that of all mechanisms together")
        titles = [AS_IT_STANDS, *(s.title for s in self.scenarios.values())]
        for title in titles:
            if titles.count(title) > 1:
                raise ValueError(f"scenarios: two have the title {title!r}")
        if REFERENCE in self.scenarios:
            raise ValueError(
                f"scenarios.{REFERENCE}: this name is that of the study without changes"
            )
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
