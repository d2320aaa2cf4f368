"""Signed distance field of a mesh: exact beside the surface, swept over the rest of the grid.

Within some cells of the surface every node takes the distance to its nearest facet; its sign is
that of the angle-weighted pseudonormal of the nearest face, edge or corner (J. A. Baerentzen and
H. Aanaes, IEEE Trans. Vis. Comput. Graph. 11, 2005). Beyond, the eikonal equation is solved by
sweeps in the eight directions (H. Zhao, Math. Comput. 74, 2005).
"""

import math

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel, kernel
from models.vehicle.surface.field import DistanceField
from models.vehicle.surface.mesh import SurfaceMesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]

VERSION = 1
"""Of the procedure; fields of another version are built anew."""
SPACING = 0.015
"""Default distance of the grid's nodes, m."""
BAND = 5.0
"""Distance from the surface, in cells, within which the distance is that to the nearest facet."""
MARGIN = 6
"""Cells of the grid beyond the mesh, more than the band."""
UNKNOWN = 1e6
ROUNDS = 2
"""Number of times that all eight directions are swept."""


def build_field(mesh: SurfaceMesh, regions: Index, spacing: float = SPACING) -> DistanceField:
    """Return the signed distance field of a mesh.

    An open mesh has an inside as well: what lies behind the facet, or the mean of the facets, at
    the nearest point.

    Parameters
    ----------
    mesh : SurfaceMesh
    regions : (names,) array of int
        Region of the field for each region of the mesh.
    spacing : float
        Distance of the nodes, m.

    Raises
    ------
    ValueError
        If facets side by side face opposite sides, or a closed mesh faces inwards.
    """
    if len(mesh.flipped_edges()) or len(mesh.crowded_edges()):
        raise ValueError("a distance needs a mesh whose facets face the same side at every edge")
    if mesh.is_closed and mesh.volume <= 0.0:
        raise ValueError("a distance needs a closed mesh whose facets face outwards")
    low, high = mesh.box
    origin = low - MARGIN * spacing
    shape = tuple(int(n) for n in np.ceil((high - low) / spacing).astype(int) + 2 * MARGIN + 1)
    squared = np.full(shape, UNKNOWN)
    signed = np.full(shape, UNKNOWN)
    nearest = np.full(shape, -1, dtype=np.int64)
    band = BAND * spacing
    first = np.ceil((mesh.corners.min(axis=1) - band - origin) / spacing).astype(np.int64)
    last = np.floor((mesh.corners.max(axis=1) + band - origin) / spacing).astype(np.int64)
    _fill_band(
        mesh.corners, _pseudonormals(mesh), first, last, origin, spacing, band,
        squared, signed, nearest,
    )  # fmt: skip
    distance = np.where(nearest >= 0, signed, UNKNOWN)
    size = np.abs(distance)
    inside = (distance < 0.0).astype(np.int8)
    region = np.where(nearest >= 0, regions[mesh.region[nearest]], 0).astype(np.int8)
    fixed = nearest >= 0
    for _ in range(ROUNDS):
        for direction in range(8):
            _sweep(size, inside, region, fixed, spacing, direction)
    signed_size = np.where(inside == 1, -size, size)
    return DistanceField(origin.copy(), np.array([spacing]), signed_size.astype(np.float32), region)


def _pseudonormals(mesh: SurfaceMesh) -> Array:
    """Return the pseudonormals (m, 7, 3) of every facet's face, edges and corners.

    Edges are those from corner k to the next; the normal of an edge is the sum of its two facets'
    unit normals, that of a corner the sum weighted by the angles of the facets there.
    """
    face = mesh.area_vectors / mesh.areas[:, None]
    out = np.empty((len(mesh.facets), 7, 3))
    out[:, 0] = face
    ordered = np.sort(mesh.edges, axis=1)
    _, place = np.unique(ordered, axis=0, return_inverse=True)
    place = place.reshape(-1)
    sums = np.zeros((int(place.max()) + 1, 3))
    np.add.at(sums, place, np.repeat(face, 3, axis=0))
    out[:, 1:4] = sums[place].reshape(-1, 3, 3)
    ahead = np.roll(mesh.corners, -1, axis=1) - mesh.corners
    behind = np.roll(mesh.corners, 1, axis=1) - mesh.corners
    cross = np.linalg.norm(np.cross(ahead, behind), axis=2)
    angle = np.arctan2(cross, np.einsum("ijk,ijk->ij", ahead, behind))
    corner = np.zeros_like(mesh.nodes)
    for k in range(3):
        np.add.at(corner, mesh.facets[:, k], angle[:, k, None] * face)
    out[:, 4:7] = corner[mesh.facets]
    return out


