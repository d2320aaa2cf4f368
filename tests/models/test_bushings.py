"""Joints that yield: closed forms, MuJoCo's slide joints, conservation laws, the rigid limit."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mujoco_tree import mujoco_centres
from numpy.typing import NDArray
from tree_stepping import (
    advance,
    advance_jointed,
    angular_momentum,
    copy_of,
    kinetic_energy,
    linear_momentum,
    random_motion,
    rotations,
)

from models.multibody.kinematics import seat_joints
from models.multibody.setup import build_tree
from models.multibody.stability import STABLE, joint_rate
from models.multibody.tree import Motion, Tree, empty_motion
from models.pedestrian.anthropometry import PARENTS, SEGMENTS, build_body
from models.pedestrian.joints import Joints, build_joints

Array = NDArray[np.float64]

YIELDING = ("head", "upper_arm_left", "upper_arm_right")


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


def let_yield(joints: Joints, stiffness: Array, damping: float) -> Joints:
    """Return joints of which those of ``YIELDING`` give way by equal springs either side."""
    give, rate = np.zeros_like(joints.give_low), np.zeros_like(joints.give_damping)
    yields = np.zeros_like(joints.yields)
    for name in YIELDING:
        i = SEGMENTS.index(name)
        give[i], rate[i], yields[i] = stiffness, damping, True
    joints = joints._replace(give_range=np.full(joints.yields.size, np.inf))
    return joints._replace(yields=yields, give_low=give, give_high=give.copy(), give_damping=rate)


def child(joints: Joints) -> Tree:
    return build_tree(build_body(7.0, 1.22, 23.2, 3.26), joints.yields)


def stretch(tree: Tree, motion: Motion, i: int) -> Array:
    """Return how far apart (3,) m the points of a joint are, in the parent's axes."""
    p = int(tree.parent[i])
    away = rotations(motion)[p].inv().apply(motion.joint[i] - motion.joint[p])
    return np.asarray(away - tree.joint_in_parent[i])


def elastic_energy(tree: Tree, joints: Joints, motion: Motion) -> float:
    energy = 0.0
    for i in np.flatnonzero(tree.yields):
        q = stretch(tree, motion, int(i))
        side = np.where(q > 0.0, joints.give_high[i], joints.give_low[i])
        energy += 0.5 * float(side @ q**2)
    return energy


def pair(mass: tuple[float, float], damping: float, low: float, high: float) -> tuple[Tree, Joints]:
    """Return two bodies whose centres a spring along x holds together."""
    tree = Tree(
        np.array([-1, 0], dtype=np.int64), np.zeros((2, 3)), np.zeros((2, 3)), np.array(mass),
        np.full((2, 3), 0.01), np.array([False, True]),
    )  # fmt: skip
    joints = free_joints(2)
    joints.yields[1] = True
    joints.give_low[1], joints.give_high[1] = [low, 1.0, 1.0], [high, 1.0, 1.0]
    joints.give_damping[1, 0] = damping
    return tree, joints


@pytest.mark.parametrize("share", [0.0, 0.1, 0.7])
def test_two_bodies_oscillate_as_the_closed_form_says(share: float) -> None:
    stiffness, masses = 40e3, (3.0, 1.2)
    reduced = masses[0] * masses[1] / sum(masses)
    natural = math.sqrt(stiffness / reduced)
    damping = 2.0 * share * natural * reduced
    tree, joints = pair(masses, damping, stiffness, stiffness)
    motion, start, duration = empty_motion(2), 0.01, 0.05
    seat_joints(tree, motion)
    motion.joint[1, 0] += start
    advance_jointed(tree, joints, motion, duration, 2e-6)
    turn = natural * math.sqrt(1.0 - share**2)
    phase = turn * duration
    expected = start * math.exp(-share * natural * duration)
    expected *= math.cos(phase) + share / math.sqrt(1.0 - share**2) * math.sin(phase)
    assert natural * duration > 2.0 * math.pi
    assert motion.joint[1, 0] - motion.joint[0, 0] == pytest.approx(expected, abs=1e-6 * start)


def test_tension_and_compression_have_their_own_stiffness() -> None:
    # Half a swing on either side: the amplitudes are as the roots of the stiffnesses.
    low, high, masses = 90e3, 10e3, (2.0, 2.0)
    tree, joints = pair(masses, 0.0, low, high)
    motion = empty_motion(2)
    seat_joints(tree, motion)
    motion.joint[1, 0] += 0.01
    quarter = 0.5 * math.pi * math.sqrt(1.0 / high)
    advance_jointed(tree, joints, motion, quarter + 0.5 * math.pi * math.sqrt(1.0 / low), 1e-6)
    assert motion.joint[1, 0] - motion.joint[0, 0] == pytest.approx(-0.01 / 3.0, rel=1e-4)


def test_beyond_its_range_a_joint_is_five_times_as_stiff() -> None:
    # Released beyond the range, the pair passes the middle with all of its energy in motion.
    stiffness, masses, reach, start = 40e3, (2.0, 2.0), 0.01, 0.015
    tree, joints = pair(masses, 0.0, stiffness, stiffness)
    joints.give_range[1] = reach
    motion = empty_motion(2)
    seat_joints(tree, motion)
    motion.joint[1, 0] += start
    # The force is k q up to the range and then k r + 5 k (q - r).
    over = start - reach
    energy = 0.5 * stiffness * reach**2 + stiffness * reach * over + 2.5 * stiffness * over**2
    fastest = 0.0
    for _ in range(200):
        advance_jointed(tree, joints, motion, 1e-4, 1e-6)
        fastest = max(fastest, abs(motion.joint_velocity[1, 0] - motion.joint_velocity[0, 0]))
    assert fastest == pytest.approx(math.sqrt(2.0 * energy), rel=1e-3)


