"""Which facets of a car's surface its shells replace."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from models.vehicle.structure.panel import Structure
from models.vehicle.surface.mesh import SurfaceMesh

REPLACED = "shells"
"""Region of the facets that shells replace."""
FINENESS = 4
"""Points along the sides of an element at which a facet looks for it."""
SPARE = 0.012
"""Distance (m) of a facet's middle from the shells up to which they replace it (assumed: the gaps
between panels close, and lofted and generated surfaces lie as near)."""


def with_replaced(mesh: SurfaceMesh, structure: Structure) -> SurfaceMesh:
    """Return a mesh in which the facets that shells replace are a region of their own, the last.

    Parameters
    ----------
    mesh : SurfaceMesh
    structure : Structure
    """
    share = (np.arange(FINENESS) + 0.5) / FINENESS
    u, v = (grid.ravel() for grid in np.meshgrid(share, share))
    weight = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=1)
    points = [
        np.einsum("qc,mck->mqk", weight, panel.position[panel.elements[panel.outer]]).reshape(-1, 3)
        for panel in structure.panels
    ]
    middle = mesh.corners.mean(axis=1)
    away, _ = cKDTree(np.concatenate(points)).query(middle)
    covered: NDArray[np.bool_] = np.asarray(away < SPARE)
    return replace(
        mesh,
        region=np.where(covered, len(mesh.names), mesh.region),
        names=(*mesh.names, REPLACED),
    )
