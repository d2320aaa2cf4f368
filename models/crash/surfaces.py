"""Contact as loads on the segments: state of the contacts, work channels, shared steps."""

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
    """State and results of the contacts.

    Attributes
    ----------
    largest : (n, z + 1) m, largest penetration so far. pair_largest : (p,) m.
    pair_normal : (p, 3) last separating direction of a pair. pair_force : (p,) N, its normal force.
    engaged : (n, z) whether a segment entered a zone through its surface and is still in it.
    zone_force : (z + 1,) N, sum over segments of the normal force at this instant.
    segment_force : (n, z + 1) N, normal force at this instant.
    car_force : (n, 3) N, all of the car's force on a segment at this instant, world axes.
    point : (n, z, 3) m, deepest point in the car's frame at this instant.
    normal : (n, z, 3) car-frame normal at this instant (of the nearest approach).
    centre : (n, 3) m, ellipsoid centres, world.
    shape : (n, 6) m2, shape matrices, world: xx, xy, xz, yy, yz, zz.
    """

    largest: Array
    pair_largest: Array
    pair_normal: Array
    pair_force: Array
    engaged: NDArray[np.bool_]
    zone_force: Array
    segment_force: Array
    car_force: Array
    point: Array
    normal: Array
    centre: Array
    shape: Array


def empty_contacts(n: int, z: int, p: int) -> Contacts:
    """Return the state of an untouched set of contacts."""
    return Contacts(
        largest=np.zeros((n, z + 1)),
        pair_largest=np.zeros(p),
        pair_normal=np.zeros((p, 3)),
        pair_force=np.zeros(p),
        engaged=np.zeros((n, z), dtype=np.bool_),
        zone_force=np.zeros(z + 1),
        segment_force=np.zeros((n, z + 1)),
        car_force=np.zeros((n, 3)),
        point=np.zeros((n, z, 3)),
        normal=np.zeros((n, z, 3)),
        centre=np.zeros((n, 3)),
        shape=np.zeros((n, 6)),
    )


@inlined_kernel
def push(motion, loads, i, px, py, pz, fx, fy, fz):
    """Add a force at a world point to segment ``i``."""
    rx, ry, rz = px - motion.centre[i, 0], py - motion.centre[i, 1], pz - motion.centre[i, 2]
    loads.force[i, 0] += fx
    loads.force[i, 1] += fy
    loads.force[i, 2] += fz
    loads.torque[i, 0] += ry * fz - rz * fy
    loads.torque[i, 1] += rz * fx - rx * fz
    loads.torque[i, 2] += rx * fy - ry * fx


@inlined_kernel
def point_velocity(motion, i, px, py, pz):
    """Return the velocity (m/s) of the point of segment ``i`` that is at a world point."""
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
    """Fill the ellipsoids' centres and shape matrices in world axes."""
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
    """Return the elastic and the damping force (N) of a contact under combined law ``law``."""
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
    """Return the surface's share (m) of a penetration (m) under combined law ``law``."""
    return interpolate_law(ellipsoids.laws, law, ellipsoids.counts[law], SURFACE, penetration)
