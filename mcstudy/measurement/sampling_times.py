"""Sampling times from printed digits: uniform within the last digit counts as uniform."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_DIGITS = 12
"""Largest number of printed decimals of a second."""
EXACT = 1e-9
"""Deviation from a uniform grid, as a share of a step, that counts as none."""
ROUNDED = 1.0
"""Largest deviation from a uniform grid in printed units: half of one is rounding, the rest the
uncertainty of start and step."""
STEP_IN_UNITS = 1.5
"""Smallest step in printed units for which a missing line is detectable: the double step then
prints at least two units longer than the shortest."""


def regular_times(time: Array) -> Array:
    """Return times on the uniform grid that they were rounded from, else unchanged.

    Steps between rounded times differ by one printed unit at most; a missing line makes one longer.

    Parameters
    ----------
    time : (n,) array
        s, rising.
    """
    if time.size < 3:
        return time
    place = np.arange(time.size, dtype=np.float64)
    step, start = np.polyfit(place, time - time[0], 1)
    grid = np.asarray(time[0] + start + step * place)
    away = float(np.max(np.abs(time - grid)))
    if away <= EXACT * step:
        return time
    unit = _printed_unit(time)
    even = float(np.ptp(np.diff(time))) < 1.5 * unit
    seen = step >= STEP_IN_UNITS * unit
    return grid if even and seen and away <= ROUNDED * unit else time


def _printed_unit(time: Array) -> float:
    """Return the unit (s) of the last digit that times are printed with, 0 if they have many."""
    for digits in range(MAX_DIGITS + 1):
        counted = time * 10.0**digits
        if np.all(np.abs(counted - np.round(counted)) <= 1e-12 * np.abs(counted) + 1e-6):
            return float(10.0**-digits)
    return 0.0
