"""Least-squares loading curves: rising, piecewise linear, with few knots."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]

MAX_KNOTS = 8
"""Largest number of knots of a loading curve."""
SPACING = 0.08
"""Least distance of knots over the largest penetration (assumed)."""
SWEEPS = 4
"""Rounds in which each knot is moved once."""
FLATTEST = 1e-3
"""Least slope of a fitted segment over the secant of the whole curve, so that the law rises."""


def fit_loading(depth: Array, force: Array, places: Array) -> Array:
    """Return the forces (N) at the knots of the least-squares rising piecewise linear curve.

    Parameters
    ----------
    depth, force : (n,) array
        Measured penetration (m) and force (N).
    places : (k,) array
        Penetrations of the knots, m; the first is 0.

    Returns
    -------
    (k,) array
    """
    # Column j: penetration of a sample within segment j; slopes are non-negative.
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
    depth, force : (n,) array
        Measured penetration (m) and force (N).
    most : int
        Largest number of knots, 2 to 8.
    independent_samples : float, optional
        Number of independent samples; by default all. Filtered samples are correlated.

    Raises
    ------
    ValueError
        If ``most`` is not within 2 to 8.
    """
    if not 2 <= most <= MAX_KNOTS:
        raise ValueError(f"a loading curve has 2 to {MAX_KNOTS} knots, given {most}")
    n = max(float(independent_samples or depth.size), 4.0)
    end = float(depth.max())
    grid = end * np.arange(SPACING, 1.0 - 0.5 * SPACING, 0.5 * SPACING)
    places = np.array([0.0, end])
    score = n * np.log(_misfit(depth, force, places))
    while places.size < most:
        trials = [t for c in grid for t in (np.sort(np.append(places, c)),) if _is_spaced(t)]
        if not trials:
            break
        best = min(trials, key=lambda trial: _misfit(depth, force, trial))
        best = refine_knots(depth, force, best, grid)
        best = refine_knots(depth, force, best)
        # A knot costs two parameters: its penetration and its force.
        cost = 2.0 * np.log(n) * (best.size - 2)
        found = n * np.log(_misfit(depth, force, best)) + cost
        if found >= score:
            break
        places, score = best, found
    return places


def refine_knots(depth: Array, force: Array, places: Array, grid: Array | None = None) -> Array:
    """Return knots whose inner ones have been moved, one at a time, to improve the fit.

    Parameters
    ----------
    depth, force : (n,) array
        Measured penetration (m) and force (N).
    places : (k,) array
        Knots to start from, m.
    grid : (m,) array, optional
        Candidate penetrations of a knot, m; by default within half a spacing of its present one.
    """
    end = float(places[-1])
    best = _misfit(depth, force, places)
    for _ in range(SWEEPS):
        before = best
        for k in range(1, places.size - 1):
            if grid is None:
                steps = end * SPACING * np.array([-0.5, -0.25, -0.1, 0.1, 0.25, 0.5])
                candidates = places[k] + steps
            else:
                candidates = grid
            for candidate in candidates:
                trial = places.copy()
                trial[k] = candidate
                if not _is_spaced(trial):
                    continue
                misfit = _misfit(depth, force, trial)
                if misfit < best:
                    best, places = misfit, trial
        if best >= before * (1.0 - 1e-6):
            break
    return places


def _is_spaced(places: Array) -> bool:
    return bool(np.diff(places).min() >= 0.999 * SPACING * places[-1])


def _misfit(depth: Array, force: Array, places: Array) -> float:
    """Return the mean square residual of the best curve with these knots."""
    fitted = np.interp(depth, places, fit_loading(depth, force, places))
    # A floor keeps rounding errors of an exact fit from counting as misfit.
    return float(np.mean((force - fitted) ** 2)) + (1e-6 * float(force.max())) ** 2
