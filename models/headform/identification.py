"""Identification of the force-penetration curve of the struck surface from a headform acceleration.

A piecewise linear loading curve and an unloading line are fitted to force against penetration by
least squares. A signal smoothed by a channel class below 1000 is instead fitted by the simulated
signal after the same filter. Intervals come from repeating the whole procedure on the signal with
added noise, and on speed and mass within their uncertainties.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.contact.law import ForceCurve
from models.contact.loading import choose_knots, fit_loading, refine_knots
from models.criteria.filters import CUTOFF_FACTOR, filter_cfc, settling_time
from models.criteria.units import STANDARD_GRAVITY
from models.headform.filtered_fit import FilteredFit, fit_through_filter, repeat_fit
from models.headform.loop import MIN_QUIET, QUIET, UNLOADED, Loop, force_penetration, integrate

Array = NDArray[np.float64]

CHANNEL_CLASS = 1000.0
"""Channel frequency class of head acceleration (SAE J211)."""
CONFIDENCE = 0.95
UNEVEN = 1e-3
"""Share of a sampling interval by which intervals of a uniform signal may differ."""


@dataclass(frozen=True)
class Bounded:
    """A fitted value with its 95 % interval.

    Attributes
    ----------
    value, low, high : float
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class _Law:
    """A fitted law.

    Attributes
    ----------
    curve : ForceCurve
    depth : float
        Largest penetration, m.
    loop : Loop
    residual : float
        Root mean square residual, N.
    filtered : FilteredFit, optional
        Result of the fit through a filter.
    """

    curve: ForceCurve
    depth: float
    loop: Loop
    residual: float
    filtered: FilteredFit | None = None

    def at(self, places: Array) -> list[float]:
        """Return forces at penetrations, unloading ratio, permanent and largest penetration."""
        ratio = self.curve.unloading_ratio
        return [*self.curve.at(places), ratio, self.depth * (1.0 - 1.0 / ratio), self.depth]


@dataclass(frozen=True)
class StiffnessFit:
    """A fitted law with intervals.

    Attributes
    ----------
    curve : ForceCurve
        With the fitted unloading ratio.
    force_low, force_high : (k,) array
        95 % interval of the force at each knot, N.
    unloading_ratio : Bounded
        Dimensionless.
    permanent : Bounded
        Penetration at which the unloading line meets zero force, m.
    largest : Bounded
        Largest penetration, m.
    loop : Loop
        Data of the fit; for a signal of a low channel class the part removed by the filter is
        restored from the fitted law.
    residual : float
        Root mean square residual over the loading part, N.
    """

    curve: ForceCurve
    force_low: Array
    force_high: Array
    unloading_ratio: Bounded
    permanent: Bounded
    largest: Bounded
    loop: Loop
    residual: float


