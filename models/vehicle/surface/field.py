"""Signed distance to a surface, its gradient and its regions on a grid, for compiled code."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel, kernel

Array = NDArray[np.float64]


class DistanceField(NamedTuple):
    """Signed distance on the nodes of a uniform grid, negative inside.

    Attributes
    ----------
    origin : (3,) array
        First node, m.
    spacing : (1,) array
        Distance of the nodes, m.
    distance : (i, j, k) array of float32
        m.
    region : (i, j, k) array of int8
        Region of the nearest facet.
    """

    origin: Array
    spacing: Array
    distance: NDArray[np.float32]
    region: NDArray[np.int8]


@inlined_kernel
def _cell(position, count):
    """Return the cell of a grid in which a position (in spacings) lies, and the place in it."""
    last = count - 2
    index = int(position)
    index = min(max(index, 0), last)
    return index, min(max(position - index, 0.0), 1.0)


@inlined_kernel
def distance_at(field, x, y, z):
    """Return the signed distance to the surface and its gradient, trilinear between the nodes.

    Beyond the grid the distance is a lower bound: a surface inside a box is at least as far as the
    box and the nearest point of the box together.

    Parameters
    ----------
    field : DistanceField
    x, y, z : float
        m.

    Returns
    -------
    distance, gx, gy, gz : float
        m, and the gradient, which is not quite a unit vector.
    """
    spacing = field.spacing[0]
    scale = 1.0 / spacing
    u = (x - field.origin[0]) * scale
    v = (y - field.origin[1]) * scale
    w = (z - field.origin[2]) * scale
    ni, nj, nk = field.distance.shape
    i, a = _cell(u, ni)
    j, b = _cell(v, nj)
    k, c = _cell(w, nk)
    p000, p001 = float(field.distance[i, j, k]), float(field.distance[i, j, k + 1])
    p010, p011 = float(field.distance[i, j + 1, k]), float(field.distance[i, j + 1, k + 1])
    p100, p101 = float(field.distance[i + 1, j, k]), float(field.distance[i + 1, j, k + 1])
    p110, p111 = float(field.distance[i + 1, j + 1, k]), float(field.distance[i + 1, j + 1, k + 1])
    p00, p01 = p000 + c * (p001 - p000), p010 + c * (p011 - p010)
    p10, p11 = p100 + c * (p101 - p100), p110 + c * (p111 - p110)
    p0, p1 = p00 + b * (p01 - p00), p10 + b * (p11 - p10)
    value = p0 + a * (p1 - p0)
    gx = (p1 - p0) * scale
    gy = ((1.0 - a) * (p01 - p00) + a * (p11 - p10)) * scale
    q0 = (1.0 - b) * (p001 - p000) + b * (p011 - p010)
    q1 = (1.0 - b) * (p101 - p100) + b * (p111 - p110)
    gz = ((1.0 - a) * q0 + a * q1) * scale
    # The way from the box to the point, zero inside.
    ox, oy, oz = (u - (i + a)) * spacing, (v - (j + b)) * spacing, (w - (k + c)) * spacing
    away = ox * ox + oy * oy + oz * oz
    if away > 0.0:
        near = max(value, 0.0)
        far = math.sqrt(away + near * near)
        return far, (ox + near * gx) / far, (oy + near * gy) / far, (oz + near * gz) / far
    return value, gx, gy, gz


@inlined_kernel
def add_to_regions(field, x, y, z, amount, shares):
    """Add an amount at a point to its regions, shared out where regions meet within a cell.

    Parameters
    ----------
    field : DistanceField
    x, y, z : float
        m.
    amount : float
        What is shared out.
    shares : (regions,) array
        Increased in place.
    """
    scale = 1.0 / field.spacing[0]
    i, a = _cell((x - field.origin[0]) * scale, field.distance.shape[0])
    j, b = _cell((y - field.origin[1]) * scale, field.distance.shape[1])
    k, c = _cell((z - field.origin[2]) * scale, field.distance.shape[2])
    for p in range(2):
        wa = amount * (a if p == 1 else 1.0 - a)
        for q in range(2):
            wb = wa * (b if q == 1 else 1.0 - b)
            shares[field.region[i + p, j + q, k]] += wb * (1.0 - c)
            shares[field.region[i + p, j + q, k + 1]] += wb * c


@inlined_kernel
def region_at(field, x, y, z):
    """Return the region of the grid's node nearest to a point."""
    scale = 1.0 / field.spacing[0]
    i, a = _cell((x - field.origin[0]) * scale, field.distance.shape[0])
    j, b = _cell((y - field.origin[1]) * scale, field.distance.shape[1])
    k, c = _cell((z - field.origin[2]) * scale, field.distance.shape[2])
    return int(
        field.region[
            i + (1 if a > 0.5 else 0), j + (1 if b > 0.5 else 0), k + (1 if c > 0.5 else 0)
        ]
    )


@kernel
def _distances(field, points, out):
    for n in range(points.shape[0]):
        found = distance_at(field, points[n, 0], points[n, 1], points[n, 2])
        for k in range(4):
            out[n, k] = found[k]


def distances(field: DistanceField, points: Array) -> tuple[Array, Array]:
    """Return the signed distance (n,) in m and its gradient (n, 3) at points (n, 3)."""
    out = np.empty((len(points), 4))
    _distances(field, np.ascontiguousarray(points, dtype=np.float64), out)
    return out[:, 0], out[:, 1:]
