"""Contact forces as loads on the segments: contact state, work channels, shared steps."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel
from models.contact.geometry import shape_matrix
from models.contact.law import DAMPING_ONSET, SURFACE, contact_force, interpolate_law

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# Work channels.
(
    JOINT_ELASTIC,
    JOINT_DAMPING,
    CAR_NORMAL,
    ROAD_NORMAL,
    SELF_NORMAL,
    FRICTION,
    CONTACT_DAMPING,
    PLOUGHING,
) = range(8)
CHANNELS = 8
WORK_CHANNELS = (
    "joint_elastic",
    "joint_damping",
    "car_contact",
    "road_contact",
    "self_contact",
    "friction",
    "contact_damping",
    "ploughing",
)


class Contacts(NamedTuple):
    """State and results of the contacts of ``n`` segments, ``z`` zones and ``p`` pairs.

    Attributes
    ----------
    largest : (n, z + 1) array
        Largest penetration so far, last column the road, m.
    pair_largest : (p,) array
        Largest penetration of a pair so far, m.
    pair_normal : (p, 3) array
        Last separating direction of a pair.
    pair_force : (p,) array
        Normal force of a pair, N.
    engaged : (n, z) array of bool
        Whether a segment entered a zone through its surface and is still in contact with it.
    zone_force : (z + 1,) array
        Sum over the segments of the current normal force, last entry the road, N.
    segment_force : (n, z + 1) array
        Current normal force, N.
    car_force : (n, 3) array
        Current total force of the car on a segment, world axes, N.
    car_torque : (n, 3) array
        Current total torque of the car on a segment about its centre of mass, world axes, N m.
    point : (n, z, 3) array
        Current deepest point in the car's frame, m.
    normal : (n, z, 3) array
        Current normal in the car's frame, pointing to the segment.
    centre : (n, 3) array
        Ellipsoid centres, world axes, m.
    shape : (n, 6) array
        Shape matrices, world axes: xx, xy, xz, yy, yz, zz, m2.
    """

    largest: Array
    pair_largest: Array
    pair_normal: Array
    pair_force: Array
    engaged: NDArray[np.bool_]
    zone_force: Array
    segment_force: Array
    car_force: Array
    car_torque: Array
    point: Array
    normal: Array
    centre: Array
    shape: Array


def empty_contacts(n: int, z: int, p: int) -> Contacts:
    """Return the initial state of the contacts, without any penetration or force.

    Parameters
    ----------
    n, z, p : int
        Numbers of segments, zones and pairs of segments.
    """
    return Contacts(
        largest=np.zeros((n, z + 1)),
        pair_largest=np.zeros(p),
        pair_normal=np.zeros((p, 3)),
        pair_force=np.zeros(p),
        engaged=np.zeros((n, z), dtype=np.bool_),
        zone_force=np.zeros(z + 1),
        segment_force=np.zeros((n, z + 1)),
        car_force=np.zeros((n, 3)),
        car_torque=np.zeros((n, 3)),
        point=np.zeros((n, z, 3)),
        normal=np.zeros((n, z, 3)),
        centre=np.zeros((n, 3)),
        shape=np.zeros((n, 6)),
    )


@inlined_kernel
def push(motion, loads, i, px, py, pz, fx, fy, fz):
    """Add a force at a world point to the loads on segment ``i``.

    Parameters
    ----------
    motion : Motion
        Positions and velocities of the segments.
    loads : Loads
        ``force`` and ``torque`` of the segments are increased in place.
    i : int
        Row of the segment.
    px, py, pz : float
        Point of application, world axes, m.
    fx, fy, fz : float
        Force, world axes, N.
    """
    rx, ry, rz = px - motion.centre[i, 0], py - motion.centre[i, 1], pz - motion.centre[i, 2]
    loads.force[i, 0] += fx
    loads.force[i, 1] += fy
    loads.force[i, 2] += fz
    loads.torque[i, 0] += ry * fz - rz * fy
    loads.torque[i, 1] += rz * fx - rx * fz
    loads.torque[i, 2] += rx * fy - ry * fx


@inlined_kernel
def point_velocity(motion, i, px, py, pz):
    """Return the velocity of the point of segment ``i`` at a world position.

    Parameters
    ----------
    motion : Motion
        Positions and velocities of the segments.
    i : int
        Row of the segment.
    px, py, pz : float
        Position, world axes, m.

    Returns
    -------
    vx, vy, vz : float
        m/s.
    """
    rx, ry, rz = px - motion.centre[i, 0], py - motion.centre[i, 1], pz - motion.centre[i, 2]
    wx = motion.angular_velocity[i, 0]
    wy = motion.angular_velocity[i, 1]
    wz = motion.angular_velocity[i, 2]
    return (
        motion.velocity[i, 0] + wy * rz - wz * ry,
        motion.velocity[i, 1] + wz * rx - wx * rz,
        motion.velocity[i, 2] + wx * ry - wy * rx,
    )


@inlined_kernel
def update_surfaces(ellipsoids, motion, contacts):
    """Compute the ellipsoids' centres and shape matrices in world axes.

    Parameters
    ----------
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    motion : Motion
        Positions and velocities of the segments.
    contacts : Contacts
        ``centre`` and ``shape`` are filled.
    """
    for i in range(motion.centre.shape[0]):
        x, y, z = ellipsoids.offset[i, 0], ellipsoids.offset[i, 1], ellipsoids.offset[i, 2]
        for k in range(3):
            contacts.centre[i, k] = (
                motion.centre[i, k]
                + motion.rotation[i, k, 0] * x
                + motion.rotation[i, k, 1] * y
                + motion.rotation[i, k, 2] * z
            )
        A = shape_matrix(
            motion.rotation,
            i,
            ellipsoids.square[i, 0],
            ellipsoids.square[i, 1],
            ellipsoids.square[i, 2],
        )
        for k in range(6):
            contacts.shape[i, k] = A[k]


@inlined_kernel
def shape_of(contacts, i):
    """Return the six entries of the shape matrix of segment ``i`` (m2)."""
    return (
        contacts.shape[i, 0],
        contacts.shape[i, 1],
        contacts.shape[i, 2],
        contacts.shape[i, 3],
        contacts.shape[i, 4],
        contacts.shape[i, 5],
    )


@inlined_kernel
def law_force(ellipsoids, law, penetration, rate, largest):
    """Return the elastic and the damping force of a contact under a combined law.

    Parameters
    ----------
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    law : int
        Row of the combined law.
    penetration : float
        m.
    rate : float
        Rate of penetration, m/s.
    largest : float
        Largest penetration so far, ``penetration`` included, m.

    Returns
    -------
    elastic, viscous : float
        N.
    """
    return contact_force(
        ellipsoids.laws,
        law,
        ellipsoids.counts[law],
        ellipsoids.damping[law],
        DAMPING_ONSET,
        penetration,
        rate,
        largest,
    )


@inlined_kernel
def law_surface(ellipsoids, law, penetration):
    """Return the surface's share (m) of a penetration under a combined law.

    Parameters
    ----------
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    law : int
        Row of the combined law.
    penetration : float
        m.
    """
    return interpolate_law(ellipsoids.laws, law, ellipsoids.counts[law], SURFACE, penetration)
