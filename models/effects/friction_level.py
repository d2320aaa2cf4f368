"""Friction level: the road's friction differs from the assumed one along the whole slide."""

from collections.abc import Mapping

from models.contact.road import Road


def apply(road: Road, parameters: Mapping[str, float]) -> Road:
    """Return the road with the effect."""
    return road._replace(friction=road.friction * parameters["factor"])
