"""Morris's trajectories: designs that change one factor after the other, by SALib.

With a single step size an output that is periodic in an input with just this step shows no effect.
The grid of each trajectory is therefore shrunk by a random factor, and that of each input shifted:
steps have any size from half of Morris's to all of it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.sampling import seeds
from mcstudy.sampling.factors import factors_of, perturbed, salib_problem

Array = NDArray[np.float64]

TAIL = 0.025
"""Levels lie between this and one minus this in an input's probability (assumed)."""
SMALLEST_GRID = 0.5
"""Smallest extent of a trajectory's grid, as a share of the range (assumed)."""


@dataclass(frozen=True)
class Trajectories:
    """A Morris design in the unit cube.

    Attributes
    ----------
    uniforms : (n * block, d) of the inputs, perturbed by the dummy.
    levels : (n * block, d + 1) places of the inputs and the dummy, 0 to 1, on the grid of their
        trajectory.
    factors : names of the factors, inputs or groups, the dummy last.
    block : number of rows of one trajectory.
    trajectory : (n * block,) trajectory of each row.
    """

    uniforms: Array
    levels: Array
    factors: tuple[str, ...]
    block: int
    trajectory: NDArray[np.int64]


def draw_trajectories(
    inputs: Sequence[str],
    groups: Mapping[str, Sequence[str]],
    n: int,
    levels: int,
    seed: int,
) -> Trajectories:
    """Return Morris's design.

    Parameters
    ----------
    inputs : sequence of str
        Names of the d inputs.
    groups : mapping
        Names of inputs by group.
    n : int
        Trajectories; each has its own random stream, so a larger design begins with a smaller one.
    levels : int
        Of the grid, even.
    seed : int
    """
    from SALib.sample import morris

    problem = salib_problem(inputs, groups)
    rows = np.concatenate(
        [
            _shifted(morris.sample(problem, 1, num_levels=levels, seed=stream), stream)
            for stream in (seeds.generator(seed, seeds.MORRIS, k) for k in range(n))
        ]
    )
    factors = factors_of(inputs, groups)
    block = len(factors) + 1
    uniforms = perturbed(TAIL + (1.0 - 2.0 * TAIL) * rows[:, :-1], rows[:, -1])
    return Trajectories(uniforms, rows, factors, block, np.arange(n * block) // block)


def _shifted(rows: Array, stream: np.random.Generator) -> Array:
    """Return a trajectory on a grid that is shrunk, and shifted for each input."""
    size = stream.uniform(SMALLEST_GRID, 1.0)
    return stream.uniform(0.0, 1.0 - size, rows.shape[1]) + size * rows
