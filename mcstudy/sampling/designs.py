"""Designs: samples in the unit cube.

A design is a sequence of independent *replicates*. Sample i belongs to replicate
``i // replicate_size`` and depends on the seed and that replicate alone, so a larger n extends a
design without changing earlier samples. Intervals come from the variance between replicates; plain
Monte Carlo needs none, its samples are independent.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from mcstudy.sampling import seeds

Array = NDArray[np.float64]


def _monte_carlo(size: int, dimensions: int, rng: np.random.Generator) -> Array:
    return rng.random((size, dimensions))


def _latin_hypercube(size: int, dimensions: int, rng: np.random.Generator) -> Array:
    return np.asarray(qmc.LatinHypercube(dimensions, rng=rng).random(size))


def _sobol(size: int, dimensions: int, rng: np.random.Generator) -> Array:
    return np.asarray(qmc.Sobol(dimensions, scramble=True, rng=rng).random(size))


METHODS: dict[str, Callable[[int, int, np.random.Generator], Array]] = {
    "monte-carlo": _monte_carlo,
    "latin-hypercube": _latin_hypercube,
    "sobol": _sobol,
}
"""A new design is one function and one line here."""

DEFAULT_REPLICATE_SIZE = {"monte-carlo": 1, "latin-hypercube": 200, "sobol": 128}


def draw(method: str, n: int, replicate_size: int, dimensions: int, seed: int) -> Array:
    """Return an (n, dimensions) design in the unit cube.

    Parameters
    ----------
    method : str
        Key of ``METHODS``.
    n : int
        Number of samples, a multiple of ``replicate_size``.
    replicate_size : int
        Samples of one independent replicate.
    dimensions : int
    seed : int
    """
    blocks = [
        METHODS[method](replicate_size, dimensions, seeds.generator(seed, seeds.DESIGN, r))
        for r in range(n // replicate_size)
    ]
    return np.concatenate(blocks)
