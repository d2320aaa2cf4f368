"""Hood bottoming: the hood meets a structure below it after a clearance.

Beyond the clearance the force grows by ``stiffness * depth * (depth / 10 mm)^(power - 1)``,
approximated by straight segments. In the free form the stiffness is that of the first of three
segments, and the two others have factors of their own on it.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.contact.law import ForceCurve

REFERENCE = 0.010
"""Depth (m) beyond the clearance at which all powers have the same force."""
DEPTHS = (0.0015, 0.003, 0.0045, 0.006, 0.008, 0.01, 0.012, 0.0145, 0.018, 0.024, 0.04)
"""Depths (m) beyond the clearance of the knots of a curved law: up to 14.5 mm its chords are within
2 % of the force at 10 mm."""
SEGMENTS = (0.003, 0.008, 0.04)
"""Depths (m) beyond the clearance at which the segments of the free form end."""
SLOPES = ("to_8_mm", "beyond_8_mm")

NEAREST = 1e-6
"""m from a knot of the curve within which none is added."""


def apply(curve: ForceCurve, parameters: Mapping[str, float]) -> ForceCurve:
    """Return the hood's loading curve with the effect."""
    clearance, power = parameters["clearance"], parameters["power"]
    if parameters["stiffness"] == 0.0:
        return curve
    slopes = [1.0, *(parameters[name] for name in SLOPES)]
    free = any(slope != 1.0 for slope in slopes)
    depths = np.array([0.0, *(SEGMENTS if free else DEPTHS if power > 1.0 else DEPTHS[-1:])])
    added_knots = clearance + depths
    apart = np.abs(added_knots[:, None] - curve.penetration).min(axis=1) > NEAREST
    x = np.sort(np.concatenate([curve.penetration, added_knots[apart]]))
    depth = np.maximum(x - clearance, 0.0)
    if free:
        rise = np.cumsum(np.array(slopes) * np.diff(depths))
        beyond = np.maximum(depth - SEGMENTS[-1], 0.0)
        added = np.interp(depth, depths, np.append(0.0, rise)) + slopes[-1] * beyond
    else:
        added = depth * (depth / REFERENCE) ** (power - 1.0)
    return replace(curve, penetration=x, force=curve.at(x) + parameters["stiffness"] * added)
