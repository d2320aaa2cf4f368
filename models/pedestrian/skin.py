"""The surface of a body as points with areas, which turn with the segments.

Every ellipsoid becomes an icosphere stretched to its semi-axes, as in the case's facet child, whose
meshes were converted from the ellipsoids. Points come in clusters: a cluster whose centre is
farther from a surface than its radius cannot touch it.
"""

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.pedestrian.anthropometry import Body

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SUBDIVISIONS = 2
"""Default subdivisions of the icosahedron: 162 points and 320 facets a segment."""


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
    grain : (n,) array
        Mean area of a segment's points, m2.
    """

    point: Array
    normal: Array
    area: Array
    centre: Array
    radius: Array
    first_point: Index
    first_cluster: Index
    grain: Array


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


def build_skin(body: Body, subdivisions: int = SUBDIVISIONS) -> Skin:
    """Return the surface points of all segments of a body.

    Parameters
    ----------
    body : Body
    subdivisions : int
        Of the icosahedron: 2 give 162 points a segment, 3 give 642.
    """
    nodes, facets = icosphere(subdivisions)
    order, first = _clusters(subdivisions)
    n, size = len(body.semi_axes), len(nodes)
    axes = body.semi_axes[:, None, :]
    point = nodes[None] * axes
    corners = point[:, facets]
    cross = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    third = np.linalg.norm(cross, axis=2) / 6.0
    area: Array = np.stack(
        [np.bincount(facets.ravel(), weights=np.repeat(own, 3), minlength=size) for own in third]
    )
    normal = nodes[None] / axes
    normal /= np.linalg.norm(normal, axis=2)[:, :, None]
    point, normal, area = point[:, order], normal[:, order], area[:, order]
    clusters = len(first) - 1
    centre = np.empty((n, clusters, 3))
    radius = np.empty((n, clusters))
    for c in range(clusters):
        own = point[:, first[c] : first[c + 1]]
        centre[:, c] = own.mean(axis=1)
        radius[:, c] = np.linalg.norm(own - centre[:, c, None], axis=2).max(axis=1)
    starts = (np.arange(n)[:, None] * size + first[None, :-1]).ravel()
    return Skin(
        point=point.reshape(-1, 3),
        normal=normal.reshape(-1, 3),
        area=area.ravel(),
        centre=centre.reshape(-1, 3),
        radius=radius.ravel(),
        first_point=np.append(starts, n * size),
        first_cluster=np.arange(n + 1) * clusters,
        grain=area.mean(axis=1),
    )
