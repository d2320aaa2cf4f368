"""Sled test of head and neck, upright on an accelerated sled: adult donors of Kang 2018.

The base of the neck is the root of the tree, so heavy that head and neck do not affect it; it does
not rotate. Muscles are passive, as those of the donors.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.compilation import kernel
from models.component.head_and_neck import load_weights, mount_neck
from models.multibody.bushings import apply_bushings
from models.multibody.integration import correct, empty_memory, predict
from models.multibody.joints import apply_joint_torques
from models.multibody.kinematics import seat_joints, update_kinematics
from models.multibody.sweeps import solve_accelerations
from models.multibody.tree import empty_loads, empty_motion
from models.pedestrian.anthropometry import Body
from models.pedestrian.joints import Joints

Array = NDArray[np.float64]

STEP = 2e-5
"""s."""
DURATION = 0.25
"""s of test."""


@dataclass(frozen=True)
class SledTest:
    """Histories of a sled test.

    Attributes
    ----------
    time : (n,) array
        s.
    rotation : (n,) array
        Rotation of the head about y, flexion positive, rad.
    tension : (n,) array
        Force of the neck on the head along the neck's axis, towards the base, N.
    """

    time: Array
    rotation: Array
    tension: Array


@kernel
def _ride(tree, joints, motion, loads, memory, power, pulse, step, out):
    """Step through accelerations ``pulse`` (n,) along x, m/s2.

    ``out`` (n, 2) receives rotation (rad) and tension (N).
    """
    head = tree.mass.shape[0] - 1
    turned = 0.0
    for k in range(pulse.shape[0]):
        if k > 0:
            turned += 0.5 * step * motion.angular_velocity[head, 1]
            predict(tree, motion, loads, memory, step)
        update_kinematics(tree, motion)
        load_weights(tree, loads)
        loads.force[0, 0] = pulse[k] * tree.mass[0]
        apply_joint_torques(tree, joints, motion, loads, power)
        apply_bushings(tree, joints, motion, loads, power)
        solve_accelerations(tree, motion, loads)
        if k > 0:
            correct(tree, motion, loads, memory, step)
            turned += 0.5 * step * motion.angular_velocity[head, 1]
        out[k, 0] = turned
        neck = tree.parent[head]
        along = 0.0
        for j in range(3):
            along += motion.rotation[neck, j, 2] * loads.joint_force[head, j]
        out[k, 1] = -along


def ride_sled(body: Body, joints: Joints, pulse: Array) -> SledTest:
    """Run the sled test; the body faces +x and the sled is accelerated towards -x.

    Parameters
    ----------
    body : Body
        Body whose head and neck are used.
    joints : Joints
        Joints of the body.
    pulse : (k, 2) array
        Time (s) and magnitude of the acceleration (m/s2), 0 after the last row.

    Raises
    ------
    ValueError
        If the times of the pulse do not rise.
    """
    pulse = np.asarray(pulse, dtype=np.float64)
    if pulse.ndim != 2 or np.any(np.diff(pulse[:, 0]) <= 0.0):
        raise ValueError("the pulse must be rows of time and acceleration, times rising")
    tree, held = mount_neck(body, joints, np.zeros(3))
    n = tree.mass.size
    motion = empty_motion(n)
    seat_joints(tree, motion)
    time: Array = np.arange(round(DURATION / STEP) + 1, dtype=np.float64) * STEP
    pushed = -np.interp(time, pulse[:, 0], pulse[:, 1], left=0.0, right=0.0)
    out = np.zeros((time.size, 2))
    _ride(
        tree, held, motion, empty_loads(n), empty_memory(n), np.zeros(2),
        pushed, STEP, out,
    )  # fmt: skip
    return SledTest(time, out[:, 0].copy(), out[:, 1].copy())
