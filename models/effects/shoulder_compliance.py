"""Shoulder compliance: the shoulder girdle deforms more than the data say."""

from collections.abc import Mapping


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs with the effect."""
    return {**values, "shoulder_stiffness": values["shoulder_stiffness"] / parameters["factor"]}
