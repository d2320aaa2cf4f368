"""Second-order time stepping with one force evaluation per step.

Velocity Verlet with a predicted velocity (L. Verlet, Phys. Rev. 159, 1967; the prediction serves
the velocity-dependent terms)::

    x1 = x0 + h v0 + h^2/2 a0        v* = v0 + h a0
    a1 = a(x1, v*)                   v1 = v0 + h/2 (a0 + a1)

For forces that depend on position alone it is symplectic; damping is stable while its rate is below
``1/h``. The state consists of the root's centre of mass, the joint points that yield, and all
orientations.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel
from models.rotation import rotate_quaternion

Array = NDArray[np.float64]


class Memory(NamedTuple):
    """Rates of ``n`` segments at the start of a step.

    Attributes
    ----------
    spin : (n, 3) array
        Angular velocity, rad/s.
    spin_rate : (n, 3) array
        Angular acceleration, rad/s2.
    velocity : (n, 3) array
        Velocity of the root's centre of mass (row 0) and of joint points that yield, m/s.
    acceleration : (n, 3) array
        Acceleration of the same points, m/s2.
    """

    spin: Array
    spin_rate: Array
    velocity: Array
    acceleration: Array


def empty_memory(n: int) -> Memory:
    """Return zero rates for ``n`` segments."""
    return Memory(np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)))


@inlined_kernel
def predict(tree, motion, loads, memory, h):
    """Advance positions by one step, store the old rates, and predict the new ones.

    Parameters
    ----------
    tree : Tree
        Constant data of the segments.
    motion : Motion
        Positions and velocities are changed in place.
    loads : Loads
        Accelerations at the start of the step.
    memory : Memory
        Filled with the rates at the start of the step.
    h : float
        Length of the step, s.
    """
    n = motion.orientation.shape[0]
    half = 0.5 * h * h
    for k in range(3):
        memory.velocity[0, k] = motion.root_velocity[k]
        memory.acceleration[0, k] = loads.joint_acceleration[0, k]
        motion.root_position[k] += h * memory.velocity[0, k] + half * memory.acceleration[0, k]
        motion.root_velocity[k] += h * memory.acceleration[0, k]
    for i in range(n):
        for k in range(3):
            memory.spin[i, k] = motion.angular_velocity[i, k]
            memory.spin_rate[i, k] = loads.angular_acceleration[i, k]
            motion.angular_velocity[i, k] += h * memory.spin_rate[i, k]
        rotate_quaternion(
            motion.orientation,
            i,
            h * memory.spin[i, 0] + half * memory.spin_rate[i, 0],
            h * memory.spin[i, 1] + half * memory.spin_rate[i, 1],
            h * memory.spin[i, 2] + half * memory.spin_rate[i, 2],
        )
        if tree.yields[i]:
            for k in range(3):
                memory.velocity[i, k] = motion.joint_velocity[i, k]
                memory.acceleration[i, k] = loads.joint_acceleration[i, k]
                motion.joint[i, k] += h * memory.velocity[i, k] + half * memory.acceleration[i, k]
                motion.joint_velocity[i, k] += h * memory.acceleration[i, k]


@inlined_kernel
def correct(tree, motion, loads, memory, h):
    """Replace the predicted rates by the trapezoidal ones.

    Parameters
    ----------
    tree : Tree
        Constant data of the segments.
    motion : Motion
        Velocities are changed in place.
    loads : Loads
        Accelerations at the end of the step.
    memory : Memory
        Rates at the start of the step.
    h : float
        Length of the step, s.
    """
    half = 0.5 * h
    for k in range(3):
        motion.root_velocity[k] = memory.velocity[0, k] + half * (
            memory.acceleration[0, k] + loads.joint_acceleration[0, k]
        )
    for i in range(motion.orientation.shape[0]):
        for k in range(3):
            motion.angular_velocity[i, k] = memory.spin[i, k] + half * (
                memory.spin_rate[i, k] + loads.angular_acceleration[i, k]
            )
        if tree.yields[i]:
            for k in range(3):
                motion.joint_velocity[i, k] = memory.velocity[i, k] + half * (
                    memory.acceleration[i, k] + loads.joint_acceleration[i, k]
                )
