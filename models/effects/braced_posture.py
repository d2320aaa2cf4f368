"""The person saw the car coming: the limbs are part way from running to a braced stance."""

from collections.abc import Mapping


def apply(_share: float, parameters: Mapping[str, float]) -> float:
    """Return the share of the way from the running to the braced posture."""
    return parameters["share"]
