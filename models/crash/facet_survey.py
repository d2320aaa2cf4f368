"""Survey of a segment against facets: pressure, direction, depth and share of every region.

The surface points of a segment that lie inside the car carry a pressure that grows with their
depth. Regions that the segment touches with the same direction share the force by the pressure on
each, so that nothing jumps where a segment passes from one to the next; regions that it touches in
different directions (bumper and hood) each carry their own force.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel
from models.vehicle.surface.field import add_to_regions, distance_at, region_at

Array = NDArray[np.float64]

TOGETHER = math.cos(math.radians(20.0))
"""Cosine of the angle between two regions' directions up to which they share one force (assumed).
"""
APART = math.cos(math.radians(60.0))
"""Cosine of the angle from which on they carry a force each (assumed)."""
DESCENTS = 4
"""Steps of the search for the deepest point of an ellipsoid."""
TIP = 0.25
"""Share of a point's mean area that the deepest point of an ellipsoid represents (assumed)."""


class Findings(NamedTuple):
    """What a survey of a segment finds, by region; the workspace of a front of facets.

    Attributes
    ----------
    pressure : (z,) array
        Sum of depth times area seen along the direction of the surface, m3.
    direction : (z, 3) array
        Sum of the pressure times the surface's normal; then the unit normal.
    mean : (z, 3) array
        Sum of the pressure times position; then the centre of pressure.
    total : (z,) array
        Sum of the pressure of the points in ``direction`` and ``mean``.
    depth : (z,) array
        Largest depth, m.
    share : (z,) array
        Weight of the region's force, 0 where the segment does not touch it.
    shared_depth : (z,) array
        Depth at which the region's law is taken, m.
    turn : (3, 3) array
        Rotation from the segment's axes to the static car's frame.
    """

    pressure: Array
    direction: Array
    mean: Array
    total: Array
    depth: Array
    share: Array
    shared_depth: Array
    turn: Array


def empty_findings(regions: int) -> Findings:
    """Return the workspace of a front with a number of regions."""
    return Findings(
        pressure=np.zeros(regions),
        direction=np.zeros((regions, 3)),
        mean=np.zeros((regions, 3)),
        total=np.zeros(regions),
        depth=np.zeros(regions),
        share=np.zeros(regions),
        shared_depth=np.zeros(regions),
        turn=np.zeros((3, 3)),
    )


@inlined_kernel
def to_static(front, x, y, z):
    """Return a point of the diving car's frame in that of the static car."""
    c, s = front.dive[0], front.dive[1]
    dx, dz = x - front.dive[2], z - front.dive[3]
    return c * dx - s * dz, y, s * dx + c * dz


@inlined_kernel
def _add(front, x, y, z, depth, area, gx, gy, gz):
    """Add a point inside the car, in the static car's frame, to its regions."""
    found, field = front.found, front.field
    j = region_at(field, x, y, z)
    pressure = depth * area
    add_to_regions(field, x, y, z, pressure, found.pressure)
    found.total[j] += pressure
    found.direction[j, 0] += pressure * gx
    found.direction[j, 1] += pressure * gy
    found.direction[j, 2] += pressure * gz
    found.mean[j, 0] += pressure * x
    found.mean[j, 1] += pressure * y
    found.mean[j, 2] += pressure * z
    found.depth[j] = max(found.depth[j], depth)


@inlined_kernel
def _carry(front, x, y, z, depth, gx, gy, gz):
    """Give the whole load to the region of one point, in the static car's frame."""
    found = front.found
    j = region_at(front.field, x, y, z)
    found.pressure[j], found.total[j], found.depth[j] = 1.0, 1.0, depth
    found.direction[j, 0], found.direction[j, 1], found.direction[j, 2] = gx, gy, gz
    found.mean[j, 0], found.mean[j, 1], found.mean[j, 2] = x, y, z


@inlined_kernel
def rotation_of(front, motion, i, cosine, sine, M):
    """Fill the rotation (3, 3) from a segment's axes to the static car's frame."""
    c, s = front.dive[0], front.dive[1]
    for k in range(3):
        wx, wy, wz = motion.rotation[i, 0, k], motion.rotation[i, 1, k], motion.rotation[i, 2, k]
        x, y = cosine * wx + sine * wy, -sine * wx + cosine * wy
        M[0, k], M[1, k], M[2, k] = c * x - s * wz, y, s * x + c * wz


@inlined_kernel
def facet_reach(front, ellipsoids, i):
    """Return the largest distance (m) of a segment's surface from its ellipsoid's centre."""
    return front.skin.reach[i]


