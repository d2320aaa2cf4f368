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
"""Samples by which a signal is continued at either end, mirrored about its last point."""


SETTLED = 1e-3
"""Share of a step that a filter still has to go after its settling time."""


def settling_time(frequency_class: float) -> float:
    """Return the time (s) by which a filter's answer reaches before and after its cause.

    The poles of a Butterworth filter of second order decay with its corner frequency over the
    square root of two.
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
def _pass(section, values, start, step):
    """Filter three columns in place, from the state that a constant of their first would leave.

    Each sample waits for the one before it, so that three columns cost hardly more than one.

    ``start`` is the first sample that is taken, ``step`` 1 or -1 the direction.
    """
    b0, b1, b2, a1, a2 = section[0], section[1], section[2], section[3], section[4]
    # The gain at frequency zero is one, so a constant goes through unchanged.
    first_0 = (1.0 - b0) * values[start, 0]
    first_1 = (1.0 - b0) * values[start, 1]
    first_2 = (1.0 - b0) * values[start, 2]
    second_0 = (b2 - a2) * values[start, 0]
    second_1 = (b2 - a2) * values[start, 1]
    second_2 = (b2 - a2) * values[start, 2]
    k = start
    for _ in range(values.shape[0]):
        x_0, x_1, x_2 = values[k, 0], values[k, 1], values[k, 2]
        y_0 = b0 * x_0 + first_0
        y_1 = b0 * x_1 + first_1
        y_2 = b0 * x_2 + first_2
        first_0 = b1 * x_0 - a1 * y_0 + second_0
        first_1 = b1 * x_1 - a1 * y_1 + second_1
        first_2 = b1 * x_2 - a1 * y_2 + second_2
        second_0 = b2 * x_0 - a2 * y_0
        second_1 = b2 * x_1 - a2 * y_1
        second_2 = b2 * x_2 - a2 * y_2
        values[k, 0] = y_0
        values[k, 1] = y_1
        values[k, 2] = y_2
        k += step


@kernel
def _there_and_back(section, signal, longer, filtered):
    """Filter the columns of a signal (n, k) into ``filtered``; ``longer`` is room for three."""
    n = signal.shape[0]
    pad = (longer.shape[0] - n) // 2
    for start in range(0, signal.shape[1], 3):
        columns = min(3, signal.shape[1] - start)
        for c in range(3):
            column = start + min(c, columns - 1)
            for k in range(n):
                longer[pad + k, c] = signal[k, column]
            for k in range(pad):
                longer[k, c] = 2.0 * signal[0, column] - signal[pad - k, column]
                longer[pad + n + k, c] = 2.0 * signal[n - 1, column] - signal[n - 2 - k, column]
        _pass(section, longer, 0, 1)
        _pass(section, longer, longer.shape[0] - 1, -1)
        for c in range(columns):
            for k in range(n):
                filtered[k, start + c] = longer[pad + k, c]


def filter_cfc(signal: ArrayLike, sampling_rate: float, frequency_class: float = 1000.0) -> Array:
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
    filtered = np.empty_like(columns)
    longer = np.empty((x.shape[0] + 2 * min(x.shape[0] - 1, PADDING), 3))
    _there_and_back(section, columns, longer, filtered)
    return filtered.reshape(x.shape)
