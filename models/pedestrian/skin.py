"""The surface of a body as points with areas, which turn with the segments.

Every ellipsoid becomes an icosphere stretched to its semi-axes, as in the case's facet child, whose
meshes were converted from the ellipsoids; a segment may also have a mesh of its own. Two ellipsoids
taper towards the joint between them: a cap, a sphere about the joint that turns with the outer
segment, closes the notch in every posture. Points come in clusters: a cluster whose centre is
farther from a surface than its radius cannot touch it.
"""

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.pedestrian.anthropometry import PARENTS, SEGMENTS, Body, region_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SUBDIVISIONS = 2
"""Default subdivisions of the icosahedron: 162 points and 320 facets a segment."""
FINE = 3
"""Subdivisions of head and trunk, 642 points: with 162, HIC15 scatters by a tenth over changes of
the inputs by 0.3 %, with 642 by 4 % (the multibody model: 3 %)."""


class Skin(NamedTuple):
    """Surface points of ``n`` segments, in clusters.

    Attributes
    ----------
    point : (p, 3) array
        From the ellipsoid's centre, own axes, m.
    normal : (p, 3) array
        Outward unit normals, own axes.
    area : (p,) array
        m2.
    centre : (c, 3) array
        Centres of the clusters, own axes, m.
    radius : (c,) array
        Radii of the clusters, m.
    first_point : (c + 1,) array
        First point of each cluster.
    first_cluster : (n + 1,) array
        First cluster of each segment.
    reach : (n,) array
        Largest distance of a segment's points from its centre, m.
    grain : (n,) array
        Mean area of a segment's points, m2.
    smooth : (n,) array of bool
        Whether the segment is the ellipsoid on which its points lie.
    """

    point: Array
    normal: Array
    area: Array
    centre: Array
    radius: Array
    first_point: Index
    first_cluster: Index
    reach: Array
    grain: Array
    smooth: NDArray[np.bool_]


class Cap(NamedTuple):
    """A sphere about a joint.

    Attributes
    ----------
    place : (3,) array
        Joint from the ellipsoid's centre, own axes of the outer segment, m.
    radius : float
        m.
    """

    place: Array
    radius: float


CAPPED = ("upper_arm", "forearm", "shank", "foot")
"""Regions whose joint to the parent has a cap: shoulder, elbow, knee, ankle."""
CAP_POINTS = 2
"""Subdivisions of a cap's icosahedron."""


def joint_caps(body: Body) -> dict[int, Cap]:
    """Return the caps of a body's joints, by row of the outer segment.

    The radius is the smallest semi-axis of the two segments (assumed: half the breadth of knee and
    elbow; 39 and 27 mm of a child of seven [recalled], 41 and 27 mm here).

    Parameters
    ----------
    body : Body
    """
    caps = {}
    for row, name in enumerate(SEGMENTS):
        if region_of(name) in CAPPED:
            radius = float(body.semi_axes[[row, PARENTS[row]]].min())
            caps[row] = Cap(body.joint[row] - body.ellipsoid[row], radius)
    return caps


@functools.cache
def icosphere(subdivisions: int) -> tuple[Array, Index]:
    """Return nodes (n, 3) and facets (m, 3) of a unit sphere, facets counterclockwise from outside.

    Parameters
    ----------
    subdivisions : int
        Number of times that every facet of the icosahedron is cut into four.
    """
    golden = 0.5 * (1.0 + 5.0**0.5)
    corners = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)]
    nodes = np.array([p[-k:] + p[:-k] for k in (0, 1, 2) for p in corners], dtype=float)
    nodes /= np.linalg.norm(nodes[0])
    # The twenty triples of corners that are neighbours of each other.
    apart = np.linalg.norm(nodes[:, None] - nodes[None], axis=2)
    close = apart < 1.1 * apart[apart > 1e-9].min()
    np.fill_diagonal(close, val=False)
    facets = np.array([
        (i, j, k)
        for i in range(12) for j in range(i) for k in range(j)
        if close[i, j] and close[j, k] and close[i, k]
    ])  # fmt: skip
    inward = np.einsum(
        "ij,ij->i", nodes[facets[:, 0]], np.cross(nodes[facets[:, 1]], nodes[facets[:, 2]])
    )
    facets[inward < 0.0] = facets[inward < 0.0, ::-1]
    for _ in range(subdivisions):
        edges = np.sort(np.stack([facets, np.roll(facets, -1, axis=1)], axis=2), axis=2)
        unique, place = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
        middle = nodes[unique].sum(axis=1)
        middle /= np.linalg.norm(middle, axis=1)[:, None]
        ab, bc, ca = (place.reshape(-1, 3) + len(nodes)).T
        a, b, c = facets.T
        nodes = np.concatenate([nodes, middle])
        quarters = ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))
        facets = np.concatenate([np.stack(corners, axis=1) for corners in quarters])
    return nodes, facets


