"""The person tensed the muscles: neck and limb joints resist more than a relaxed body's."""

from collections.abc import Mapping


def apply(values: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the inputs as they truly were."""
    tense = {
        name: values[name] * parameters["factor"] for name in ("neck_stiffness", "muscle_tone")
    }
    return {**values, **tense}
