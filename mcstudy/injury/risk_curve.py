"""A risk curve with the quantities that ISO/TS 18506 requires in its report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.injury.observations import Observations
from mcstudy.injury.survival import (
    FAMILIES,
    QUALITY_AT,
    RiskFit,
    fit_risk_curve,
    quality_class,
)
from mcstudy.injury.turnbull import estimate_steps
from mcstudy.statistics import REACH, Estimate
from mcstudy.typed_json import Real

Array = NDArray[np.float64]

GRID = 200
MAX_REFITTED = 300
"""Largest number of cases for which each is left out once (influence)."""
INFLUENCE_SHOWN = 5
INFLUENTIAL = 1.0
"""Standard errors by which leaving out one case may move the curve (assumed)."""


@dataclass(frozen=True)
class Family:
    """A fitted family: parameters of its linear predictor in ln x, and its likelihood."""

    intercept: Real
    slope: Real
    median: Real
    log_likelihood: Real
    aic: Real


@dataclass(frozen=True)
class StimulusAt(Estimate):
    """Stimulus at a risk, with the width of its interval over it and the class of that."""

    quality_index: Real
    quality: str


@dataclass(frozen=True)
class Curve:
    """Risk along the stimulus with its 95 % band."""

    stimulus: Sequence[Real]
    risk: Sequence[Real]
    low: Sequence[Real]
    high: Sequence[Real]


@dataclass(frozen=True)
class Steps:
    """Turnbull's estimate: corners of its steps."""

    stimulus: Sequence[Real]
    risk: Sequence[Real]


@dataclass(frozen=True)
class Rug:
    """Stimulus of every case and whether it is injured."""

    stimulus: Sequence[Real]
    injured: Sequence[bool]


@dataclass(frozen=True)
class Shift:
    """Shift of the curve without a case in standard errors, NaN if it leaves no curve."""

    case: int
    shift: Real


@dataclass(frozen=True)
class Influence:
    """Influence of single cases: the largest shifts, and the number of influential cases."""

    largest: Sequence[Shift]
    influential: int


@dataclass(frozen=True)
class RiskDescription:
    """Fits of all families, details of the best one, and Turnbull's estimate.

    Attributes
    ----------
    cases : number of cases.
    weight : sum of their weights, where they have any.
    counted : whether the weights count cases.
    injured, exact : number of injured cases and of exact observations.
    family : name of the best family, by the AIC.
    families : fits by name, best first.
    at : stimulus by risk.
    curve, turnbull, rug : what is drawn.
    influence : of single cases; None if there are too many to leave out each.
    """

    cases: int
    weight: float | None
    counted: bool
    injured: int
    exact: int
    family: str
    families: Mapping[str, Family]
    at: Mapping[str, StimulusAt]
    curve: Curve
    turnbull: Steps
    rug: Rug
    influence: Influence | None


def describe_risk(observations: Observations) -> RiskDescription:
    """Return the fits of all families, details of the best one, and Turnbull's estimate.

    Parameters
    ----------
    observations : Observations

    Raises
    ------
    ValueError
        If the observations allow no curve.
    """
    fits = _fit_families(observations)
    best = fits[0]
    held = observations.stimulus
    grid = np.linspace(0.0, 1.05 * float(held.max()), GRID + 1)[1:]
    low, high = best.band(grid)
    steps = estimate_steps(observations)
    x, risk = steps.steps()
    return RiskDescription(
        cases=observations.size,
        weight=None if observations.weight is None else float(observations.weights.sum()),
        counted=bool(observations.counted),
        injured=int(observations.injured.sum()),
        exact=int(observations.exact.sum()),
        family=best.family,
        families={fit.family: _parameters(fit) for fit in fits},
        at={f"{p:g}": _at(best, p) for p in QUALITY_AT},
        curve=Curve(*(part.tolist() for part in (grid, best.risk(grid), low, high))),
        turnbull=Steps(x.tolist(), risk.tolist()),
        rug=Rug(held.tolist(), observations.injured.tolist()),
        influence=_influence(observations, best),
    )


def _fit_families(observations: Observations) -> list[RiskFit]:
    """Return the fits of the families that the observations allow, best first."""
    fits, refusal = [], None
    for family in FAMILIES:
        try:
            fits.append(fit_risk_curve(observations, family))
        except ValueError as error:
            refusal = error
    if not fits and refusal is not None:
        raise refusal
    return sorted(fits, key=lambda fit: fit.aic)


def _parameters(fit: RiskFit) -> Family:
    return Family(
        intercept=fit.intercept,
        slope=fit.slope,
        median=fit.stimulus_at(0.5)[0],
        log_likelihood=fit.log_likelihood,
        aic=fit.aic,
    )


def _at(fit: RiskFit, risk: float) -> StimulusAt:
    value, low, high = fit.stimulus_at(risk)
    index = fit.quality_index(risk)
    return StimulusAt(value, low, high, quality_index=index, quality=quality_class(index))


def _influence(observations: Observations, fit: RiskFit) -> Influence | None:
    """Return the influence of leaving out each case on the curve, largest first.

    The shift is that of the stimulus at 5, 25 or 50 % risk, whichever moves most, in standard
    errors of the curve without the case.
    """
    if observations.size > MAX_REFITTED:
        return None
    before = np.array([fit.log_stimulus_at(p)[0] for p in QUALITY_AT])
    shifts = np.full(observations.size, np.inf)
    for k in range(observations.size):
        try:
            refitted = fit_risk_curve(observations.without(k), fit.family)
        except ValueError:
            # Without this case no curve can be fitted.
            continue
        centre, reach = np.transpose([refitted.log_stimulus_at(p) for p in QUALITY_AT])
        moved = (centre - before) / (reach / REACH)
        shifts[k] = moved[np.argmax(np.abs(moved))]
    order = np.argsort(-np.abs(shifts))[:INFLUENCE_SHOWN]
    return Influence(
        largest=[Shift(int(k) + 1, float(shifts[k])) for k in order],
        influential=int(np.sum(np.abs(shifts) > INFLUENTIAL)),
    )
