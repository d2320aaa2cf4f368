"""Hood yield: beyond a force the slope is reduced to a share of the curve's slope.

In the free form the slope is lost in steps: up to 10 and to 25 % beyond the force shares of the
loss, each with a value of its own, are still to come.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models.contact.law import ForceCurve

Array = NDArray[np.float64]

EDGES = (0.1, 0.25)
"""Ends of the steps of the free form, relative to the force."""
STEPS = ("kept_to_10_percent", "kept_to_25_percent")


def apply(curve: ForceCurve, parameters: Mapping[str, float]) -> ForceCurve:
    """Return the hood's loading curve with the effect."""
    force, remaining = parameters["force"], parameters["remaining"]
    kept = [parameters[name] for name in STEPS]
    edges = force * np.array([0.0, *EDGES]) if any(kept) else np.zeros(1)
    shares = remaining + (1.0 - remaining) * np.array([*kept, 0.0])[-edges.size :]
    d = curve.penetration
    knots = _penetration_at(curve, force + edges)
    x = np.unique(np.concatenate([d, knots]))
    if knots[-1] >= d[-1]:
        # The curve is extrapolated linearly: one more knot gives it the reduced slope.
        x = np.append(x, x[-1] + d[-1])
    at = curve.at(x)
    lengths = np.append(np.diff(edges), np.inf)
    beyond = np.clip(at[:, None] - force - edges, 0.0, lengths)
    return replace(curve, penetration=x, force=np.minimum(at, force + beyond @ shares))


def _penetration_at(curve: ForceCurve, force: Array) -> Array:
    """Return the penetrations (m) at forces (N), extrapolated linearly."""
    d, f = curve.penetration, curve.force
    last = (f[-1] - f[-2]) / (d[-1] - d[-2])
    return np.asarray(np.interp(force, f, d) + np.maximum(force - f[-1], 0.0) / last)
