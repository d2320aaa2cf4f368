"""The study file of a posterior, and the evidence file for an existing bank of runs."""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, model_validator

from mcstudy.injury.functions import risk_function
from mcstudy.studyfile.distributions import Distribution, Unit
from mcstudy.studyfile.schema import Design, DesignedStudy, StudyTable

Positive = Annotated[FiniteFloat, Field(gt=0.0)]
NotNegative = Annotated[FiniteFloat, Field(ge=0.0)]


class EvidenceEntry(StudyTable):
    """``[evidence.<input or output>]``: a value with its uncertainty, bounds, or an event.

    ``happened`` says whether there is such an output at all: a head that did not strike the car has
    no wrap-around distance.
    """

    value: FiniteFloat | None = None
    sd: Positive | None = None
    at_least: FiniteFloat | None = None
    at_most: FiniteFloat | None = None
    happened: bool | None = None
    unit: Unit = "1"

    @model_validator(mode="after")
    def _one_kind(self) -> "EvidenceEntry":
        bounded = self.at_least is not None or self.at_most is not None
        kinds = [self.value is not None, bounded, self.happened is not None]
        if sum(kinds) != 1:
            raise ValueError("give one of value, at_least or at_most (or both), happened")
        if self.value is not None and self.sd is None:
            raise ValueError("sd: a value needs its standard uncertainty")
        if self.happened is not None and self.sd is not None:
            raise ValueError("sd: an event has none")
        if (
            self.at_least is not None
            and self.at_most is not None
            and not self.at_least < self.at_most
        ):
            raise ValueError(
                f"at_least ({self.at_least:g}) must be below at_most ({self.at_most:g})"
            )
        return self


class DiscrepancyEntry(StudyTable):
    """``[discrepancy.<output>]``: standard deviation of the model's own error.

    As a share of the simulated value (``relative``), in a unit (``sd``), or both.
    """

    relative: NotNegative = 0.0
    sd: NotNegative = 0.0
    unit: Unit = "1"
    source: str = ""


class PropositionEntry(StudyTable):
    """``[propositions.<label>]``: that an input or output lies above, below or between bounds."""

    of: str
    above: FiniteFloat | None = None
    below: FiniteFloat | None = None
    unit: Unit = "1"

    @model_validator(mode="after")
    def _bounded(self) -> "PropositionEntry":
        if self.above is None and self.below is None:
            raise ValueError("give above, below or both")
        return self


class AvoidabilityEntry(StudyTable):
    """``[avoidability]``: what would have happened at other speeds, with the same reaction.

    ``braking_distance`` is how far the car braked before the impact, ``reaction_time`` what passed
    before that since the danger could be seen.
    """

    speeds: Annotated[list[Positive], Field(min_length=1, max_length=8)]
    unit: Unit = "km/h"
    braking_distance: Distribution
    reaction_time: Distribution
    friction: str = "friction_tyre_road"


class InjuryEntry(StudyTable):
    """``[injury]``: the recorded AIS of the head, and risk functions to compare it with."""

    recorded: Annotated[int, Field(ge=0, le=6)] | None = None
    functions: Annotated[list[str], Field(min_length=1)] = ["nhtsa_lognormal", "prasad_mertz"]
    age: Positive = 40.0

    @model_validator(mode="after")
    def _known(self) -> "InjuryEntry":
        for name in self.functions:
            risk_function(name)
        return self


class MeasurementEntry(StudyTable):
    """``[measurements.<input or output>]``: what could still be measured, and how well."""

    sd: Positive
    unit: Unit = "1"


class EvidenceTables(StudyTable):
    """Tables that posterior studies and evidence files share."""

    target: str = "impact_speed"
    evidence: Annotated[dict[str, EvidenceEntry], Field(min_length=1)]
    discrepancy: dict[str, DiscrepancyEntry] = {}
    propositions: dict[str, PropositionEntry] = {}
    priors: dict[str, Distribution] = {}
    avoidability: AvoidabilityEntry | None = None
    injury: InjuryEntry | None = None
    measurements: dict[str, MeasurementEntry] = {}
    also: list[str] = []

    @model_validator(mode="after")
    def _something_measured(self) -> "EvidenceTables":
        if not any(entry.value is not None for entry in self.evidence.values()):
            raise ValueError("evidence: at least one item must have a value")
        return self


class EvidenceFile(EvidenceTables):
    """A file of evidence for ``mcstudy infer``."""

    format: Literal["mcstudy-evidence/1"]
    title: str


class PosteriorStudy(DesignedStudy, EvidenceTables):
    """``kind = "posterior"``: what evidence says of the inputs of a crash."""

    kind: Literal["posterior"]
    design: Design = Design(method="sobol", n=4096, replicate_size=1024)
