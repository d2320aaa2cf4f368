"""The pulse of a headform on a linear hood that unloads steeper than it loads, in closed form.

Loading is a quarter of a sine, unloading a quarter of a faster cosine. With the values below:
largest penetration v sqrt(m / k) = 66.26 mm, permanent 3/4 of it = 49.70 mm, peak 144.79 g.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Array = NDArray[np.float64]

GRAVITY = 9.80665
SPEED, MASS, STIFFNESS, RATIO = 9.7, 3.5, 75_000.0, 4.0
LARGEST = SPEED * math.sqrt(MASS / STIFFNESS)
PERMANENT = LARGEST * (1.0 - 1.0 / RATIO)
PEAK = SPEED * math.sqrt(STIFFNESS / MASS) / GRAVITY


def pulse(time: Array, stiffness: float = STIFFNESS, speed: float = SPEED) -> Array:
    """Return the acceleration (g) of a contact that begins at time 0 (s)."""
    frequency = math.sqrt(stiffness / MASS)
    turn = 0.5 * math.pi / frequency
    falling = math.sqrt(RATIO) * frequency * (time - turn)
    loading = np.where((time > 0.0) & (time <= turn), np.sin(frequency * time), 0.0)
    unloading = np.where((time > turn) & (falling < 0.5 * math.pi), np.cos(falling), 0.0)
    return np.asarray(speed * frequency / GRAVITY * (loading + unloading))


def filtered(values: Array, rate: float, channel_class: float) -> Array:
    """Return a signal through SciPy's Butterworth filter, forwards and backwards, as SAE J211."""
    b, a = signal.butter(2, 2.0775 * channel_class / (0.5 * rate))
    return np.asarray(signal.filtfilt(b, a, values))
