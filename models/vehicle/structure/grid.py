"""Rectangular grids whose lines run through given edges."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

NARROW = 1.25
"""Length of an element, over the size asked for, from which on it is halved."""


def grid_lines(edges: Sequence[float], size: float) -> Array:
    """Return grid lines through all edges, about ``size`` apart.

    Parameters
    ----------
    edges : sequence of float
        In order, m.
    size : float
        m.
    """
    lines = [edges[0]]
    for a, b in itertools.pairwise(edges):
        count = max(1, math.ceil((b - a) / (NARROW * size) - 1e-9))
        lines += [a + (b - a) * k / count for k in range(1, count + 1)]
    return np.array(lines)


def grid_cells(rows: int, columns: int) -> Index:
    """Return the cells of a grid, counterclockwise seen from above (s rearwards, y to the left).

    Parameters
    ----------
    rows, columns : int
        Numbers of grid lines; node ``k`` lies on row ``k // columns``.
    """
    i, j = (g.ravel() for g in np.meshgrid(np.arange(rows - 1), np.arange(columns - 1),
                                           indexing="ij"))  # fmt: skip
    a = i * columns + j
    return np.stack([a, a + 1, a + columns + 1, a + columns], axis=1)


def node_areas(count: int, cells: Index, area: Array) -> Array:
    """Return the area (count,) about each node, from those of its cells, m2.

    Parameters
    ----------
    count : int
        Number of nodes.
    cells : (m, 4) array of int
    area : (m,) array
        m2.
    """
    found = np.zeros(count)
    np.add.at(found, cells.ravel(), np.repeat(area / 4.0, 4))
    return found
