"""The three-dimensional body held in the plane of the car's travel.

Every segment keeps its place and posture at first contact and may from then on move along x and z
and turn about y alone. Masses, joints and ellipsoids are thus those of the spatial body; only its
motion across the plane is taken away. Angles are Pymunk's: from x towards z, zero at the start.
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
    """Constant data and start of ``n`` segments in the plane.

    Attributes
    ----------
    parent : (n,). mass : (n,) kg. inertia : (n,) kg m2 about y through the centre of mass.
    normal : (n, 3) the plane's normal y in the segment's own axes, the same at all times.
    shadow : (n, 3) m2, shape entries xx, xz, zz of the ellipsoid's shadow at the start.
    offset : (n, 2) m, ellipsoid's centre from the centre of mass at the start.
    breadth : (n, 2) m, lowest and highest y of the ellipsoid.
    side : (n,) m, y of the ellipsoid's centre. orientation : (n, 4) quaternions at the start.
    centre : (n, 2) m. velocity : (n, 2) m/s. spin : (n,) rad/s.
    joint : (n, 2) m, joint to the parent (root: its centre).
    axes : (n, 3, 2) the segment's own axes at the start, their parts in the plane.
    mobility : (n,) 1/kg, largest acceleration of the joint's two points against each other per unit
        force between them, both segments free.
    """

    parent: Index
    mass: Array
    inertia: Array
    normal: Array
    shadow: Array
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
    """Return a body in a posture, held in the plane."""
    n = len(SEGMENTS)
    rotation = np.array([matrix_of(q) for q in posture.orientation])
    normal = rotation[:, 1, :].copy()
    shape = (rotation * body.semi_axes[:, None, :] ** 2) @ rotation.transpose(0, 2, 1)
    centre = segment_centres(body, posture.orientation, posture.root_position)
    offset = np.einsum("ijk,ik->ij", rotation, body.ellipsoid - body.centre)
    half = np.sqrt(shape[:, 1, 1])
    middle = centre[:, 1] + offset[:, 1]
    joint, velocity = centre[:, ::2].copy(), np.empty((n, 2))
    # Of a turning segment only the turn about y is kept; y turns z towards x.
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
        shadow=np.stack([shape[:, 0, 0], shape[:, 0, 2], shape[:, 2, 2]], axis=1),
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

    Of two segments that are apart across the plane the shadows pass through each other.

    Parameters
    ----------
    ellipsoids : of the spatial body. body : in the plane.
    free : regions that pass through the car and through other segments.
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
    """Return the corners (m) of a polygon along a segment's shadow, from its centre of mass.

    Its corners lie outside the ellipse by as much as its sides lie inside.
    """
    xx, xz, zz = body.shadow[segment]
    root = np.linalg.cholesky(np.array([[xx, xz], [xz, zz]]))
    scale = 2.0 / (1.0 + math.cos(math.pi / corners))
    angle = 2.0 * math.pi * np.arange(corners) / corners
    ring = body.offset[segment] + scale * np.stack([np.cos(angle), np.sin(angle)], axis=1) @ root.T
    return [(float(x), float(z)) for x, z in ring]


def _quarter_turn(arm: Array) -> Array:
    """Return the velocity of a point on a unit spin about an arm's foot."""
    return np.array([-arm[1], arm[0]])
