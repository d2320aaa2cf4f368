"""Whether evidence is possible at all by the model and the prior (G. Box, 1980)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.posterior.evidence import Simulated
from mcstudy.posterior.kernel import weighted_quantile
from mcstudy.posterior.summary import NormalScores
from mcstudy.typed_json import Real

Array = NDArray[np.float64]

IMPOSSIBLE = 0.001
"""p-value below which evidence is called impossible."""


@dataclass(frozen=True)
class PriorCheck:
    """Prior predictive p-values.

    Attributes
    ----------
    possible : prior probability of the bounds and events of the evidence.
    together : of all measured items, by their Mahalanobis distance.
    items : of each alone, two-sided.
    blamed : the item that is to blame, empty if the evidence is possible.
    """

    possible: Real
    together: Real
    items: Mapping[str, Real]
    blamed: str

    @property
    def impossible(self) -> bool:
        """Whether the evidence is impossible by model and prior."""
        return bool(self.blamed)


def check_prior(simulated: Simulated, prior: Array) -> PriorCheck:
    """Return the prior predictive check of evidence.

    Parameters
    ----------
    simulated : Simulated
        Evidence of the runs of a bank.
    prior : (n,) array
        Weight of each run.
    """
    weights = prior[simulated.rows]
    weights = weights / weights.sum()
    possible = float(prior @ simulated.possible / prior.sum())
    items = {}
    for k, item in enumerate(simulated.items):
        below = float(weights[simulated.noisy[:, k] <= simulated.observed[k]].sum())
        above = float(weights[simulated.noisy[:, k] >= simulated.observed[k]].sum())
        items[item.name] = min(1.0, 2.0 * min(below, above))
    scores = NormalScores.of(simulated.noisy)
    table = scores(simulated.noisy)
    seen = _beyond(simulated, scores)
    everything = list(range(len(items)))
    together = _tail(table, seen, weights, everything)
    blamed = ""
    worst = min(items, key=lambda name: items[name])
    if items[worst] < IMPOSSIBLE:
        blamed = worst
    elif together < IMPOSSIBLE:
        without = [
            _tail(table, seen, weights, [j for j in everything if j != k]) for k in everything
        ]
        blamed = simulated.items[int(np.argmax(without))].name
    elif possible < IMPOSSIBLE:
        blamed = "bounds and events"
    return PriorCheck(possible, together, items, blamed)


def _beyond(simulated: Simulated, scores: NormalScores) -> Array:
    """Return the scores (k,) of the measured items, going on beyond the ends of the table."""
    seen = scores(simulated.observed[None])[0]
    for k in range(seen.size):
        values = simulated.noisy[:, k]
        equal = np.full(values.size, 1.0 / values.size)
        low, middle, high = weighted_quantile(values, equal, np.array([0.159, 0.5, 0.841]))
        sd = max(0.5 * (high - low), 1e-300)
        if not values.min() <= simulated.observed[k] <= values.max():
            seen[k] = (simulated.observed[k] - middle) / sd
    return np.asarray(seen)


def _tail(table: Array, seen: Array, weights: Array, columns: list[int]) -> float:
    """Return the share of simulated evidence that lies as far out as the measured one."""
    if not columns:
        return 1.0
    part = table[:, columns]
    middle = weights @ part
    off = part - middle
    spread = (off * weights[:, None]).T @ off + 1e-9 * np.eye(len(columns))
    inverse = np.linalg.inv(spread)
    distance = np.einsum("ij,jk,ik->i", off, inverse, off)
    own = seen[columns] - middle
    return float(weights[distance >= float(own @ inverse @ own)].sum())
