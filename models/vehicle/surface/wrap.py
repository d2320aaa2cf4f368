"""Wrap-around lines on a mesh: a taut tape from the road over the front of the car."""

import numpy as np
from numpy.typing import NDArray

from models.vehicle.surface.mesh import SurfaceMesh
from models.vehicle.tape import tape_over

Array = NDArray[np.float64]

STRIP = 0.01
"""Length (m) of the strips whose highest points are the upper side of a section."""


def section(mesh: SurfaceMesh, y: float) -> Array:
    """Return the points (k, 2), x and z in m, in which a plane of constant y cuts the edges."""
    start, end = mesh.nodes[mesh.edges[:, 0]], mesh.nodes[mesh.edges[:, 1]]
    before, after = start[:, 1] - y, end[:, 1] - y
    cut = before * after <= 0.0
    cut &= before != after
    share = before[cut] / (before[cut] - after[cut])
    points = start[cut] + share[:, None] * (end[cut] - start[cut])
    return np.asarray(points[:, [0, 2]])


def wrap_distance(points: Array, end: Array) -> float:
    """Return the length (m) of a taut tape from the road to a point of a section.

    Parameters
    ----------
    points : (n, 2) array
        x and z of the section, m.
    end : (2,) array
        Point of its upper side, m.
    """
    ahead = points[points[:, 0] > end[0]]
    path = tape_over(np.concatenate([ahead, end[None]]))
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _upper_side(points: Array) -> Array:
    """Return the highest point of a section in each strip, from the front rearwards."""
    strip = np.floor(points[:, 0] / STRIP).astype(int)
    order = np.lexsort((-points[:, 1], -strip))
    first = np.concatenate([[True], np.diff(strip[order]) != 0])
    return np.asarray(points[order][first])


def wrap_line(mesh: SurfaceMesh, distance: float, stations: Array) -> Array:
    """Return the points of a wrap-around distance at lateral stations, NaN where there is none.

    Parameters
    ----------
    mesh : SurfaceMesh
    distance : float
        Wrap-around distance, m.
    stations : (k,) array
        y, m.

    Returns
    -------
    (k, 3) array
        m.
    """
    found = np.full((len(stations), 3), np.nan)
    for k, y in enumerate(stations):
        points = section(mesh, float(y))
        if len(points) < 3:
            continue
        side = _upper_side(points)
        low, high = 0, len(side) - 1
        if wrap_distance(points, side[high]) < distance:
            continue
        while high - low > 1:
            middle = (low + high) // 2
            if wrap_distance(points, side[middle]) < distance:
                low = middle
            else:
                high = middle
        before, after = (wrap_distance(points, side[place]) for place in (low, high))
        share = (distance - before) / (after - before) if after > before else 1.0
        x, z = side[low] + min(max(share, 0.0), 1.0) * (side[high] - side[low])
        found[k] = (x, y, z)
    return found


def wrap_point(mesh: SurfaceMesh, distance: float, y: float) -> Array:
    """Return the point (3,) in m of a wrap-around distance at a lateral station, NaN if none.

    Parameters
    ----------
    mesh : SurfaceMesh
    distance : float
        Wrap-around distance, m.
    y : float
        Lateral station, m.
    """
    return np.asarray(wrap_line(mesh, distance, np.array([y]))[0])
