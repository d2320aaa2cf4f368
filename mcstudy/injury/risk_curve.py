"""A risk curve with the quantities that ISO/TS 18506 requires in its report."""

from typing import Any

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
from mcstudy.statistics import REACH

Array = NDArray[np.float64]

GRID = 200
MAX_REFITTED = 300
"""Largest number of cases for which each is left out once (influence)."""
INFLUENCE_SHOWN = 5
INFLUENTIAL = 1.0
"""Standard errors by which leaving out one case may move the curve (assumed)."""


def describe_risk(observations: Observations) -> dict[str, Any]:
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
    return {
        "cases": observations.size,
        "weight": None if observations.weight is None else float(observations.weights.sum()),
        "counted": observations.counted,
        "injured": int(observations.injured.sum()),
        "exact": int(observations.exact.sum()),
        "family": best.family,
        "families": {fit.family: _parameters(fit) for fit in fits},
        "at": {f"{p:g}": _at(best, p) for p in QUALITY_AT},
        "curve": {"stimulus": grid, "risk": best.risk(grid), "low": low, "high": high},
        "turnbull": {"stimulus": x, "risk": risk},
        "rug": {"stimulus": held, "injured": observations.injured},
        "influence": _influence(observations, best),
    }


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


def _parameters(fit: RiskFit) -> dict[str, float]:
    return {
        "intercept": fit.intercept,
        "slope": fit.slope,
        "median": fit.stimulus_at(0.5)[0],
        "log_likelihood": fit.log_likelihood,
        "aic": fit.aic,
    }


def _at(fit: RiskFit, risk: float) -> dict[str, Any]:
    value, low, high = fit.stimulus_at(risk)
    index = fit.quality_index(risk)
    return {
        "value": value, "low": low, "high": high,
        "quality_index": index, "quality": quality_class(index),
    }  # fmt: skip


def _influence(observations: Observations, fit: RiskFit) -> dict[str, Any] | None:
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
    return {
        "largest": [{"case": int(k) + 1, "shift": float(shifts[k])} for k in order],
        "influential": int(np.sum(np.abs(shifts) > INFLUENTIAL)),
    }
