"""Neck pendulum test: head and neck on a falling pendulum that is stopped.

49 CFR 572.123, 6-year-old dummy. The pendulum is the root of the tree, so heavy that head and neck
do not affect it; head and neck hang from it upside down with the joints and inertia of the model's
own body.
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

ARM, GAUGE = 1.80, 1.657
"""m from the pivot to the base of the neck and to the point whose speed is prescribed (recalled:
49 CFR 572.33, figure 22)."""
STEP = 2e-5
"""s; the lightest segment's damping rate times the step stays below one half."""
DURATION = 0.25
"""s after the pendulum meets its stop."""

_FACING = {"flexion": (0.0, 1.0, 0.0, 0.0), "extension": (0.0, 0.0, 1.0, 0.0)}


@dataclass(frozen=True)
class PendulumTest:
    """Histories of a neck pendulum test.

    Attributes
    ----------
    time : (n,) array
        Time after the pendulum meets its stop, s.
    angle : (n,) array
        Rotation of the head relative to the pendulum, in the direction of the test, rad.
    moment : (n,) array
        Moment about the occipital condyles, positive when it resists that rotation, N m.
    """

    time: Array
    angle: Array
    moment: Array

    def decay_time(self, level: float) -> float:
        """Return when (s) the moment first falls to ``level`` (N m) after its peak, or NaN."""
        peak = int(np.argmax(self.moment))
        below = np.flatnonzero(self.moment[peak:] <= level)
        return float(self.time[peak + below[0]]) if below.size else np.nan


@kernel
def _swing(
    tree, joints, motion, loads, memory, power, rates, step, out
):  # fmt: skip
    """Step the pendulum through its angular accelerations ``rates`` (n,) about y, rad/s2.

    ``out`` (n, 3) receives the head's quaternion components w and y and the torque of its joint
    about y.
    """
    head = tree.mass.shape[0] - 1
    for k in range(rates.shape[0]):
        if k > 0:
            predict(tree, motion, loads, memory, step)
        update_kinematics(tree, motion)
        load_weights(tree, loads)
        loads.torque[0, 1] = rates[k] * tree.inertia[0, 1]
        apply_joint_torques(tree, joints, motion, loads, power)
        apply_bushings(tree, joints, motion, loads, power)
        solve_accelerations(tree, motion, loads)
        if k > 0:
            correct(tree, motion, loads, memory, step)
        # The head against the pendulum: conj(root) * head, whose x and z parts stay 0.
        w, x, y, z = motion.orientation[0]
        hw, hx, hy, hz = motion.orientation[head]
        out[k, 0] = w * hw + x * hx + y * hy + z * hz
        out[k, 1] = w * hy - y * hw - z * hx + x * hz
        out[k, 2] = loads.joint_torque[head, 1]


def swing_neck(
    body: Body, joints: Joints, direction: str, speed: float, pulse: Array
) -> PendulumTest:
    """Run the neck pendulum test.

    Parameters
    ----------
    body : Body
        Body whose head and neck hang on the pendulum.
    joints : Joints
        Joints of the body.
    direction : {"flexion", "extension"}
    speed : float
        Speed of the gauge when the stop is met, m/s.
    pulse : (k, 2) array
        Time (s) and speed lost by the gauge until then (m/s); the first row is 0, 0 and the last
        row reaches ``speed``.

    Raises
    ------
    ValueError
        If the direction is unknown or the pulse does not end with the pendulum at rest.
    """
    if direction not in _FACING:
        raise ValueError(f"direction must be one of {', '.join(_FACING)}, given {direction!r}")
    pulse = np.asarray(pulse, dtype=np.float64)
    if pulse[0, 0] != 0.0 or pulse[0, 1] != 0.0:
        raise ValueError("the pulse must begin at 0 s with nothing lost")
    if not np.isclose(pulse[-1, 1], speed):
        raise ValueError(f"the pulse ends at {pulse[-1, 1]:g} m/s, not at the speed {speed:g} m/s")
    tree, held = mount_neck(body, joints, np.array([0.0, 0.0, ARM]))
    n = tree.mass.size
    motion, loads = empty_motion(n), empty_loads(n)
    motion.orientation[:] = _FACING[direction]
    motion.angular_velocity[:, 1] = -speed / GAUGE
    seat_joints(tree, motion)
    time: Array = np.arange(round(DURATION / STEP) + 1, dtype=np.float64) * STEP
    lost = np.interp(time, pulse[:, 0], pulse[:, 1])
    # The loss of each step is applied at its end: the trapezoidal sum equals the total loss.
    rates = np.diff(lost, prepend=0.0) / (STEP * GAUGE)
    out = np.zeros((time.size, 3))
    _swing(
        tree, held, motion, loads, empty_memory(n), np.zeros(2), rates, STEP, out,
    )  # fmt: skip
    # The pendulum's own y axis points to the right when the body faces the way of the swing.
    sign = 1.0 if direction == "flexion" else -1.0
    return PendulumTest(time, sign * 2.0 * np.arctan2(out[:, 1], out[:, 0]), out[:, 2].copy())
