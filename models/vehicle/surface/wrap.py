"""Wrap-around lines on a mesh: a taut tape from the road over the front of the car."""

import numpy as np
from numpy.typing import NDArray

from models.vehicle.surface.mesh import SurfaceMesh
from models.vehicle.tape import EDGE_TANGENT, tape_over

Array = NDArray[np.float64]

STRIP = 0.01
"""Distance (m) of the places in which a section is seen."""
_REARWARDS = np.array([-1.0, 1.0]) / 2.0**0.5
_UPWARDS = np.array([1.0, 1.0]) / 2.0**0.5
"""A front is seen from ahead and above, at 45 degrees: neither grille nor hood is seen edge-on."""


def section(mesh: SurfaceMesh, y: float) -> Array:
    """Return the lines (k, 2, 2), ends by x and z in m, in which a plane of constant y cuts facets.

    Parameters
    ----------
    mesh : SurfaceMesh
    y : float
        Lateral station, m.
    """
    away = mesh.corners[:, :, 1] - y
    # A corner in the plane belongs to one side.
    above = away > 0.0
    cut = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    corners, away, above = mesh.corners[cut], away[cut], above[cut]
    # The corner alone on its side of the plane, and the two others.
    lone = np.where(above.sum(axis=1) == 1, np.argmax(above, axis=1), np.argmin(above, axis=1))
    row = np.arange(len(cut))
    ends = []
    for step in (1, 2):
        other = (lone + step) % 3
        share = away[row, lone] / (away[row, lone] - away[row, other])
        start = corners[row, lone]
        ends.append(start + share[:, None] * (corners[row, other] - start))
    return np.asarray(np.stack(ends, axis=1)[:, :, [0, 2]])


def wrap_distance(lines: Array, end: Array) -> float:
    """Return the length (m) of a taut tape from the road to a point of a section.

    Parameters
    ----------
    lines : (k, 2, 2) array
        Of the section, m.
    end : (2,) array
        Point seen from ahead and above, m.
    """
    return float(np.linalg.norm(np.diff(wrap_path(lines, end), axis=0), axis=1).sum())


def wrap_path(lines: Array, end: Array) -> Array:
    """Return the corners (k, 2) of that tape, x and z, m.

    Parameters
    ----------
    lines : (k, 2, 2) array
        Of the section, m.
    end : (2,) array
        Point seen from ahead and above, m.
    """
    points = lines.reshape(-1, 2)
    ahead = points[points[:, 0] > end[0]]
    return tape_over(np.concatenate([ahead, end[None]]))


def leading_edge_distance(lines: Array) -> float:
    """Return the wrap-around distance (m) of the hood's leading edge line on a section.

    Parameters
    ----------
    lines : (k, 2, 2) array
        Of the section, m.
    """
    path = tape_over(lines.reshape(-1, 2))
    step = np.diff(path, axis=0)
    length = np.linalg.norm(step, axis=1)
    # The slope changes from line to line: it is taken at their middles.
    slope = np.arctan2(step[:, 1], -step[:, 0])
    middle = np.cumsum(length) - 0.5 * length
    first = int(np.argmax(slope <= EDGE_TANGENT))
    if first == 0:
        return float(middle[0])
    pair = [first - 1, first]
    return float(np.interp(-EDGE_TANGENT, -slope[pair], middle[pair]))


def _seen(lines: Array) -> Array:
    """Return the points (n, 2) of a section that are seen from ahead and above, rearwards."""
    along, height = lines @ _REARWARDS, lines @ _UPWARDS
    order = np.argsort(along, axis=1)
    start, end = np.take_along_axis(along, order, axis=1).T
    low, high = np.take_along_axis(height, order, axis=1).T
    places = np.arange(start.min() + 0.5 * STRIP, end.max(), STRIP)
    inside = (start <= places[:, None]) & (places[:, None] <= end)
    width = np.where(end > start, end - start, 1.0)
    seen = low + (places[:, None] - start) / width * (high - low)
    best = np.where(inside, seen, -np.inf).max(axis=1)
    held = np.isfinite(best)
    found = places[held, None] * _REARWARDS + best[held, None] * _UPWARDS
    # Nothing below the foremost point is seen first.
    return np.asarray(found[int(np.argmax(found[:, 0])) :])


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
        lines = section(mesh, float(y))
        if len(lines) < 3:
            continue
        side = _seen(lines)
        low, high = 0, len(side) - 1
        if not wrap_distance(lines, side[low]) <= distance <= wrap_distance(lines, side[high]):
            continue
        while high - low > 1:
            middle = (low + high) // 2
            if wrap_distance(lines, side[middle]) < distance:
                low = middle
            else:
                high = middle
        before, after = (wrap_distance(lines, side[place]) for place in (low, high))
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
