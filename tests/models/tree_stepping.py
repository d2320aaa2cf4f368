"""Steps a tree of segments without a crash, by our kernels and by MuJoCo."""

import mujoco
import numpy as np
from builders import Array
from scipy.spatial.transform import Rotation

from models.compilation import kernel
from models.multibody.bushings import apply_bushings
from models.multibody.integration import correct, empty_memory, predict
from models.multibody.joints import apply_joint_torques
from models.multibody.kinematics import seat_joints, update_kinematics
from models.multibody.sweeps import solve_accelerations
from models.multibody.tree import Loads, Motion, Tree, empty_loads, empty_motion
from models.pedestrian.joints import Joints


@kernel
def _advance(tree, motion, loads, memory, h, count):
    update_kinematics(tree, motion)
    solve_accelerations(tree, motion, loads)
    for _ in range(count):
        predict(tree, motion, loads, memory, h)
        update_kinematics(tree, motion)
        solve_accelerations(tree, motion, loads)
        correct(tree, motion, loads, memory, h)
    update_kinematics(tree, motion)


@kernel
def _advance_jointed(tree, joints, motion, loads, memory, power, h, count):
    update_kinematics(tree, motion)
    apply_joint_torques(tree, joints, motion, loads, power)
    apply_bushings(tree, joints, motion, loads, power)
    solve_accelerations(tree, motion, loads)
    power[:] = 0.0
    for _ in range(count):
        predict(tree, motion, loads, memory, h)
        update_kinematics(tree, motion)
        apply_joint_torques(tree, joints, motion, loads, power)
        apply_bushings(tree, joints, motion, loads, power)
        solve_accelerations(tree, motion, loads)
        correct(tree, motion, loads, memory, h)
    update_kinematics(tree, motion)


@kernel
def _torques(tree, joints, motion, loads, power):
    update_kinematics(tree, motion)
    power[:] = 0.0
    apply_joint_torques(tree, joints, motion, loads, power)


def _weights(tree: Tree, gravity: float) -> Loads:
    loads = empty_loads(tree.mass.size)
    loads.force[:, 2] = -gravity * tree.mass
    return loads


def advance(tree: Tree, motion: Motion, duration: float, step: float, gravity: float = 0.0) -> None:
    """Step free joints in place."""
    memory, count = empty_memory(tree.mass.size), round(duration / step)
    _advance(tree, motion, _weights(tree, gravity), memory, step, count)


def advance_jointed(
    tree: Tree, joints: Joints, motion: Motion, duration: float, step: float, gravity: float = 0.0
) -> Array:
    """Step joints with resistance in place; return elastic and damping work (J) on the tree."""
    power, memory, count = np.zeros(2), empty_memory(tree.mass.size), round(duration / step)
    loads = _weights(tree, gravity)
    _advance_jointed(tree, joints, motion, loads, memory, power, step, count)
    return step * power


def joint_torques(tree: Tree, joints: Joints, motion: Motion) -> tuple[Array, Array]:
    """Return the torques (n, 3) on the segments in world axes, and elastic and damping power."""
    loads, power = empty_loads(tree.mass.size), np.zeros(2)
    _torques(tree, joints, motion, loads, power)
    return loads.joint_torque, power


def rotations(motion: Motion) -> Rotation:
    return Rotation.from_quat(motion.orientation, scalar_first=True)


def random_motion(tree: Tree, seed: int, spin: float) -> Motion:
    """Return a motion with any orientations and angular velocities around ``spin`` rad/s."""
    rng = np.random.default_rng(seed)
    n = tree.mass.size
    motion = empty_motion(n)
    motion.orientation[:] = Rotation.random(n, random_state=rng).as_quat(scalar_first=True)
    motion.angular_velocity[:] = rng.normal(0.0, spin, (n, 3))
    motion.root_position[:] = rng.normal(0.0, 1.0, 3)
    motion.root_velocity[:] = rng.normal(0.0, 1.0, 3)
    seat_joints(tree, motion)
    return motion


def copy_of(motion: Motion) -> Motion:
    return Motion(*(array.copy() for array in motion))


def world_inertia(tree: Tree, motion: Motion) -> Array:
    R = rotations(motion).as_matrix()
    return np.asarray(np.einsum("nij,nj,nkj->nik", R, tree.inertia, R))


def kinetic_energy(tree: Tree, motion: Motion) -> float:
    w, v = motion.angular_velocity, motion.velocity
    turning = np.einsum("ni,nij,nj->", w, world_inertia(tree, motion), w)
    return float(0.5 * turning + 0.5 * (tree.mass * (v**2).sum(axis=1)).sum())


def linear_momentum(tree: Tree, motion: Motion) -> Array:
    return np.asarray(tree.mass @ motion.velocity)


def angular_momentum(tree: Tree, motion: Motion) -> Array:
    """Return the angular momentum about the origin."""
    own = np.einsum("nij,nj->i", world_inertia(tree, motion), motion.angular_velocity)
    moving = np.cross(motion.centre, tree.mass[:, None] * motion.velocity).sum(axis=0)
    return np.asarray(own + moving)


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
    tree: Tree, motion: Motion, gravity: float, duration: float, step: float,
    joints: Joints | None = None,
) -> Array:  # fmt: skip
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
