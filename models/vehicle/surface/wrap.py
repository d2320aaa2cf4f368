"""Wrap-around lines on a mesh: a taut tape from the road over the front of the car."""

import math

import numpy as np
from numpy.typing import NDArray

from models.vehicle.surface.mesh import SurfaceMesh

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


def tape_over(points: Array) -> Array:
    """Return the path (k, 2) of a taut tape from the road under the foremost point to the rearmost.

    Parameters
    ----------
    points : (n, 2) array
        x and z of a section, m.
    """
    path = [np.array([points[:, 0].max(), 0.0])]
    heading, last = 0.5 * math.pi, points[:, 0].min()
    while path[-1][0] > last + 1e-9:
        step = points - path[-1]
        size = np.hypot(step[:, 0], step[:, 1])
        angle = np.arctan2(step[:, 1], step[:, 0]) % (2.0 * math.pi)
        ahead = (size > 1e-9) & (angle >= heading - 1e-9) & (angle < heading + math.pi)
        if not ahead.any():
            break
        turned = np.where(ahead, angle, np.inf)
        nearest = np.lexsort((-size, np.round(turned, 9)))[0]
        heading = float(angle[nearest])
        path.append(points[nearest])
    return np.array(path)


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
