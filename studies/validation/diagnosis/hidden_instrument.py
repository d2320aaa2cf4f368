"""The instruments of the hidden effects: accelerometer, filter, clock and speed gate."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from studies.validation.diagnosis.hidden_hood import find
from studies.validation.diagnosis.laboratory import GRAVITY, Hidden

Array = NDArray[np.float64]

CORNER = 2.0775
"""Corner frequency (Hz) of the filter over its channel frequency class (SAE J211)."""
STATED = 1000.0
"""Channel frequency class that the folder states."""


def read(hidden: Sequence[Hidden], acceleration: Array, time: Array, progress: float) -> Array:
    """Return what the accelerometer reads (g).

    Parameters
    ----------
    hidden : sequence of Hidden
        Effects.
    acceleration : (n,) array
        True acceleration, g.
    time : (n,) array
        s.
    progress : float
        Place of the test in the order of tests, 0 to 1.
    """
    for h in hidden:
        change = READINGS.get(h.name)
        if change is not None:
            acceleration = change(h, acceleration, time, progress)
    return acceleration


def _gain(h: Hidden, acceleration: Array, _time: Array, progress: float) -> Array:
    if h.form == "warming":
        # The amplifier warms up over the first tests and then stays warm.
        warm = 1.0 - float(np.exp(-3.0 * progress))
        return acceleration * (1.0 + h.numbers["change"] * warm)
    return acceleration * h.numbers["factor"]


def _offset(h: Hidden, acceleration: Array, _time: Array, progress: float) -> Array:
    if h.form == "drifting":
        return acceleration + h.numbers["offset"] * progress
    return acceleration + h.numbers["offset"]


def _saturation(h: Hidden, acceleration: Array, time: Array, _progress: float) -> Array:
    limit = h.numbers["limit"]
    if h.form == "soft":
        return np.asarray(limit * np.tanh(acceleration / limit))
    clipped = np.clip(acceleration, -limit, limit)
    over = np.flatnonzero(np.abs(acceleration) > limit)
    if h.form == "recovery" and over.size:
        # An overdriven amplifier reads too low for a while.
        since = np.maximum(time - time[over[-1]], 0.0)
        depth = h.numbers["depth"] * limit * np.sign(acceleration[over[-1]])
        tail = depth * np.exp(-since / h.numbers["time"])
        clipped = clipped - np.where(since > 0.0, tail, 0.0)
    return np.asarray(clipped)


def read_axes(
    hidden: Sequence[Hidden], acceleration: Array, time: Array, rate: float, progress: float
) -> Array:
    """Return the resultant (n,) of three axes that are read and filtered each by itself (g).

    Parameters
    ----------
    hidden : sequence of Hidden
        Effects; an offset is that of the first axis.
    acceleration : (n, 3) array
        True acceleration along the axes, g.
    time : (n,) array
        s.
    rate : float
        Sampling rate, Hz.
    progress : float
        Place of the test in the order of tests, 0 to 1.
    """
    shown = []
    for k, axis in enumerate(acceleration.T):
        own = [h for h in hidden if k == 0 or h.name != "sensor_offset"]
        shown.append(filtered(read(own, axis, time, progress), rate, hidden))
    return np.asarray(np.linalg.norm(shown, axis=0))


def _cable(h: Hidden, acceleration: Array, time: Array, _progress: float) -> Array:
    # Outside the catalogue: a loose cable adds bursts of hum.
    return acceleration + h.numbers["size"] * np.sin(2e3 * np.pi * time) * (time > 0)


def _resonance(h: Hidden, acceleration: Array, time: Array, _progress: float) -> Array:
    # Outside the catalogue: the accelerometer's mount rings.
    omega, zeta = 2.0 * np.pi * h.numbers["frequency"], h.numbers["damping_ratio"]
    system = ([omega**2], [1.0, 2.0 * zeta * omega, omega**2])
    return np.asarray(signal.lsim(system, acceleration, time - time[0])[1])


def _turning(h: Hidden, acceleration: Array, time: Array, _progress: float) -> Array:
    # Outside the catalogue: the headform turns, and its sensor looks aside.
    turned = np.minimum(h.numbers["rate"] * np.maximum(time, 0.0), 0.5 * np.pi)
    return np.asarray(acceleration * np.cos(turned))


Change = Callable[[Hidden, Array, Array, float], Array]
READINGS: dict[str, Change] = {
    "sensor_gain": _gain,
    "sensor_offset": _offset,
    "sensor_saturation": _saturation,
    "cable": _cable,
    "mount_resonance": _resonance,
    "turning": _turning,
}


def filtered(values: Array, rate: float, hidden: Sequence[Hidden] = ()) -> Array:
    """Return values through the filter, by default that of the stated class (SAE J211).

    Parameters
    ----------
    values : (n,) array
    rate : float
        Sampling rate, Hz.
    hidden : sequence of Hidden
        Effects.
    """
    h = find(hidden, "sensor_filter")
    if h is None:
        return _both_ways(signal.butter(2, CORNER * STATED, fs=rate, output="sos"), values)
    corner = CORNER * h.numbers["channel_class"]
    if h.form == "bessel":
        return _both_ways(signal.bessel(4, corner, fs=rate, norm="mag", output="sos"), values)
    if h.form == "steep":
        return _both_ways(signal.butter(6, corner, fs=rate, output="sos"), values)
    sections = signal.butter(2, corner, fs=rate, output="sos")
    if h.form == "forward":
        return np.asarray(signal.sosfilt(sections, values))
    return _both_ways(sections, values)


def _both_ways(sections: Array, values: Array) -> Array:
    return np.asarray(signal.sosfiltfilt(sections, values))


def clock(hidden: Sequence[Hidden], time: Array) -> Array:
    """Return the recorded time (s)."""
    h = find(hidden, "time_scale")
    return time if h is None else time * h.numbers["factor"]


def recorded_speed(hidden: Sequence[Hidden], speed: float, progress: float) -> float:
    """Return the recorded impact speed (m/s).

    Parameters
    ----------
    hidden : sequence of Hidden
        Effects.
    speed : float
        True speed, m/s.
    progress : float
        Place of the test in the order of tests, 0 to 1.
    """
    h = find(hidden, "speed_bias")
    if h is None:
        return speed
    if h.form == "offset":
        return speed - h.numbers["offset"]
    if h.form == "falling":
        # The gates lie above the hood: the headform goes on to fall.
        return float(np.sqrt(speed**2 - 2.0 * GRAVITY * h.numbers["height"]))
    if h.form == "drifting":
        return speed / (1.0 + h.numbers["change"] * progress)
    return speed / h.numbers["factor"]
