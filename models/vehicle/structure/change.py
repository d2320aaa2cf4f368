"""What a run's inputs change in a structure."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from models import data

_POWERS: dict[str, dict[str, float]] = data.load("fem.toml")["force_powers"]


@dataclass(frozen=True)
class Change:
    """Factors on a structure.

    Attributes
    ----------
    sheet, strength, rib : float
        On the thickness of all sheets, their yield stress and the depth of the hood's sections.
    force : mapping of str to float
        By zone: what a loading curve of the zone's corridor would carry, over the median.
    """

    sheet: float = 1.0
    strength: float = 1.0
    rib: float = 1.0
    force: Mapping[str, float] = field(default_factory=dict)

    def factors(self, zone: str, *, backed: bool = False) -> tuple[float, float, float]:
        """Return the factors on thickness, yield stress and rib depth in a zone.

        A factor on force acts by the powers of ``data/fem.toml``.

        Parameters
        ----------
        zone : str
        backed : bool
            Whether borders and backing take the factor on force as well.
        """
        f = self.force.get(zone, 1.0)
        power = _POWERS["backed" if backed else "free"]
        return (
            self.sheet * f ** power["sheet"],
            self.strength * f ** power["strength"],
            self.rib * f ** power.get("rib", 0.0),
        )
