"""The 3 ms clip: highest acceleration level held for a given time.

*Consecutive*: held in one single interval (NHTSA CLIP). *Cumulative*: "except for intervals whose
cumulative duration is not more than 3 milliseconds" (FMVSS 208, ECE R94 for the head). Both are
exact for the signal interpolated linearly.
"""

import numpy as np
from numpy.typing import ArrayLike

from models.compilation import kernel


@kernel
def _time_above(t, a, cells, count, level, consecutive):
    """Return the total or the longest single time (s) with the signal at or above ``level``.

    ``cells`` holds the first samples of the ``count`` cells that may reach the level.
    """
    total, run, longest = 0.0, 0.0, 0.0
    for c in range(count):
        i = cells[c]
        # A cell that is not listed lies below the level and ends a run.
        if c > 0 and cells[c - 1] != i - 1:
            run = 0.0
        a0, a1, dt = a[i] - level, a[i + 1] - level, t[i + 1] - t[i]
        if a0 >= 0.0 and a1 >= 0.0:
            part, broken_before, broken_after = dt, False, False
        elif a0 < 0.0 and a1 < 0.0:
            part, broken_before, broken_after = 0.0, True, True
        elif a0 >= 0.0:
            part, broken_before, broken_after = dt * a0 / (a0 - a1), False, True
        else:
            part, broken_before, broken_after = dt * a1 / (a1 - a0), True, False
        total += part
        run = part if broken_before else run + part
        longest = max(longest, run)
        if broken_after:
            run = 0.0
    return longest if consecutive else total


@kernel
def _highest_level(t, a, cells, duration, low, high, consecutive):
    """Return the highest level held; ``cells`` is workspace for all cells."""
    count = t.size - 1
    for i in range(count):
        cells[i] = i
    # The held time falls with the level; bisect to the last bit of a double.
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return low
        if _time_above(t, a, cells, count, middle, consecutive) >= duration:
            low = middle
            # Cells below this level do not contribute at higher levels.
            kept = 0
            for c in range(count):
                i = cells[c]
                if a[i] >= low or a[i + 1] >= low:
                    cells[kept] = i
                    kept += 1
            count = kept
        else:
            high = middle


def clip_level(
    time: ArrayLike, acceleration: ArrayLike, duration: float = 0.003, *, mode: str = "cumulative"
) -> float:
    """Return the highest level that the signal holds for ``duration``.

    Parameters
    ----------
    time, acceleration : (n,) array_like
        Strictly rising times in s; acceleration in g (the result has its unit).
    duration : float
        Held time in s.
    mode : {"cumulative", "consecutive"}
        Whether the held time is summed over all intervals or that of one interval.

    Returns
    -------
    float
        The level; 0 if the record is shorter than ``duration``.

    Raises
    ------
    ValueError
        If the arrays do not match or are not finite, or the mode is unknown.

    Notes
    -----
    A half sine of amplitude A and length T gives ``A cos(pi duration / (2 T))`` in both modes.
    """
    t = np.ascontiguousarray(time, dtype=np.float64)
    a = np.ascontiguousarray(acceleration, dtype=np.float64)
    if t.ndim != 1 or t.shape != a.shape or t.size < 2 or np.any(np.diff(t) <= 0.0):
        raise ValueError("time and acceleration must be equal, 1-D, with time rising strictly")
    if not (np.all(np.isfinite(t)) and np.all(np.isfinite(a)) and duration >= 0.0):
        raise ValueError("time and acceleration must be finite and duration not negative")
    if mode not in ("cumulative", "consecutive"):
        raise ValueError(f"mode must be 'cumulative' or 'consecutive', given {mode!r}")
    if t[-1] - t[0] < duration:
        return 0.0
    cells = np.empty(t.size - 1, dtype=np.int64)
    low, high = float(a.min()), float(a.max())
    return float(_highest_level(t, a, cells, duration, low, high, mode == "consecutive"))
