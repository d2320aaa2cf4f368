"""Tree dynamics against MuJoCo, conservation laws and closed or dense solutions."""

import numpy as np
import pytest
from mujoco_tree import mujoco_centres
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from tree_stepping import (
    advance,
    angular_momentum,
    copy_of,
    kinetic_energy,
    linear_momentum,
    random_motion,
    rotations,
    world_inertia,
)

from models.multibody.kinematics import update_kinematics
from models.multibody.setup import build_tree, place
from models.multibody.sweeps import solve_accelerations
from models.multibody.tree import Tree, empty_loads, empty_motion
from models.pedestrian.anthropometry import PARENTS, SEGMENTS, build_body
from models.pedestrian.posture import standing_posture

Array = NDArray[np.float64]

GRAVITY = 9.81


@pytest.fixture(scope="module")
def child() -> Tree:
    return build_tree(build_body(7.0, 1.22, 23.2, 3.26))


def single_body() -> Tree:
    return Tree(
        np.array([-1], dtype=np.int64),
        np.zeros((1, 3)),
        np.zeros((1, 3)),
        np.array([3.0]),
        np.array([[0.010, 0.013, 0.020]]),
        np.zeros(1, dtype=np.bool_),
    )


@pytest.mark.parametrize("gravity", [0.0, GRAVITY])
def test_tumbling_child_ends_where_mujoco_says(child: Tree, gravity: float) -> None:
    motion = random_motion(child, seed=1, spin=5.0)
    expected = mujoco_centres(child, motion, gravity, duration=0.5, step=1e-4)
    start = motion.centre.copy()
    advance(child, motion, duration=0.5, step=1e-5, gravity=gravity)
    assert np.linalg.norm(motion.centre - start, axis=1).min() > 0.1
    assert np.abs(motion.centre - expected).max() < 1e-5


def test_momentum_and_energy_are_kept_without_forces(child: Tree) -> None:
    motion = random_motion(child, seed=2, spin=6.0)
    before = [f(child, motion) for f in (linear_momentum, angular_momentum, kinetic_energy)]
    advance(child, motion, duration=0.5, step=1e-5)
    after = [f(child, motion) for f in (linear_momentum, angular_momentum, kinetic_energy)]
    for old, new in zip(before, after, strict=True):
        assert np.linalg.norm(np.subtract(new, old)) < 1e-6 * np.linalg.norm(old)


def test_falling_child_trades_height_for_speed(child: Tree) -> None:
    motion = random_motion(child, seed=3, spin=4.0)
    mass = child.mass.sum()
    centre = child.mass @ motion.centre / mass
    momentum = linear_momentum(child, motion)
    energy = kinetic_energy(child, motion) + GRAVITY * mass * centre[2]
    advance(child, motion, duration=0.4, step=1e-5, gravity=GRAVITY)
    fallen = centre + 0.4 * momentum / mass - [0.0, 0.0, 0.5 * GRAVITY * 0.4**2]
    np.testing.assert_allclose(child.mass @ motion.centre / mass, fallen, atol=1e-7)
    height = float(child.mass @ motion.centre[:, 2])
    assert kinetic_energy(child, motion) + GRAVITY * height == pytest.approx(energy, rel=1e-6)


def test_joints_never_drift(child: Tree) -> None:
    motion = random_motion(child, seed=4, spin=8.0)
    advance(child, motion, duration=1.0, step=5e-5)
    R = rotations(motion)
    # Both segments of a joint put it at the same point, with rotations that are rotations.
    for i in range(1, len(SEGMENTS)):
        p = PARENTS[i]
        own = motion.centre[i] - R[i].apply(child.centre_from_joint[i])
        parents = (
            motion.centre[p]
            - R[p].apply(child.centre_from_joint[p])
            + R[p].apply(child.joint_in_parent[i])
        )
        np.testing.assert_allclose(own, parents, atol=2e-14)
        np.testing.assert_allclose(motion.joint[i], own, atol=2e-14)
    np.testing.assert_allclose(np.linalg.norm(motion.orientation, axis=1), 1.0, atol=1e-14)


def test_standing_child_has_the_joints_of_the_body() -> None:
    body = build_body(7.0, 1.22, 23.2, 3.26)
    tree, motion = build_tree(body), place(standing_posture(body))
    update_kinematics(tree, motion)
    np.testing.assert_allclose(motion.centre, body.centre, atol=1e-15)
    np.testing.assert_allclose(motion.joint[1:], body.joint[1:], atol=1e-15)


