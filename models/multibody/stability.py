"""Stable step lengths, from the fastest rates of joints and contacts."""

import math

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel, kernel
from models.contact.law import FORCE, RECOVERY, interpolate_law
from models.multibody.bushings import BEYOND
from models.multibody.joints import FRICTION_RATE
from models.multibody.sweeps import solve_accelerations
from models.multibody.tree import Motion, Tree, empty_loads
from models.pedestrian.joints import TWIST_FRICTION, Joints

Array = NDArray[np.float64]

STABLE = 0.8
"""Largest damping rate times step; the integrator is stable below 1. Friction counts at its
steepest, at rest, so a body in motion is further away from the bound."""
RESOLVED = 1.0
"""Largest circular frequency of a spring times step; stable below 2 without damping (L. Verlet
1967)."""
SWEEPS = 30
"""Power iterations for the largest damping rate; it is then known to some per cent."""


def joint_rate(tree: Tree, joints: Joints, motion: Motion) -> float:
    """Return the largest rate (1/s) of the joints; the longest stable step is ``STABLE`` over it.

    It is the maximum over damping and bushings; a bushing's frequency is weighted by
    ``STABLE / RESOLVED``.

    Parameters
    ----------
    tree : Tree
        Constant data of the segments.
    joints : Joints
        Joints of the body.
    motion : Motion
        Posture of the body, with its kinematics up to date.
    """
    return max(_damping_rate(tree, joints, motion), _bushing_rate(tree, joints))


def stable_ticks(rate: float, tick: float, wanted: int) -> int:
    """Return the number of ticks, one to ``wanted``, that a step may take at a joint rate.

    Parameters
    ----------
    rate : float
        Largest rate of the joints, 1/s.
    tick : float
        Finest step, s.
    wanted : int
        Largest number of ticks.
    """
    return min(wanted, max(1, int(STABLE / (rate * tick))))


def surface_mobility(tree: Tree, semi_axes: Array) -> Array:
    """Return the acceleration of each segment's surface per unit force on it.

    The segment is free and the point lies at half of its longest semi-axis from its centre of mass
    (assumed: bodies lie on the road along their length).

    Parameters
    ----------
    tree : Tree
        Constant data of the segments.
    semi_axes : (n, 3) array
        m.

    Returns
    -------
    (n,) array
        1/kg.
    """
    longest = np.argmax(semi_axes, axis=1)
    arms = np.zeros_like(semi_axes)
    rows = np.arange(semi_axes.shape[0])
    arms[rows, longest] = 0.5 * semi_axes[rows, longest]
    return _mobility(tree, rows, arms)


@inlined_kernel
def ticks_in_contact(settings, ellipsoids, contacts, wanted):
    """Return the number of ticks, one to ``wanted``, that a step may take in the present contacts.

    The stiffness of a contact is that of its unloading, its mass that of the free segments at the
    contact point.

    Parameters
    ----------
    settings : Settings
        Gives ``tick`` and ``mobility``.
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    contacts : Contacts
        State and results of the contacts.
    wanted : int
        Largest number of ticks.
    """
    fastest = 0.0
    for i in range(contacts.centre.shape[0]):
        for j in range(contacts.zone_force.shape[0]):
            if contacts.segment_force[i, j] > 0.0:
                law, deepest = ellipsoids.surface_law[i, j], contacts.largest[i, j]
                stiffness = _unloading(ellipsoids, law, deepest)
                fastest = max(fastest, settings.mobility[i] * stiffness)
    for k in range(ellipsoids.pairs.shape[0]):
        if contacts.pair_force[k] > 0.0:
            mobility = (
                settings.mobility[ellipsoids.pairs[k, 0]]
                + settings.mobility[ellipsoids.pairs[k, 1]]
            )
            stiffness = _unloading(ellipsoids, ellipsoids.pairs[k, 2], contacts.pair_largest[k])
            fastest = max(fastest, mobility * stiffness)
    if fastest == 0.0:
        return wanted
    longest = RESOLVED / (math.sqrt(fastest) * settings.tick)
    return max(1, int(min(longest, float(wanted))))


@inlined_kernel
def _unloading(ellipsoids, law, deepest):
    """Return the unloading slope (N/m) of a combined law from its largest penetration (m)."""
    count = ellipsoids.counts[law]
    top = interpolate_law(ellipsoids.laws, law, count, FORCE, deepest)
    return top / interpolate_law(ellipsoids.laws, law, count, RECOVERY, deepest)


