"""A limit as a classifier of injury, such as HIC 700.

Outcomes are probabilities, not sampled cases: each run counts as injured with its risk and as
uninjured with the complement, which removes sampling noise of the outcomes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Limit:
    """Performance of a limit as a classifier.

    Attributes
    ----------
    value : of the stimulus.
    sensitivity : share of the injured above the limit.
    specificity : share of the uninjured below it.
    positive : predictive value, the risk above the limit; NaN if nobody is above.
    negative : predictive value, the share of uninjured below it; NaN if nobody is below.
    """

    value: float
    sensitivity: float
    specificity: float
    positive: float
    negative: float


@dataclass(frozen=True)
class Roc:
    """Receiver operating characteristic: sensitivity over 1 - specificity, and its area."""

    false_alarm: Array
    sensitivity: Array
    limit: Array
    area: float
    best: float


def judge_limit(stimulus: Array, risk: Array, limit: float, weight: Array | None = None) -> Limit:
    """Return sensitivity, specificity and predictive values of a limit.

    Parameters
    ----------
    stimulus : (n,) array
        NaN counts as below.
    risk : (n,) array
        Probability of injury.
    limit : float
        Of the stimulus.
    weight : (n,) array, optional
        Of each run, by default equal.
    """
    w = np.ones(risk.size) if weight is None else weight
    hurt, spare = w * risk, w * (1.0 - risk)
    above = np.nan_to_num(stimulus, nan=-np.inf) > limit
    injured, uninjured = float(hurt.sum()), float(spare.sum())
    hit, spared = float(hurt[above].sum()), float(spare[~above].sum())
    return Limit(
        value=limit,
        sensitivity=_share(hit, injured),
        specificity=_share(spared, uninjured),
        positive=_share(hit, float(w[above].sum())),
        negative=_share(spared, float(w[~above].sum())),
    )


def receiver_operating_characteristic(
    stimulus: Array, risk: Array, weight: Array | None = None
) -> Roc:
    """Return the ROC curve over all limits, its area and the best limit (Youden's J).

    Parameters
    ----------
    stimulus : (n,) array
        NaN counts as lowest.
    risk : (n,) array
        Probability of injury, neither all 0 nor all 1.
    weight : (n,) array, optional
        Of each run, by default equal.
    """
    w = np.ones(risk.size) if weight is None else weight
    held = np.nan_to_num(stimulus, nan=-np.inf)
    order = np.argsort(-held, kind="stable")
    x, hurt, spare = held[order], (w * risk)[order], (w * (1.0 - risk))[order]
    # Runs of equal stimulus form one step of the curve.
    last = np.append(np.flatnonzero(x[1:] != x[:-1]), x.size - 1)
    hits = np.concatenate([[0.0], np.cumsum(hurt)[last] / hurt.sum()])
    alarms = np.concatenate([[0.0], np.cumsum(spare)[last] / spare.sum()])
    # A limit half-way to the next lower stimulus separates them from the rest.
    below = np.append(x[last[:-1] + 1], -np.inf)
    limits = np.concatenate([x[:1], np.where(np.isinf(below), below, 0.5 * (x[last] + below))])
    best = int(np.argmax(hits - alarms))
    return Roc(alarms, hits, limits, float(np.trapezoid(hits, alarms)), float(limits[best]))


def _share(part: float, whole: float) -> float:
    return part / whole if whole > 0.0 else float("nan")
