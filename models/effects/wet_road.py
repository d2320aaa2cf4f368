"""Wet road: beyond a distance the friction of a sliding body is lower."""

from collections.abc import Mapping

from models.contact.road import Road


def apply(road: Road, parameters: Mapping[str, float]) -> Road:
    """Return the road with the effect."""
    return road._replace(
        wet_from=parameters["place"], wet_friction=road.friction * parameters["factor"]
    )
