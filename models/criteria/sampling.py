"""Resampling of a record on a uniform grid, and resultants of vector signals."""

import numpy as np
from numpy.typing import NDArray

from models.compilation import unfused_kernel

Array = NDArray[np.float64]


@unfused_kernel
def _interpolate(grid, time, record, first, slope, out):
    """Fill ``out`` (n, k) with columns ``first`` to ``first + k`` of a record, linear in time.

    ``slope`` (k,) is workspace for the slopes between two rows.
    """
    i, n, columns = 0, grid.size, out.shape[1]
    while i < n and grid[i] <= time[0]:
        for k in range(columns):
            out[i, k] = record[0, first + k]
        i += 1
    for j in range(time.size - 1):
        if i == n:
            return
        if grid[i] >= time[j + 1]:
            continue
        for k in range(columns):
            slope[k] = (record[j + 1, first + k] - record[j, first + k]) / (time[j + 1] - time[j])
        while i < n and grid[i] < time[j + 1]:
            away = grid[i] - time[j]
            for k in range(columns):
                value = record[j, first + k]
                out[i, k] = slope[k] * away + value if away > 0.0 else value
            i += 1
    last = time.size - 1
    while i < n:
        for k in range(columns):
            out[i, k] = record[last, first + k]
        i += 1


@unfused_kernel
def _resultant(signal, out):
    for i in range(signal.shape[0]):
        x, y, z = signal[i, 0], signal[i, 1], signal[i, 2]
        out[i] = np.sqrt(x * x + y * y + z * z)


def sample_record(record: Array, first: int, columns: int, grid: Array) -> Array:
    """Return columns of a record at rising times, interpolated linearly as by ``numpy.interp``.

    Parameters
    ----------
    record : (m, w) array
        Its first column is the time in s, rising.
    first : int
        First column to return.
    columns : int
        Number of columns.
    grid : (n,) array
        Times in s, rising; outside the record its first or last row is returned.

    Returns
    -------
    (n, columns) array
    """
    out = np.empty((grid.size, columns))
    time = np.ascontiguousarray(record[:, 0])
    _interpolate(grid, time, record, first, np.empty(columns), out)
    return out


def resultant(signal: Array) -> Array:
    """Return the length (n,) of the vectors (n, 3) of a signal, in its unit."""
    out = np.empty(signal.shape[0])
    _resultant(signal, out)
    return out


@unfused_kernel
def _largest(signal, out):
    for i in range(signal.shape[0]):
        for k in range(signal.shape[1]):
            out[k] = max(out[k], abs(signal[i, k]))


def largest_magnitudes(signal: Array) -> Array:
    """Return the largest magnitude (k,) of each column of a signal (n, k)."""
    out = np.zeros(signal.shape[1])
    _largest(signal, out)
    return out
