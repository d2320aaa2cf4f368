"""A tree of segments as a MuJoCo model: the peer of the tests of the tree and of its joints."""

import mujoco
import numpy as np
from numpy.typing import NDArray
from tree_stepping import rotations

from models.multibody.tree import Motion, Tree
from models.pedestrian.joints import Joints

Array = NDArray[np.float64]


def _numbers(values: Array) -> str:
    return " ".join(f"{v:.17g}" for v in values)


def _slides(joints: Joints, i: int) -> str:
    return "".join(
        f'<joint type="slide" axis="{axis}" stiffness="{joints.give_low[i, k]:.17g}" '
        f'damping="{joints.give_damping[i, k]:.17g}"/>'
        for k, axis in enumerate(("1 0 0", "0 1 0", "0 0 1"))
    )


def mujoco_model(
    tree: Tree, gravity: float, step: float, joints: Joints | None = None
) -> tuple[mujoco.MjModel, list[int]]:
    """Return the tree as a MuJoCo model and the segments in its order.

    A joint that yields is three slide joints, with the springs and dampers of ``joints``, before
    the ball.
    """
    order: list[int] = []

    def held(i: int) -> str:
        if tree.parent[i] < 0:
            return "<freejoint/>"
        slides = _slides(joints, i) if joints is not None and tree.yields[i] else ""
        return slides + '<joint type="ball"/>'

    def element(i: int) -> str:
        order.append(i)
        children = "".join(element(int(c)) for c in np.flatnonzero(tree.parent == i))
        return (
            f'<body pos="{_numbers(tree.joint_in_parent[i])}">{held(i)}'
            f'<inertial pos="{_numbers(tree.centre_from_joint[i])}" mass="{tree.mass[i]:.17g}"'
            f' diaginertia="{_numbers(tree.inertia[i])}"/>{children}</body>'
        )

    text = (
        f'<mujoco><option gravity="0 0 {-gravity}" integrator="RK4" timestep="{step}"/>'
        f"<worldbody>{element(0)}</worldbody></mujoco>"
    )
    return mujoco.MjModel.from_xml_string(text), order


def mujoco_centres(
    tree: Tree,
    motion: Motion,
    gravity: float,
    duration: float,
    step: float,
    joints: Joints | None = None,
) -> Array:
    """Return the centres of mass after ``duration`` s by MuJoCo's fourth-order Runge-Kutta."""
    model, order = mujoco_model(tree, gravity, step, joints)
    data = mujoco.MjData(model)
    R = rotations(motion)
    data.qpos[:3], data.qvel[:3] = motion.root_position, motion.root_velocity
    data.qpos[3:7] = motion.orientation[0]
    data.qvel[3:6] = R[0].inv().apply(motion.angular_velocity[0])
    for k, i in enumerate(order[1:], start=1):
        p = int(tree.parent[i])
        # The ball is a body's last joint: rotation and angular velocity against the parent.
        ball = model.body_jntadr[k + 1] + model.body_jntnum[k + 1] - 1
        at, rate = model.jnt_qposadr[ball], model.jnt_dofadr[ball]
        data.qpos[at : at + 4] = (R[p].inv() * R[i]).as_quat(scalar_first=True)
        relative = motion.angular_velocity[i] - motion.angular_velocity[p]
        data.qvel[rate : rate + 3] = R[i].inv().apply(relative)
    for _ in range(round(duration / step)):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    centres = np.empty((tree.mass.size, 3))
    centres[order] = data.xipos[1:]
    return centres
