"""Every number of an injury report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mcstudy.statistics import Estimate
from mcstudy.typed_json import Real
from studies.runs import RunEnds


@dataclass(frozen=True)
class LimitOf:
    """The limit of the study: output, its value and unit, and the AIS level that it is to tell."""

    output: str
    value: float
    level: int
    unit: str


@dataclass(frozen=True)
class Change(Estimate):
    """Change of a probability by a scenario; ``relative`` is NaN where the reference is zero."""

    relative: Real


@dataclass(frozen=True)
class Association:
    """Rank correlations of predictors with the drawn AIS, and its proportional-odds regression.

    Attributes
    ----------
    runs : number of runs with a value of every predictor.
    rank : Spearman's and Kendall's coefficient by predictor.
    odds : factor on the odds of a worse AIS for one standard deviation, by predictor.
    constant : predictors that do not vary.
    levels : AIS levels that were drawn.
    no_odds : reason for there being no regression.
    explained : McFadden's share of the log likelihood.
    """

    runs: int
    rank: Mapping[str, Mapping[str, Estimate]]
    odds: Mapping[str, Estimate] | None
    constant: Sequence[str]
    levels: Sequence[int]
    no_odds: str | None = None
    explained: float | None = None


@dataclass(frozen=True)
class RocCurve:
    """Receiver operating characteristic: false alarms and sensitivity over all limits."""

    false_alarm: Sequence[float]
    sensitivity: Sequence[float]


@dataclass(frozen=True)
class Rating:
    """A limit as a classifier of injury.

    Attributes
    ----------
    sensitivity, specificity : shares of the injured and of the uninjured that it tells.
    positive, negative : predictive values.
    area : below the ROC curve.
    best : optimal limit by Youden's index.
    roc : the curve.
    """

    sensitivity: Estimate
    specificity: Estimate
    positive: Estimate
    negative: Estimate
    area: Estimate
    best: Real
    roc: RocCurve


@dataclass(frozen=True)
class ScenarioOutcome:
    """Outcome of a scenario.

    Attributes
    ----------
    title : of the scenario.
    runs : number of complete runs.
    at_least : probability of a head injury by AIS level or worse.
    ais : probability of AIS 0 to 6 of the head.
    mechanisms : the same by mechanism.
    above_limit : probability of exceeding the limit.
    by_front : probability of the limit's AIS level or worse by car front.
    association : rank correlations and regression of the drawn AIS.
    limit : rating of the limit for the head and by mechanism; None where it cannot be rated.
    difference : change from the reference scenario by AIS level.
    """

    title: str
    runs: int
    at_least: Mapping[str, Estimate]
    ais: Sequence[float]
    mechanisms: Mapping[str, Sequence[float]]
    above_limit: Estimate
    by_front: Mapping[str, Estimate]
    association: Association
    limit: Mapping[str, Rating | None]
    difference: Mapping[str, Change] | None = None


@dataclass(frozen=True)
class FunctionRisk:
    """Mean risk by one risk function alone, by AIS level or worse."""

    title: str
    label: str
    source: str
    at_least: Mapping[str, Estimate]


@dataclass(frozen=True)
class ObservedInjury:
    """Probability of an injury of the real case.

    Attributes
    ----------
    label, mechanism, level : of the injury.
    probability : mean over the runs.
    central_90 : 5 % and 95 % quantile over the runs.
    by_function : mean risk by risk function.
    """

    label: str
    mechanism: str
    level: int
    probability: Estimate
    central_90: tuple[Real, Real]
    by_function: Mapping[str, Real]


@dataclass(frozen=True)
class Together:
    """Probability of all observed injuries, if the risks of a run are dependent or independent."""

    dependent: Estimate
    independent: Estimate


@dataclass(frozen=True)
class ObservedCase:
    """Probabilities of the injuries of the real case, and of all of them together."""

    injuries: Sequence[ObservedInjury]
    all: Together | None = None


@dataclass(frozen=True)
class SpeedCurve:
    """Risk along the impact speed, with its 95 % band."""

    risk: Sequence[Real]
    low: Sequence[Real]
    high: Sequence[Real]


@dataclass(frozen=True)
class HalvingSpeed(Estimate):
    """Impact speed in km/h that halves a risk, and the reference risk ``now``."""

    now: float


@dataclass(frozen=True)
class SpeedRisk:
    """Risks along the impact speed.

    Attributes
    ----------
    speed : in km/h.
    runs : number of runs.
    curves, halved : by risk.
    reference_speed : median of the reference scenario in km/h.
    """

    speed: Sequence[float]
    runs: int
    curves: Mapping[str, SpeedCurve]
    halved: Mapping[str, HalvingSpeed]
    reference_speed: float


@dataclass(frozen=True)
class InjuryAnalysis(RunEnds):
    """Every number of an injury report.

    Attributes
    ----------
    fronts : share of each car front.
    limit : limit of the study.
    scenarios : outcome by scenario, the reference first.
    functions : mean risk by risk function.
    observed : injuries of the real case.
    speed : risks along the impact speed; None where the study does not vary it.
    """

    fronts: Mapping[str, float]
    limit: LimitOf
    scenarios: Mapping[str, ScenarioOutcome]
    functions: Mapping[str, FunctionRisk]
    observed: ObservedCase
    speed: SpeedRisk | None
