"""Given-data sensitivity: measures from any sample of inputs and outputs, whatever its design.

For dependent inputs the measures are measures of association: an input that is only correlated with
an influential one shares its value. Dummies, independent of everything, give the noise line of each
measure.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.sampling import seeds
from mcstudy.sensitivity.delta import delta
from mcstudy.sensitivity.pawn import pawn
from mcstudy.sensitivity.rank_based import rank_first_order
from mcstudy.statistics import varies

Array = NDArray[np.float64]

MIN_RUNS = 100
"""Smallest number of runs with a value for the measures to be estimated (assumed)."""
DUMMIES = 20
"""Dummies whose largest value is the noise line: one input in twenty passes it by chance."""

MEASURES: dict[str, Callable[[Array, Array, np.random.Generator], Array]] = {
    "first_order": rank_first_order,
    "delta": delta,
    "pawn": pawn,
}
"""A new measure is one file and one line here: (n, d) inputs and (n,) outputs to (3, d)."""


@dataclass(frozen=True)
class GivenData:
    """Given-data measures of one output; NaN where it does not vary.

    Attributes
    ----------
    values : by measure, (3, d) value, low and high of each input.
    noise : by measure, the largest value among the dummies.
    runs : number of runs with a value of the output.
    """

    values: dict[str, Array]
    noise: dict[str, float]
    runs: int


def measure_given_data(values: Array, outputs: Array, seed: int) -> GivenData:
    """Return all measures of the inputs of one output.

    Parameters
    ----------
    values : (n, d) array
        Finite.
    outputs : (n,) array
        NaN where undefined.
    seed : int
        Of dummies and resamples.

    Raises
    ------
    ValueError
        If fewer than 100 runs have the output.
    """
    held = np.isfinite(outputs)
    y = outputs[held]
    if y.size < MIN_RUNS:
        raise ValueError(f"{y.size} runs have a value, {MIN_RUNS} are needed")
    rng = seeds.generator(seed, seeds.GIVEN_DATA)
    x = np.column_stack([values[held], rng.random((y.size, DUMMIES))])
    d = values.shape[1]
    if not varies(y):
        nothing = np.full((3, d), np.nan)
        return GivenData(dict.fromkeys(MEASURES, nothing), dict.fromkeys(MEASURES, np.nan), y.size)
    found = {name: measure(x, y, rng) for name, measure in MEASURES.items()}
    return GivenData(
        values={name: table[:, :d] for name, table in found.items()},
        noise={name: float(table[0, d:].max()) for name, table in found.items()},
        runs=int(y.size),
    )
