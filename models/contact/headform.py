"""Contact parameters of a headform, apart from the hood's curve, that effects may change."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def empty_table() -> Array:
    """Return a table over the penetration that adds nothing."""
    return np.zeros((1, 2))


@dataclass(frozen=True)
class HeadformContact:
    """Contact parameters apart from the hood's curve.

    Attributes
    ----------
    friction : float
        Coefficient of friction.
    damping : float
        Damping while loading, N s/m.
    onset : float
        Penetration over which the damping tapers in, m.
    rate_share : float
        Relative increase of the force at a penetration rate of 8 m/s.
    rate_exponent : float
        Exponent of the rate in that increase.
    rate_force : (k, 2) array
        Penetrations (m), rising from 0, and the force (N) that a rate of 8 m/s adds there while
        loading; one row for none.
    skin_compliance : float
        Compliance of the headform's skin in series with the hood, m/N; its secant at 4 kN.
    skin_power : float
        Exponent of the force in the penetration of the skin, 1 for a linear spring.
    pickup : (k, 2) array
        Penetrations (m), rising from 0, and the mass of the hood per penetration (kg/m) that is
        brought to the headform's speed there; one row for none.
    part_mass, part_stiffness, part_damping : float
        A part of the hood that the headform strikes through a local spring and damper, kg, N/m and
        N s/m; without mass for none.
    guide_force : float
        Force of a guide of the rig against the headform's motion at 8 m/s, N.
    guide_exponent : float
        Exponent of the speed in that force.
    """

    friction: float
    damping: float
    onset: float
    rate_share: float = 0.0
    rate_exponent: float = 1.0
    rate_force: Array = field(default_factory=empty_table)
    skin_compliance: float = 0.0
    skin_power: float = 1.0
    pickup: Array = field(default_factory=empty_table)
    part_mass: float = 0.0
    part_stiffness: float = 0.0
    part_damping: float = 0.0
    guide_force: float = 0.0
    guide_exponent: float = 0.0
