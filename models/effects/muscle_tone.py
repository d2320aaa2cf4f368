"""Muscle tone: tensed muscles stiffen the neck and raise the friction of the limb joints."""

from collections.abc import Mapping


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs with the effect."""
    tense = {
        name: values[name] * parameters["factor"] for name in ("neck_stiffness", "muscle_tone")
    }
    return {**values, **tense}
