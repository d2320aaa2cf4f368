"""How long a step may be: the fastest thing that the joints of a body do."""

import math

import numpy as np
from numpy.typing import NDArray

from models.multibody.joints import FRICTION_RATE
from models.multibody.tree import Tree
from models.pedestrian.joints import TWIST_FRICTION, Joints

Array = NDArray[np.float64]

STABLE = 0.5
"""Largest joint rate times step. The integrator's damping is stable below 1, an undamped spring
below 2 in its circular frequency (L. Verlet 1967), of which half counts as its rate; half of both
keeps a spring that is damped as well away from the bound."""


def joint_rate(tree: Tree, joints: Joints) -> float:
    """Return the largest rate (1/s) of the joints: of their damping and of their bushings."""
    return max(_damping_rate(tree, joints), _bushing_rate(tree, joints))


def stable_ticks(rate: float, tick: float, wanted: int) -> int:
    """Return how many ticks, one to ``wanted``, a step may take with a joint rate (1/s)."""
    return min(wanted, max(1, int(STABLE / (rate * tick))))


def _damping_rate(tree: Tree, joints: Joints) -> float:
    """Return the largest rotational damping rate (1/s) of a segment.

    A segment's rate is the damping of its joints over its inertia, to which its children's masses
    add about the transverse axes.
    """
    n = tree.mass.size
    damping = joints.damping + joints.friction[:, None] / FRICTION_RATE * [
        1.0,
        1.0,
        TWIST_FRICTION,
    ]
    total = damping.copy()
    inertia = tree.inertia.copy()
    lever = np.linalg.norm(tree.centre_from_joint, axis=1)
    inertia[:, :2] += (tree.mass * lever**2)[:, None]
    for i in range(1, n):
        parent = tree.parent[i]
        total[parent] += damping[i]
        if not tree.yields[i]:
            inertia[parent, :2] += tree.mass[i] * float(
                tree.joint_in_parent[i] @ tree.joint_in_parent[i]
            )
    return float((total / inertia)[1:].max())


def _bushing_rate(tree: Tree, joints: Joints) -> float:
    """Return the largest rate (1/s) of a joint that yields: of its damping, half of its frequency.

    By the mass that two segments, free of all others, put against each other at the joint point.
    """
    rates = [0.0]
    for i in np.flatnonzero(tree.yields):
        parent = tree.parent[i]
        mobility = _mobility(tree, int(i), tree.centre_from_joint[i]) + _mobility(
            tree, int(parent), tree.joint_in_parent[i] - tree.centre_from_joint[parent]
        )
        stiffness = max(joints.give_low[i].max(), joints.give_high[i].max())
        rates += [
            float(joints.give_damping[i].max() * mobility),
            0.5 * math.sqrt(stiffness * mobility),
        ]
    return max(rates)


def _mobility(tree: Tree, i: int, arm: Array) -> float:
    """Return the largest acceleration (1/kg) of a point of a free segment per unit force at it."""
    cross = np.array([[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]])
    turned = cross.T @ np.diag(1.0 / tree.inertia[i]) @ cross
    return float(np.linalg.eigvalsh(np.eye(3) / tree.mass[i] + turned)[-1])
