"""Force against penetration from the acceleration of a headform.

The headform is assumed rigid and without rotation (perpendicular impact), so its acceleration times
its mass is the force and, integrated twice from first contact, gives the penetration.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import cumulative_trapezoid

from models.criteria.units import STANDARD_GRAVITY

Array = NDArray[np.float64]

RISE = (0.00015, 0.0006)
"""s after the signal has risen out of its noise: this part of the flank, beyond what the filter
rounds and before the force curve bends, is extended to zero for first contact (assumed)."""
FAR, NEAR = 0.25, 0.05
"""Shares of the peak from which the part before contact is sought, at first and at last."""
OUT_OF_NOISE = 3.0
"""Standard deviations above which a signal has risen out of its noise."""
SLOW = 0.06
"""Share of the peak up to which a slow start is followed (assumed)."""
LEAST_RISE = 0.02
"""Share of the peak that a signal has risen by at least: less is the filter's tail (assumed)."""
QUIET = 0.002
"""s before the flank from which on a sample no longer counts as before contact (assumed)."""
MIN_QUIET = 10
"""Samples before contact that offset and noise take at least."""
UNLOADED = 0.05
"""Share of the force at the largest penetration below which unloading is not fitted: contact ends
in the filter's tail (assumed)."""
FASTEST_REBOUND = 1.1
"""Rebound speed over impact speed beyond which a test is refused: contact gives no
energy, but speed is not known exactly (assumed)."""


@dataclass(frozen=True)
class Loop:
    """Force against penetration of one test.

    Attributes
    ----------
    time : (n,) array
        Time after first contact, s.
    penetration : (n,) array
        m.
    force : (n,) array
        N.
    onset : float
        First contact on the signal's own time axis, s.
    offset, noise : float
        Mean and standard deviation before contact, g; the noise is NaN if there is no such part.
    """

    time: Array
    penetration: Array
    force: Array
    onset: float
    offset: float
    noise: float

    @property
    def deepest(self) -> int:
        """Sample of the largest penetration."""
        return int(np.argmax(self.penetration))

    @property
    def loading(self) -> tuple[Array, Array]:
        """Penetration and force up to the largest penetration."""
        end = self.deepest + 1
        return self.penetration[:end], self.force[:end]


def force_penetration(
    time: ArrayLike, acceleration: ArrayLike, speed: float, mass: float, *, lead: float = QUIET
) -> Loop:
    """Return force against penetration from a filtered acceleration.

    Parameters
    ----------
    time : (n,) array_like
        s, rising.
    acceleration : (n,) array_like
        Deceleration, already filtered, g.
    speed : float
        Speed at first contact, perpendicular to the surface, m/s.
    mass : float
        kg.
    lead : float
        Time before the flank that does not count as quiet, because the filter responds before the
        event, s.

    Returns
    -------
    Loop

    Raises
    ------
    ValueError
        If the signal contains no impact, or ends before the headform stops.
    """
    t, a = np.asarray(time, dtype=np.float64), np.asarray(acceleration, dtype=np.float64)
    if t.ndim != 1 or t.shape != a.shape or t.size < 8:
        raise ValueError(f"time {t.shape} and acceleration {a.shape} must be equal, 8 or more")
    if not (np.all(np.isfinite(a)) and np.all(np.diff(t) > 0.0)):
        raise ValueError("the acceleration must be finite and its time must rise")
    if not (speed > 0.0 and mass > 0.0):
        raise ValueError("speed and mass must be positive")
    peak = int(np.argmax(a))
    if not a[peak] > 0.0:
        raise ValueError("the signal holds no impact: its largest value is not positive")
    offset, noise = 0.0, np.nan
    # An offset shifts the crossings from which it is estimated: estimate it twice, far and near.
    for share in (FAR, NEAR):
        start = _crossing(t, a - offset, peak, share)
        quiet = a[t < start - lead]
        if quiet.size >= MIN_QUIET:
            offset, noise = float(quiet.mean()), float(quiet.std(ddof=1))
    a = a - offset
    if not a[peak] > 0.0:
        raise ValueError("the signal holds no impact above its offset")
    return integrate(t, a, _first_contact(t, a, peak, noise), speed, mass, offset, noise)


def integrate(
    time: Array,
    acceleration: Array,
    onset: float,
    speed: float,
    mass: float,
    offset: float,
    noise: float,
) -> Loop:
    """Return force against penetration from first contact on.

    Parameters
    ----------
    time : (n,) array
        s, rising.
    acceleration : (n,) array
        Deceleration without its offset, g.
    onset : float
        First contact, s.
    speed : float
        Speed at first contact, m/s.
    mass : float
        kg.
    offset, noise : float
        g; stored in the result.

    Returns
    -------
    Loop

    Raises
    ------
    ValueError
        If the signal ends before the headform stops, or it rebounds faster than it came.
    """
    later = time > onset
    t = np.concatenate([[onset], time[later]]) - onset
    a = np.concatenate([[0.0], acceleration[later]])
    rate = speed - STANDARD_GRAVITY * cumulative_trapezoid(a, t, initial=0)
    depth = cumulative_trapezoid(rate, t, initial=0)
    deepest = int(np.argmax(depth))
    if deepest >= t.size - 3:
        raise ValueError(
            "the signal ends before the headform rebounds: its impulse does not stop "
            f"{speed:g} m/s (check speed, unit and length)"
        )
    force = mass * STANDARD_GRAVITY * a
    over = np.flatnonzero(force[deepest:] < 0.5 * UNLOADED * force[deepest])
    end = deepest + int(over[0]) + 1 if over.size else t.size
    if -rate[end - 1] > FASTEST_REBOUND * speed:
        raise ValueError(
            f"the headform would rebound at {-rate[end - 1]:.3g} m/s, faster than it came "
            f"({speed:g} m/s): check speed, unit and offset"
        )
    return Loop(t[:end], depth[:end], force[:end], float(onset), offset, noise)


def _first_contact(t: Array, a: Array, peak: int, noise: float) -> float:
    """Return the time of first contact: the flank just above the noise, extrapolated to zero."""
    level = OUT_OF_NOISE * noise / a[peak] if np.isfinite(noise) else 0.0
    risen = _crossing(t, a, peak, min(max(level, LEAST_RISE), FAR))
    # A slow start is estimated from a longer part of the flank.
    last = max(risen + RISE[1], _crossing(t, a, peak, SLOW))
    places = np.linspace(risen + RISE[0], last, 9)
    slope, start = np.polyfit(places, np.interp(places, t, a), 1)
    if not slope > 0.0:
        return risen
    return float(min(-start / slope, risen))


def _crossing(t: Array, a: Array, peak: int, share: float) -> float:
    """Return the last time before the peak at which the signal rose through a share of it."""
    level = share * a[peak]
    below = np.flatnonzero(a[: peak + 1] < level)
    if below.size == 0:
        # The record begins above the level: extend its first rise backwards.
        k = int(np.argmax(a > a[0]))
        slope = (a[k] - a[0]) / (t[k] - t[0]) if k else np.inf
        return float(t[0] - (a[0] - level) / slope)
    k = int(below[-1])
    return float(t[k] + (level - a[k]) / (a[k + 1] - a[k]) * (t[k + 1] - t[k]))
