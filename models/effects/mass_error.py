"""The headform, or the person struck, was heavier or lighter than recorded."""

from collections.abc import Mapping


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs as they truly were."""
    name = "headform_mass" if "headform_mass" in values else "body_mass"
    return {**values, name: values[name] * parameters["factor"]}
