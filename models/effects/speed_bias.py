"""Speed bias: the true impact speed differs from the recorded one, by a factor or an offset."""

from collections.abc import Mapping

LEAST = 0.1
"""Smallest share of the recorded speed that the true one may be."""


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs with the effect."""
    recorded = values["impact_speed"]
    true = recorded * parameters["factor"] + parameters["offset"]
    return {**values, "impact_speed": max(true, LEAST * recorded)}
