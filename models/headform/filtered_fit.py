"""Fit of a hood's law to an acceleration that was smoothed by a low channel class.

A filter of CFC 60 smears the flank and the corner of unloading over milliseconds: integrated twice,
such a signal gives too large a penetration and too early a first contact. Here the test is
simulated with a trial law, the simulated acceleration passes the same filter, and the two filtered
signals are compared. First contact, knots, slopes and unloading ratio are fitted by least squares,
and the number of knots is chosen by the Bayesian information criterion, as for signals that are
integrated.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from models.contact.law import KNOTS, ForceCurve, law_of
from models.contact.loading import MAX_KNOTS, SPACING
from models.criteria.filters import CUTOFF_FACTOR, filter_cfc, settling_time
from models.criteria.units import STANDARD_GRAVITY
from models.headform.impact import (
    COLUMNS,
    DEEPEST,
    END_TIME,
    NORMAL,
    SAMPLES,
    SUMMARY,
    Impactor,
    plain_surface,
    strike,
)
from models.headform.target import SAMPLING_RATE

Array = NDArray[np.float64]

STRIDE = 5
"""Simulation steps per sample."""
LONGEST = 0.15
"""s of contact after which a trial law is rejected."""
FINEST = 1e-4
"""Parameter perturbation of the finite differences; all are logarithms or milliseconds."""
FLATTEST, STEEPEST = 1e2, 1e8
"""Bounds of a slope, N/m."""
LEAST_RATIO, MAX_RATIO = 1.001, 1e3
"""Bounds of the unloading ratio, as for signals that are integrated."""


@dataclass(frozen=True)
class FilteredFit:
    """A law fitted through a filter.

    Attributes
    ----------
    curve : ForceCurve
        Its last knot is at the largest penetration.
    onset : float
        First contact, s.
    taken : (n,) array
        Part of the signal removed by the filter according to the fitted law, g.
    residual : float
        Root mean square residual, g.
    parameters : array
        Parameters of the search, from which a repeated fit can start.
    """

    curve: ForceCurve
    onset: float
    taken: Array
    residual: float
    parameters: Array


@dataclass(frozen=True)
class _Signal:
    """The signal to fit.

    Attributes
    ----------
    time : (n,) array
        s.
    acceleration : (n,) array
        g.
    speed : float
        m/s.
    mass : float
        kg.
    channel_class : float
    """

    time: Array
    acceleration: Array
    speed: float
    mass: float
    channel_class: float


def fit_through_filter(
    time: Array,
    acceleration: Array,
    speed: float,
    mass: float,
    channel_class: float,
    start: ForceCurve,
    onset: float,
    knots: int,
) -> FilteredFit:
    """Return the law whose simulated and equally filtered acceleration fits a filtered one.

    Parameters
    ----------
    time : (n,) array
        s, uniform.
    acceleration : (n,) array
        Without offset, filtered by ``channel_class``, g.
    speed : float
        Impact speed, m/s.
    mass : float
        kg.
    channel_class : float
        Channel frequency class of the filter.
    start : ForceCurve
        Initial law.
    onset : float
        Initial first contact, s.
    knots : int
        Largest number of knots, 2 to 8.

    Returns
    -------
    FilteredFit

    Raises
    ------
    ValueError
        If no law gives a contact that ends.
    """
    signal = _Signal(time, acceleration, speed, mass, channel_class)
    depth, force = float(start.penetration[-1]), float(start.force[-1])
    first = np.array([1e3 * onset, _log_ratio(start.unloading_ratio), math.log(force / depth)])
    best = _search(signal, first)
    count = _independent(signal)
    score = _score(signal, best, count)
    while _segments(best) < min(knots, MAX_KNOTS) - 1:
        trials = [_search(signal, trial) for trial in _with_a_knot(signal, best)]
        if not trials:
            break
        longer = min(trials, key=lambda p: float(np.sum(_left(signal, p) ** 2)))
        found = _score(signal, longer, count)
        if found >= score:
            break
        best, score = longer, found
    return _describe(signal, best)


def repeat_fit(
    time: Array,
    acceleration: Array,
    speed: float,
    mass: float,
    channel_class: float,
    parameters: Array,
) -> FilteredFit:
    """Return the law of a repeated signal, starting from given parameters and with their knots.

    Parameters
    ----------
    time : (n,) array
        s, uniform.
    acceleration : (n,) array
        Without offset, filtered by ``channel_class``, g.
    speed : float
        Impact speed, m/s.
    mass : float
        kg.
    channel_class : float
        Channel frequency class of the filter.
    parameters : array
        ``FilteredFit.parameters`` of the first fit.

    Returns
    -------
    FilteredFit

    Raises
    ------
    ValueError
        If no law gives a contact that ends.
    """
    signal = _Signal(time, acceleration, speed, mass, channel_class)
    return _describe(signal, _search(signal, parameters))


def _segments(parameters: Array) -> int:
    """Return the number of segments; each has a log slope and all but the last a log width."""
    return (parameters.size - 1) // 2


def _curve_of(parameters: Array) -> ForceCurve:
    """Return the law of onset (ms), log (ratio - 1), log slopes (N/m) and log widths (m)."""
    count = _segments(parameters)
    slopes = np.exp(np.clip(parameters[2 : 2 + count], math.log(FLATTEST), math.log(STEEPEST)))
    widths = np.append(np.exp(np.clip(parameters[2 + count :], -12.0, 2.0)), 1.0)
    ratio = 1.0 + math.exp(min(max(parameters[1], math.log(LEAST_RATIO - 1.0)),
                               math.log(MAX_RATIO - 1.0)))  # fmt: skip
    places = np.concatenate([[0.0], np.cumsum(widths)])
    return ForceCurve(places, np.concatenate([[0.0], np.cumsum(slopes * widths)]), ratio)


def _log_ratio(ratio: float) -> float:
    return math.log(min(max(ratio, LEAST_RATIO), MAX_RATIO) - 1.0)


def _simulate(signal: _Signal, parameters: Array) -> tuple[Array, Array, float] | None:
    """Return the simulated acceleration (g) at the signal's times, raw and filtered, and the depth.

    None if the contact does not end.
    """
    laws = np.zeros((1, KNOTS, 4))
    count = law_of(_curve_of(parameters), laws[0])
    record, summary = np.empty((round(LONGEST * SAMPLING_RATE), COLUMNS)), np.zeros(SUMMARY)
    strike(
        Impactor(signal.mass, 1.0, 1.0), plain_surface(),
        laws, count, signal.speed, 0.0, 1.0 / (SAMPLING_RATE * STRIDE), STRIDE, record, summary,
    )  # fmt: skip
    if math.isnan(summary[END_TIME]):
        return None
    samples = int(summary[SAMPLES])
    room = round(settling_time(signal.channel_class) * SAMPLING_RATE) + 1
    raw = np.zeros(samples + 2 * room)
    raw[room : room + samples] = record[:samples, NORMAL] / (signal.mass * STANDARD_GRAVITY)
    filtered = filter_cfc(raw, SAMPLING_RATE, signal.channel_class)
    since = (np.arange(raw.size) - room) / SAMPLING_RATE
    at = signal.time - 1e-3 * parameters[0]
    both = (np.interp(at, since, values, left=0.0, right=0.0) for values in (raw, filtered))
    return next(both), next(both), float(summary[DEEPEST])


def _left(signal: _Signal, parameters: Array) -> Array:
    """Return the residual (g) of a law; the whole signal if its contact does not end."""
    found = _simulate(signal, parameters)
    return signal.acceleration - (0.0 if found is None else found[1])


def _search(signal: _Signal, start: Array) -> Array:
    """Return the least-squares parameters, starting from others."""

    def left(parameters: Array) -> Array:
        return _left(signal, parameters)

    found = optimize.least_squares(
        left, start, method="trf", x_scale=np.full(start.size, 0.1),
        diff_step=np.full(start.size, FINEST), max_nfev=40, ftol=1e-10, xtol=1e-10, gtol=1e-12,
    )  # fmt: skip
    return np.asarray(found.x, dtype=np.float64)


def _with_a_knot(signal: _Signal, parameters: Array) -> list[Array]:
    """Return parameters of the same law with one more knot, at the possible penetrations."""
    found = _simulate(signal, parameters)
    if found is None:
        return []
    end, count = found[2], _segments(parameters)
    widths = np.exp(parameters[2 + count :])
    places = np.concatenate([[0.0], np.cumsum(widths), [end]])
    trials = []
    for place in end * np.arange(SPACING, 1.0 - 0.5 * SPACING, SPACING):
        if np.abs(places - place).min() < 0.999 * SPACING * end:
            continue
        k = int(np.searchsorted(places, place)) - 1
        slopes = np.insert(parameters[2 : 2 + count], k, parameters[2 + k])
        inner = np.sort(np.append(places[1:-1], place))
        moved = np.log(np.diff(np.concatenate([[0.0], inner])))
        trials.append(np.concatenate([parameters[:2], slopes, moved]))
    return trials


def _independent(signal: _Signal) -> float:
    """Return the number of independent samples of the filtered signal."""
    length = float(signal.time[-1] - signal.time[0])
    return max(2.0 * CUTOFF_FACTOR * signal.channel_class * length, 4.0)


def _score(signal: _Signal, parameters: Array, count: float) -> float:
    """Return the Bayesian information criterion; a knot costs two parameters."""
    size = (1e-6 * float(signal.acceleration.max())) ** 2
    misfit = float(np.mean(_left(signal, parameters) ** 2)) + size
    return count * math.log(misfit) + 2.0 * math.log(count) * (_segments(parameters) - 1)


def _describe(signal: _Signal, parameters: Array) -> FilteredFit:
    found = _simulate(signal, parameters)
    if found is None:
        raise ValueError("no law gives a contact that ends: check speed, mass and unit")
    raw, filtered, deepest = found
    curve = _curve_of(parameters)
    inner = curve.penetration[1:-1]
    inner = inner[inner < deepest]
    places = np.concatenate([[0.0], inner, [deepest]])
    residual = float(np.sqrt(np.mean((signal.acceleration - filtered) ** 2)))
    law = ForceCurve(places, curve.at(places), curve.unloading_ratio)
    return FilteredFit(law, 1e-3 * parameters[0], raw - filtered, residual, parameters)
