"""Least-squares loading curves: rising and piecewise linear, with few knots."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]

MOST_KNOTS = 8
"""Knots that a loading curve may have."""
SPACING = 0.08
"""Least distance of knots over the largest penetration (assumed)."""
FLATTEST = 1e-3
"""Least slope of a fitted segment over the secant of the whole curve: a law must rise."""


def fit_loading(depth: Array, force: Array, places: Array) -> Array:
    """Return the forces (N) at the knots of the rising piecewise linear curve of least squares.

    Parameters
    ----------
    depth, force : (n,) m and N. places : (k,) m, knots, the first at 0.
    """
    # Column j: how far a sample has come in segment j; slopes are non-negative.
    widths = np.diff(places)
    basis = np.clip(depth[:, None] - places[:-1], 0.0, widths)
    basis[:, -1] = np.maximum(depth - places[-2], 0.0)
    flattest = FLATTEST * float(force.max()) / float(places[-1])
    slopes, _ = nnls(basis, force - flattest * basis.sum(axis=1))
    return np.concatenate([[0.0], np.cumsum((slopes + flattest) * widths)])


def choose_knots(
    depth: Array, force: Array, most: int, independent_samples: float | None = None
) -> Array:
    """Return knots (m) from 0 to the largest depth that describe a curve.

    Knots are added one by one where they lower the sum of squares most, as long as the Bayesian
    information criterion falls (G. Schwarz, Ann. Statist. 6, 1978).

    Parameters
    ----------
    depth, force : (n,) m and N.
    most : knots at most, 2 to 8.
    independent_samples : how many samples count; by default all. Filtered samples are correlated.

    Raises
    ------
    ValueError
        If ``most`` is not within 2 to 8.
    """
    if not 2 <= most <= MOST_KNOTS:
        raise ValueError(f"a loading curve has 2 to {MOST_KNOTS} knots, given {most}")
    n = max(float(independent_samples or depth.size), 4.0)
    end = float(depth.max())
    candidates = end * np.arange(SPACING, 1.0 - 0.5 * SPACING, 0.5 * SPACING)
    places = np.array([0.0, end])

    def squares(knots: Array) -> float:
        fitted = np.interp(depth, knots, fit_loading(depth, force, knots))
        return float(np.mean((force - fitted) ** 2)) + (1e-6 * float(force.max())) ** 2

    score = n * np.log(squares(places))
    while places.size < most:
        free = [c for c in candidates if np.abs(places - c).min() >= SPACING * end * 0.999]
        if not free:
            break
        trials = [np.sort(np.append(places, c)) for c in free]
        found = [squares(trial) for trial in trials]
        best = int(np.argmin(found))
        # A knot costs two parameters: where it lies and its force.
        trial_score = n * np.log(found[best]) + 2.0 * np.log(n) * (places.size - 1)
        if trial_score >= score:
            break
        places, score = trials[best], trial_score
    return places
