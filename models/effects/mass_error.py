"""The headform was heavier or lighter than recorded."""

from collections.abc import Mapping


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs as they truly were."""
    return {**values, "headform_mass": values["headform_mass"] * parameters["factor"]}
