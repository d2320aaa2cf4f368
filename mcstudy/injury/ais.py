"""From stimuli to AIS: probability of each level by mechanism, and sampled outcomes.

A *mechanism* is one way to be injured, such as a blow to the head or its rotation, with one or more
candidate risk functions: the choice between them is an uncertain input with weights. The *head*
takes the worse of its mechanisms. Their dependence is unknown; the larger probability (full
dependence) is the lower bound, independence the upper one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mcstudy.injury.functions import HIGHEST_LEVEL, RiskFunction

Array = NDArray[np.float64]

LEVELS = tuple(range(1, HIGHEST_LEVEL + 1))


@dataclass(frozen=True)
class Mechanism:
    """A way to be injured.

    Attributes
    ----------
    name : for the report.
    functions : (risk function, weight) pairs, weights positive.
    """

    name: str
    functions: Sequence[tuple[RiskFunction, float]]


def exceedance(function: RiskFunction, stimulus: Array, age: Array) -> Array:
    """Return P(AIS >= k) for k = 1 to 6 by one risk function, shape (n, 6).

    Levels that the function lacks are NaN. A stimulus of NaN means no blow: risk 0.

    Parameters
    ----------
    function : RiskFunction
    stimulus : (n,) array
        In the function's unit.
    age : (n,) array
        Years.
    """
    found = np.full((stimulus.size, HIGHEST_LEVEL), np.nan)
    for level in function.levels:
        risk = function.risk(level, stimulus, age)
        found[:, level - 1] = np.where(np.isnan(stimulus), 0.0, risk)
    return found


def mix(mechanism: Mechanism, outputs: Mapping[str, Array], age: Array) -> Array:
    """Return P(AIS >= k) of a mechanism, its risk functions weighted, shape (n, 6).

    Every level is the weighted mean of the functions that have it, capped at the level below, which
    other functions may have. A level that no function has takes the risk of the next higher level
    that some have, or zero above them all.

    Parameters
    ----------
    mechanism : Mechanism
    outputs : mapping
        (n,) stimuli by name.
    age : (n,) array
        Years.
    """
    total = np.zeros((age.size, HIGHEST_LEVEL))
    weights = np.zeros(HIGHEST_LEVEL)
    for function, weight in mechanism.functions:
        found = exceedance(function, outputs[function.stimulus], age)
        known = np.array([level in function.levels for level in LEVELS])
        total[:, known] += weight * found[:, known]
        weights[known] += weight
    mean = total / np.where(weights > 0.0, weights, 1.0)
    for k in reversed(range(HIGHEST_LEVEL - 1)):
        if weights[k] == 0.0:
            mean[:, k] = mean[:, k + 1]
    return np.asarray(np.minimum.accumulate(mean, axis=1))


def combine(
    mechanisms: Sequence[Array], together: Literal["dependent", "independent"] = "dependent"
) -> Array:
    """Return P(AIS >= k) of the worse of several mechanisms, shape (n, 6).

    Parameters
    ----------
    mechanisms : sequence of (n, 6) array
        P(AIS >= k) of each.
    together : {"dependent", "independent"}
        The largest probability, or one minus the product of the complements.
    """
    stacked = np.stack(mechanisms)
    if together == "dependent":
        return np.asarray(stacked.max(axis=0))
    return np.asarray(1.0 - np.prod(1.0 - stacked, axis=0))


def distribution(exceeding: Array) -> Array:
    """Return P(AIS = k) for k = 0 to 6 from P(AIS >= k), shape (..., 7)."""
    ends = np.zeros((*exceeding.shape[:-1], 1))
    reached, passed = (np.concatenate(p, -1) for p in ([1.0 + ends, exceeding], [exceeding, ends]))
    return np.asarray(reached - passed)


def draw_ais(exceeding: Array, uniforms: Array) -> NDArray[np.int64]:
    """Return an AIS for each run, 0 to 6.

    Parameters
    ----------
    exceeding : (n, 6) array
        P(AIS >= k).
    uniforms : (n,) array
        In (0, 1); the same ones in two scenarios are common random numbers.
    """
    return np.asarray(np.sum(uniforms[:, None] < exceeding, axis=1))
