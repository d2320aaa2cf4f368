"""Saltelli's design: base points and copies in which one factor is exchanged (drawn by SALib).

A design is sixteen independent scrambles of one low-discrepancy sequence, taken in turn. Points of
one scramble are not independent, and resampling them gives intervals that are too wide, three to
ten times for smooth functions from 1,024 points on; the scrambles are, and give unbiased intervals.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.sampling import seeds
from mcstudy.sampling.factors import factors_of, perturbed, salib_problem

Array = NDArray[np.float64]

SCRAMBLES = 16
"""Independent scrambles: enough for intervals, few enough to keep their points well spread."""


@dataclass(frozen=True)
class Saltelli:
    """A Saltelli design in the unit cube.

    Attributes
    ----------
    uniforms : (n * block, d) of the inputs, perturbed by the dummy.
    factors : names of the factors, inputs or groups, the dummy last.
    block : number of rows of one base point.
    scramble : (n * block,) scramble of each row; base point i belongs to scramble ``i % 16``.
    """

    uniforms: Array
    factors: tuple[str, ...]
    block: int
    scramble: NDArray[np.int64]


def block_size(factors: Sequence[str], *, second_order: bool) -> int:
    """Return the rows of one base point."""
    return (2 if second_order else 1) * len(factors) + 2


def is_base_row(run: NDArray[np.int64], block: int) -> NDArray[np.bool_]:
    """Return which runs are rows of A or B, the only independently drawn ones of a block.

    Parameters
    ----------
    run : (n,) array of int
        Ids in the order of the design.
    block : int
        Rows of one base point.
    """
    return np.isin(run % block, (0, block - 1))


def draw_saltelli(
    inputs: Sequence[str],
    groups: Mapping[str, Sequence[str]],
    n: int,
    seed: int,
    *,
    second_order: bool = False,
) -> Saltelli:
    """Return Saltelli's design.

    Parameters
    ----------
    inputs : sequence of str
        Names of the d inputs.
    groups : mapping
        Names of inputs by group.
    n : int
        Base points, 16 times a power of two; the design for n is the first half of that for 2 n.
    seed : int
        Of the scrambles.
    second_order : bool
        Whether to add the rows that second-order indices need.
    """
    from SALib.sample import sobol

    factors = factors_of(inputs, groups)
    block = block_size(factors, second_order=second_order)
    problem = salib_problem(inputs, groups)
    cube = np.empty((n // SCRAMBLES, SCRAMBLES, block, len(inputs) + 1))
    with warnings.catch_warnings():
        # The scrambled sequence is used from its first point.
        warnings.simplefilter("ignore")
        for k in range(SCRAMBLES):
            stream = seeds.generator(seed, seeds.SALTELLI, k)
            rows = sobol.sample(
                problem, n // SCRAMBLES, calc_second_order=second_order, seed=stream
            )
            cube[:, k] = rows.reshape(-1, block, len(inputs) + 1)
    rows = cube.reshape(n * block, -1)
    scramble = np.arange(n * block) // block % SCRAMBLES
    return Saltelli(perturbed(rows[:, :-1], rows[:, -1]), factors, block, scramble)
