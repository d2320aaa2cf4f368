"""Unloading slope: the hood returns more or less energy than assumed."""

from collections.abc import Mapping
from dataclasses import replace

from models.contact.law import ForceCurve


def apply(curve: ForceCurve, parameters: Mapping[str, float]) -> ForceCurve:
    """Return the hood's loading curve with the effect."""
    ratio = 1.0 + (curve.unloading_ratio - 1.0) * parameters["factor"]
    return replace(curve, unloading_ratio=ratio)
