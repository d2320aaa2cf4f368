"""Time origin of a measured signal beside a simulated one.

Most records state the time of first contact, up to a few samples; some have an arbitrary origin.
The pulses as wholes cannot tell: a cause that acts late, as a bottoming hood does, moves their
centres by milliseconds while they begin together. So the origin is only called arbitrary where the
rising flanks are apart as well, and it is then taken from these.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KNOWN, LATE = 2e-3, 0.2
"""Shift between measured and simulated pulse from which a time origin counts as arbitrary: s, and
share of the time from the begin of the simulated pulse to its flank. In a crash the head moves
long before it strikes, and a wrong speed, posture or geometry makes it strike earlier or later by a
share of that time (assumed: by less than a fifth)."""
BEGIN = 0.02
"""Share of the simulated peak at which its pulse begins."""
FLANK = 0.2
"""Share of the smaller of the two peaks at which flanks are compared: above noise and offsets,
and below the plateaus that follow (assumed)."""


def time_shift(
    time: Array, values: Array, model_time: Array, model_values: Array, step: float
) -> float:
    """Return the delay (s) of a measured signal whose time origin is arbitrary, else zero.

    Parameters
    ----------
    time, values : (n,) array
        Measured signal.
    model_time, model_values : (m,) array
        Simulated signal.
    step : float
        s, resolution of the comparison of whole pulses.
    """
    size = np.abs(model_values)
    level = FLANK * min(np.abs(values).max(), size.max())
    flank = _rise(model_time, model_values, level)
    begin = float(model_time[int(np.argmax(size >= BEGIN * size.max()))])
    known = max(KNOWN, LATE * (flank - begin))
    flanks = _rise(time, values, level) - flank
    if abs(flanks) < known or abs(_lag(time, values, model_time, model_values, step)) < known:
        return 0.0
    return flanks


def _rise(time: Array, values: Array, level: float) -> float:
    """Return the last time before the peak at which a signal rose through a level."""
    size = np.abs(values)
    peak = int(np.argmax(size))
    below = np.flatnonzero(size[:peak] < level)
    if below.size == 0:
        return float(time[0])
    k = int(below[-1])
    return float(np.interp(level, size[k : k + 2], time[k : k + 2]))


def _lag(time: Array, values: Array, model_time: Array, model_values: Array, step: float) -> float:
    """Return the delay (s) at which the two pulses correlate best."""
    measured = np.interp(np.arange(time[0], time[-1], step), time, values)
    model = np.interp(np.arange(model_time[0], model_time[-1], step), model_time, model_values)
    lag = int(np.argmax(np.correlate(measured, model, mode="full"))) - (model.size - 1)
    return float(time[0] + lag * step - model_time[0])
