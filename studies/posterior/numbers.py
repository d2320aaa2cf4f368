"""Every number of a posterior study, in the units of its study file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mcstudy.posterior.calibration import Calibration
from mcstudy.posterior.prior_check import PriorCheck
from mcstudy.posterior.ratio import Ratio
from mcstudy.typed_json import Real
from studies.posterior.formulae import HandSpeed
from studies.runs import RunEnds


@dataclass(frozen=True)
class Spread:
    """A distribution: median, central intervals by their probability, effective runs."""

    median: Real
    intervals: Mapping[str, tuple[Real, Real]]
    effective: Real

    @property
    def width(self) -> float:
        """Width of the 90 % interval."""
        low, high = self.intervals["0.9"]
        return high - low


@dataclass(frozen=True)
class ItemResult:
    """An item of evidence.

    Attributes
    ----------
    name, said : its name, and its value in words.
    prior_p : prior predictive p-value.
    predictive_p : the same given the other items.
    alone, left_out : target given this item alone, and given all but it; None where nothing
        measured is left.
    """

    name: str
    said: str
    prior_p: Real
    predictive_p: Real
    alone: Spread | None
    left_out: Spread | None


@dataclass(frozen=True)
class RatioResult:
    """A proposition: its likelihood ratio, without the model's errors, and its range.

    ``lowest`` and ``highest`` are those of all assumptions that were varied, NaN where one of them
    is beyond the resolution of the bank.
    """

    label: str
    given: Ratio
    plain: Ratio
    verbal: str
    lowest: Real
    highest: Real


@dataclass(frozen=True)
class Assumption:
    """The result under another assumption: target, and likelihood ratios by proposition."""

    label: str
    target: Spread
    ratios: Mapping[str, Ratio]


@dataclass(frozen=True)
class Avoided:
    """What would have happened at another speed.

    Attributes
    ----------
    speed : of the car when the danger could be seen.
    stopped : probability that it would have stopped before.
    impact : speed of the impact where it would not have.
    head_speed : head speed relative to the car there, m/s.
    hic15 : there.
    """

    speed: Real
    stopped: Real
    impact: Spread | None
    head_speed: Spread | None
    hic15: Spread | None


@dataclass(frozen=True)
class InjuryResult:
    """Injury given the evidence: HIC15, and probability of each AIS or worse by function."""

    hic15: Spread
    exceeding: Mapping[str, Mapping[str, Real]]
    recorded: int | None


@dataclass(frozen=True)
class OtherQuantity:
    """Another input or output: unit, before and after the evidence."""

    name: str
    unit: str
    before: Spread
    after: Spread


@dataclass(frozen=True)
class Further:
    """A further measurement: its uncertainty in words, expected width of the 90 % interval."""

    name: str
    said: str
    width: Real


@dataclass(frozen=True)
class PosteriorAnalysis(RunEnds):
    """Every number of a posterior study.

    Attributes
    ----------
    target, unit : what is asked for, and its unit.
    seed : of the simulated noise.
    before, after, plain : prior, posterior, and posterior without the model's errors.
    curves : densities of prior, posterior and posterior without the model's errors on a grid of
        the target, by name.
    ranks : runs left out by twentieth of their rank.
    check : prior predictive check.
    refused : why no likelihood ratio is given, empty if they are.
    calibration : over the whole bank, then by thirds of the posterior median.
    joint : Kolmogorov distance of the joint coverage from the straight line, and its p-value.
    items : of evidence.
    ratios : of the propositions.
    assumptions : results under other assumptions.
    formulae : speeds by hand, m/s.
    avoidability, injury, others, further : see their classes.
    """

    target: str
    unit: str
    seed: int
    before: Spread
    after: Spread
    plain: Spread
    curves: Mapping[str, Sequence[Real]]
    ranks: Sequence[int]
    check: PriorCheck
    refused: str
    calibration: Sequence[Calibration]
    joint: tuple[Real, Real]
    items: Sequence[ItemResult]
    ratios: Sequence[RatioResult]
    assumptions: Sequence[Assumption]
    formulae: Sequence[HandSpeed]
    avoidability: Sequence[Avoided]
    injury: InjuryResult | None
    others: Sequence[OtherQuantity]
    further: Sequence[Further]
