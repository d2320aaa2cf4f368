"""Force-penetration law: loading curve, unloading line, permanent part and damping.

The loading curve is piecewise linear and is extrapolated linearly. From the largest penetration
``d`` so far, with force ``F(d)``, the contact unloads and reloads along a straight line of
slope ``ratio F(d) / d``; the line meets zero force at the permanent part ``d (1 - 1 / ratio)``. A
viscous force acts while the penetration grows.

Body and car deform in series: they carry the same force, their penetrations add and so do their
elastic recoveries. Both are piecewise linear, so the combined law is exact (this is MADYMO's
"combined" contact characteristic, in closed form).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel, kernel

Array = NDArray[np.float64]

KNOTS = 64
"""Largest number of knots of a combined law; each side has at most half of them."""

DAMPING_ONSET = 0.005
"""Penetration (m) over which the damping of a crash contact tapers in (assumed: small against the
20 to 90 mm of a vehicle zone, so that the force has no jump at first touch)."""

# Columns of a combined law.
PENETRATION, FORCE, RECOVERY, SURFACE = 0, 1, 2, 3


@kernel
def _all_finite(penetration, force):
    finite = True
    for k in range(penetration.size):
        finite &= math.isfinite(penetration[k]) and math.isfinite(force[k])
    return finite


@kernel
def _rises(penetration, force):
    """Return whether a curve begins at (0, 0) and rises strictly in both columns."""
    rising = penetration[0] == 0.0 and force[0] == 0.0
    for k in range(1, penetration.size):
        rising &= penetration[k] > penetration[k - 1] and force[k] > force[k - 1]
    return rising


@kernel
def stiffest_slope(penetration, force, unloading_ratio):
    """Return the largest slope (N/m) of a curve, over loading and unloading from any penetration.

    Parameters
    ----------
    penetration, force : (k,) array
        Knots of the loading curve, m and N.
    unloading_ratio : float
        Unloading slope over secant slope.
    """
    steepest, last = 0.0, 0.0
    for k in range(1, penetration.size):
        last = (force[k] - force[k - 1]) / (penetration[k] - penetration[k - 1])
        steepest = max(steepest, last, unloading_ratio * force[k] / penetration[k])
    # Beyond the last knot the secant tends to the last slope.
    return max(steepest, unloading_ratio * last)


@dataclass(frozen=True)
class ForceCurve:
    """One side of a contact.

    Attributes
    ----------
    penetration, force : (k,) array
        Knots in m and N, rising from (0, 0).
    unloading_ratio : float
        Unloading slope over secant slope at the largest penetration, > 1.
    damping : float
        Damping while loading, N s/m.
    unloading_growth, unloading_curvature : float
        Deviation from a straight unloading line of one ratio, which only the headform test against
        one zone has; see ``models.headform.impact.Surface``.
    """

    penetration: Array
    force: Array
    unloading_ratio: float
    damping: float = 0.0
    unloading_growth: float = 0.0
    unloading_curvature: float = 1.0

    def __post_init__(self) -> None:
        d, f = self.penetration, self.force
        if d.ndim != 1 or d.shape != f.shape or not 2 <= d.size <= KNOTS // 2:
            raise ValueError(f"a force curve takes 2 to {KNOTS // 2} knots, given {d.shape}")
        if not _all_finite(d, f):
            raise ValueError("the knots of a force curve must be finite")
        if not _rises(d, f):
            raise ValueError("a force curve starts at (0, 0) and rises strictly in both columns")
        if not (self.unloading_ratio > 1.0 and self.damping >= 0.0):
            raise ValueError("unloading_ratio must exceed 1 and damping must not be negative")

    @property
    def knots(self) -> list[list[float]]:
        """Knots as stored in data files and model options: pairs of penetration and force."""
        pairs: list[list[float]] = np.stack([self.penetration, self.force], axis=1).tolist()
        return pairs

    def scaled(self, force: float = 1.0, penetration: float = 1.0) -> "ForceCurve":
        """Return the curve with forces and penetrations multiplied by the given factors."""
        return ForceCurve(
            self.penetration * penetration,
            self.force * force,
            self.unloading_ratio,
            self.damping * force / penetration,
        )

    def at(self, penetration: Array) -> Array:
        """Return the loading force (N) at penetrations (m) of any shape."""
        d, f = self.penetration, self.force
        slope = (f[-1] - f[-2]) / (d[-1] - d[-2])
        beyond = np.maximum(penetration - d[-1], 0.0)
        return np.asarray(np.interp(penetration, d, f) + slope * beyond)


@kernel
def combine_curves(surface_d, surface_f, surface_ratio, body_d, body_f, body_ratio, out):
    """Write the law of two curves in series and return its number of knots.

    Parameters
    ----------
    surface_d, surface_f : (k,) array
        Knots of the surface's loading curve, m and N.
    surface_ratio : float
        Unloading ratio of the surface.
    body_d, body_f : (k,) array
        Knots of the body's loading curve, m and N.
    body_ratio : float
        Unloading ratio of the body.
    out : (KNOTS, 4) array
        Filled: penetration (m), force (N), elastic recovery (m), penetration of the surface (m).

    Returns
    -------
    int
        Number of rows used.
    """
    ns, nb = surface_d.size, body_d.size
    i, j, n = 1, 1, 0
    out[0, :] = 0.0
    while i < ns or j < nb:
        # Next knot: the smaller force of the two sides.
        surface_next = j >= nb or (i < ns and surface_f[i] <= body_f[j])
        force = surface_f[i] if surface_next else body_f[j]
        a, b = min(i, ns - 1), min(j, nb - 1)
        ds = surface_d[a - 1] + (force - surface_f[a - 1]) * (surface_d[a] - surface_d[a - 1]) / (
            surface_f[a] - surface_f[a - 1]
        )
        db = body_d[b - 1] + (force - body_f[b - 1]) * (body_d[b] - body_d[b - 1]) / (
            body_f[b] - body_f[b - 1]
        )
        n += 1
        out[n, 0] = ds + db
        out[n, 1] = force
        out[n, 2] = ds / surface_ratio + db / body_ratio
        out[n, 3] = ds
        # Knots whose forces differ only by rounding are merged.
        if i < ns and surface_f[i] <= force * (1.0 + 1e-9):
            i += 1
        if j < nb and body_f[j] <= force * (1.0 + 1e-9):
            j += 1
    return n + 1


def law_of(curve: ForceCurve, out: Array) -> int:
    """Write the law of one curve against a rigid body into ``out`` and return its number of knots.

    The columns are those of ``combine_curves``.
    """
    count = curve.penetration.size
    out[:count, PENETRATION] = curve.penetration
    out[:count, FORCE] = curve.force
    out[:count, RECOVERY] = curve.penetration / curve.unloading_ratio
    out[:count, SURFACE] = curve.penetration
    return count


@inlined_kernel
def interpolate_law(laws, law, count, column, penetration):
    """Return a column of a combined law at a penetration, with linear extrapolation.

    Parameters
    ----------
    laws : (m, KNOTS, 4) array
        Combined laws.
    law : int
        Row of the law.
    count : int
        Number of knots used.
    column : int
        ``FORCE``, ``RECOVERY`` or ``SURFACE``.
    penetration : float
        m.
    """
    k = 1
    while k < count - 1 and penetration > laws[law, k, 0]:
        k += 1
    x0 = laws[law, k - 1, 0]
    y0 = laws[law, k - 1, column]
    return y0 + (laws[law, k, column] - y0) * (penetration - x0) / (laws[law, k, 0] - x0)


@inlined_kernel
def contact_force(laws, law, count, damping, onset, penetration, rate, largest):
    """Return the elastic and the damping force (N) of a contact.

    Parameters
    ----------
    laws : (m, KNOTS, 4) array
        Combined laws.
    law : int
        Row of the law.
    count : int
        Number of knots used.
    damping : float
        Damping while loading, N s/m.
    onset : float
        Penetration over which the damping tapers in, m; 0 applies it at once.
    penetration : float
        m.
    rate : float
        Rate of penetration, m/s.
    largest : float
        Largest penetration so far, ``penetration`` included, m.

    Returns
    -------
    elastic, viscous : float
        N.
    """
    top = interpolate_law(laws, law, count, FORCE, largest)
    if penetration >= largest:
        elastic = top
    else:
        recovery = interpolate_law(laws, law, count, RECOVERY, largest)
        elastic = top * (penetration - largest + recovery) / recovery
        if elastic < 0.0:
            elastic = 0.0
    viscous = 0.0
    if rate > 0.0 and damping > 0.0:
        viscous = damping * rate
        if penetration < onset:
            viscous *= penetration / onset
    return elastic, viscous
