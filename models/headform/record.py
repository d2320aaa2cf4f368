"""Detection of the first impact in a record of acceleration, and notes on the rest of the record.

A record may begin with disturbances (a release, an electronic spike) and continue after the impact:
the headform falls on the floor, often with a harder impact than that on the hood. The impact is the
first event that removes most of the recorded speed; what comes before and after is left out and
reported.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.criteria.units import STANDARD_GRAVITY

Array = NDArray[np.float64]

WINDOW = 0.001
"""s over which the record is averaged to detect events (assumed)."""
GAP = 0.003
"""Least gap (s) of two events; a contact with two peaks is one event (assumed)."""
SHORTEST = 0.002
"""Least duration (s) of an impact (assumed)."""
LEVEL = 0.1
"""Share of the largest average from which on an event counts."""
FOOT = 0.01
"""Share of the largest average from which on an event that reaches the level has begun."""
LONGEST_FOOT = 0.005
"""Largest duration (s) of that rise: a drift is no event (assumed)."""
SLOWEST = 0.05
"""Longest time (s) in which an impact removes half of the speed (assumed)."""
MIN_SHARE = 0.5
"""Least share of the speed that an impact removes; with rebound it is above one."""
STOPPED = 0.97
"""Share of the speed from which on a headform counts as stopped: speed and mass are not exact."""
SIZEABLE = 0.02
"""Share of the speed from which another event is reported."""
OUT_OF_NOISE = 8.0
"""Standard deviations from which on a single sample is a spike (assumed)."""
SPIKE = 0.2
"""Share of the largest average from which on a single sample is a spike."""
LONELY = 0.25
"""Share of a spike by which its neighbours may differ from each other."""
MIN_QUIET = 20
"""Samples between a disturbance and contact that are kept as quiet, if there are so many."""
TOP, SHOULDER = 0.99, 0.95
"""Shares of the peak whose durations distinguish a plateau from a round peak (assumed)."""
CLIPPED = 0.7
"""Ratio of these durations above which a peak seems clipped; 0.45 for a parabola (assumed)."""
MIN_FLAT = 4
"""Least number of samples of a plateau."""


@dataclass(frozen=True)
class Impact:
    """The first impact of a record.

    Attributes
    ----------
    time, acceleration : (n,) array
        The record without the parts left out, s and g.
    notes : tuple of str
        What was left out, and problems of the signal.
    """

    time: Array
    acceleration: Array
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Event:
    """An event of a record.

    Attributes
    ----------
    start, stop : int
        First sample and the sample after the last.
    speed : float
        Change of speed, m/s.
    peak : float
        Largest acceleration, g.
    """

    start: int
    stop: int
    speed: float
    peak: float


def first_impact(
    time: ArrayLike, acceleration: ArrayLike, speed: float, reach: float = 0.0
) -> Impact:
    """Return the first impact of a record.

    Parameters
    ----------
    time : (n,) array_like
        s, uniform.
    acceleration : (n,) array_like
        Deceleration, finite, g.
    speed : float
        Speed before the impact, m/s.
    reach : float
        Time by which the response of the signal's filter extends before and after an event, s.

    Notes
    -----
    A record in which no event removes half of the speed is returned complete.
    """
    t = np.asarray(time, dtype=np.float64)
    a = np.array(acceleration, dtype=np.float64)
    if t.size < MIN_FLAT or not (np.all(np.isfinite(a)) and speed > 0.0):
        return Impact(t, a, ())
    step = float(t[-1] - t[0]) / (t.size - 1)
    around = round(max(reach, WINDOW) / step)
    notes = _remove_spikes(t, a, step)
    base = _base(a)
    events = _events(a - base, step, speed)
    impact = next(
        (k for k, e in enumerate(events)
         if e.speed >= MIN_SHARE * speed and (e.stop - e.start) * step >= SHORTEST),
        None,
    )  # fmt: skip
    if impact is None:
        return Impact(t, a, tuple(notes))
    own, first, last = events[impact], 0, t.size
    later = events[impact + 1 :]
    # If the headform has not stopped yet, the next peak belongs to the same contact.
    while later and own.speed < STOPPED * speed and (later[0].start - own.stop) * step < SLOWEST:
        own = _Event(own.start, later[0].stop, own.speed + later[0].speed,
                     max(own.peak, later[0].peak))  # fmt: skip
        del later[0]
    for event in events[:impact]:
        if event.speed < SIZEABLE * speed:
            continue
        notes.append(
            f"a disturbance of {event.peak:.3g} g {1e3 * t[event.start]:.1f} ms, before the "
            "impact, is left out"
        )
        begin, end = event.start - around, event.stop + around
        if own.start - end >= MIN_QUIET:
            first = end
        else:
            a[max(begin, 0) : min(end, own.start)] = base
    for event in later:
        if event.speed < SIZEABLE * speed:
            continue
        last = max(own.stop, event.start - around)
        notes.append(
            f"a later impact of {event.peak:.3g} g {1e3 * t[event.start]:.1f} ms is left out, with "
            "all that follows"
        )
        break
    inside = slice(own.start, min(own.stop, last))
    if clipping := _clipping(t[inside], a[inside]):
        notes.append(clipping)
    return Impact(t[first:last], a[first:last], tuple(notes))


def _remove_spikes(t: Array, a: Array, step: float) -> list[str]:
    """Replace isolated outlying samples in place and return notes on them."""
    middle = 0.5 * (a[:-2] + a[2:])
    away = a[1:-1] - middle
    noise = float(np.median(np.abs(away))) / 0.6745
    size = float(np.abs(_averaged(a, step)).max())
    lonely = (np.abs(away) > max(OUT_OF_NOISE * noise, SPIKE * size)) & (
        np.abs(a[2:] - a[:-2]) < LONELY * np.abs(away)
    )
    # The neighbours of a spike deviate from their own mean as well, by half of its height.
    places = [
        k for k in np.flatnonzero(lonely)
        if abs(away[k]) >= np.abs(away[max(k - 1, 0) : k + 2]).max()
    ]  # fmt: skip
    notes = [
        f"a single sample of {a[k + 1]:.3g} g {1e3 * t[k + 1]:.2f} ms, between {a[k]:.3g} and "
        f"{a[k + 2]:.3g} g, is taken for a spike and replaced"
        for k in places[:3]
    ]
    if len(places) > len(notes):
        notes.append(f"{len(places) - len(notes)} more single samples are replaced likewise")
    for k in places:
        a[k + 1] = middle[k]
    return notes


def _averaged(a: Array, step: float) -> Array:
    count = max(1, round(WINDOW / step))
    return np.convolve(a, np.full(count, 1.0 / count), mode="same")


def _base(a: Array) -> float:
    """Return the approximate zero level of the sensor, from before or after the impact."""
    return float(min(np.median(a[:5]), np.median(a[-max(5, a.size // 5) :])))


def _events(a: Array, step: float, speed: float) -> list[_Event]:
    """Return the events, in order, in which the averaged signal exceeds the level."""
    smooth = _averaged(a, step)
    level = min(LEVEL * float(smooth.max()), 0.5 * speed / (STANDARD_GRAVITY * SLOWEST))
    if not level > 0.0:
        return []
    runs = _stretches(smooth > level)
    joined: list[list[int]] = []
    for start, stop in runs:
        if joined and (start - joined[-1][1]) * step < GAP:
            joined[-1][1] = stop
        else:
            joined.append([start, stop])
    # A soft event begins before it reaches the level.
    foot = _stretches(smooth > FOOT * smooth.max())
    for k, (start, _) in enumerate(joined):
        free = joined[k - 1][1] + 1 if k else 0
        begun = next((begin for begin, end in foot if begin <= start < end), start)
        joined[k][0] = max(begun, free, start - round(LONGEST_FOOT / step))
    return [
        _Event(start, stop, STANDARD_GRAVITY * step * float(a[start:stop].sum()),
               float(a[start:stop].max()))
        for start, stop in joined
    ]  # fmt: skip


def _stretches(inside: NDArray[np.bool_]) -> list[list[int]]:
    """Return first sample and end of each run of true samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside, [0]]).astype(int)))
    found: list[list[int]] = edges.reshape(-1, 2).tolist()
    return found


def _clipping(t: Array, a: Array) -> str:
    """Return a note on a peak that seems clipped, or an empty string."""
    top = float(a.max())
    flat = a >= TOP * top
    if flat.sum() < MIN_FLAT or flat.sum() < CLIPPED * np.sum(a >= SHOULDER * top):
        return ""
    return (
        f"the largest reading, {top:.4g} g, stands for {flat.sum()} samples from "
        f"{1e3 * t[int(np.argmax(flat))]:.1f} ms on: the sensor or its record seems clipped, peak "
        "and HIC are too low, penetration is too large"
    )