def test_torque_free_body_follows_eulers_equations() -> None:
    tree, duration = single_body(), 0.5
    moments = tree.inertia[0]
    rng = np.random.default_rng(6)
    motion = empty_motion(1)
    turn = Rotation.random(random_state=rng)
    spin = np.array([3.0, 12.0, 4.0])  # own axes, near the unstable one
    motion.orientation[0] = turn.as_quat(scalar_first=True)
    motion.angular_velocity[0] = turn.apply(spin)

    def rates(_: float, state: Array) -> Array:
        q, w = state[:4], state[4:]
        half = 0.5 * np.array(
            [
                -q[1:] @ w,
                *(q[0] * w + np.cross(q[1:], w)),
            ]
        )
        return np.concatenate((half, np.cross(moments * w, w) / moments))

    start = np.concatenate((motion.orientation[0], spin))
    end = solve_ivp(rates, (0.0, duration), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    expected = Rotation.from_quat(end[:4], scalar_first=True)
    errors = []
    for step in (4e-5, 2e-5, 1e-5):
        run = copy_of(motion)
        advance(tree, run, duration, step)
        errors.append((rotations(run)[0] * expected.inv()).magnitude())
        assert run.angular_velocity[0] == pytest.approx(expected.apply(end[4:]), abs=1e-6)
    # A second-order method turns 6 rad with 1.1e-7 rad of error at the coarsest step.
    assert errors[0] < 2e-7
    assert 3.8 < errors[0] / errors[1] < 4.2
    assert 3.8 < errors[1] / errors[2] < 4.2


def test_spinning_top_precesses_at_the_closed_form_rate() -> None:
    # Symmetric body: in its own axes w turns about the axis of symmetry at (C - A) / A * wz.
    tree = single_body()._replace(inertia=np.array([[0.01, 0.01, 0.018]]))
    motion = empty_motion(1)
    motion.angular_velocity[0] = [2.0, 0.0, 10.0]
    duration = 0.3
    advance(tree, motion, duration, 1e-5)
    own = rotations(motion)[0].inv().apply(motion.angular_velocity[0])
    angle = 0.8 * 10.0 * duration
    assert own == pytest.approx([2.0 * np.cos(angle), 2.0 * np.sin(angle), 10.0], abs=1e-6)


def test_error_falls_with_the_square_of_the_step(child: Tree) -> None:
    motion = random_motion(child, seed=7, spin=3.0)
    duration = 0.2
    ends = []
    for step in (4e-4, 2e-4, 1e-4, 5e-6):
        run = copy_of(motion)
        advance(child, run, duration, step, GRAVITY)
        ends.append(run.centre)
    errors = [np.linalg.norm(end - ends[-1]) for end in ends[:-1]]
    # The reference's own error, 1/400 of the finest, is in the band.
    assert 3.8 < errors[0] / errors[1] < 4.2
    assert 3.8 < errors[1] / errors[2] < 4.2


@pytest.mark.parametrize("seed", range(5))
def test_accelerations_solve_the_dense_equations(child: Tree, seed: int) -> None:
    """All accelerations and joint forces at once, as one linear system of 132 unknowns."""
    n = child.mass.size
    rng = np.random.default_rng(seed)
    motion, loads = random_motion(child, seed, spin=10.0), empty_loads(n)
    loads.force[:] = rng.normal(0.0, 500.0, (n, 3))
    loads.torque[:] = rng.normal(0.0, 20.0, (n, 3))
    loads.joint_torque[:] = rng.normal(0.0, 20.0, (n, 3))
    solve_accelerations(child, motion, loads)

    def cross(v: Array) -> Array:
        return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])

    # Unknowns: a (centre of mass), alpha, and the force F_i of the parent on segment i > 0.
    size = 6 * n + 3 * (n - 1)
    matrix, right = np.zeros((size, size)), np.zeros(size)
    inertia = world_inertia(child, motion)
    R = rotations(motion)
    a = [slice(3 * i, 3 * i + 3) for i in range(n)]
    q = [slice(3 * n + 3 * i, 3 * n + 3 * i + 3) for i in range(n)]
    F = [slice(6 * n + 3 * (i - 1), 6 * n + 3 * i) for i in range(n)]
    spin = motion.angular_velocity
    for i in range(n):
        matrix[a[i], a[i]] = child.mass[i] * np.eye(3)
        matrix[q[i], q[i]] = inertia[i]
        right[a[i]] += loads.force[i]
        right[q[i]] += loads.torque[i] - np.cross(spin[i], inertia[i] @ spin[i])
        if i == 0:
            continue
        p = PARENTS[i]
        own = -R[i].apply(child.centre_from_joint[i])  # own centre to joint
        far = R[p].apply(child.joint_in_parent[i] - child.centre_from_joint[p])
        matrix[a[i], F[i]] -= np.eye(3)
        matrix[a[p], F[i]] += np.eye(3)
        matrix[q[i], F[i]] -= cross(own)
        matrix[q[p], F[i]] += cross(far)
        right[q[i]] += loads.joint_torque[i]
        right[q[p]] -= loads.joint_torque[i]
        # The joint point accelerates equally on both segments.
        matrix[F[i], a[i]], matrix[F[i], q[i]] = np.eye(3), -cross(own)
        matrix[F[i], a[p]], matrix[F[i], q[p]] = -np.eye(3), cross(far)
        right[F[i]] = np.cross(spin[p], np.cross(spin[p], far)) - np.cross(
            spin[i], np.cross(spin[i], own)
        )
    solution = np.linalg.solve(matrix, right)
    alpha = solution[3 * n : 6 * n].reshape(n, 3)
    np.testing.assert_allclose(
        loads.angular_acceleration, alpha, rtol=1e-9, atol=1e-9 * np.abs(alpha).max()
    )
    np.testing.assert_allclose(loads.joint_acceleration[0], solution[:3], rtol=1e-9)
