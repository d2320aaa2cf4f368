"""Restitution: the road contact returns more or less energy than the tissue data say."""

from collections.abc import Mapping

from models.contact.road import Road


def apply(road: Road, parameters: Mapping[str, float]) -> Road:
    """Return the road with the effect."""
    return road._replace(returned=parameters["factor"])
