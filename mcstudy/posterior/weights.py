"""Prior weights of the runs of a bank: another prior without another run."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]
Quantile = Callable[[Array], Array]
"""Values of a distribution at probabilities (n,)."""

POINTS = 4001
"""Points of the table by which a quantile function is inverted."""


def density_of(quantile: Quantile, values: Array) -> Array:
    """Return the density (n,) of a distribution with a given quantile function at values (n,).

    Parameters
    ----------
    quantile : callable
        Values at probabilities.
    values : (n,) array
    """
    levels = np.concatenate([[1e-9], (np.arange(POINTS) + 0.5) / POINTS, [1.0 - 1e-9]])
    table = quantile(levels)
    rising = np.concatenate([[True], np.diff(table) > 0.0])
    table, levels = table[rising], levels[rising]
    middle = 0.5 * (table[1:] + table[:-1])
    slope = np.diff(levels) / np.diff(table)
    inside = (values >= table[0]) & (values <= table[-1])
    return np.where(inside, np.interp(values, middle, slope), 0.0)


def reweight(values: Array, old: Quantile, new: Quantile) -> Array:
    """Return the weights (n,) that turn draws of one distribution into draws of another.

    Parameters
    ----------
    values : (n,) array
        Draws.
    old, new : callable
        Quantile functions.

    Raises
    ------
    ValueError
        If the new distribution reaches where the old one has no draws.
    """
    levels = np.array([0.001, 0.999])
    wide, narrow = old(np.array([1e-9, 1.0 - 1e-9])), new(levels)
    reach = 1e-6 * float(wide[1] - wide[0])
    if narrow[0] < wide[0] - reach or narrow[1] > wide[1] + reach:
        raise ValueError(
            f"{narrow[0]:.4g} to {narrow[1]:.4g} goes beyond the {wide[0]:.4g} to {wide[1]:.4g} "
            "of the bank"
        )
    before = density_of(old, values)
    return np.where(
        before > 0.0, density_of(new, values) / np.where(before > 0.0, before, 1.0), 0.0
    )


def tilt(values: Array, shift: float) -> Array:
    """Return the weights (n,) that move a distribution up by a number of standard deviations.

    Exactly so for a normal one; of any other, the normal scores of the draws move.

    Parameters
    ----------
    values : (n,) array
        Draws.
    shift : float
        In standard deviations.
    """
    ranks = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    scores = special.ndtri((ranks + 0.5) / len(values))
    return np.asarray(np.exp(shift * scores - 0.5 * shift**2))


def combine(weights: Mapping[str, Array], n: int) -> Array:
    """Return the product (n,) of weights by input, of mean one.

    Parameters
    ----------
    weights : mapping
        Weights (n,) by input.
    n : int
        Number of runs.
    """
    product = np.ones(n)
    for factor in weights.values():
        product = product * factor
    return np.asarray(product / product.mean())
