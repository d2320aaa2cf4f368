"""Braced posture: the limbs lie between the running posture and a braced stance."""

from collections.abc import Mapping


def apply(_share: float, parameters: Mapping[str, float]) -> float:
    """Return the interpolation share between the running (0) and the braced posture (1)."""
    return parameters["share"]
