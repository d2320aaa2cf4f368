"""Contact parameters of a headform, apart from the hood's curve, that effects may change."""

from dataclasses import dataclass


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
    skin_compliance : float
        Compliance of the headform's skin in series with the hood, m/N.
    moved_mass : float
        Mass of the hood that the headform accelerates, kg.
    moved_depth : float
        Penetration over which this mass is picked up, m.
    """

    friction: float
    damping: float
    onset: float
    rate_share: float = 0.0
    rate_exponent: float = 1.0
    skin_compliance: float = 0.0
    moved_mass: float = 0.0
    moved_depth: float = 0.01
