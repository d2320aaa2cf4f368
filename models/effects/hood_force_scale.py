"""Hood force scale: the hood is stiffer or softer than its loading curve."""

from collections.abc import Mapping

from models.contact.law import ForceCurve


def apply(curve: ForceCurve, parameters: Mapping[str, float]) -> ForceCurve:
    """Return the hood's loading curve with the effect."""
    return curve.scaled(force=parameters["factor"])
