"""A triangle mesh of a car's surface with regions."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SLENDER = 1e-6
"""Smallest height of a facet over its longest edge (assumed): a flatter one is degenerate."""


@dataclass(frozen=True)
class SurfaceMesh:
    """Facets of a car's surface, in the frame of the static car.

    The frame is that of the vehicle files: x forward, y left, z up, origin on the road under the
    foremost point.

    Attributes
    ----------
    nodes : (n, 3) array
        m.
    facets : (m, 3) array of int
        Nodes of each facet, counterclockwise seen from outside.
    region : (m,) array of int
        Region of each facet.
    names : tuple of str
        Names of the regions.
    """

    nodes: Array
    facets: Index
    region: Index
    names: tuple[str, ...]

    @cached_property
    def corners(self) -> Array:
        """Corners (m, 3, 3) of the facets, m."""
        return np.asarray(self.nodes[self.facets])

    @cached_property
    def area_vectors(self) -> Array:
        """Normal of each facet times its area (m, 3), m2."""
        a, b, c = (self.corners[:, k] for k in range(3))
        return np.asarray(0.5 * np.cross(b - a, c - a))

    @property
    def areas(self) -> Array:
        """Area of each facet (m,), m2."""
        return np.asarray(np.linalg.norm(self.area_vectors, axis=1))

    @property
    def volume(self) -> float:
        """Enclosed volume (m3), positive if the facets of a closed mesh face outwards."""
        return float(np.einsum("ij,ij->", self.corners[:, 0], self.area_vectors) / 3.0)

    @property
    def box(self) -> Array:
        """Lowest and highest corner (2, 3) of the mesh, m."""
        return np.stack([self.nodes.min(axis=0), self.nodes.max(axis=0)])

    @cached_property
    def edges(self) -> Index:
        """Directed edges (3 m, 2) of the facets, facet by facet."""
        f = self.facets
        return np.stack([f, np.roll(f, -1, axis=1)], axis=2).reshape(-1, 2)

    def open_edges(self) -> Index:
        """Return the edges (k, 2) that belong to one facet only."""
        ordered = np.sort(self.edges, axis=1)
        _, first, count = np.unique(ordered, axis=0, return_index=True, return_counts=True)
        return np.asarray(self.edges[first[count == 1]])

    def crowded_edges(self) -> Index:
        """Return the edges (k, 2) that belong to more than two facets."""
        ordered = np.sort(self.edges, axis=1)
        found, count = np.unique(ordered, axis=0, return_counts=True)
        return np.asarray(found[count > 2])

    def flipped_edges(self) -> Index:
        """Return the edges (k, 2) whose two facets face opposite sides."""
        found, count = np.unique(self.edges, axis=0, return_counts=True)
        return np.asarray(found[count > 1])

    def degenerate_facets(self) -> Index:
        """Return the facets (k,) without an area, or as good as without."""
        sides = self.corners - np.roll(self.corners, -1, axis=1)
        longest = np.linalg.norm(sides, axis=2).max(axis=1)
        return np.flatnonzero(2.0 * self.areas <= SLENDER * longest**2)

    @property
    def is_closed(self) -> bool:
        """Whether every edge belongs to two facets that face the same side."""
        return not (
            len(self.open_edges()) or len(self.crowded_edges()) or len(self.flipped_edges())
        )

    def compact(self) -> "SurfaceMesh":
        """Return the mesh with equal nodes merged and without degenerate facets and lone nodes."""
        _, first, place = np.unique(
            np.round(self.nodes, 9), axis=0, return_index=True, return_inverse=True
        )
        joined = replace(self, nodes=self.nodes[first], facets=place.reshape(-1)[self.facets])
        kept = np.ones(len(joined.facets), dtype=bool)
        kept[joined.degenerate_facets()] = False
        used, numbered = np.unique(joined.facets[kept], return_inverse=True)
        return replace(
            joined,
            nodes=joined.nodes[used],
            facets=numbered.reshape(-1, 3),
            region=self.region[kept],
        )
