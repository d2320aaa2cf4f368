"""Brake dive: the car's pitch, and so the height of the hood edge, differs from the assumed one."""

from collections.abc import Mapping


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs with the effect."""
    return {**values, "dive_angle": values["dive_angle"] + parameters["angle"]}
