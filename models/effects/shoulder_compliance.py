"""The shoulder girdle gives way more than the data say, so that the head swings further."""

from collections.abc import Mapping


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs as they truly were."""
    return {**values, "shoulder_stiffness": values["shoulder_stiffness"] / parameters["factor"]}
