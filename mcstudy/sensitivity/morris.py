"""Morris screening: elementary effects along random trajectories, by SALib.

Every trajectory changes one factor after the other by one large step. The mean size of an output's
changes (mu*) ranks the factors at the cost of a few dozen runs each, their scatter (sigma) shows
interactions and curvature (M. Morris, Technometrics 33, 1991; F. Campolongo, J. Cariboni,
A. Saltelli, Environmental Modelling and Software 22, 2007).

With one size of step an output that repeats itself after just this step, as one of a periodic input
may, has no effect at all. The grid of each trajectory is therefore shrunk by a random factor, and
that of each input shifted: steps have any size from half of Morris's to all of it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy import seeds
from mcstudy.sensitivity.factors import factors_of, nudged, salib_problem
from mcstudy.statistics import scale_of, varies

Array = NDArray[np.float64]

TAIL = 0.025
"""Levels lie between this and one minus this in an input's probability (assumed)."""
SMALLEST_GRID = 0.5
"""Share of its range that a trajectory's grid has at least (assumed)."""


@dataclass(frozen=True)
class Trajectories:
    """A design in the unit cube.

    Attributes
    ----------
    uniforms : (n * block, d) of the inputs, the dummy's nudge applied.
    levels : (n * block, d + 1) places of the inputs and the dummy, 0 to 1: levels of the grid of
        their trajectory.
    factors : names of what is changed, inputs or groups, the dummy last.
    block : rows of one trajectory. trajectory : (n * block,) of each row.
    """

    uniforms: Array
    levels: Array
    factors: tuple[str, ...]
    block: int
    trajectory: NDArray[np.int64]


@dataclass(frozen=True)
class ElementaryEffects:
    """Elementary effects of d factors: change of the output over the levels' whole range.

    Attributes
    ----------
    mean : (d,), NaN for a group. mean_size : (3, d) mu* with low and high.
    spread : (d,) sigma, NaN for a group. trajectories : used.
    """

    mean: Array
    mean_size: Array
    spread: Array
    trajectories: int


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
    inputs : d names. groups : names of inputs by group.
    n : trajectories; each has its own random stream, so a larger design begins with a smaller one.
    levels : of the grid, even. seed : int
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
    uniforms = nudged(TAIL + (1.0 - 2.0 * TAIL) * rows[:, :-1], rows[:, -1])
    return Trajectories(uniforms, rows, factors, block, np.arange(n * block) // block)


def _shifted(rows: Array, stream: np.random.Generator) -> Array:
    """Return a trajectory on a grid that is smaller, and elsewhere for each input."""
    size = stream.uniform(SMALLEST_GRID, 1.0)
    return stream.uniform(0.0, 1.0 - size, rows.shape[1]) + size * rows


def estimate_effects(
    inputs: Sequence[str],
    groups: Mapping[str, Sequence[str]],
    rows: Array,
    outputs: Array,
    levels: int,
    *,
    resamples: int = 1000,
    seed: int = 0,
) -> ElementaryEffects:
    """Return the elementary effects of one output.

    Parameters
    ----------
    inputs, groups, levels : as drawn.
    rows : (n * block, d + 1) places of the trajectories. outputs : (n * block,), all finite.
    resamples, seed : of the bootstrap over trajectories that gives the 95 % intervals of mu*.

    Raises
    ------
    ValueError
        If an output is not finite or there are fewer than two trajectories.
    """
    from SALib.analyze import morris

    if not np.all(np.isfinite(outputs)):
        raise ValueError("outputs must be finite: drop failed trajectories whole first")
    count = outputs.size // (len(factors_of(inputs, groups)) + 1)
    if count < 2:
        raise ValueError("elementary effects take two trajectories or more")
    scale = scale_of(outputs)
    # Effects of an output that does not vary beyond rounding are zero, not rounding.
    scaled = outputs / scale if varies(outputs) else np.zeros_like(outputs)
    # SALib divides by Morris's step; each trajectory has its own.
    paths = rows.reshape(count, -1, rows.shape[1])
    steps = np.abs(np.diff(paths, axis=1)).max(axis=(1, 2))
    morris_step = levels / (2.0 * (levels - 1))
    scaled = (scaled.reshape(count, -1) * (morris_step / steps)[:, None]).ravel()
    found = morris.analyze(
        salib_problem(inputs, groups),
        rows,
        scaled,
        num_levels=levels,
        num_resamples=resamples,
        seed=seeds.generator(seed, seeds.BOOTSTRAP),
    )
    size, reach, spread = (
        scale * np.asarray(found[key], dtype=float) for key in ("mu_star", "mu_star_conf", "sigma")
    )
    # The members of a group move up or down on their own: their mean has no sign.
    mean = np.where(np.isnan(spread), np.nan, scale * np.asarray(found["mu"], dtype=float))
    return ElementaryEffects(mean, np.stack([size, size - reach, size + reach]), spread, count)
