"""Speed bias: the true impact speed differs from the recorded one."""

from collections.abc import Mapping


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs with the effect."""
    return {**values, "impact_speed": values["impact_speed"] * parameters["factor"]}
