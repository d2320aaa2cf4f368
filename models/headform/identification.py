"""From the acceleration of a headform to the force-penetration curve of what it struck.

The headform is taken as rigid and as not turning (perpendicular impact), so its acceleration gives
the force by its mass and, integrated twice, the penetration. A piecewise linear loading curve and
an unloading line are fitted to force against penetration by least squares. Intervals come from
repeating the whole chain on the signal with fresh noise, and on speed and mass within their
uncertainties.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import cumulative_trapezoid

from models.contact.law import ForceCurve
from models.contact.loading import choose_knots, fit_loading, refine_knots
from models.criteria.filters import CUTOFF_FACTOR, filter_cfc
from models.criteria.units import STANDARD_GRAVITY

Array = NDArray[np.float64]

CHANNEL_CLASS = 1000.0
"""Channel frequency class of head acceleration (SAE J211)."""
RISE = (0.00015, 0.0006)
"""s after the signal has risen out of its noise: this part of the flank, beyond what the filter
rounds and before the force curve bends, is extended to zero for first contact (assumed)."""
FAR, NEAR = 0.25, 0.05
"""Shares of the peak from which the part before contact is sought, at first and at last."""
OUT_OF_NOISE = 3.0
"""Standard deviations that a signal has risen by when it is out of its noise."""
SLOW = 0.06
"""Share of the peak up to which a slow start is followed (assumed)."""
LEAST_RISE = 0.02
"""Share of the peak that a signal has risen by at least: less is the filter's tail (assumed)."""
QUIET = 0.002
"""s before the flank from which on a sample no longer counts as before contact (assumed)."""
FEWEST_QUIET = 10
"""Samples before contact that offset and noise take at least."""
UNLOADED = 0.05
"""Share of the force at the largest penetration below which unloading is not fitted: contact ends
in the filter's tail (assumed)."""
FASTEST_REBOUND = 1.1
"""Rebound speed over impact speed beyond which a test is refused: contact gives no
energy, but speed is not known exactly (assumed)."""
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Loop:
    """Force against penetration of one test.

    Attributes
    ----------
    time : (n,) s after first contact. penetration : (n,) m. force : (n,) N.
    onset : s, first contact on the signal's own time axis.
    offset, noise : g, mean and standard deviation before contact; NaN if there is no such part.
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


@dataclass(frozen=True)
class Bounded:
    """A fitted value with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class StiffnessFit:
    """A fitted law.

    Attributes
    ----------
    curve : ForceCurve, with the fitted unloading ratio.
    force_low, force_high : (k,) N, 95 % interval of the force at each knot.
    unloading_ratio : 1. permanent : m, where the unloading line meets zero force.
    loop : Loop, what it was fitted to.
    residual : N, root mean square over the loading part.
    """

    curve: ForceCurve
    force_low: Array
    force_high: Array
    unloading_ratio: Bounded
    permanent: Bounded
    loop: Loop
    residual: float


