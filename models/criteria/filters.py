"""Channel frequency class filters of SAE J211-1 (appendix C) and ISO 6487."""

import functools
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import sosfiltfilt

Array = NDArray[np.float64]

CUTOFF_FACTOR = 2.0775
"""Hz of each pass's corner frequency per unit of channel frequency class (SAE J211-1)."""


@functools.cache
def _sections(frequency_class: float, sampling_rate: float) -> Array:
    wd = 2.0 * math.pi * frequency_class * CUTOFF_FACTOR
    wa = math.tan(wd / (2.0 * sampling_rate))
    scale = 1.0 + math.sqrt(2.0) * wa + wa * wa
    gain = wa * wa / scale
    a1 = 2.0 * (wa * wa - 1.0) / scale
    a2 = (1.0 - math.sqrt(2.0) * wa + wa * wa) / scale
    return np.array([[gain, 2.0 * gain, gain, 1.0, a1, a2]])


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
    sections = _sections(float(frequency_class), float(sampling_rate))
    return np.asarray(sosfiltfilt(sections, x, axis=0, padlen=min(x.shape[0] - 1, 60)))
