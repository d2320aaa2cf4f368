"""Tree dynamics, with joints that hold and that yield, against MuJoCo, laws and closed forms."""

import math

import numpy as np
import pytest
from builders import CHILD, GRAVITY, Array, quiet
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from tree_stepping import (
    advance,
    advance_jointed,
    angular_momentum,
    copy_of,
    kinetic_energy,
    linear_momentum,
    mujoco_centres,
    random_motion,
    rotations,
    world_inertia,
)

from models.multibody.kinematics import seat_joints, update_kinematics
from models.multibody.setup import build_tree, place
from models.multibody.stability import STABLE, joint_rate
from models.multibody.sweeps import solve_accelerations
from models.multibody.tree import Motion, Tree, empty_loads, empty_motion
from models.pedestrian.anthropometry import PARENTS, SEGMENTS
from models.pedestrian.joints import Joints, build_joints
from models.pedestrian.posture import standing_posture

TREE = build_tree(CHILD)
N = len(SEGMENTS)
YIELDING = [SEGMENTS.index(name) for name in ("head", "upper_arm_left", "upper_arm_right")]


def single_body(*inertia: float) -> Tree:
    zero = np.zeros((1, 3))
    return Tree(
        np.array([-1], dtype=np.int64), zero, zero, np.array([3.0]), np.array([inertia]),
        np.zeros(1, dtype=np.bool_),
    )  # fmt: skip


# -- joints that hold ------------------------------------------------------------------------


@pytest.mark.parametrize("gravity", [0.0, GRAVITY])
def test_tumbling_child_ends_where_mujoco_says(gravity: float) -> None:
    motion = random_motion(TREE, seed=1, spin=5.0)
    expected = mujoco_centres(TREE, motion, gravity, duration=0.5, step=1e-4)
    start = motion.centre.copy()
    advance(TREE, motion, duration=0.5, step=1e-5, gravity=gravity)
    assert np.linalg.norm(motion.centre - start, axis=1).min() > 0.1
    assert np.abs(motion.centre - expected).max() < 1e-5


def test_momentum_and_energy_are_kept_without_forces() -> None:
    motion, kept = (
        random_motion(TREE, seed=2, spin=6.0), (linear_momentum, angular_momentum, kinetic_energy)
    )  # fmt: skip
    before = [f(TREE, motion) for f in kept]
    advance(TREE, motion, duration=0.5, step=1e-5)
    for old, f in zip(before, kept, strict=True):
        assert np.linalg.norm(np.subtract(f(TREE, motion), old)) < 1e-6 * np.linalg.norm(old)


def test_falling_child_trades_height_for_speed() -> None:
    motion, mass = random_motion(TREE, seed=3, spin=4.0), TREE.mass.sum()
    centre, momentum = TREE.mass @ motion.centre / mass, linear_momentum(TREE, motion)
    energy = kinetic_energy(TREE, motion) + GRAVITY * mass * centre[2]
    advance(TREE, motion, duration=0.4, step=1e-5, gravity=GRAVITY)
    fallen = centre + 0.4 * momentum / mass - [0.0, 0.0, 0.5 * GRAVITY * 0.4**2]
    now = TREE.mass @ motion.centre / mass
    np.testing.assert_allclose(now, fallen, atol=1e-7)
    total = kinetic_energy(TREE, motion) + GRAVITY * mass * now[2]
    assert total == pytest.approx(energy, rel=1e-6)


def test_joints_never_drift() -> None:
    motion = random_motion(TREE, seed=4, spin=8.0)
    advance(TREE, motion, duration=1.0, step=5e-5)
    R = rotations(motion)
    # Both segments of a joint put it at the same point, with rotations that are rotations.
    root, p = motion.centre - R.apply(TREE.centre_from_joint), list(PARENTS[1:])
    parents = root[p] + R[p].apply(TREE.joint_in_parent[1:])
    np.testing.assert_allclose(root[1:], parents, atol=2e-14)
    np.testing.assert_allclose(motion.joint[1:], root[1:], atol=2e-14)
    np.testing.assert_allclose(np.linalg.norm(motion.orientation, axis=1), 1.0, atol=1e-14)
    standing = place(standing_posture(CHILD))
    update_kinematics(TREE, standing)
    np.testing.assert_allclose(standing.centre, CHILD.centre, atol=1e-15)
    np.testing.assert_allclose(standing.joint[1:], CHILD.joint[1:], atol=1e-15)