def force_penetration(time: ArrayLike, acceleration: ArrayLike, speed: float, mass: float) -> Loop:
    """Return force against penetration from a filtered acceleration.

    Parameters
    ----------
    time : (n,) s, rising. acceleration : (n,) g, against the motion, already filtered.
    speed : m/s at first contact, perpendicular to the surface. mass : kg.

    Raises
    ------
    ValueError
        If the signal has no impact in it, or ends before the headform stops.
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
    # An offset moves the crossings from which it is sought: seek twice, from far and from near.
    for share in (FAR, NEAR):
        start = _crossing(t, a - offset, peak, share)
        quiet = a[t < start - QUIET]
        if quiet.size >= FEWEST_QUIET:
            offset, noise = float(quiet.mean()), float(quiet.std(ddof=1))
    a = a - offset
    if not a[peak] > 0.0:
        raise ValueError("the signal holds no impact above its offset")
    onset = _first_contact(t, a, peak, noise)
    later = t > onset
    t = np.concatenate([[onset], t[later]]) - onset
    a = np.concatenate([[0.0], a[later]])
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
    """Return when contact began: the flank just out of the noise, extended to zero."""
    level = OUT_OF_NOISE * noise / a[peak] if np.isfinite(noise) else 0.0
    risen = _crossing(t, a, peak, min(max(level, LEAST_RISE), FAR))
    # A slow start is known the better the longer it is followed.
    last = max(risen + RISE[1], _crossing(t, a, peak, SLOW))
    places = np.linspace(risen + RISE[0], last, 9)
    slope, start = np.polyfit(places, np.interp(places, t, a), 1)
    if not slope > 0.0:
        return risen
    return float(min(-start / slope, risen))


def _crossing(t: Array, a: Array, peak: int, share: float) -> float:
    """Return when the signal last rose through a share of its peak before the peak."""
    level = share * a[peak]
    below = np.flatnonzero(a[: peak + 1] < level)
    if below.size == 0:
        # The record begins above the level: extend its first rise backwards.
        k = int(np.argmax(a > a[0]))
        slope = (a[k] - a[0]) / (t[k] - t[0]) if k else np.inf
        return float(t[0] - (a[0] - level) / slope)
    k = int(below[-1])
    return float(t[k] + (level - a[k]) / (a[k + 1] - a[k]) * (t[k + 1] - t[k]))


def fit_stiffness(
    time: ArrayLike,
    acceleration: ArrayLike,
    speed: float,
    mass: float,
    *,
    filtered: bool = False,
    noise: float = 0.0,
    speed_sd: float = 0.0,
    mass_sd: float = 0.0,
    knots: int = 6,
    draws: int = 200,
    seed: int = 0,
) -> StiffnessFit:
    """Fit a force-penetration law to the acceleration of a headform.

    Parameters
    ----------
    time, acceleration : (n,) s and g, uniform. speed, mass : m/s, kg.
    filtered : whether the signal has already passed CFC 1000.
    noise : g, standard deviation of the filtered signal's noise, if known; the noise before
        contact or the misfit of the fitted curve counts instead where it is larger.
    speed_sd, mass_sd : standard uncertainties.
    knots : most knots of the loading curve, 2 to 8; the information criterion may take fewer.
    draws : repetitions for the intervals. seed : of their noise.

    Raises
    ------
    ValueError
        If the signal cannot be used; the message says why.
    """
    t = np.asarray(time, dtype=np.float64)
    a = np.asarray(acceleration, dtype=np.float64)
    if t.size < 8 or np.ptp(np.diff(t)) > 1e-3 * np.diff(t).mean():
        raise ValueError("the signal must be sampled uniformly, 8 samples or more")
    rate = 1.0 / float(np.diff(t).mean())
    if not filtered:
        a = filter_cfc(a, rate, CHANNEL_CLASS)
    loop = force_penetration(t, a, speed, mass)
    deepest = loop.deepest
    places = choose_knots(
        *loop.loading,
        knots,
        independent_samples=2.0 * CUTOFF_FACTOR * CHANNEL_CLASS * loop.time[deepest],
    )
    force, ratio = _fit_law(loop, places)
    misfit = loop.force[: deepest + 1] - np.interp(loop.penetration[: deepest + 1], places, force)
    residual = float(np.sqrt(np.mean(misfit**2)))
    level = np.nanmax([noise, loop.noise, residual / (mass * STANDARD_GRAVITY)])
    rng = np.random.default_rng(seed)
    repeated = []
    for _ in range(draws):
        white = filter_cfc(rng.standard_normal(a.size), rate, min(CHANNEL_CLASS, rate / 4.3))
        copy = a + level * white / white.std()
        # Zero-mean draws of speed and mass, kept away from nonsense.
        v = speed + speed_sd * float(np.clip(rng.standard_normal(), -4.0, 4.0))
        m = mass + mass_sd * float(np.clip(rng.standard_normal(), -4.0, 4.0))
        try:
            again = force_penetration(t, copy, v, m)
            moved = refine_knots(*again.loading, places)
            f, r = _fit_law(again, moved)
            f = ForceCurve(moved, f, r).at(places)
        except ValueError:
            continue
        depth = again.penetration[again.deepest]
        repeated.append([*f, r, depth * (1.0 - 1.0 / r)])
    if draws and len(repeated) < draws / 2:
        raise ValueError("the signal is too noisy: its curve cannot be repeated with its own noise")
    depth = loop.penetration[deepest]
    best = np.array([*force, ratio, depth * (1.0 - 1.0 / ratio)])
    low, high = np.full(best.size, np.nan), np.full(best.size, np.nan)
    if repeated:
        tail = 0.5 * (1.0 - CONFIDENCE)
        low, high = np.quantile(repeated, [tail, 1.0 - tail], axis=0)
        # Centred on the fit: a second helping of noise shifts the copies a little.
        shift = best - np.median(repeated, axis=0)
        low, high = low + shift, high + shift
    n = places.size
    return StiffnessFit(
        curve=ForceCurve(places, force, ratio),
        force_low=low[:n],
        force_high=high[:n],
        unloading_ratio=Bounded(ratio, float(low[n]), float(high[n])),
        permanent=Bounded(float(best[n + 1]), float(low[n + 1]), float(high[n + 1])),
        loop=loop,
        residual=residual,
    )


def _fit_law(loop: Loop, places: Array) -> tuple[Array, float]:
    """Return forces at the knots and the unloading ratio of a loop.

    Raises
    ------
    ValueError
        If the loop has no unloading part.
    """
    k = loop.deepest
    force = fit_loading(loop.penetration[: k + 1], loop.force[: k + 1], places)
    depth = float(loop.penetration[k])
    top = float(ForceCurve(places, force, 2.0).at(np.array(depth)))
    falling = slice(k, None)
    kept = loop.force[falling] > UNLOADED * top
    back = depth - loop.penetration[falling][kept]
    drop = top - loop.force[falling][kept]
    if kept.sum() < 3 or not back @ back > 0.0:
        raise ValueError("the unloading part has fewer than 3 samples: sample faster")
    # Line through (depth, top): the orthogonal axis is penetration, so regress it on the force.
    slope = float(drop @ drop / (drop @ back)) if drop @ back > 0.0 else np.inf
    return force, max(min(slope * depth / top, 1e3), 1.001)