@functools.cache
def _clusters(subdivisions: int) -> tuple[Index, Index]:
    """Return an order of an icosphere's nodes by cluster, and the first node of each cluster.

    A cluster is what is nearest to one corner of the icosahedron.
    """
    nodes, _ = icosphere(subdivisions)
    nearest = np.argmax(nodes @ nodes[:12].T, axis=1)
    order = np.argsort(nearest, kind="stable")
    return order, np.searchsorted(nearest[order], np.arange(13))


def segment_mesh(body: Body, segment: int, subdivisions: int = SUBDIVISIONS) -> tuple[Array, Index]:
    """Return nodes (n, 3), from the ellipsoid's centre in own axes, and facets of a segment.

    Parameters
    ----------
    body : Body
    segment : int
        Row of the segment.
    subdivisions : int
        Of the icosahedron.
    """
    nodes, facets = icosphere(subdivisions)
    return nodes * body.semi_axes[segment], facets


@dataclass(frozen=True)
class SegmentShape:
    """A mesh of a segment's surface.

    Attributes
    ----------
    nodes : (n, 3) array
        From the ellipsoid's centre, own axes, m.
    facets : (m, 3) array of int
        Counterclockwise seen from outside.
    """

    nodes: Array
    facets: Index


def build_skin(
    semi_axes: Array,
    subdivisions: Sequence[int],
    shapes: Mapping[int, SegmentShape] | None = None,
    caps: Mapping[int, Cap] | None = None,
) -> Skin:
    """Return the surface points of all segments of a body.

    Parameters
    ----------
    semi_axes : (n, 3) array
        Of the segments' ellipsoids, m.
    subdivisions : (n,) sequence of int
        Of the icosahedron, for each segment: 2 give 162 points, 3 give 642.
    shapes : mapping of int to SegmentShape, optional
        Meshes of the segments that have one of their own, by row.
    caps : mapping of int to Cap, optional
        Caps of the joints, by row of the segment that they turn with.
    """
    chosen = np.asarray(subdivisions)
    found: dict[int, _Part] = {}
    for level in np.unique(chosen).tolist():
        rows = np.flatnonzero(chosen == level).tolist()
        found |= dict(zip(rows, _stretch(semi_axes[rows], level), strict=True))
    for row, shape in (shapes or {}).items():
        found[row] = _cover(shape)
    grain = np.array([found[row].area.mean() for row in range(len(chosen))])
    for row, cap in (caps or {}).items():
        found[row] = _capped(found[row], cap, semi_axes[row])
    parts = [found[row] for row in range(len(chosen))]
    sizes = np.array([len(part.point) for part in parts])
    clusters = np.array([len(part.centre) for part in parts])
    ends = np.cumsum(sizes)
    starts = [
        part.first[:-1] + before
        for part, before in zip(parts, (ends - sizes).tolist(), strict=True)
    ]
    smooth = np.ones(len(parts), dtype=np.bool_)
    smooth[list(shapes or {})] = False
    reach = [np.linalg.norm(part.point, axis=1).max() for part in parts]
    return Skin(
        point=np.concatenate([part.point for part in parts]),
        normal=np.concatenate([part.normal for part in parts]),
        area=np.concatenate([part.area for part in parts]),
        centre=np.concatenate([part.centre for part in parts]),
        radius=np.concatenate([part.radius for part in parts]),
        first_point=np.append(np.concatenate(starts), ends[-1]),
        first_cluster=np.concatenate([[0], np.cumsum(clusters)]),
        reach=np.where(smooth, np.maximum(reach, semi_axes.max(axis=1)), reach),
        grain=grain,
        smooth=smooth,
    )


