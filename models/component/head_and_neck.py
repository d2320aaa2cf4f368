"""Head and neck of a body on a base so heavy that it is unaffected by them."""

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel
from models.criteria.units import STANDARD_GRAVITY
from models.multibody.tree import Tree
from models.pedestrian.anthropometry import SEGMENTS, Body
from models.pedestrian.joints import Joints, joints_of

Array = NDArray[np.float64]

HEAVY = 1e8
"""Mass (kg) and inertia (kg m2) of the base: large enough that head and neck do not move it."""
_ROWS = [SEGMENTS.index("neck"), SEGMENTS.index("head")]


def mount_neck(body: Body, joints: Joints, place: Array) -> tuple[Tree, Joints]:
    """Return base, neck and head as a tree of three segments, and their joints.

    Parameters
    ----------
    body : Body
        Body whose head and neck are used.
    joints : Joints
        Joints of the body.
    place : (3,) array
        Position of the neck's joint on the base, from the base's centre of mass, m.

    Returns
    -------
    tree : Tree
    joints : Joints
    """
    neck, head = _ROWS
    chain = [0, *_ROWS]
    tree = Tree(
        parent=np.array([-1, 0, 1], dtype=np.int64),
        joint_in_parent=np.array([np.zeros(3), place, body.joint[head] - body.joint[neck]]),
        centre_from_joint=np.vstack([np.zeros(3), body.centre[_ROWS] - body.joint[_ROWS]]),
        mass=np.array([HEAVY, *body.mass[_ROWS]]),
        inertia=np.vstack([np.full(3, HEAVY), body.inertia[_ROWS]]),
        yields=joints.yields[chain],
    )
    return tree, joints_of(joints, chain)


@inlined_kernel
def load_weights(tree, loads):
    """Replace the external loads by the weights of all segments but the base."""
    for i in range(tree.mass.shape[0]):
        for j in range(3):
            loads.force[i, j] = 0.0
            loads.torque[i, j] = 0.0
        if i > 0:
            loads.force[i, 2] = -tree.mass[i] * STANDARD_GRAVITY
