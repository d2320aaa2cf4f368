"""What effects may change of a headform's contact beside the hood's curve."""

from dataclasses import dataclass


@dataclass(frozen=True)
class HeadformContact:
    """The contact beside the hood's curve.

    Attributes
    ----------
    friction : coefficient. damping : N s/m, while loading. onset : m over which it fades in.
    rate_share : by which the rate of penetration raises the force at 8 m/s.
    rate_exponent : with which it does.
    skin_compliance : m/N, of the headform's skin in series with the hood.
    moved_mass : kg of the hood that the headform sets in motion. moved_depth : m, over which.
    """

    friction: float
    damping: float
    onset: float
    rate_share: float = 0.0
    rate_exponent: float = 1.0
    skin_compliance: float = 0.0
    moved_mass: float = 0.0
    moved_depth: float = 0.01
