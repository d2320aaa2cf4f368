"""PAWN: the shift of an output's distribution when an input is fixed (by SALib).

F. Pianosi, T. Wagener, Environmental Modelling and Software 67, 2015, and 108, 2018: the sample is
cut into slices of equal counts along an input; the index is the median over the slices of the
Kolmogorov-Smirnov distance between the slice's outputs and all outputs.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SLICES = 10


def pawn(values: Array, outputs: Array, rng: np.random.Generator) -> Array:
    """Return median, smallest and largest distance over the slices of each input, shape (3, d).

    Parameters
    ----------
    values : (n, d) array
    outputs : (n,) array
        Finite.
    rng : Generator
        Not used: the measure is deterministic.
    """
    from SALib.analyze import pawn as salib_pawn

    d = values.shape[1]
    problem = {
        "num_vars": d,
        "names": [f"x{k}" for k in range(d)],
        "bounds": [[0.0, 1.0]] * d,
    }
    # Without a seed SALib leaves NumPy's global generator alone.
    found = salib_pawn.analyze(problem, values, outputs, S=SLICES)
    return np.stack([found["median"], found["minimum"], found["maximum"]])
