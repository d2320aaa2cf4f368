"""Every number of a report of given-data sensitivity."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mcstudy.figures.screening import Ranked
from mcstudy.sensitivity.main_effects import MainEffect
from mcstudy.typed_json import Real


@dataclass(frozen=True)
class Measure:
    """A measure of sensitivity: its noise line, NaN if the output does not vary, and by input."""

    noise: Real
    inputs: Mapping[str, Ranked]


@dataclass(frozen=True)
class MeasuredOutput:
    """Sensitivities of an output.

    Attributes
    ----------
    unit : unit of the output.
    runs : number of runs with a value.
    measures : by name of the measure.
    """

    unit: str
    runs: int
    measures: Mapping[str, Measure]


@dataclass(frozen=True)
class GivenDataAnalysis:
    """Every number of the report.

    Attributes
    ----------
    source : folder of the study.
    kind, title : of the study.
    runs : number of complete runs.
    dependent : inputs that depend on each other.
    outputs : sensitivities by output.
    main_effects : by output and input.
    """

    source: str
    kind: str
    title: str
    runs: int
    dependent: Sequence[str]
    outputs: Mapping[str, MeasuredOutput]
    main_effects: Mapping[str, Mapping[str, MainEffect]]
