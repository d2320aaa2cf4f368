"""Rotational head injury criteria."""

import numpy as np
from numpy.typing import ArrayLike

from models.criteria.sampling import largest_magnitudes

CRITICAL_ANGULAR_VELOCITY = (66.25, 56.45, 42.87)
"""rad/s about x, y, z: means of the CSDM and MPS values (E. Takhounts et al., Stapp 57, 2013)."""


def brain_injury_criterion(angular_velocity: ArrayLike) -> float:
    """Return BrIC.

    Parameters
    ----------
    angular_velocity : (n, 3) array_like
        Head angular velocity about its own x (forward), y, z axes in rad/s.

    Notes
    -----
    ``BrIC = sqrt(sum_i (max |w_i| / w_ic)^2)``; the maxima need not be simultaneous.
    """
    w = np.asarray(angular_velocity, dtype=np.float64)
    if w.ndim != 2 or w.shape[1] != 3:
        raise ValueError(f"angular_velocity must have shape (n, 3), given {w.shape}")
    return float(np.sqrt(np.sum((largest_magnitudes(w) / CRITICAL_ANGULAR_VELOCITY) ** 2)))
