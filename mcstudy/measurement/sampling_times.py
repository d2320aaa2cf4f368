"""Times of samples as files print them: uniform within the last digit is uniform."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_DIGITS = 12
"""Decimals of a second up to which printed digits are sought."""
EXACT = 1e-9
"""Share of a step within which times are uniform as they are."""
ROUNDED = 1.0
"""Printed units by which times may lie away from a uniform grid: half of one is rounding, the rest
what the grid's two numbers leave."""
STEP_IN_UNITS = 1.5
"""Printed units in a step from which a missing line shows in the steps: two steps then print at
least two units longer than the shortest."""


def regular_times(time: Array) -> Array:
    """Return times on the uniform grid that they were rounded from, or as they are.

    Steps between rounded times differ by one printed unit at most; a missing line makes one longer.

    Parameters
    ----------
    time : (n,) s, rising.
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
