"""Posterior of one quantity given evidence, from a bank of runs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcstudy.posterior.evidence import Bank, Item, Simulated, simulate_evidence
from mcstudy.posterior.kernel import Kernel, effective_size, weighted_quantile
from mcstudy.posterior.summary import Summary, learn_summary

Array = NDArray[np.float64]

SETS = 262_144
"""Simulated sets of evidence that are aimed at: a run of a small bank has several."""
MOST_COPIES = 64
MARGIN = 0.01
"""Share of the range of a target by which its bounds lie beyond its smallest and largest value."""


@dataclass(frozen=True)
class Scale:
    """An unbounded scale of a bounded quantity: the logit between its bounds."""

    low: float
    high: float

    @classmethod
    def of(cls, values: Array) -> "Scale":
        """Return the scale of values (n,)."""
        low, high = float(values.min()), float(values.max())
        margin = MARGIN * (high - low) + 1e-12
        return cls(low - margin, high + margin)

    def forth(self, values: Array) -> Array:
        """Return the unbounded values (n,)."""
        return np.asarray(special.logit((values - self.low) / (self.high - self.low)))

    def back(self, unbounded: Array) -> Array:
        """Return the bounded values (n,)."""
        return np.asarray(self.low + (self.high - self.low) * special.expit(unbounded))


@dataclass(frozen=True)
class Draws:
    """Weighted draws of a posterior.

    Attributes
    ----------
    runs : (j,) int array
        Run of the bank of each draw.
    weights : (j,) array
        They sum to one.
    values : (j,) array
        The target, adjusted to the evidence.
    """

    runs: NDArray[np.int64]
    weights: Array
    values: Array

    @property
    def effective(self) -> float:
        """Effective number of runs: the draws of one run count as one."""
        return self.effective_among(np.ones(self.runs.size, dtype=bool))

    def effective_among(self, inside: NDArray[np.bool_]) -> float:
        """Return the effective number of runs among some of the draws, (j,)."""
        if not inside.any():
            return 0.0
        unique, place = np.unique(self.runs[inside], return_inverse=True)
        sums = np.bincount(place, self.weights[inside], minlength=unique.size)
        return effective_size(sums.astype(float))

    def quantile(self, levels: Array | float) -> Array:
        """Return quantiles of the target."""
        return weighted_quantile(self.values, self.weights, levels)

    def share(self, inside: NDArray[np.bool_]) -> float:
        """Return the probability of draws (j,)."""
        return float(self.weights[inside].sum())


class Posterior:
    """Posterior of a target given evidence.

    Parameters
    ----------
    bank : Bank
    items : sequence of Item
        Evidence.
    target : str
        Input or output that is asked for.
    weights : (n,) array, optional
        Prior weight of each run, in place of equal ones.
    seed : int
        Of the noise of the simulated evidence.
    sets : int
        Simulated sets of evidence that are aimed at.

    Raises
    ------
    ValueError
        If no item has a value, no run agrees with bounds and events, or some that do have no
        target.
    """

    def __init__(
        self,
        bank: Bank,
        items: Sequence[Item],
        target: str,
        *,
        weights: Array | None = None,
        seed: int = 0,
        sets: int = SETS,
    ) -> None:
        self.bank, self.target = bank, target
        copies = int(np.clip(sets // bank.size, 1, MOST_COPIES))
        self.simulated: Simulated = simulate_evidence(bank, items, seed=seed, copies=copies)
        rows = self.simulated.rows
        self.prior = np.ones(bank.size) if weights is None else weights
        values = bank.values[target][rows]
        if not np.isfinite(values).all():
            raise ValueError(
                f"{target}: some runs that agree with the evidence have none; say with 'happened' "
                "that there is one"
            )
        self.scale = Scale.of(values)
        unbounded = self.scale.forth(values)
        own = self.prior[rows]
        self.summary: Summary = learn_summary(self.simulated.noisy, unbounded, rows, own)
        self.kernel = Kernel(self.summary.known, unbounded, rows, own)

    def given(self, observed: Array | None = None) -> Draws:
        """Return the draws given the measured evidence, or given another one.

        Parameters
        ----------
        observed : (k,) array, optional
            Values of the measured items.
        """
        seen = self.simulated.observed if observed is None else observed
        return self._draws(float(self.summary.of(seen[None])[0]))

    def given_set(self, place: int) -> Draws:
        """Return the draws given a simulated set of evidence, its own run left out.

        Parameters
        ----------
        place : int
            Number of the set.
        """
        run = int(self.simulated.rows[place])
        return self._draws(float(self.summary.known[place]), run)

    def _draws(self, summary: float, without: int | None = None) -> Draws:
        near = self.kernel.at(summary, without)
        runs = self.simulated.rows[near.places]
        return Draws(runs, near.weights, self.scale.back(near.shifted))
