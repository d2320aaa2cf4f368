"""Steps a tree of segments without a crash, for the tests of the tree and of the joints."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from models.compilation import kernel
from models.multibody.bushings import apply_bushings
from models.multibody.integration import correct, empty_memory, predict
from models.multibody.joints import apply_joint_torques
from models.multibody.kinematics import seat_joints, update_kinematics
from models.multibody.sweeps import solve_accelerations
from models.multibody.tree import Loads, Motion, Tree, empty_loads, empty_motion
from models.pedestrian.joints import Joints

Array = NDArray[np.float64]


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


def gravity_loads(tree: Tree, gravity: float) -> Loads:
    """Return loads of weight along -z only."""
    loads = empty_loads(tree.mass.size)
    loads.force[:, 2] = -gravity * tree.mass
    return loads


def advance(tree: Tree, motion: Motion, duration: float, step: float, gravity: float = 0.0) -> None:
    """Step free joints in place."""
    n = tree.mass.size
    count = round(duration / step)
    _advance(tree, motion, gravity_loads(tree, gravity), empty_memory(n), step, count)


def advance_jointed(
    tree: Tree,
    joints: Joints,
    motion: Motion,
    duration: float,
    step: float,
    gravity: float = 0.0,
) -> Array:
    """Step joints with resistance in place; return elastic and damping work (J) on the tree."""
    power = np.zeros(2)
    loads = gravity_loads(tree, gravity)
    count = round(duration / step)
    _advance_jointed(tree, joints, motion, loads, empty_memory(tree.mass.size), power, step, count)
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
    return np.asarray(
        own + np.cross(motion.centre, tree.mass[:, None] * motion.velocity).sum(axis=0)
    )
