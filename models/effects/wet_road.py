"""Beyond a place the road is slippery: the friction of a body sliding on it is lower there."""

from collections.abc import Mapping

from models.contact.road import Road


def apply(road: Road, parameters: Mapping[str, float]) -> Road:
    """Return the road with the effect."""
    return road._replace(
        wet_from=parameters["place"], wet_friction=road.friction * parameters["factor"]
    )
