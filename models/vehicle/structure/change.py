"""What a run's inputs change in a structure."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from models import data

_POWERS: dict[str, float] = data.load("fem.toml")["force_powers"]


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

    def factors(self, zone: str, *, ribs: bool = False) -> tuple[float, float, float]:
        """Return the factors on thickness, yield stress and rib depth in a zone.

        A factor on force acts by the powers of ``data/fem.toml``; without ribs, their power is the
        yield stress's.

        Parameters
        ----------
        zone : str
        ribs : bool
            Whether the sheet has ribs.
        """
        f = self.force.get(zone, 1.0)
        strength = _POWERS["strength"] + (0.0 if ribs else _POWERS["rib"])
        return (
            self.sheet * f ** _POWERS["sheet"],
            self.strength * f**strength,
            self.rib * f ** _POWERS["rib"],
        )
