"""Head injury criterion, exact on the samples and exact for the piecewise-linear signal.

``HIC = max (t2 - t1) [ 1/(t2 - t1) int a dt ]^2.5`` over windows no longer than W (15 or 36 ms),
with a in g and t in s (J. Versace, 15th Stapp Car Crash Conf., 1971; NHTSA 1972).

*Grid-exact*: both window ends lie on samples, as in NHTSA's reference program. *Continuous-exact*:
the global maximum for the signal interpolated linearly, with the ends anywhere. At a maximum of
unconstrained length the signal at both ends equals ``L = 0.6 mean`` (C. Chou and G. Nyquist, SAE
740082, 1974). In a pair of cells the ends, the length and the area are polynomials of L, so the
condition ``L d = 0.6 area`` is a quadratic equation; with the length fixed at W, the area has its
maximum where the signal is equal at both ends, a linear equation. Every pair of cells that a bound
does not exclude is solved in closed form, so the result is the global maximum and not a refinement
of a grid search. Short pulses in long windows are handled: all lengths are searched, not only W.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.compilation import kernel, unfused_kernel

Array = NDArray[np.float64]


BLOCK = 8
"""Number of windows with one start that share a bound."""
SLACK = 1.0 - 1e-9
"""Share of the best value that a bound must reach, so that rounding excludes no maximum."""


@kernel
def _value(area, length):
    if area <= 0.0 or length <= 0.0:
        return 0.0
    mean = area / length
    return length * mean * mean * math.sqrt(mean)


@kernel
def _may_beat(area, length, best):
    """Return whether ``area^2.5 / length^1.5`` may exceed ``best``, without roots."""
    square = area * area
    return square * square * area > SLACK * best * best * length * length * length


@kernel
def _area_at(t, a, s, i, x):
    """Return the integral from the start to time ``x`` inside cell ``i``."""
    u = x - t[i]
    return s[i] + u * (a[i] + 0.5 * u * (a[i + 1] - a[i]) / (t[i + 1] - t[i]))


@kernel
def _value_about_peak(t, a, s, window):
    """Return the best value of some windows about the peak: a lower bound of the maximum."""
    middle, n = 0, t.size
    for i in range(n):
        if a[i] > a[middle]:
            middle = i
    floor, i, j = 0.0, middle, middle
    # Extend the window by the larger neighbour.
    while True:
        left = i > 0 and (j == n - 1 or a[i - 1] >= a[j + 1])
        if left:
            i -= 1
        elif j < n - 1:
            j += 1
        else:
            break
        if t[j] - t[i] > window:
            break
        floor = max(floor, _value(s[j] - s[i], t[j] - t[i]))
    return floor


@kernel
def _grid_maximum(t, a, s, window, peak):
    n = t.size
    limit = window * (1.0 + 1e-7)
    best, b1, b2 = 0.0, t[0], t[0]
    # Slightly below an attained value, so that no maximum is excluded.
    floor = SLACK * _value_about_peak(t, a, s, window)
    last = 0
    for i in range(n - 1):
        while last < n - 1 and t[last + 1] - t[i] <= limit:
            last += 1
        # No window that starts here exceeds (area over W) * peak^1.5.
        bar = max(best, floor)
        if (s[last] - s[i]) * peak * math.sqrt(peak) <= bar:
            continue
        start = i + 1
        while start <= last:
            stop = min(start + BLOCK, last + 1)
            if _may_beat(s[stop - 1] - s[i], t[start] - t[i], max(best, floor)):
                for j in range(start, stop):
                    area, length = s[j] - s[i], t[j] - t[i]
                    if _may_beat(area, length, max(best, floor)):
                        value = _value(area, length)
                        if value > best:
                            best, b1, b2 = value, t[i], t[j]
            start = stop
    return best, b1, b2


@kernel
def _free_pair(t, a, s, i, j, window, best):
    """Return the best window with equal end levels in cells ``i`` < ``j``; (0, 0, 0) if none."""
    si = (a[i + 1] - a[i]) / (t[i + 1] - t[i])
    sj = (a[j + 1] - a[j]) / (t[j + 1] - t[j])
    if si == 0.0 or sj == 0.0:
        return 0.0, 0.0, 0.0
    low = max(min(a[i], a[i + 1]), min(a[j], a[j + 1]))
    high = min(max(a[i], a[i + 1]), max(a[j], a[j + 1]))
    if low > high:
        return 0.0, 0.0, 0.0
    # d(L) = d0 + d1 L; area(L) = c0 + c2 L^2; L d = 0.6 area.
    d0 = t[j] - a[j] / sj - t[i] + a[i] / si
    d1 = 1.0 / sj - 1.0 / si
    c0 = s[j] - 0.5 * a[j] * a[j] / sj - s[i] + 0.5 * a[i] * a[i] / si
    c2 = 0.5 * d1
    q2, q1, q0 = d1 - 0.6 * c2, d0, -0.6 * c0
    value, b1, b2 = 0.0, 0.0, 0.0
    for sign in (-1.0, 1.0):
        if q2 == 0.0:
            if q1 == 0.0:
                break
            level = -q0 / q1
        else:
            discriminant = q1 * q1 - 4.0 * q2 * q0
            if discriminant < 0.0:
                break
            root = math.sqrt(discriminant)
            half = -0.5 * (q1 + (root if q1 >= 0.0 else -root))
            if sign < 0.0:
                level = half / q2
            elif half != 0.0:
                level = q0 / half
            else:
                continue
        # A window that ends on a sample has its level on the boundary of two cells: rounding must
        # not put it outside both.
        slack = 1e-9 * high
        if level < low - slack or level > high + slack:
            continue
        level = min(max(level, low), high)
        x1 = t[i] + (level - a[i]) / si
        x2 = t[j] + (level - a[j]) / sj
        if x2 - x1 > window or x2 <= x1:
            continue
        v = _value(_area_at(t, a, s, j, x2) - _area_at(t, a, s, i, x1), x2 - x1)
        if v > max(best, value):
            value, b1, b2 = v, x1, x2
    return value, b1, b2


@kernel
def _bound_window(t, a, s, window, best, b1, b2):
    """Improve ``best`` over windows of the full length."""
    n = t.size
    i, j = 0, 0
    while j < n - 2 and t[j + 1] <= t[0] + window:
        j += 1
    if t[n - 1] - t[0] < window:
        return best, b1, b2
    x = t[0]
    while True:
        # Interval of x in which x lies in cell i and x + W in cell j.
        end = min(t[i + 1], t[j + 1] - window)
        # The area up to the ends of both cells bounds the area of the window.
        area = s[j + 1] - s[i]
        if _may_beat(area, window, best):
            si = (a[i + 1] - a[i]) / (t[i + 1] - t[i])
            sj = (a[j + 1] - a[j]) / (t[j + 1] - t[j])
            candidates = (x, end, x)
            if si != sj:
                # a_j(x + W) = a_i(x)
                zero = (a[i] - si * t[i] - a[j] + sj * (t[j] - window)) / (sj - si)
                candidates = (x, end, min(max(zero, x), end))
            for y in candidates:
                v = _value(_area_at(t, a, s, j, y + window) - _area_at(t, a, s, i, y), window)
                if v > best:
                    best, b1, b2 = v, y, y + window
        if t[i + 1] <= end:
            i += 1
        if t[j + 1] - window <= end:
            j += 1
        x = end
        if i >= n - 1 or j >= n - 1:
            break
    return best, b1, b2


@kernel
def _open_end(t, a, s, window, best, b1, b2):
    """Improve ``best`` over windows that start or end with the record."""
    n = t.size
    for side in range(2):
        first, last = 0, n - 1
        # Cells further than W from the fixed end cannot contain the other end.
        if side == 0:
            while last > 1 and t[last - 1] - t[0] > window:
                last -= 1
        else:
            while first < n - 2 and t[n - 1] - t[first + 1] > window:
                first += 1
        for k in range(first, last):
            slope = (a[k + 1] - a[k]) / (t[k + 1] - t[k])
            # With u = length inside cell k: a(u) d(u) = 0.6 area(u), a quadratic in u.
            if side == 0:
                d0, area0, a0, rate = t[k] - t[0], s[k], a[k], slope
            else:
                d0, area0, a0, rate = t[n - 1] - t[k + 1], s[n - 1] - s[k + 1], a[k + 1], -slope
            q2 = 0.7 * rate
            q1 = 0.4 * a0 + rate * d0
            q0 = a0 * d0 - 0.6 * area0
            width = t[k + 1] - t[k]
            for sign in (-1.0, 1.0):
                if q2 == 0.0:
                    if q1 == 0.0:
                        break
                    u = -q0 / q1
                else:
                    discriminant = q1 * q1 - 4.0 * q2 * q0
                    if discriminant < 0.0:
                        break
                    u = (-q1 + sign * math.sqrt(discriminant)) / (2.0 * q2)
                d = d0 + u
                if u < 0.0 or u > width or d > window or d <= 0.0:
                    continue
                v = _value(area0 + u * (a0 + 0.5 * u * rate), d)
                if v > best:
                    if side == 0:
                        best, b1, b2 = v, t[0], t[0] + d
                    else:
                        best, b1, b2 = v, t[n - 1] - d, t[n - 1]
    return best, b1, b2


@kernel
def _continuous_maximum(t, a, s, window, peak):
    n = t.size
    best, b1, b2 = _grid_maximum(t, a, s, window, peak)
    best, b1, b2 = _bound_window(t, a, s, window, best, b1, b2)
    best, b1, b2 = _open_end(t, a, s, window, best, b1, b2)
    if peak <= 0.0:
        return best, b1, b2
    power = peak * math.sqrt(peak)
    last = 0
    for i in range(n - 1):
        while last < n - 2 and t[last + 1] - t[i + 1] < window:
            last += 1
        if (s[last + 1] - s[i]) * power <= best:
            continue
        start = i + 1
        while start <= last:
            stop = min(start + BLOCK, last + 1)
            if _may_beat(s[stop] - s[i], t[start] - t[i + 1], best):
                for j in range(start, stop):
                    area = s[j + 1] - s[i]
                    if area * power <= best or not _may_beat(area, t[j] - t[i + 1], best):
                        continue
                    v, x1, x2 = _free_pair(t, a, s, i, j, window, best)
                    if v > best:
                        best, b1, b2 = v, x1, x2
            start = stop
    return best, b1, b2


def head_injury_criterion(
    time: ArrayLike, acceleration: ArrayLike, window: float = 0.015, *, method: str = "continuous"
) -> tuple[float, float, float]:
    """Return HIC and its window.

    Parameters
    ----------
    time : (n,) array_like
        Sample times in s, strictly rising, any spacing.
    acceleration : (n,) array_like
        Resultant acceleration of the head's centre of gravity in g, not negative.
    window : float
        Longest window in s: 0.015 for HIC15, 0.036 for HIC36, ``inf`` for no limit.
    method : {"continuous", "grid"}
        Global maximum for the piecewise-linear signal, or with both ends on samples.

    Returns
    -------
    hic, start, end : float
        HIC in g^2.5 s (quoted without a unit) and the window's ends in s.

    Raises
    ------
    ValueError
        If the arrays do not match, are not finite, time does not rise, an acceleration is
        negative, the window is not positive or the method is unknown.

    Notes
    -----
    Analytic values for pulses of amplitude A and length T not above W: rectangle ``A^2.5 T``,
    triangle ``(4/7) (5/7)^2.5 A^2.5 T``, half sine ``0.4146456 A^2.5 T``.

    Examples
    --------
    >>> hic, start, end = head_injury_criterion([0.0, 0.0015, 0.003], [0.0, 100.0, 0.0])
    >>> round(hic, 4)
    73.9202
    """
    t = np.ascontiguousarray(time, dtype=np.float64)
    a = np.ascontiguousarray(acceleration, dtype=np.float64)
    if t.ndim != 1 or t.shape != a.shape or t.size < 2:
        raise ValueError(f"time {t.shape} and acceleration {a.shape} must be equal and 1-D, n >= 2")
    if not (np.all(np.isfinite(t)) and np.all(np.isfinite(a))):
        raise ValueError("time and acceleration must be finite")
    if np.any(np.diff(t) <= 0.0):
        raise ValueError("time must rise strictly")
    if np.any(a < 0.0):
        raise ValueError("acceleration must be a resultant, not negative")
    if not window > 0.0:
        raise ValueError(f"window must be positive, given {window}")
    if method not in ("continuous", "grid"):
        raise ValueError(f"method must be 'continuous' or 'grid', given {method!r}")
    return maximise_window(t, a, cumulative_area(t, a), window, method=method)


@unfused_kernel
def _accumulate(t, a, area):
    area[0] = 0.0
    for k in range(1, t.size):
        area[k] = area[k - 1] + 0.5 * (a[k] + a[k - 1]) * (t[k] - t[k - 1])


def cumulative_area(time: Array, acceleration: Array) -> Array:
    """Return the area (n,) under a linearly interpolated signal up to each sample.

    Parameters
    ----------
    time : (n,) array
        s.
    acceleration : (n,) array
        Any unit.

    Returns
    -------
    (n,) array
        Area in the unit of the signal times seconds.
    """
    area = np.empty_like(acceleration)
    _accumulate(time, acceleration, area)
    return area


def maximise_window(
    time: Array, acceleration: Array, area: Array, window: float, *, method: str = "continuous"
) -> tuple[float, float, float]:
    """Return HIC and its window of a checked signal; see ``head_injury_criterion``.

    Parameters
    ----------
    time : (n,) array
        s, rising.
    acceleration : (n,) array
        g, finite and not negative.
    area : (n,) array
        As ``cumulative_area`` gives it.
    window : float
        Longest window in s.
    method : {"continuous", "grid"}
    """
    longest = min(float(window), float(time[-1] - time[0]))
    search = _continuous_maximum if method == "continuous" else _grid_maximum
    best, start, end = search(time, acceleration, area, longest, float(acceleration.max()))
    return float(best), float(start), float(end)