def bare_skin(semi_axes: Array) -> Skin:
    """Return a skin without points: the segments are ellipsoids of semi-axes (n, 3) in m."""
    count = len(semi_axes)
    none, no_rows = np.zeros((0, 3)), np.zeros(count + 1, dtype=np.int64)
    return Skin(
        none, none, np.zeros(0), none, np.zeros(0), np.zeros(1, dtype=np.int64), no_rows,
        semi_axes.max(axis=1), np.ones(count), np.ones(count, dtype=np.bool_),
    )  # fmt: skip


class _Part(NamedTuple):
    """Points and clusters of one segment; ``first`` (c + 1,) is the first point of each cluster."""

    point: Array
    normal: Array
    area: Array
    centre: Array
    radius: Array
    first: Index


def _cover(shape: SegmentShape) -> _Part:
    """Return points, areas and clusters of a segment's own mesh."""
    nodes, facets = shape.nodes, shape.facets
    corners = nodes[facets]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.zeros(len(nodes))
    normal = np.zeros_like(nodes)
    for k in range(3):
        np.add.at(area, facets[:, k], np.linalg.norm(cross, axis=1) / 6.0)
        np.add.at(normal, facets[:, k], cross)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    away = nodes / np.linalg.norm(nodes, axis=1)[:, None]
    nearest = np.argmax(away @ icosphere(0)[0].T, axis=1)
    order = np.argsort(nearest, kind="stable")
    first = np.concatenate([np.searchsorted(nearest[order], np.unique(nearest)), [len(nodes)]])
    return _clustered(nodes[order], normal[order], area[order], first)


def _clustered(point: Array, normal: Array, area: Array, first: Index) -> _Part:
    """Return points in order of their clusters with the clusters' centres and radii."""
    cells = [slice(a, b) for a, b in itertools.pairwise(first.tolist())]
    centre = np.array([point[cell].mean(axis=0) for cell in cells])
    radius = np.array(
        [
            np.linalg.norm(point[cell] - c, axis=1).max()
            for cell, c in zip(cells, centre, strict=True)
        ]
    )
    return _Part(point, normal, area, centre, radius, first)


def _capped(part: _Part, cap: Cap, semi_axes: Array) -> _Part:
    """Return the points of a segment with those of a cap outside its ellipsoid, a cluster more."""
    unit, _ = icosphere(CAP_POINTS)
    point = cap.place + cap.radius * unit
    outside = np.square(point / semi_axes).sum(axis=1) > 1.0
    if not outside.any():
        return part
    count = int(outside.sum())
    share = np.full(count, 4.0 * np.pi * cap.radius**2 / len(unit))
    own = _clustered(point[outside], unit[outside], share, np.array([0, count]))
    return _Part(
        point=np.concatenate([part.point, own.point]),
        normal=np.concatenate([part.normal, own.normal]),
        area=np.concatenate([part.area, own.area]),
        centre=np.concatenate([part.centre, own.centre]),
        radius=np.concatenate([part.radius, own.radius]),
        first=np.append(part.first, part.first[-1] + count),
    )


def _stretch(semi_axes: Array, subdivisions: int) -> list[_Part]:
    """Return the icosphere stretched to the semi-axes (n, 3) of some segments."""
    nodes, facets = icosphere(subdivisions)
    order, first = _clusters(subdivisions)
    size, axes = len(nodes), semi_axes[:, None, :]
    point = nodes[None] * axes
    corners = point[:, facets]
    cross = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    third = np.linalg.norm(cross, axis=2) / 6.0
    area = np.stack(
        [np.bincount(facets.ravel(), weights=np.repeat(own, 3), minlength=size) for own in third]
    )
    normal = nodes[None] / axes
    normal /= np.linalg.norm(normal, axis=2)[:, :, None]
    point, normal, area = point[:, order], normal[:, order], area[:, order]
    cells = [slice(a, b) for a, b in itertools.pairwise(first.tolist())]
    centre = np.stack([point[:, cell].mean(axis=1) for cell in cells], axis=1)
    away = [point[:, cell] - centre[:, c, None] for c, cell in enumerate(cells)]
    radius = np.stack([np.linalg.norm(part, axis=2).max(axis=1) for part in away], axis=1)
    return [
        _Part(point[k], normal[k], area[k], centre[k], radius[k], first)
        for k in range(len(semi_axes))
    ]
