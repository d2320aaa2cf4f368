"""Hardening curves of a user's materials in the form of ``models.shells.material``."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar, nnls

Array = NDArray[np.float64]

STRAIN = 0.5
"""Largest plastic strain that is fitted: sheet metal of a front sees less (assumed)."""
ERROR = 0.05
"""Largest relative error of a stress (assumed)."""
SCALES = (1e-3, 1.0)
"""Plastic strains between which hardening saturates."""


def fit_hardening(curve: Array) -> tuple[tuple[float, float, float, float], float]:
    """Return yield stress, slope, saturation (Pa) and scale of a curve, and the largest error.

    The law is ``yield + slope p + saturation (1 - exp(-p / scale))`` with the plastic strain p.

    Parameters
    ----------
    curve : (k, 2) array
        Plastic strain and yield stress, Pa.

    Raises
    ------
    ValueError
        In one line, if the curve does not begin at zero strain, falls, or is not met within 5 %.
    """
    strain, stress = curve[np.argsort(curve[:, 0], kind="stable")].T
    if strain[0] != 0.0:
        raise ValueError("the hardening curve must begin at plastic strain 0")
    if (np.diff(strain) <= 0.0).any() or stress[0] <= 0.0:
        raise ValueError("the hardening curve has no stress above 0 at rising strains")
    if (np.diff(stress) < 0.0).any():
        raise ValueError("the hardening curve falls; softening is not modelled")
    p = np.linspace(0.0, min(STRAIN, float(strain[-1])), 60)
    p = np.unique(np.concatenate([p, strain[strain <= p[-1]]]))
    wanted = np.interp(p, strain, stress)

    def parts(scale: float) -> Array:
        return np.stack([np.ones_like(p), p, 1.0 - np.exp(-p / scale)], axis=1)

    def solve(scale: float) -> tuple[Array, float]:
        weights, left = nnls(parts(scale) / wanted[:, None], np.ones_like(p))
        return weights, float(left)

    low, high = np.log(SCALES)
    # One valley a decade: the best of some starts.
    grid = np.linspace(low, high, 25)
    start = grid[int(np.argmin([solve(float(np.exp(g)))[1] for g in grid]))]
    best = minimize_scalar(
        lambda g: solve(float(np.exp(g)))[1], bounds=(start - 0.3, start + 0.3), method="bounded"
    )
    scale = float(np.exp(best.x))
    weights, _ = solve(scale)
    error = float(np.abs(parts(scale) @ weights / wanted - 1.0).max())
    if error > ERROR:
        raise ValueError(
            f"the hardening curve is met within {100.0 * error:.0f} % only, {100.0 * ERROR:.0f} % "
            "are allowed; smooth it"
        )
    yield_stress, slope, saturation = (float(w) for w in weights)
    return (yield_stress, slope, saturation, scale), error
