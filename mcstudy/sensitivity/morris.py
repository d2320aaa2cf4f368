"""Morris screening: elementary effects along random trajectories.

Every trajectory changes one factor after the other by one large step. The mean absolute elementary
effect (mu*) ranks the factors at the cost of a few dozen runs each; the standard deviation (sigma)
shows interactions and curvature (M. Morris, Technometrics 33, 1991; F. Campolongo, J. Cariboni,
A. Saltelli, Environmental Modelling and Software 22, 2007).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.sampling import seeds
from mcstudy.sampling.factors import factors_of, salib_problem
from mcstudy.statistics import scale_of, varies

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ElementaryEffects:
    """Elementary effects of d factors: change of the output over the levels' whole range.

    Attributes
    ----------
    mean : (d,) mu, NaN for a group.
    mu_star : (3, d) mu* with low and high.
    sigma : (d,) sigma, NaN for a group.
    trajectories : number of trajectories used.
    """

    mean: Array
    mu_star: Array
    sigma: Array
    trajectories: int


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
    inputs : sequence of str
        Names of the inputs, as drawn.
    groups : mapping
        Names of inputs by group, as drawn.
    rows : (n * block, d + 1) array
        Places of the trajectories.
    outputs : (n * block,) array
        All finite.
    levels : int
        Levels of the grid, as drawn.
    resamples : int
        Of the bootstrap over trajectories that gives the 95 % intervals of mu*.
    seed : int
        Of the bootstrap.

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
    # Effects of an output that varies by rounding alone are set to zero.
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
    # Members of a group move up or down independently: the mean effect has no sign.
    mean = np.where(np.isnan(spread), np.nan, scale * np.asarray(found["mu"], dtype=float))
    return ElementaryEffects(mean, np.stack([size, size - reach, size + reach]), spread, count)
