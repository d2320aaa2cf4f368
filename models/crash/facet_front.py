"""A rigid car front of facets: implementation of ``models.crash.front``.

The front is a signed distance field with regions; a patch is a region. A survey of a segment
(``models.crash.facet_survey``) shares its load out; a region's force is its law at the largest
depth, and direction and point of action are those of the pressure.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel
from models.crash.facet_survey import Findings, to_static
from models.crash.surfaces import shape_of
from models.pedestrian.skin import Skin
from models.vehicle.surface.field import DistanceField, distance_at

Array = NDArray[np.float64]

CAP = 2.0 / 3.0
"""Distance of flattened flesh from the mean height of a cap under a pressure that grows with depth,
over its depth."""


class FacetFront(NamedTuple):
    """A car's front of facets and the surface of the body that meets it.

    Attributes
    ----------
    field : DistanceField
        Distance to the static car; its regions are the rows of the vehicle's zones.
    dive : (4,) array
        Cosine and sine of the dive angle, and the shift of the diving car in x and z, m.
    friction : (z,) array
        Coefficient of friction against the body.
    ploughing : (z,) array
        Share of the ploughing resistance of a lasting dent.
    skin : Skin
    distributed : (1,) array
        1 if the points inside the car share the load, 0 if the deepest one carries all of it.
    found : Findings
        Workspace.
    """

    field: DistanceField
    dive: Array
    friction: Array
    ploughing: Array
    skin: Skin
    distributed: Array
    found: Findings


@inlined_kernel
def facet_count(front):
    """Return the number of patches."""
    return front.friction.shape[0]


@inlined_kernel
def vector_to_car(front, x, y, z):
    """Return a vector of the static car's frame in that of the diving car."""
    c, s = front.dive[0], front.dive[1]
    return c * x + s * z, y, -s * x + c * z


@inlined_kernel
def _to_car(front, x, y, z):
    """Return a point of the static car's frame in that of the diving car."""
    tx, ty, tz = vector_to_car(front, x, y, z)
    return tx + front.dive[2], ty, tz + front.dive[3]


@inlined_kernel
def facet_is_near(front, j, margin, x, y, z):
    """Return whether a point lies within a margin of the surface; asked once, of the first patch.

    Parameters
    ----------
    front : FacetFront
    j : int
        Row of the patch.
    margin : float
        m.
    x, y, z : float
        Point in the car's frame, m.
    """
    if j > 0:
        return False
    sx, sy, sz = to_static(front, x, y, z)
    return distance_at(front.field, sx, sy, sz)[0] < margin


@inlined_kernel
def facet_may_touch(front, j, margin, x, z):
    """Return whether the surveyed segment touches a region.

    Parameters
    ----------
    front : FacetFront
    j : int
        Row of the region.
    margin, x, z : float
        Not used.
    """
    return front.found.share[j] > 0.0


@inlined_kernel
def facets_are_joined(front, j, k):
    """Return True: the surface is closed, and a segment enters it from outside only."""
    return True


@inlined_kernel
def facet_friction(front, j):
    """Return the coefficient of friction of a region."""
    return front.friction[j]


@inlined_kernel
def facet_ploughing(front, j):
    """Return the share of the ploughing resistance of a lasting dent in a region."""
    return front.ploughing[j]


@inlined_kernel
def facet_reaction(front, j, px, py, pz, fx, fy, fz):
    """Ignore the load on a patch: a rigid front does not respond to it.

    Parameters
    ----------
    front : FacetFront
    j : int
        Row of the region.
    px, py, pz : float
        Point of application in the car's frame, m.
    fx, fy, fz : float
        Force in world axes, N.
    """
    return


@inlined_kernel
def facet_separation(front, ellipsoids, contacts, j, i, cx, cy, cz, cosine, sine):
    """Return the separation of the surveyed segment from a region, with the contact geometry.

    Parameters
    ----------
    front : FacetFront
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    contacts : Contacts
        State and results of the contacts.
    j, i : int
        Rows of the region and of the segment.
    cx, cy, cz : float
        Ellipsoid centre in the car's frame, m.
    cosine, sine : float
        Of the car's yaw.

    Returns
    -------
    tuple of float
        ``(separation, nx, ny, nz, px, py, pz, weight, region)``; a separation of 1.0 m with weight
        0 means that the region is not touched.
    """
    found = front.found
    if found.share[j] <= 0.0:
        return 1.0, 1.0, 0.0, 0.0, cx, cy, cz, 0.0, j
    nx, ny, nz = vector_to_car(
        front, found.direction[j, 0], found.direction[j, 1], found.direction[j, 2]
    )
    # The point of the ellipsoid that is foremost against that direction.
    A = shape_of(contacts, i)
    wx, wy = cosine * nx - sine * ny, sine * nx + cosine * ny
    ax = A[0] * wx + A[1] * wy + A[2] * nz
    ay = A[1] * wx + A[3] * wy + A[4] * nz
    az = A[2] * wx + A[4] * wy + A[5] * nz
    h = math.sqrt(ax * wx + ay * wy + az * nz)
    px = cx - (cosine * ax + sine * ay) / h
    py = cy - (-sine * ax + cosine * ay) / h
    pz = cz - az / h
    return -found.shared_depth[j], nx, ny, nz, px, py, pz, found.share[j], j


@inlined_kernel
def facet_pressure_point(front, j, share, flesh, px, py, pz, cx, cy, cz):
    """Return the centre of pressure on a region.

    Points on the body's surface have a mean height of a third of the depth under a pressure that
    grows with it; flattened flesh lies in the plane of contact, at its whole depth. A single point
    carries the load as that of a zone does.

    Parameters
    ----------
    front : FacetFront
    j : int
        Row of the region.
    share : float
        Distance from a single point that carries the load, over that of the centre.
    flesh : float
        Penetration of the segment's flesh, m.
    px, py, pz : float
        Deepest point in the car's frame, m.
    cx, cy, cz : float
        Ellipsoid centre in the car's frame, m.
    """
    found = front.found
    if front.distributed[0] != 1.0:
        return px + share * (cx - px), py + share * (cy - py), pz + share * (cz - pz)
    x, y, z = _to_car(front, found.mean[j, 0], found.mean[j, 1], found.mean[j, 2])
    nx, ny, nz = vector_to_car(
        front, found.direction[j, 0], found.direction[j, 1], found.direction[j, 2]
    )
    lift = CAP * flesh
    return x + lift * nx, y + lift * ny, z + lift * nz
