"""Resampling of a record on a uniform grid, and resultants of vector signals."""

import numpy as np
from numpy.typing import NDArray

from models.compilation import unfused_kernel

Array = NDArray[np.float64]


@unfused_kernel
def _interpolate(grid, record, first, slope, out):
    """Fill ``out`` (n, k) with columns ``first`` to ``first + k`` of a record, linear in time.

    ``slope`` (k,) is workspace for the slopes between two rows.
    """
    i, n, columns = 0, grid.size, out.shape[1]
    while i < n and grid[i] <= record[0, 0]:
        for k in range(columns):
            out[i, k] = record[0, first + k]
        i += 1
    last = record.shape[0] - 1
    for j in range(last):
        start, end = record[j, 0], record[j + 1, 0]
        if i == n:
            return
        if grid[i] >= end:
            continue
        for k in range(columns):
            slope[k] = (record[j + 1, first + k] - record[j, first + k]) / (end - start)
        if grid[i] <= start:
            for k in range(columns):
                out[i, k] = record[j, first + k]
            i += 1
        while i < n and grid[i] < end:
            away = grid[i] - start
            for k in range(columns):
                out[i, k] = slope[k] * away + record[j, first + k]
            i += 1
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
    # Numba needs half a millisecond for the type of an enumeration's member.
    _interpolate(grid, record, int(first), np.empty(columns), out)
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
