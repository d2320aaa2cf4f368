"""Hood yield: beyond a force the slope is reduced to a share of the curve's slope."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.contact.law import ForceCurve


def apply(curve: ForceCurve, parameters: Mapping[str, float]) -> ForceCurve:
    """Return the hood's loading curve with the effect."""
    force, remaining = parameters["force"], parameters["remaining"]
    d, f = curve.penetration, curve.force
    last = (f[-1] - f[-2]) / (d[-1] - d[-2])
    begin = float(np.interp(force, f, d)) if force <= f[-1] else d[-1] + (force - f[-1]) / last
    x = d if begin in d else np.sort(np.append(d, begin))
    if begin >= x[-1]:
        # The curve is extrapolated linearly: one more knot gives it the reduced slope.
        x = np.append(x, begin + d[-1])
    at = curve.at(x)
    return replace(curve, penetration=x, force=np.minimum(at, force + remaining * (at - force)))