@inlined_kernel
def facet_survey(front, ellipsoids, motion, i, cx, cy, cz, cosine, sine):
    """Find pressure, direction and depth of a segment in every region.

    Parameters
    ----------
    front : FacetFront
        ``found`` is filled.
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    motion : Motion
        Orientations of the segments.
    i : int
        Row of the segment.
    cx, cy, cz : float
        Ellipsoid centre in the car's frame, m.
    cosine, sine : float
        Of the car's yaw.
    """
    found, field, skin = front.found, front.field, front.skin
    regions = found.share.shape[0]
    for j in range(regions):
        found.share[j] = 0.0
    x, y, z = to_static(front, cx, cy, cz)
    nearest, gx, gy, gz = distance_at(field, x, y, z)
    # The distance is exact on the grid's nodes only.
    spare = 0.5 * field.spacing[0]
    if nearest > skin.reach[i] + spare:
        return
    for j in range(regions):
        found.pressure[j] = 0.0
        found.total[j] = 0.0
        found.depth[j] = 0.0
        for k in range(3):
            found.direction[j, k] = 0.0
            found.mean[j, k] = 0.0
    M = found.turn
    rotation_of(front, motion, i, cosine, sine, M)
    least, lx, ly, lz = 1.0, gx, gy, gz
    dx, dy, dz = x, y, z
    shared = front.distributed[0] == 1.0
    for c in range(skin.first_cluster[i], skin.first_cluster[i + 1]):
        ux, uy, uz = skin.centre[c, 0], skin.centre[c, 1], skin.centre[c, 2]
        px = x + M[0, 0] * ux + M[0, 1] * uy + M[0, 2] * uz
        py = y + M[1, 0] * ux + M[1, 1] * uy + M[1, 2] * uz
        pz = z + M[2, 0] * ux + M[2, 1] * uy + M[2, 2] * uz
        away, _, _, _ = distance_at(field, px, py, pz)
        if away > skin.radius[c] + spare:
            continue
        for p in range(skin.first_point[c], skin.first_point[c + 1]):
            ux, uy, uz = skin.point[p, 0], skin.point[p, 1], skin.point[p, 2]
            px = x + M[0, 0] * ux + M[0, 1] * uy + M[0, 2] * uz
            py = y + M[1, 0] * ux + M[1, 1] * uy + M[1, 2] * uz
            pz = z + M[2, 0] * ux + M[2, 1] * uy + M[2, 2] * uz
            depth, gx, gy, gz = distance_at(field, px, py, pz)
            if depth < least:
                least, lx, ly, lz = depth, gx, gy, gz
                dx, dy, dz = px, py, pz
            if depth >= 0.0 or not shared:
                continue
            nx, ny, nz = skin.normal[p, 0], skin.normal[p, 1], skin.normal[p, 2]
            facing = -(
                gx * (M[0, 0] * nx + M[0, 1] * ny + M[0, 2] * nz)
                + gy * (M[1, 0] * nx + M[1, 1] * ny + M[1, 2] * nz)
                + gz * (M[2, 0] * nx + M[2, 1] * ny + M[2, 2] * nz)
            )
            if facing > 0.0:
                _add(front, px, py, pz, -depth, facing * skin.area[p], gx, gy, gz)
    # The deepest point of an ellipsoid lies between the points of its mesh.
    between = False
    for _ in range(DESCENTS if skin.smooth[i] else 0):
        ux = ellipsoids.square[i, 0] * (M[0, 0] * lx + M[1, 0] * ly + M[2, 0] * lz)
        uy = ellipsoids.square[i, 1] * (M[0, 1] * lx + M[1, 1] * ly + M[2, 1] * lz)
        uz = ellipsoids.square[i, 2] * (M[0, 2] * lx + M[1, 2] * ly + M[2, 2] * lz)
        ax = M[0, 0] * ux + M[0, 1] * uy + M[0, 2] * uz
        ay = M[1, 0] * ux + M[1, 1] * uy + M[1, 2] * uz
        az = M[2, 0] * ux + M[2, 1] * uy + M[2, 2] * uz
        scale = 1.0 / math.sqrt(lx * ax + ly * ay + lz * az)
        px, py, pz = x - scale * ax, y - scale * ay, z - scale * az
        depth, gx, gy, gz = distance_at(field, px, py, pz)
        if depth >= least:
            break
        least, lx, ly, lz = depth, gx, gy, gz
        between, dx, dy, dz = True, px, py, pz
    if least >= 0.0:
        return
    if not shared:
        _carry(front, dx, dy, dz, -least, lx, ly, lz)
    elif between:
        _add(front, dx, dy, dz, -least, TIP * skin.grain[i], lx, ly, lz)
    _share_out(found)


@inlined_kernel
def _share_out(found):
    """Turn the sums of a survey into directions, centres, shares and depths of the regions."""
    regions = found.share.shape[0]
    for j in range(regions):
        if found.depth[j] == 0.0:
            continue
        square = 0.0
        for k in range(3):
            square += found.direction[j, k] * found.direction[j, k]
        size = math.sqrt(square)
        if size == 0.0 or found.pressure[j] <= 0.0:
            found.depth[j] = 0.0
            continue
        for k in range(3):
            found.direction[j, k] /= size
        total = found.total[j]
        for k in range(3):
            found.mean[j, k] /= total
    for j in range(regions):
        if found.depth[j] == 0.0:
            continue
        depth, alike = 0.0, 0.0
        for q in range(regions):
            if found.depth[q] == 0.0:
                continue
            cosine = 0.0
            for k in range(3):
                cosine += found.direction[j, k] * found.direction[q, k]
            near = min(max((cosine - APART) / (TOGETHER - APART), 0.0), 1.0)
            depth = max(depth, near * found.depth[q])
            alike += near * found.pressure[q]
        found.shared_depth[j] = depth
        found.share[j] = found.pressure[j] / alike
