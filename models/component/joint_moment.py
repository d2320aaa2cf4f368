"""Passive moment of a joint over its angle, with the body upright and at rest."""

import numpy as np
from numpy.typing import NDArray

from models.compilation import kernel
from models.multibody.joints import apply_joint_torques
from models.multibody.kinematics import update_kinematics
from models.multibody.setup import build_tree, place
from models.multibody.tree import empty_loads
from models.pedestrian.anthropometry import SEGMENTS, Body
from models.pedestrian.joints import Joints
from models.pedestrian.posture import standing_posture
from models.rotation import axis_rotation

Array = NDArray[np.float64]


@kernel
def _torques(tree, joints, motion, loads, power):
    update_kinematics(tree, motion)
    apply_joint_torques(tree, joints, motion, loads, power)


def passive_moment(body: Body, joints: Joints, segment: str, angles: Array) -> Array:
    """Return the moment on a segment about its own y axis (flexion and extension).

    Parameters
    ----------
    body : Body
    joints : Joints
    segment : str
        Outer segment of the joint, e.g. ``thigh_left`` for the hip.
    angles : (n,) array
        Angle of the segment relative to its parent about y, 0 upright, rad.

    Returns
    -------
    (n,) array
        N m.
    """
    tree, i = build_tree(body), SEGMENTS.index(segment)
    motion, loads = place(standing_posture(body)), empty_loads(len(SEGMENTS))
    moments = np.empty(np.size(angles))
    for k, angle in enumerate(np.ravel(angles)):
        motion.orientation[i] = axis_rotation(1, float(angle))
        _torques(tree, joints, motion, loads, np.zeros(2))
        moments[k] = loads.joint_torque[i, 1]
    return moments