def test_torque_free_body_follows_eulers_equations() -> None:
    tree, duration = single_body(0.010, 0.013, 0.020), 0.5
    moments = tree.inertia[0]
    rng = np.random.default_rng(6)
    motion = empty_motion(1)
    turn = Rotation.random(random_state=rng)
    spin = np.array([3.0, 12.0, 4.0])  # own axes, near the unstable one
    motion.orientation[0] = turn.as_quat(scalar_first=True)
    motion.angular_velocity[0] = turn.apply(spin)

    def rates(_: float, state: Array) -> Array:
        q, w = state[:4], state[4:]
        half = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))])
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


def test_error_falls_with_the_square_of_the_step() -> None:
    motion = random_motion(TREE, seed=7, spin=3.0)
    duration = 0.2
    ends = []
    for step in (4e-4, 2e-4, 1e-4, 5e-6):
        run = copy_of(motion)
        advance(TREE, run, duration, step, GRAVITY)
        ends.append(run.centre)
    errors = [np.linalg.norm(end - ends[-1]) for end in ends[:-1]]
    # The reference's own error, 1/400 of the finest, is in the band.
    assert 3.8 < errors[0] / errors[1] < 4.2
    assert 3.8 < errors[1] / errors[2] < 4.2


@pytest.mark.parametrize("seed", range(3))
def test_accelerations_solve_the_dense_equations(seed: int) -> None:
    """All accelerations and joint forces at once, as one linear system of 132 unknowns."""
    n = TREE.mass.size
    rng = np.random.default_rng(seed)
    motion, loads = random_motion(TREE, seed, spin=10.0), empty_loads(n)
    loads.force[:] = rng.normal(0.0, 500.0, (n, 3))
    loads.torque[:] = rng.normal(0.0, 20.0, (n, 3))
    loads.joint_torque[:] = rng.normal(0.0, 20.0, (n, 3))
    solve_accelerations(TREE, motion, loads)

    def cross(v: Array) -> Array:
        return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])

    # Unknowns: a (centre of mass), alpha, and the force F_i of the parent on segment i > 0.
    size = 6 * n + 3 * (n - 1)
    matrix, right = np.zeros((size, size)), np.zeros(size)
    inertia = world_inertia(TREE, motion)
    R = rotations(motion)
    a = [slice(3 * i, 3 * i + 3) for i in range(n)]
    q = [slice(3 * n + 3 * i, 3 * n + 3 * i + 3) for i in range(n)]
    F = [slice(6 * n + 3 * (i - 1), 6 * n + 3 * i) for i in range(n)]
    spin = motion.angular_velocity
    for i in range(n):
        matrix[a[i], a[i]] = TREE.mass[i] * np.eye(3)
        matrix[q[i], q[i]] = inertia[i]
        right[a[i]] += loads.force[i]
        right[q[i]] += loads.torque[i] - np.cross(spin[i], inertia[i] @ spin[i])
        if i == 0:
            continue
        p = PARENTS[i]
        own = -R[i].apply(TREE.centre_from_joint[i])  # own centre to joint
        far = R[p].apply(TREE.joint_in_parent[i] - TREE.centre_from_joint[p])
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


# -- joints that yield -----------------------------------------------------------------------


def free_joints(n: int) -> Joints:
    """Return joints without any resistance that do not yield."""
    zero = np.zeros((n, 3))
    return Joints(
        centre=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)), half_range=np.full((n, 3), np.pi),
        neutral=zero, stiffness_low=zero, stiffness_high=zero, stop_low=zero, stop_high=zero,
        damping=zero, friction=np.zeros(n), onset=np.ones(n), yields=np.zeros(n, dtype=np.bool_),
        give_low=zero.copy(), give_high=zero.copy(), give_damping=zero.copy(),
        give_range=np.full(n, np.inf),
    )  # fmt: skip


