"""Unloading slope: the hood returns more or less energy than assumed.

Beside a factor, the excess of the unloading slope over the secant slope may grow with the largest
penetration (a power of it, over 30 mm), and the way out may be curved (a power of the force along
the straight line).
"""

from collections.abc import Mapping
from dataclasses import replace

from models.contact.law import ForceCurve


def apply(curve: ForceCurve, parameters: Mapping[str, float]) -> ForceCurve:
    """Return the hood's loading curve with the effect."""
    ratio = 1.0 + (curve.unloading_ratio - 1.0) * parameters["factor"]
    return replace(
        curve,
        unloading_ratio=ratio,
        unloading_growth=parameters["growth"],
        unloading_curvature=parameters["curvature"],
    )
