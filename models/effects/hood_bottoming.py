"""Hood bottoming: the hood meets a structure below it after a clearance.

Beyond the clearance the force grows by ``stiffness * depth * (depth / 10 mm)^(power - 1)``,
approximated by straight segments.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.contact.law import ForceCurve

REFERENCE = 0.010
"""Depth (m) beyond the clearance at which all powers have the same force."""
DEPTHS = (0.002, 0.004, 0.007, 0.01, 0.014, 0.02, 0.04)
"""Depths (m) beyond the clearance of the knots of a curved law."""

NEAREST = 1e-6
"""m from a knot of the curve within which none is added."""


def apply(curve: ForceCurve, parameters: Mapping[str, float]) -> ForceCurve:
    """Return the hood's loading curve with the effect."""
    clearance, power = parameters["clearance"], parameters["power"]
    if parameters["stiffness"] == 0.0:
        return curve
    depths = np.array([0.0, *(DEPTHS if power > 1.0 else DEPTHS[-1:])])
    added_knots = clearance + depths
    apart = np.abs(added_knots[:, None] - curve.penetration).min(axis=1) > NEAREST
    x = np.sort(np.concatenate([curve.penetration, added_knots[apart]]))
    depth = np.maximum(x - clearance, 0.0)
    added = parameters["stiffness"] * depth * (depth / REFERENCE) ** (power - 1.0)
    return replace(curve, penetration=x, force=curve.at(x) + added)