@inlined_kernel
def _nearest_on_facet(corners, m, x, y, z):
    """Return the nearest point of a facet and the feature on which it lies.

    0 is the face, 1 to 3 the edge from corner 0 to 2 to the next, 4 to 6 the corner (C. Ericson,
    Real-Time Collision Detection, 2005, section 5.1.5).
    """
    ax, ay, az = corners[m, 0, 0], corners[m, 0, 1], corners[m, 0, 2]
    bx, by, bz = corners[m, 1, 0], corners[m, 1, 1], corners[m, 1, 2]
    cx, cy, cz = corners[m, 2, 0], corners[m, 2, 1], corners[m, 2, 2]
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    px, py, pz = x - ax, y - ay, z - az
    d1, d2 = ux * px + uy * py + uz * pz, vx * px + vy * py + vz * pz
    if d1 <= 0.0 and d2 <= 0.0:
        return ax, ay, az, 4
    qx, qy, qz = x - bx, y - by, z - bz
    d3, d4 = ux * qx + uy * qy + uz * qz, vx * qx + vy * qy + vz * qz
    if d3 >= 0.0 and d4 <= d3:
        return bx, by, bz, 5
    rx, ry, rz = x - cx, y - cy, z - cz
    d5, d6 = ux * rx + uy * ry + uz * rz, vx * rx + vy * ry + vz * rz
    if d6 >= 0.0 and d5 <= d6:
        return cx, cy, cz, 6
    third = d1 * d4 - d3 * d2
    if third <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / (d1 - d3)
        return ax + t * ux, ay + t * uy, az + t * uz, 1
    second = d5 * d2 - d1 * d6
    if second <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
        return ax + t * vx, ay + t * vy, az + t * vz, 3
    first = d3 * d6 - d5 * d4
    if first <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return bx + t * (cx - bx), by + t * (cy - by), bz + t * (cz - bz), 2
    whole = 1.0 / (first + second + third)
    s, t = second * whole, third * whole
    return ax + s * ux + t * vx, ay + s * uy + t * vy, az + s * uz + t * vz, 0


@kernel
def _fill_band(
    corners, normals, first, last, origin, spacing, band, squared, signed, nearest
):  # fmt: skip
    """Fill distance, sign and nearest facet of the nodes within the band.

    ``first`` and ``last`` (m, 3) are the nodes between which each facet is within the band.
    """
    for m in range(corners.shape[0]):
        n0, n1, n2 = normals[m, 0, 0], normals[m, 0, 1], normals[m, 0, 2]
        for i in range(first[m, 0], last[m, 0] + 1):
            x = origin[0] + i * spacing
            for j in range(first[m, 1], last[m, 1] + 1):
                y = origin[1] + j * spacing
                level = n0 * (x - corners[m, 0, 0]) + n1 * (y - corners[m, 0, 1])
                for k in range(first[m, 2], last[m, 2] + 1):
                    z = origin[2] + k * spacing
                    if abs(level + n2 * (z - corners[m, 0, 2])) > band:
                        continue
                    px, py, pz, feature = _nearest_on_facet(corners, m, x, y, z)
                    dx, dy, dz = x - px, y - py, z - pz
                    square = dx * dx + dy * dy + dz * dz
                    if square > band * band or square >= squared[i, j, k]:
                        continue
                    side = (
                        dx * normals[m, feature, 0]
                        + dy * normals[m, feature, 1]
                        + dz * normals[m, feature, 2]
                    )
                    squared[i, j, k] = square
                    signed[i, j, k] = math.copysign(math.sqrt(square), side)
                    nearest[i, j, k] = m


@inlined_kernel
def _upwind(a, b, c, spacing):
    """Return the distance of a node from the smallest ones of its neighbours along the axes."""
    low = min(a, b, c)
    high = max(a, b, c)
    middle = a + b + c - low - high
    found = low + spacing
    if found > middle:
        found = 0.5 * (low + middle + math.sqrt(2.0 * spacing * spacing - (low - middle) ** 2))
        if found > high:
            total = low + middle + high
            squares = low * low + middle * middle + high * high
            found = (
                total + math.sqrt(max(total * total - 3.0 * (squares - spacing * spacing), 0.0))
            ) / 3.0
    return found


@kernel
def _sweep(size, inside, region, fixed, spacing, direction):
    """Update the nodes beyond the band in one of the eight orders."""
    ni, nj, nk = size.shape
    for p in range(ni):
        i = p if direction & 1 else ni - 1 - p
        for q in range(nj):
            j = q if direction & 2 else nj - 1 - q
            for r in range(nk):
                k = r if direction & 4 else nk - 1 - r
                if fixed[i, j, k]:
                    continue
                i0, i1 = max(i - 1, 0), min(i + 1, ni - 1)
                j0, j1 = max(j - 1, 0), min(j + 1, nj - 1)
                k0, k1 = max(k - 1, 0), min(k + 1, nk - 1)
                if size[i1, j, k] < size[i0, j, k]:
                    i0 = i1
                if size[i, j1, k] < size[i, j0, k]:
                    j0 = j1
                if size[i, j, k1] < size[i, j, k0]:
                    k0 = k1
                a, b, c = size[i0, j, k], size[i, j0, k], size[i, j, k0]
                found = _upwind(a, b, c, spacing)
                if found >= size[i, j, k]:
                    continue
                size[i, j, k] = found
                # Side and region are those of the neighbour that is nearest to the surface.
                if a <= b and a <= c:
                    inside[i, j, k], region[i, j, k] = inside[i0, j, k], region[i0, j, k]
                elif b <= c:
                    inside[i, j, k], region[i, j, k] = inside[i, j0, k], region[i, j0, k]
                else:
                    inside[i, j, k], region[i, j, k] = inside[i, j, k0], region[i, j, k0]