def yielding(stiffness: Array | float, damping: float) -> tuple[Tree, Joints]:
    """Return a child whose head and shoulders give way by equal springs either side."""
    joints = free_joints(N)
    joints.yields[YIELDING] = True
    joints.give_low[YIELDING] = joints.give_high[YIELDING] = stiffness
    joints.give_damping[YIELDING] = damping
    return build_tree(CHILD, joints.yields), joints


def stretch(tree: Tree, motion: Motion, i: int) -> Array:
    """Return how far apart (3,) m the points of a joint are, in the parent's axes."""
    p = int(tree.parent[i])
    away = rotations(motion)[p].inv().apply(motion.joint[i] - motion.joint[p])
    return np.asarray(away - tree.joint_in_parent[i])


def energy_of(tree: Tree, joints: Joints, motion: Motion) -> float:
    """Return the kinetic energy and that of the springs."""
    energy = kinetic_energy(tree, motion)
    for i in np.flatnonzero(tree.yields):
        q = stretch(tree, motion, int(i))
        energy += 0.5 * float(np.where(q > 0.0, joints.give_high[i], joints.give_low[i]) @ q**2)
    return energy


class Pair:
    """Two bodies whose centres a spring along x holds together, released when pulled apart."""

    def __init__(
        self, mass: tuple[float, float], start: float, low: float, high: float,
        damping: float = 0.0, reach: float = math.inf,
    ) -> None:  # fmt: skip
        zero = np.zeros((2, 3))
        self.tree = Tree(
            np.array([-1, 0], dtype=np.int64), zero, zero, np.array(mass), np.full((2, 3), 0.01),
            np.array([False, True]),
        )  # fmt: skip
        self.joints, self.motion = free_joints(2), empty_motion(2)
        self.joints.yields[1], self.joints.give_range[1] = True, reach
        self.joints.give_low[1], self.joints.give_high[1] = [low, 1.0, 1.0], [high, 1.0, 1.0]
        self.joints.give_damping[1, 0] = damping
        seat_joints(self.tree, self.motion)
        self.motion.joint[1, 0] += start

    def after(self, duration: float, step: float) -> tuple[float, float]:
        """Return distance and its rate."""
        advance_jointed(self.tree, self.joints, self.motion, duration, step)
        place, rate = self.motion.joint[:, 0], self.motion.joint_velocity[:, 0]
        return float(place[1] - place[0]), float(rate[1] - rate[0])


@pytest.mark.parametrize("share", [0.0, 0.1, 0.7])
def test_two_bodies_oscillate_as_the_closed_form_says(share: float) -> None:
    stiffness, masses, start, duration = 40e3, (3.0, 1.2), 0.01, 0.05
    reduced = masses[0] * masses[1] / sum(masses)
    natural = math.sqrt(stiffness / reduced)
    pair = Pair(masses, start, stiffness, stiffness, 2.0 * share * natural * reduced)
    phase = natural * math.sqrt(1.0 - share**2) * duration
    expected = start * math.exp(-share * natural * duration)
    expected *= math.cos(phase) + share / math.sqrt(1.0 - share**2) * math.sin(phase)
    assert natural * duration > 2.0 * math.pi
    assert pair.after(duration, 2e-6)[0] == pytest.approx(expected, abs=1e-6 * start)


def test_tension_and_compression_have_their_own_stiffness() -> None:
    # Half a swing on either side: the amplitudes are as the roots of the stiffnesses.
    low, high = 90e3, 10e3
    quarters = 0.5 * math.pi * (math.sqrt(1.0 / high) + math.sqrt(1.0 / low))
    distance, _ = Pair((2.0, 2.0), 0.01, low, high).after(quarters, 1e-6)
    assert distance == pytest.approx(-0.01 / 3.0, rel=1e-4)


def test_beyond_its_range_a_joint_is_five_times_as_stiff() -> None:
    # Released beyond the range, the pair passes the middle with all of its energy in motion.
    k, reach, over = 40e3, 0.01, 0.005
    pair = Pair((2.0, 2.0), reach + over, k, k, reach=reach)
    # The force is k q up to the range and then k r + 5 k (q - r).
    energy = 0.5 * k * reach**2 + k * reach * over + 2.5 * k * over**2
    fastest = max(abs(pair.after(1e-4, 1e-6)[1]) for _ in range(200))
    assert fastest == pytest.approx(math.sqrt(2.0 * energy), rel=1e-3)


