"""Age scaling of adult risk functions: a child's tolerance relative to the adult's.

- ``hic``: tolerance of HIC by age relative to the adult. EEVC's factors of the Q dummies: 0.49 at
  birth, 0.45 at 1 year, 0.53 at 1.5, 0.71 at 3, 0.98 at 6 years (J. Wismans et al., EEVC 2008
  [found]); 1 from 10 years on [assumed]; linear between.
- ``brain_acceleration`` and ``brain_rate``: tolerance of angular acceleration scales with the
  brain's mass to the power -2/3, that of angular velocity with -1/3 (A. Ommaya et al. 1967
  [recalled]).
  Brain mass by age: 1.10 kg up to 3 years [assumed; an infant's is far less], 1.25 at 7, 1.40 from
  18 on [estimated]; linear between.

The BrIC is a ratio of angular velocities and scales with ``brain_rate``.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HIC_AGES, HIC_FACTORS = (0.0, 1.0, 1.5, 3.0, 6.0, 10.0), (0.49, 0.45, 0.53, 0.71, 0.98, 1.0)
BRAIN_AGES, BRAIN_MASSES = (3.0, 7.0, 18.0), (1.10, 1.25, 1.40)
ADULT_BRAIN = 1.40
"""kg, the adult's that the thresholds are for (Ommaya)."""


def tolerance_factor(scaling: str, age: Array | float) -> Array:
    """Return the tolerance relative to the adult's, by which the stimulus is divided.

    Parameters
    ----------
    scaling : str
        ``hic``, ``brain_acceleration``, ``brain_rate`` or ``none``.
    age : (n,) array or float
        Years.

    Raises
    ------
    ValueError
        If the scaling is unknown or an age is no number of years.
    """
    years = np.asarray(age, dtype=float)
    if not np.all((years >= 0.0) & (years < 130.0)):
        raise ValueError("age must be between 0 and 130 years")
    if scaling not in _FACTORS:
        raise ValueError(f"unknown scaling {scaling!r}, choose from {', '.join(_FACTORS)}")
    return _FACTORS[scaling](years)


def _hic(age: Array) -> Array:
    return np.interp(age, HIC_AGES, HIC_FACTORS)


def _brain(power: float) -> Callable[[Array], Array]:
    def factor(age: Array) -> Array:
        return (ADULT_BRAIN / np.interp(age, BRAIN_AGES, BRAIN_MASSES)) ** power

    return factor


_FACTORS: dict[str, Callable[[Array], Array]] = {
    "none": np.ones_like,
    "hic": _hic,
    "brain_acceleration": _brain(2.0 / 3.0),
    "brain_rate": _brain(1.0 / 3.0),
}