def _damping_rate(tree: Tree, joints: Joints, motion: Motion) -> float:
    """Return the largest rotational damping rate (1/s) of the body as a whole.

    It is the largest eigenvalue of damping times mobility (relative accelerations of all joints per
    joint torque), with friction at its steepest, by power iteration.
    """
    n = tree.mass.size
    mobility = np.zeros((3 * n, 3 * n))
    still = Motion(*(array.copy() for array in motion))
    still.angular_velocity[:] = 0.0
    _fill_mobility(tree, still, empty_loads(n), mobility)
    friction = joints.friction[:, None] / FRICTION_RATE * [1.0, 1.0, TWIST_FRICTION]
    root = np.sqrt(joints.damping + friction).ravel()
    root[:3] = 0.0
    return float(_largest_eigenvalue(root[:, None] * mobility * root, root.copy(), np.empty(3 * n)))


@kernel
def _largest_eigenvalue(matrix, vector, turned):
    """Return the largest eigenvalue of a symmetric matrix by power iteration."""
    n = vector.size
    rate = 0.0
    for sweep in range(SWEEPS + 1):
        if sweep > 0:
            for i in range(n):
                turned[i] = 0.0
                for j in range(n):
                    turned[i] += matrix[i, j] * vector[j]
            for i in range(n):
                vector[i] = turned[i]
        square = 0.0
        for i in range(n):
            square += vector[i] * vector[i]
        rate = math.sqrt(square)
        if rate == 0.0:
            break
        for i in range(n):
            vector[i] /= rate
    return rate


@kernel
def _fill_mobility(tree, motion, loads, mobility):
    """Fill the relative angular acceleration of every joint per unit torque in every joint."""
    n = tree.mass.shape[0]
    for i in range(1, n):
        for k in range(3):
            for j in range(3):
                loads.joint_torque[i, j] = motion.rotation[i, j, k]
            solve_accelerations(tree, motion, loads)
            for m in range(1, n):
                p = tree.parent[m]
                for axis in range(3):
                    turn = 0.0
                    for j in range(3):
                        turn += motion.rotation[m, j, axis] * (
                            loads.angular_acceleration[m, j] - loads.angular_acceleration[p, j]
                        )
                    mobility[3 * m + axis, 3 * i + k] = turn
            for j in range(3):
                loads.joint_torque[i, j] = 0.0


def _bushing_rate(tree: Tree, joints: Joints) -> float:
    """Return the largest rate (1/s) of a joint that yields, from its damping and its frequency.

    The mass is the effective mass of the two segments, free of all others, at the joint point.
    """
    rows = np.flatnonzero(tree.yields)
    if not rows.size:
        return 0.0
    parents = tree.parent[rows]
    mobility = _mobility(tree, rows, tree.centre_from_joint[rows]) + _mobility(
        tree, parents, tree.joint_in_parent[rows] - tree.centre_from_joint[parents]
    )
    stiffness = np.maximum(joints.give_low[rows].max(axis=1), joints.give_high[rows].max(axis=1))
    damped = joints.give_damping[rows].max(axis=1) * mobility
    sprung = STABLE / RESOLVED * np.sqrt(BEYOND * stiffness * mobility)
    return float(np.maximum(damped, sprung).max())


def _mobility(tree: Tree, rows: NDArray[np.int64], arms: Array) -> Array:
    """Return the largest acceleration (k,) of points of free segments per unit force at them, 1/kg.

    Parameters
    ----------
    tree : Tree
    rows : (k,) array
        Segments.
    arms : (k, 3) array
        Positions of the points from the centres of mass, m.
    """
    x, y, z = arms.T
    none = np.zeros_like(x)
    cross = np.stack(
        [np.stack([none, -z, y], -1), np.stack([z, none, -x], -1), np.stack([-y, x, none], -1)],
        axis=1,
    )
    turned = (np.swapaxes(cross, 1, 2) * (1.0 / tree.inertia[rows])[:, None, :]) @ cross
    return np.asarray(
        np.linalg.eigvalsh(np.eye(3) / tree.mass[rows][:, None, None] + turned)[:, -1]
    )