def test_tumbling_child_ends_where_mujocos_slide_joints_say() -> None:
    joints = let_yield(free_joints(len(SEGMENTS)), np.array([60e3, 90e3, 40e3]), 40.0)
    tree = child(joints)
    motion = random_motion(tree, seed=1, spin=5.0)
    expected = mujoco_centres(tree, motion, 9.81, duration=0.5, step=2e-5, joints=joints)
    start = motion.centre.copy()
    advance_jointed(tree, joints, motion, 0.5, 1e-5, gravity=9.81)
    assert np.linalg.norm(motion.centre - start, axis=1).min() > 0.1
    assert np.abs(motion.centre - expected).max() < 1e-5
    # The joints did give way: by ten times the tolerance and more.
    assert max(np.abs(stretch(tree, motion, SEGMENTS.index(n))).max() for n in YIELDING) > 1e-4


def test_momentum_and_energy_are_kept_without_forces() -> None:
    joints = let_yield(free_joints(len(SEGMENTS)), np.array([25e3, 25e3, 50e3]), 0.0)
    for i in np.flatnonzero(joints.yields):
        joints.give_low[i, 2] = 100e3
    tree = child(joints)
    motion = random_motion(tree, seed=2, spin=6.0)
    for name in YIELDING:
        motion.joint[SEGMENTS.index(name)] += [0.004, -0.003, 0.005]
    seated = copy_of(motion)
    advance(tree, seated, 0.0, 1e-5)
    motion = seated

    def energy() -> float:
        return kinetic_energy(tree, motion) + elastic_energy(tree, joints, motion)

    before = linear_momentum(tree, motion), angular_momentum(tree, motion), energy()
    advance_jointed(tree, joints, motion, 0.5, 2e-6)
    after = linear_momentum(tree, motion), angular_momentum(tree, motion), energy()
    for old, new in zip(before, after, strict=True):
        assert np.linalg.norm(np.subtract(new, old)) < 1e-6 * np.linalg.norm(old)


def test_damping_takes_what_is_booked() -> None:
    joints = let_yield(free_joints(len(SEGMENTS)), np.full(3, 25e3), 80.0)
    tree = child(joints)
    motion = random_motion(tree, seed=3, spin=6.0)
    for name in YIELDING:
        motion.joint[SEGMENTS.index(name)] += [0.01, -0.01, 0.02]
    advance_jointed(tree, joints, motion, 0.0, 1e-5)
    before = kinetic_energy(tree, motion) + elastic_energy(tree, joints, motion)
    work = advance_jointed(tree, joints, motion, 0.2, 1e-5)
    after = kinetic_energy(tree, motion) + elastic_energy(tree, joints, motion)
    assert work[1] < -0.01 * before
    assert after - before == pytest.approx(work[1], rel=1e-3)


def test_a_stiffer_joint_tends_to_the_exact_one() -> None:
    rigid = child(free_joints(len(SEGMENTS)))
    start = random_motion(rigid, seed=4, spin=5.0)
    exact = copy_of(start)
    advance(rigid, exact, 0.05, 1e-6)
    errors = []
    for stiffness in (4e6, 16e6, 64e6):
        joints = let_yield(free_joints(len(SEGMENTS)), np.full(3, stiffness), 60.0)
        tree, motion = child(joints), copy_of(start)
        advance_jointed(tree, joints, motion, 0.05, 1e-6)
        errors.append(np.abs(motion.centre - exact.centre).max())
    # The stretch is force over stiffness.
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.15)
    assert errors[2] < 2e-5


@settings(derandomize=True, deadline=None, database=None, max_examples=40,
          suppress_health_check=[HealthCheck.too_slow])  # fmt: skip
@given(
    stiffness=st.floats(4.0, 7.0).map(lambda x: 10.0**x),
    damping=st.floats(0.0, 4.0).map(lambda x: 10.0**x),
    seed=st.integers(0, 1000),
)
def test_the_longest_step_allowed_is_stable(stiffness: float, damping: float, seed: int) -> None:
    joints = let_yield(free_joints(len(SEGMENTS)), np.full(3, stiffness), damping)
    tree = child(joints)
    motion = random_motion(tree, seed, spin=0.0)
    step = STABLE / joint_rate(tree, joints, motion)
    motion.root_velocity[:] = 0.0
    seat_joints(tree, motion)
    start = 1e-4
    for name in YIELDING:
        motion.joint[SEGMENTS.index(name)] += start
    advance_jointed(tree, joints, motion, 2000 * step, step)
    for name in YIELDING:
        assert np.abs(stretch(tree, motion, SEGMENTS.index(name))).max() < 4.0 * start


def test_bodies_of_the_data_yield_at_head_and_shoulders() -> None:
    joints = build_joints(build_body(7.0, 1.22, 23.2, 3.26))
    assert {SEGMENTS[i] for i in np.flatnonzero(joints.yields)} == set(YIELDING)
    stretched = build_joints(build_body(7.0, 1.22, 23.2, 3.26), neck_tension_stiffness=2.0)
    head = SEGMENTS.index("head")
    assert stretched.give_high[head, 2] == pytest.approx(2.0 * joints.give_high[head, 2])
    np.testing.assert_allclose(stretched.give_low[head], joints.give_low[head])
    assert PARENTS[head] == SEGMENTS.index("neck")
