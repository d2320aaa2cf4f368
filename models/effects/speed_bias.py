"""The headform was faster or slower than recorded."""

from collections.abc import Mapping


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs as they truly were."""
    return {**values, "impact_speed": values["impact_speed"] * parameters["factor"]}
