"""The braking car dips its nose more, or less, than assumed: the hood edge is lower or higher."""

from collections.abc import Mapping


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs as they truly were."""
    return {**values, "dive_angle": values["dive_angle"] + parameters["angle"]}
