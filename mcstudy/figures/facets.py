"""Facets in a picture: shading and order."""

import numpy as np
from matplotlib.collections import PolyCollection
from numpy.typing import NDArray

Array = NDArray[np.float64]


def triangles(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the faces (m, 3 or 4) of a mesh as triangles (t, 3)."""
    if faces.shape[1] == 3:
        return faces
    return np.concatenate([faces[:, :3], faces[:, [0, 2, 3]]])


def unit_normals(corners: Array) -> Array:
    """Return the unit normals (m, 3) of facets (m, 3 or 4, 3), counterclockwise from outside."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None])


def shaded(colours: Array, normals: Array, light: Array, dark: float) -> Array:
    """Return colours (m, 3) as seen in a light.

    Parameters
    ----------
    colours : (m, 3) or (3,) array
        Red, green and blue, 0 to 1.
    normals : (m, 3) array
        Unit normals of the facets.
    light : (3,) array
        Unit vector towards the light.
    dark : float
        Brightness of a facet that the light does not meet, 0 to 1.
    """
    bright = dark + (1.0 - dark) * np.clip(normals @ light, 0.0, 1.0)
    return np.asarray(np.clip(bright[:, None] * colours, 0.0, 1.0))


def facet_collection(
    corners: Array, colours: Array, plane: tuple[int, int], towards: float = 1.0
) -> PolyCollection:
    """Return facets in a plane, the ones far from the viewer first.

    Parameters
    ----------
    corners : (m, k, 3) array
        Corners of the facets.
    colours : (m, 3) array
        Colour of each facet.
    plane : (int, int)
        Axes of the picture.
    towards : float
        1 if the viewer looks against the third axis, -1 if along it.
    """
    depth = ({0, 1, 2} - set(plane)).pop()
    order = np.argsort(towards * corners[:, :, depth].mean(axis=1))
    return PolyCollection(
        list(corners[order][:, :, list(plane)]),
        facecolors=colours[order],
        edgecolors="none",
        antialiaseds=False,
        rasterized=True,
    )
