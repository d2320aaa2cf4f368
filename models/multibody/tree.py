"""The tree of rigid segments: constant data, motion and loads."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Tree(NamedTuple):
    """Constant data of ``n`` segments, parents before children.

    Attributes
    ----------
    parent : (n,) array of int64
        Row of the parent, -1 for the root.
    joint_in_parent : (n, 3) array
        Inboard joint from the parent's own inboard joint, parent axes, m.
    centre_from_joint : (n, 3) array
        Own centre of mass from the inboard joint, own axes, m; 0 for the root, whose reference
        point is its centre of mass.
    mass : (n,) array
        kg.
    inertia : (n, 3) array
        Principal moments along the own axes about the centre of mass, kg m2.
    yields : (n,) array of bool
        Whether the two points of the inboard joint can separate (root: False).
    """

    parent: NDArray[np.int64]
    joint_in_parent: Array
    centre_from_joint: Array
    mass: Array
    inertia: Array
    yields: NDArray[np.bool_]


class Motion(NamedTuple):
    """Positions and velocities, in world axes.

    Attributes
    ----------
    root_position, root_velocity : (3,) array
        The root's centre of mass, m and m/s.
    orientation : (n, 4) array
        Unit quaternions.
    angular_velocity : (n, 3) array
        rad/s.
    rotation : (n, 3, 3) array
        Rotation matrices of ``orientation``.
    centre, velocity : (n, 3) array
        Centre of mass and its velocity, m and m/s.
    joint, joint_velocity : (n, 3) array
        Joint point on the segment and its velocity, m and m/s; part of the state for a joint that
        yields.
    lever : (n, 3) array
        Own joint from the parent's joint, m.
    offset : (n, 3) array
        Own centre of mass from the own joint, m.
    """

    root_position: Array
    root_velocity: Array
    orientation: Array
    angular_velocity: Array
    rotation: Array
    centre: Array
    velocity: Array
    joint: Array
    joint_velocity: Array
    lever: Array
    offset: Array


class Loads(NamedTuple):
    """Loads on the segments and the resulting accelerations, in world axes.

    Attributes
    ----------
    force, torque : (n, 3) array
        External load about the centre of mass, N and N m.
    joint_torque : (n, 3) array
        Torque of the inboard joint on the segment, N m (the opposite acts on its parent); ignored
        for the root.
    joint_force : (n, 3) array
        Force of an inboard joint that yields on the segment, at its joint point, N (the opposite
        acts on its parent at the same point); 0 for the root.
    joint_acceleration : (n, 3) array
        Acceleration of the joint point (root: centre of mass), m/s2.
    angular_acceleration : (n, 3) array
        rad/s2.
    articulated : (n, 27) array
        Workspace: articulated-inertia accumulators, contributions of the children to M, K, G, p
        and s.
    gain : (n, 3, 3) array
        Workspace of ``alpha = free_spin + gain^T a_J``.
    free_spin : (n, 3) array
        Workspace, as above.
    """

    force: Array
    torque: Array
    joint_torque: Array
    joint_force: Array
    joint_acceleration: Array
    angular_acceleration: Array
    articulated: Array
    gain: Array
    free_spin: Array


def empty_motion(n: int) -> Motion:
    """Return a motion of ``n`` segments at the origin, at rest and upright."""
    motion = Motion(
        np.zeros(3), np.zeros(3), np.zeros((n, 4)), np.zeros((n, 3)), np.zeros((n, 3, 3)),
        np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)),
        np.zeros((n, 3)),
    )  # fmt: skip
    motion.orientation[:, 0] = 1.0
    return motion


def empty_loads(n: int) -> Loads:
    """Return zero loads for ``n`` segments."""
    return Loads(
        np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)),
        np.zeros((n, 3)), np.zeros((n, 27)), np.zeros((n, 3, 3)), np.zeros((n, 3)),
    )  # fmt: skip