def fit_stiffness(
    time: ArrayLike,
    acceleration: ArrayLike,
    speed: float,
    mass: float,
    *,
    channel_class: float = 0.0,
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
    time : (n,) array_like
        s, uniform.
    acceleration : (n,) array_like
        g.
    speed : float
        Impact speed, m/s.
    mass : float
        kg.
    channel_class : float
        Channel frequency class of the signal; 0 for a raw signal.
    noise : float
        Standard deviation of the filtered signal's noise, g, if known; the noise before contact or
        the residual of the fitted curve is used instead where it is larger.
    speed_sd, mass_sd : float
        Standard uncertainties, m/s and kg.
    knots : int
        Largest number of knots of the loading curve, 2 to 8; the information criterion may choose
        fewer.
    draws : int
        Repetitions for the intervals.
    seed : int
        Of the added noise.

    Returns
    -------
    StiffnessFit

    Raises
    ------
    ValueError
        If the signal cannot be used; the message gives the reason.
    """
    t = np.asarray(time, dtype=np.float64)
    a = np.asarray(acceleration, dtype=np.float64)
    check_uniform(t)
    rate = 1.0 / float(np.diff(t).mean())
    if not channel_class > 0.0:
        a = filter_cfc(a, rate, CHANNEL_CLASS)
        channel_class = CHANNEL_CLASS
    law = _integrated(t, a, speed, mass, channel_class, knots)
    rounded = channel_class < CHANNEL_CLASS
    if rounded:
        law = _through_filter(t, a, speed, mass, channel_class, law, knots)
    places = law.curve.penetration
    level = np.nanmax([noise, law.loop.noise, law.residual / (mass * STANDARD_GRAVITY)])
    rng = np.random.default_rng(seed)
    repeated = []
    for _ in range(draws):
        white = filter_cfc(rng.standard_normal(a.size), rate, min(channel_class, rate / 4.3))
        copy = a + level * white / white.std()
        # Zero-mean draws of speed and mass, truncated at four standard deviations.
        v = speed + speed_sd * float(np.clip(rng.standard_normal(), -4.0, 4.0))
        m = mass + mass_sd * float(np.clip(rng.standard_normal(), -4.0, 4.0))
        try:
            again = (
                _through_filter(t, copy, v, m, channel_class, law, knots)
                if rounded
                else _integrated_again(t, copy, v, m, places)
            )
        except ValueError:
            continue
        repeated.append(again.at(places))
    if draws and len(repeated) < draws / 2:
        raise ValueError("the signal is too noisy: its curve cannot be repeated with its own noise")
    best = np.array(law.at(places))
    low, high = np.full(best.size, np.nan), np.full(best.size, np.nan)
    if repeated:
        tail = 0.5 * (1.0 - CONFIDENCE)
        low, high = np.quantile(repeated, [tail, 1.0 - tail], axis=0)
        # Centred on the fit: corrects the bootstrap bias of noise that is added twice.
        shift = best - np.median(repeated, axis=0)
        low, high = low + shift, high + shift
    n = places.size
    ratio, permanent, largest = (
        Bounded(float(best[k]), float(low[k]), float(high[k])) for k in range(n, n + 3)
    )
    return StiffnessFit(
        law.curve, low[:n], high[:n], ratio, permanent, largest, law.loop, law.residual
    )


def check_uniform(time: Array) -> None:
    """Raise ``ValueError`` unless a signal has 8 or more uniformly spaced samples."""
    if time.size < 8:
        raise ValueError(
            f"the signal must be sampled uniformly, 8 samples or more, given {time.size}"
        )
    steps = np.diff(time)
    usual = float(np.median(steps))
    if np.ptp(steps) <= UNEVEN * steps.mean():
        return
    k = int(np.argmax(np.abs(steps - usual)))
    raise ValueError(
        f"the signal must be sampled uniformly: after {time[k]:.9g} s the step is {steps[k]:.6g} "
        f"s, elsewhere {usual:.6g} s"
    )


def _integrated(
    t: Array, a: Array, speed: float, mass: float, channel_class: float, knots: int
) -> _Law:
    """Return the law of a loop integrated from the signal."""
    lead = max(QUIET, settling_time(channel_class))
    loop = force_penetration(t, a, speed, mass, lead=lead)
    independent = 2.0 * CUTOFF_FACTOR * channel_class * loop.time[loop.deepest]
    return _law_of(loop, choose_knots(*loop.loading, knots, independent_samples=independent))


def _integrated_again(t: Array, a: Array, speed: float, mass: float, places: Array) -> _Law:
    """Return the law of a repeated signal, with knots near the given ones."""
    loop = force_penetration(t, a, speed, mass)
    return _law_of(loop, refine_knots(*loop.loading, places))


def _law_of(loop: Loop, places: Array) -> _Law:
    force, ratio = _fit_law(loop, places)
    depth, measured = loop.loading
    residual = float(np.sqrt(np.mean((measured - np.interp(depth, places, force)) ** 2)))
    return _Law(ForceCurve(places, force, ratio), float(depth[-1]), loop, residual)


def _through_filter(
    t: Array, a: Array, speed: float, mass: float, channel_class: float, near: _Law, knots: int
) -> _Law:
    """Return the law whose simulated and filtered signal fits the measured one.

    The search starts from the law ``near``.
    """
    settling = settling_time(channel_class)
    quiet = a[t < near.loop.onset - max(QUIET, settling)]
    offset = float(quiet.mean()) if quiet.size >= MIN_QUIET else near.loop.offset
    begin, end = near.loop.onset - settling, near.loop.onset + near.loop.time[-1] + settling
    inside = (t >= begin) & (t <= end)
    signal = (t[inside], a[inside] - offset, speed, mass, channel_class)
    if near.filtered is None:
        found = fit_through_filter(*signal, near.curve, near.loop.onset, knots)
    else:
        found = repeat_fit(*signal, near.filtered.parameters)
    restored = a - offset
    restored[inside] += found.taken
    loop = integrate(t, restored, found.onset, speed, mass, offset, near.loop.noise)
    depth = float(found.curve.penetration[-1])
    return _Law(found.curve, depth, loop, found.residual * mass * STANDARD_GRAVITY, found)


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
    # Line through (depth, top): the error is in the penetration, so regress it on the force.
    slope = float(drop @ drop / (drop @ back)) if drop @ back > 0.0 else np.inf
    return force, max(min(slope * depth / top, 1e3), 1.001)