def test_tumbling_child_ends_where_mujocos_slide_joints_say() -> None:
    tree, joints = yielding(np.array([60e3, 90e3, 40e3]), 40.0)
    motion = random_motion(tree, seed=1, spin=5.0)
    expected = mujoco_centres(tree, motion, 9.81, duration=0.3, step=2e-5, joints=joints)
    start = motion.centre.copy()
    advance_jointed(tree, joints, motion, 0.3, 1e-5, gravity=9.81)
    assert np.linalg.norm(motion.centre - start, axis=1).min() > 0.05
    assert np.abs(motion.centre - expected).max() < 1e-5
    # The joints did give way: by ten times the tolerance and more.
    assert max(np.abs(stretch(tree, motion, i)).max() for i in YIELDING) > 1e-4


def test_springs_keep_momentum_and_energy_and_damping_takes_what_is_booked() -> None:
    tree, joints = yielding(np.array([25e3, 25e3, 50e3]), 0.0)
    joints.give_low[YIELDING, 2] = 100e3
    motion = random_motion(tree, seed=2, spin=6.0)
    motion.joint[YIELDING] += [0.004, -0.003, 0.005]
    advance(tree, motion, 0.0, 1e-5)
    kept = (
        lambda: linear_momentum(tree, motion),
        lambda: angular_momentum(tree, motion),
        lambda: energy_of(tree, joints, motion),
    )
    before = [f() for f in kept]
    advance_jointed(tree, joints, motion, 0.5, 2e-6)
    for old, f in zip(before, kept, strict=True):
        assert np.linalg.norm(np.subtract(f(), old)) < 1e-6 * np.linalg.norm(old)
    tree, joints = yielding(25e3, 80.0)
    motion = random_motion(tree, seed=3, spin=6.0)
    motion.joint[YIELDING] += [0.01, -0.01, 0.02]
    advance_jointed(tree, joints, motion, 0.0, 1e-5)
    start = energy_of(tree, joints, motion)
    work = advance_jointed(tree, joints, motion, 0.2, 1e-5)
    assert work[1] < -0.01 * start
    assert energy_of(tree, joints, motion) - start == pytest.approx(work[1], rel=1e-3)


def test_a_stiffer_joint_tends_to_the_exact_one() -> None:
    start = random_motion(TREE, seed=4, spin=5.0)
    exact, errors = copy_of(start), []
    advance(TREE, exact, 0.05, 1e-6)
    for stiffness in (4e6, 16e6, 64e6):
        (tree, joints), motion = yielding(stiffness, 60.0), copy_of(start)
        advance_jointed(tree, joints, motion, 0.05, 1e-6)
        errors.append(np.abs(motion.centre - exact.centre).max())
    # The stretch is force over stiffness.
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.15)
    assert errors[2] < 2e-5


@quiet(12)
@given(st.floats(4.0, 7.0), st.floats(0.0, 4.0), st.integers(0, 1000))
def test_the_longest_step_allowed_is_stable(stiffness: float, damping: float, seed: int) -> None:
    (tree, joints), start = yielding(10.0**stiffness, 10.0**damping), 1e-4
    motion = random_motion(tree, seed, spin=0.0)
    step = STABLE / joint_rate(tree, joints, motion)
    motion.root_velocity[:] = 0.0
    seat_joints(tree, motion)
    motion.joint[YIELDING] += start
    advance_jointed(tree, joints, motion, 2000 * step, step)
    assert max(np.abs(stretch(tree, motion, i)).max() for i in YIELDING) < 4.0 * start


def test_bodies_of_the_data_yield_at_head_and_shoulders() -> None:
    joints, stretched = (build_joints(CHILD, neck_tension_stiffness=k) for k in (1.0, 2.0))
    assert np.flatnonzero(joints.yields).tolist() == sorted(YIELDING)
    head = SEGMENTS.index("head")
    assert stretched.give_high[head, 2] == pytest.approx(2.0 * joints.give_high[head, 2])
    np.testing.assert_allclose(stretched.give_low[head], joints.give_low[head])
