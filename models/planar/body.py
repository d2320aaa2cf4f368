"""The three-dimensional body restricted to the plane of the car's travel.

Every segment keeps its lateral position and posture of first contact and then only moves along x
and z and rotates about y. Masses, joints and ellipsoids are those of the spatial body; only its
motion across the plane is removed. Angles follow Pymunk: from x towards z, zero at the start.
"""

import math
from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.crash.ellipsoids import Ellipsoids
from models.pedestrian.anthropometry import PARENTS, SEGMENTS, Body, region_of
from models.pedestrian.posture import Posture, segment_centres
from models.rotation import matrix_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class PlanarBody(NamedTuple):
    """Constant data and initial state of ``n`` segments in the plane.

    Attributes
    ----------
    parent : (n,) array of int64
        Row of the parent, -1 for the root.
    mass : (n,) array
        kg.
    inertia : (n,) array
        About y through the centre of mass, kg m2.
    normal : (n, 3) array
        The plane's normal y in the segment's own axes, constant.
    projection : (n, 3) array
        Shape entries xx, xz, zz of the ellipsoid's projection onto the plane at the start, m2.
    offset : (n, 2) array
        Ellipsoid's centre from the centre of mass at the start, m.
    breadth : (n, 2) array
        Lowest and highest y of the ellipsoid, m.
    side : (n,) array
        y of the ellipsoid's centre, m.
    orientation : (n, 4) array
        Quaternions at the start.
    centre : (n, 2) array
        m.
    velocity : (n, 2) array
        m/s.
    spin : (n,) array
        rad/s.
    joint : (n, 2) array
        Joint to the parent (root: its centre), m.
    axes : (n, 3, 2) array
        In-plane components of the segment's own axes at the start.
    mobility : (n,) array
        Largest relative acceleration of the joint's two points per unit force between them, both
        segments free, 1/kg.
    """

    parent: Index
    mass: Array
    inertia: Array
    normal: Array
    projection: Array
    offset: Array
    breadth: Array
    side: Array
    orientation: Array
    centre: Array
    velocity: Array
    spin: Array
    joint: Array
    axes: Array
    mobility: Array


def hold_in_plane(body: Body, posture: Posture) -> PlanarBody:
    """Return a body in a posture, restricted to the plane."""
    n = len(SEGMENTS)
    rotation = np.array([matrix_of(q) for q in posture.orientation])
    normal = rotation[:, 1, :].copy()
    shape = (rotation * body.semi_axes[:, None, :] ** 2) @ rotation.transpose(0, 2, 1)
    centre = segment_centres(body, posture.orientation, posture.root_position)
    offset = np.einsum("ijk,ik->ij", rotation, body.ellipsoid - body.centre)
    half = np.sqrt(shape[:, 1, 1])
    middle = centre[:, 1] + offset[:, 1]
    joint, velocity = centre[:, ::2].copy(), np.empty((n, 2))
    # Only the rotation about y is kept; a positive one rotates z towards x.
    spin = -posture.angular_velocity[:, 1]
    velocity[0] = posture.root_velocity[::2]
    for i, parent in enumerate(PARENTS):
        if parent < 0:
            continue
        arm = rotation[parent] @ (body.joint[i] - body.centre[parent])
        joint[i] = centre[parent, ::2] + arm[::2]
        at_joint = velocity[parent] + spin[parent] * _quarter_turn(arm[::2])
        velocity[i] = at_joint + spin[i] * _quarter_turn(centre[i, ::2] - joint[i])
    inertia = (normal**2 * body.inertia).sum(axis=1)
    mobility = np.zeros(n)
    for i, parent in enumerate(PARENTS):
        if parent >= 0:
            for k in (i, parent):
                arm = joint[i] - centre[k, ::2]
                mobility[i] += 1.0 / body.mass[k] + float(arm @ arm) / inertia[k]
    return PlanarBody(
        parent=np.array(PARENTS, dtype=np.int64),
        mass=body.mass.copy(),
        inertia=inertia,
        normal=normal,
        projection=np.stack([shape[:, 0, 0], shape[:, 0, 2], shape[:, 2, 2]], axis=1),
        offset=offset[:, ::2].copy(),
        breadth=np.stack([middle - half, middle + half], axis=1),
        side=middle,
        orientation=posture.orientation,
        centre=centre[:, ::2].copy(),
        velocity=velocity,
        spin=spin.copy(),
        joint=joint,
        axes=rotation[:, ::2, :].transpose(0, 2, 1).copy(),
        mobility=mobility,
    )


def surfaces_in_plane(
    ellipsoids: Ellipsoids, body: PlanarBody, free: Collection[str]
) -> Ellipsoids:
    """Return the surfaces of a body in the plane: which segments meet the car and each other.

    Two segments that are apart across the plane do not touch: their projections pass through each
    other.

    Parameters
    ----------
    ellipsoids : Ellipsoids
        Of the spatial body.
    body : PlanarBody
    free : collection of str
        Regions that pass through the car and through other segments.
    """
    loose = np.array([region_of(segment) in free for segment in SEGMENTS])
    law = ellipsoids.surface_law.copy()
    law[loose, :-1] = -1
    first, second = ellipsoids.pairs[:, 0], ellipsoids.pairs[:, 1]
    low, high = body.breadth.T
    meet = (low[first] < high[second]) & (low[second] < high[first])
    meet &= ~(loose[first] | loose[second])
    return ellipsoids._replace(
        surface_law=law, pairs=ellipsoids.pairs[meet], pair_gap=ellipsoids.pair_gap[meet]
    )


def outline(body: PlanarBody, segment: int, corners: int) -> list[tuple[float, float]]:
    """Return the corners of a polygon that approximates a segment's projection.

    Its corners lie outside the ellipse by as much as its sides lie inside.

    Parameters
    ----------
    body : PlanarBody
    segment : int
        Row of the segment.
    corners : int
        Number of corners.

    Returns
    -------
    list of tuple of float
        x and z from the centre of mass, m.
    """
    xx, xz, zz = body.projection[segment]
    root = np.linalg.cholesky(np.array([[xx, xz], [xz, zz]]))
    scale = 2.0 / (1.0 + math.cos(math.pi / corners))
    angle = 2.0 * math.pi * np.arange(corners) / corners
    ring = body.offset[segment] + scale * np.stack([np.cos(angle), np.sin(angle)], axis=1) @ root.T
    return [(float(x), float(z)) for x, z in ring]


def _quarter_turn(arm: Array) -> Array:
    """Return the velocity of an arm's end that rotates about its start at 1 rad/s."""
    return np.array([-arm[1], arm[0]])
