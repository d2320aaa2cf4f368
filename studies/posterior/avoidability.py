"""Avoidability: what would have happened at another speed, with the same reaction.

The driver reacts when the danger can be seen, brakes after the reaction time, and strikes after the
braking distance. At another speed the reaction begins at the same place.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.posterior.evidence import Bank
from mcstudy.posterior.inference import Draws
from mcstudy.sampling import seeds
from mcstudy.studyfile.distributions import Distribution
from studies.posterior.numbers import Avoided, Spread
from studies.posterior.schema import AvoidabilityEntry

Array = NDArray[np.float64]

GRAVITY = 9.81
"""m/s2."""
DRAWS = 4000
"""Draws of the posterior."""
NEAREST = 100
"""Runs nearest in speed from which the outcome of another impact is drawn."""

SpreadOf = Callable[[Array, float], Spread]
"""Distribution of equally weighted values, and their factor to the unit shown."""


def measure_avoidability(
    entry: AvoidabilityEntry,
    bank: Bank,
    draws: Draws,
    seed: int,
    spread_of: SpreadOf,
    factor: float,
) -> list[Avoided]:
    """Return what would have happened at each of the speeds.

    Parameters
    ----------
    entry : AvoidabilityEntry
    bank : Bank
    draws : Draws
        Of the impact speed, m/s.
    seed : int
        Of the reaction and the braking distance.
    spread_of : callable
        Distribution of values.
    factor : float
        From m/s to the unit of the speeds shown.
    """
    rng = seeds.generator(seed, seeds.EVIDENCE, 3)
    chosen = rng.choice(draws.values.size, DRAWS, p=draws.weights)
    impact, friction = draws.values[chosen], bank.values[entry.friction][draws.runs[chosen]]
    braked = _drawn(entry.braking_distance, "m", rng)
    reaction = _drawn(entry.reaction_time, "s", rng)
    deceleration = friction * GRAVITY
    approach = np.sqrt(impact**2 + 2.0 * deceleration * braked)
    seen_from = approach * reaction + braked
    found = []
    for speed in entry.speeds:
        other = speed * units.factor(entry.unit, "m/s")
        left = np.maximum(seen_from - other * reaction, 0.0)
        squared = other**2 - 2.0 * deceleration * left
        struck = squared > 0.0
        impacts = np.sqrt(squared[struck])
        if struck.any():
            outcome = _outcomes(bank, impacts, rng)
            found.append(
                Avoided(
                    other * factor,
                    float(np.mean(~struck)),
                    spread_of(impacts, factor),
                    _known(outcome["head_impact_speed"], spread_of),
                    _known(outcome["hic15"], spread_of),
                )
            )
        else:
            found.append(Avoided(other * factor, 1.0, None, None, None))
    return found


def _drawn(distribution: Distribution, unit: str, rng: np.random.Generator) -> Array:
    values = distribution.quantile(rng.uniform(1e-9, 1.0 - 1e-9, DRAWS), {})
    return np.asarray(values * units.factor(distribution.unit, unit))


def _outcomes(bank: Bank, impacts: Array, rng: np.random.Generator) -> Mapping[str, Array]:
    """Return outputs of runs with about these impact speeds; NaN where the bank has none."""
    speeds = bank.values["impact_speed"]
    order = np.argsort(speeds)
    near = min(NEAREST, speeds.size)
    place = np.searchsorted(speeds[order], impacts) - near // 2
    place = np.clip(place, 0, speeds.size - near) + rng.integers(near, size=impacts.size)
    rows = order[place]
    outside = (impacts < speeds.min()) | (impacts > speeds.max())
    names = ("head_impact_speed", "hic15")
    return {
        name: np.where(outside, np.nan, bank.values[name][rows])
        if name in bank.values
        else np.full(impacts.size, np.nan)
        for name in names
    }


def _known(values: Array, spread_of: SpreadOf) -> Spread | None:
    held = values[np.isfinite(values)]
    return spread_of(held, 1.0) if held.size > 0.5 * values.size else None
