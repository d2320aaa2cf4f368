"""The tree of rigid segments: constant data, motion and loads."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Tree(NamedTuple):
    """Constant data of ``n`` segments, parents before children.

    Attributes
    ----------
    parent : (n,) int64, -1 for the root.
    joint_in_parent : (n, 3) m, inboard joint from the parent's own inboard joint, parent axes.
    centre_from_joint : (n, 3) m, own centre of mass from the inboard joint, own axes; 0 for the
        root, whose reference point is its centre of mass.
    mass : (n,) kg.
    inertia : (n, 3) kg m2, principal moments along the own axes, about the centre of mass.
    yields : (n,) whether the inboard joint lets its two points part (root: False).
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
    root_position, root_velocity : (3,) m, m/s, the root's centre of mass.
    orientation : (n, 4) unit quaternions.
    angular_velocity : (n, 3) rad/s.
    rotation : (n, 3, 3) rotation matrices of ``orientation``.
    centre, velocity : (n, 3) centre of mass and its velocity.
    joint, joint_velocity : (n, 3) joint point on the segment and its velocity; of a joint that
        yields they are part of the state.
    lever, offset : (n, 3) parent's joint to own joint, own joint to own centre.
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
    """What acts on the segments, and what comes of it, in world axes.

    Attributes
    ----------
    force, torque : (n, 3) N, N m, external load about the centre of mass.
    joint_torque : (n, 3) N m, torque of the inboard joint on the segment (its parent feels the
        opposite); ignored for the root.
    joint_force : (n, 3) N, force of an inboard joint that yields on the segment, at its joint
        point (its parent feels the opposite, there); 0 for the root.
    joint_acceleration : (n, 3) m/s2, acceleration of the joint point (root: centre of mass).
    angular_acceleration : (n, 3) rad/s2.
    articulated : (n, 27) workspace: what the children add to M, K, G, p and s.
    gain, free_spin : (n, 3, 3), (n, 3) workspace: alpha = free_spin + gain^T a_J.
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
