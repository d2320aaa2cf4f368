"""Channel frequency class filters of SAE J211-1 (appendix C) and ISO 6487."""

import functools
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.compilation import inlined_kernel, kernel

Array = NDArray[np.float64]

CUTOFF_FACTOR = 2.0775
"""Hz of each pass's corner frequency per unit of channel frequency class (SAE J211-1)."""


PADDING = 60
"""Samples by which a signal is padded at either end, mirrored about its end point."""


SETTLED = 1e-3
"""Remaining share of a step response after the settling time."""


def settling_time(frequency_class: float) -> float:
    """Return the time (s) by which a filter's response extends before and after an event.

    The poles of a second-order Butterworth filter decay at its corner frequency over the square
    root of two.
    """
    decay = 2.0 * math.pi * CUTOFF_FACTOR * frequency_class / math.sqrt(2.0)
    return math.log(1.0 / SETTLED) / decay


@functools.cache
def _sections(frequency_class: float, sampling_rate: float) -> Array:
    wd = 2.0 * math.pi * frequency_class * CUTOFF_FACTOR
    wa = math.tan(wd / (2.0 * sampling_rate))
    scale = 1.0 + math.sqrt(2.0) * wa + wa * wa
    gain = wa * wa / scale
    a1 = 2.0 * (wa * wa - 1.0) / scale
    a2 = (1.0 - math.sqrt(2.0) * wa + wa * wa) / scale
    return np.array([gain, 2.0 * gain, gain, a1, a2])


@inlined_kernel
def _at_rest(section, x, y, z):
    """Return the steady filter state for constant values of three columns.

    The gain at frequency zero is one, so a constant passes unchanged.
    """
    b0, b2, a2 = section[0], section[2], section[4]
    first, second = 1.0 - b0, b2 - a2
    return first * x, second * x, first * y, second * y, first * z, second * z


@inlined_kernel
def _next(section, x, y, z, state):
    """Return the filtered samples of three columns and the filter state after them.

    Each sample depends on the one before it, so three columns take hardly longer than one.
    """
    b0, b1, b2, a1, a2 = section[0], section[1], section[2], section[3], section[4]
    u = b0 * x + state[0]
    v = b0 * y + state[2]
    w = b0 * z + state[4]
    return (
        (u, v, w),
        (
            b1 * x - a1 * u + state[1],
            b2 * x - a2 * u,
            b1 * y - a1 * v + state[3],
            b2 * y - a2 * v,
            b1 * z - a1 * w + state[5],
            b2 * z - a2 * w,
        ),
    )


@kernel
def _there_and_back(section, signal, longer, filtered):
    """Filter the columns of a signal (n, k) forwards and backwards into ``filtered``.

    ``longer`` is workspace for three padded columns.
    """
    n = signal.shape[0]
    size = longer.shape[0]
    pad = (size - n) // 2
    for c0 in range(0, signal.shape[1], 3):
        last = signal.shape[1] - 1
        c1, c2 = min(c0 + 1, last), min(c0 + 2, last)
        x0, y0, z0 = signal[0, c0], signal[0, c1], signal[0, c2]
        xn, yn, zn = signal[n - 1, c0], signal[n - 1, c1], signal[n - 1, c2]
        state = _at_rest(
            section,
            2.0 * x0 - signal[pad, c0],
            2.0 * y0 - signal[pad, c1],
            2.0 * z0 - signal[pad, c2],
        )
        for k in range(pad):
            (u, v, w), state = _next(
                section,
                2.0 * x0 - signal[pad - k, c0],
                2.0 * y0 - signal[pad - k, c1],
                2.0 * z0 - signal[pad - k, c2],
                state,
            )
            longer[k, 0], longer[k, 1], longer[k, 2] = u, v, w
        for k in range(n):
            (u, v, w), state = _next(section, signal[k, c0], signal[k, c1], signal[k, c2], state)
            row = pad + k
            longer[row, 0], longer[row, 1], longer[row, 2] = u, v, w
        for k in range(pad):
            (u, v, w), state = _next(
                section,
                2.0 * xn - signal[n - 2 - k, c0],
                2.0 * yn - signal[n - 2 - k, c1],
                2.0 * zn - signal[n - 2 - k, c2],
                state,
            )
            row = pad + n + k
            longer[row, 0], longer[row, 1], longer[row, 2] = u, v, w
        state = _at_rest(section, longer[size - 1, 0], longer[size - 1, 1], longer[size - 1, 2])
        for k in range(size - 1, pad - 1, -1):
            (u, v, w), state = _next(section, longer[k, 0], longer[k, 1], longer[k, 2], state)
            if k < pad + n:
                filtered[k - pad, c0], filtered[k - pad, c1], filtered[k - pad, c2] = u, v, w


def filter_cfc(
    signal: ArrayLike,
    sampling_rate: float,
    frequency_class: float = 1000.0,
    *,
    overwrite: bool = False,
) -> Array:
    """Return the signal filtered by a channel frequency class, forwards and backwards.

    Parameters
    ----------
    signal : (n,) or (n, k) array_like
        Filtered along the first axis; its unit is kept.
    sampling_rate : float
        Hz, uniform.
    frequency_class : float
        60, 180, 600 or 1000 in the standard; the combined gain is -3 dB near 1.65 times the class
        and -6 dB at 2.0775 times it.
    overwrite : bool
        Whether an array may be filtered in place; fresh memory costs as much as the filter.

    Raises
    ------
    ValueError
        If the class is not positive or the sampling rate not above twice the corner frequency.
    """
    if not frequency_class > 0.0:
        raise ValueError(f"the channel frequency class must be positive, given {frequency_class}")
    if sampling_rate <= 2.0 * CUTOFF_FACTOR * frequency_class:
        raise ValueError(
            f"CFC {frequency_class:g} needs a sampling rate above "
            f"{2.0 * CUTOFF_FACTOR * frequency_class:g} Hz, given {sampling_rate:g} Hz"
        )
    x = np.asarray(signal, dtype=np.float64)
    section = _sections(float(frequency_class), float(sampling_rate))
    columns = x.reshape(x.shape[0], -1)
    filtered = columns if overwrite else np.empty_like(columns)
    longer = np.empty((x.shape[0] + 2 * min(x.shape[0] - 1, PADDING), 3))
    _there_and_back(section, columns, longer, filtered)
    return filtered.reshape(x.shape)
