"""Scaling of mechanical properties between bodies of different size.

With length ratio ``lL``, modulus ratio ``lE`` and equal density, dimensional analysis gives
(H. Mertz 1989; A. Irwin and H. Mertz, SAE 973317, 1997; both recalled):

==================  ==================
force               lE lL^2
linear stiffness    lE lL
deflection          lL
moment              lE lL^3
time                lL / sqrt(lE)
linear damping      lL^2 sqrt(lE)
rotational damping  lL^4 sqrt(lE)
==================  ==================
"""

import math
from dataclasses import dataclass

import numpy as np

MODULUS_AGE = (1.0, 3.0, 6.0, 10.0, 18.0)
MODULUS_RATIO = (0.32, 0.475, 0.667, 0.854, 1.0)
"""Elastic modulus of a child over an adult's (skull and bone set; Irwin and Mertz 1997, recalled).
A six-year-old cranium was measured as stiff as an adult's (Davis 2012), so the ratio is uncertain
between these values and 1."""


@dataclass(frozen=True)
class Scale:
    """Ratios of a body to its reference.

    Attributes
    ----------
    length : float
        Ratio of lengths.
    modulus : float
        Ratio of elastic moduli.
    """

    length: float
    modulus: float = 1.0

    @property
    def force(self) -> float:
        """Ratio of forces."""
        return self.modulus * self.length**2

    @property
    def stiffness(self) -> float:
        """Ratio of linear stiffnesses."""
        return self.modulus * self.length

    @property
    def damping(self) -> float:
        """Ratio of linear damping."""
        return math.sqrt(self.modulus) * self.length**2

    @property
    def moment(self) -> float:
        """Ratio of moments and of rotational stiffnesses."""
        return self.modulus * self.length**3

    @property
    def rotational_damping(self) -> float:
        """Ratio of rotational damping."""
        return math.sqrt(self.modulus) * self.length**4


def modulus_ratio(age: float) -> float:
    """Return the elastic modulus of a body of ``age`` years over the adult's."""
    return float(np.interp(age, MODULUS_AGE, MODULUS_RATIO))


def scale_between(stature: float, age: float, from_stature: float, from_age: float) -> Scale:
    """Return the scale from one body to another.

    Parameters
    ----------
    stature, from_stature : float
        Stature of the body and of the reference, m.
    age, from_age : float
        Age of the body and of the reference, years.
    """
    return Scale(stature / from_stature, modulus_ratio(age) / modulus_ratio(from_age))
