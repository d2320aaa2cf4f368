"""Mass error: the mass of the headform or the pedestrian differs from the recorded one."""

from collections.abc import Mapping


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs with the effect."""
    name = "headform_mass" if "headform_mass" in values else "body_mass"
    return {**values, name: values[name] * parameters["factor"]}
