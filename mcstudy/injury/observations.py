"""Observations of injury: the stimulus at which it occurred, as an interval.

The stimulus of injury of every case lies in an interval: an injured case known only to have
tolerated less is *left-censored* (0, x); an uninjured one *right-censored* (x, infinity); a case in
which the moment of injury was measured is *exact* (x, x); and one between two tests of the same
subject is *interval-censored* (low, high).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SMALLEST, LARGEST = 1e-100, 1e100
"""Range of stimuli; a number beyond it counts as a mistake (assumed)."""
UNEQUAL = 1e9
"""Ratio of two weights beyond which one of them counts as a mistake (assumed)."""


@dataclass(frozen=True)
class Observations:
    """Intervals of the stimulus at which injury occurs.

    Attributes
    ----------
    low, high : (n,) bounds; ``low`` 0 for left-censored, ``high`` infinite for right-censored,
        equal for exact cases.
    weight : (n,) number of cases that each row stands for; None if each is one.
    """

    low: Array
    high: Array
    weight: Array | None = None

    @property
    def size(self) -> int:
        """Number of rows."""
        return int(self.low.size)

    @property
    def weights(self) -> Array:
        """Number of cases that each row stands for."""
        return np.ones(self.size) if self.weight is None else self.weight

    @property
    def counted(self) -> bool:
        """Whether the weights are whole numbers of cases, not shares of a population."""
        return bool(np.all(self.weights == np.round(self.weights)))

    @property
    def exact(self) -> Flags:
        """Cases whose stimulus of injury was measured."""
        return np.asarray(self.low == self.high)

    @property
    def injured(self) -> Flags:
        """Cases with injury at or below a finite stimulus."""
        return np.asarray(np.isfinite(self.high))

    @property
    def stimulus(self) -> Array:
        """The finite bound of each case, the middle of an interval."""
        middle = 0.5 * (self.low + np.where(self.injured, self.high, self.low))
        return np.where(self.low == 0.0, self.high, middle)

    def without(self, index: int) -> "Observations":
        """Return the observations without one row."""
        weight = None if self.weight is None else np.delete(self.weight, index)
        return Observations(np.delete(self.low, index), np.delete(self.high, index), weight)


def observe(
    stimulus: Array, injured: Flags, exact: Flags | None = None, weight: Array | None = None
) -> Observations:
    """Return observations of cases with one stimulus each.

    Parameters
    ----------
    stimulus : (n,) array
        Positive.
    injured : (n,) array of bool
    exact : (n,) array of bool, optional
        Injured cases whose stimulus of injury was measured; by default none.
    weight : (n,) array, optional
        Number of cases that each row stands for; by default one.

    Raises
    ------
    ValueError
        As ``check``, or if a case is exact and not injured.
    """
    stimulus = np.asarray(stimulus, dtype=float)
    injured = np.asarray(injured, dtype=bool)
    known = np.zeros(stimulus.size, dtype=bool) if exact is None else np.asarray(exact, dtype=bool)
    if np.any(known & ~injured):
        case = int(np.flatnonzero(known & ~injured)[0])
        raise ValueError(f"case {case + 1} is exact and not injured")
    low = np.where(injured & ~known, 0.0, stimulus)
    high = np.where(injured, stimulus, np.inf)
    return check(Observations(low, high, weight))


def check(observations: Observations) -> Observations:
    """Return the observations if a risk curve can be fitted to them.

    Raises
    ------
    ValueError
        If a stimulus is not a positive number, an interval is empty or open on both sides, all
        cases are of one class, or the classes are completely separated.
    """
    low, high, weights = observations.low, observations.high, observations.weights
    for k in range(observations.size):
        # The open side of a censored case is no measurement.
        bounds = [b for b, open_side in ((low[k], 0.0), (high[k], np.inf)) if b != open_side]
        if not bounds:
            raise ValueError(
                f"case {k + 1}: the stimulus must be a positive number, neither bound is one"
            )
        if not all(SMALLEST <= b <= LARGEST for b in bounds):
            raise ValueError(
                f"case {k + 1}: the stimulus must be a positive number, given "
                f"{', '.join(f'{b:g}' for b in bounds)}"
            )
        if high[k] < low[k]:
            raise ValueError(f"case {k + 1}: the interval {low[k]:g} to {high[k]:g} is empty")
        if not SMALLEST <= weights[k] <= LARGEST:
            raise ValueError(
                f"case {k + 1}: the weight must be a positive number, given {weights[k]:g}"
            )
    if observations.size and weights.max() > UNEQUAL * weights.min():
        raise ValueError(
            f"the weights go from {weights.min():g} to {weights.max():g}: a row may not stand for "
            f"more than {UNEQUAL:g} times the cases of another"
        )
    if observations.size < 3:
        raise ValueError(f"{observations.size} cases are too few for a risk curve")
    if np.all(low == 0.0):
        raise ValueError(
            "all cases are injured: the onset of risk is unidentifiable; add uninjured"
        )
    if not observations.injured.any():
        raise ValueError("no case is injured: the onset of risk is unidentifiable; add injured")
    if high.min() >= low.max():
        raise ValueError(
            f"the uninjured (up to {low.max():g}) and the injured (from {high.min():g}) do not "
            "overlap: one stimulus fits all cases with any steepness (complete separation), so no "
            "curve is given; add cases between or beyond them"
        )
    return observations
