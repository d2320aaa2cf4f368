"""Joint resistance: a potential inside, losses outside, and which way the joints bend."""

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tree_stepping import (
    advance_jointed,
    joint_torques,
    kinetic_energy,
    random_motion,
    rotations,
)

from models.multibody.kinematics import update_kinematics
from models.multibody.setup import build_tree, place
from models.multibody.tree import Motion, Tree, empty_motion
from models.pedestrian.anthropometry import PARENTS, SEGMENTS, Body, build_body
from models.pedestrian.joints import Joints, build_joints
from models.pedestrian.posture import standing_posture
from models.rotation import axis_rotation

Array = NDArray[np.float64]

JOINTS = range(1, len(SEGMENTS))


@pytest.fixture(scope="module")
def body() -> Body:
    # The reference body of data/pedestrians/joints.toml: all scales are 1.
    return build_body(7.0, 1.22, 23.2, 3.26)


@pytest.fixture(scope="module")
def tree(body: Body) -> Tree:
    return build_tree(body)


@pytest.fixture(scope="module")
def joints(body: Body) -> Joints:
    return build_joints(body)


def lossless(joints: Joints) -> Joints:
    return joints._replace(
        damping=np.zeros_like(joints.damping), friction=np.zeros_like(joints.friction)
    )


def rotation_vectors(joints: Joints, turns: Rotation) -> Array:
    """Return (14, 3) rotation vectors of the joints from the centres of their ranges."""
    centres = Rotation.from_quat(joints.centre, scalar_first=True)
    children, parents = list(JOINTS), [PARENTS[i] for i in JOINTS]
    return np.asarray(
        (centres[children].inv() * turns[parents].inv() * turns[children]).as_rotvec()
    )


def potentials(joints: Joints, turns: Rotation) -> Array:
    """Return the (14,) energies stored in the joints, J, integrated from the formulas."""
    phi = rotation_vectors(joints, turns)
    rows = slice(1, None)
    rest = phi - joints.neutral[rows]
    stiffness = np.where(rest > 0.0, joints.stiffness_high[rows], joints.stiffness_low[rows])
    onset = joints.onset[rows, None]
    excess = np.maximum(np.abs(phi) - joints.half_range[rows], 0.0)
    stop = np.where(phi > 0.0, joints.stop_high[rows], joints.stop_low[rows])
    below = excess**3 / (6.0 * onset)
    beyond = 0.5 * (excess - 0.5 * onset) ** 2 + onset**2 / 24.0
    stored = 0.5 * stiffness * rest**2 + stop * np.where(excess < onset, below, beyond)
    return np.asarray(stored.sum(axis=1))


def motion_near_range(tree: Tree, joints: Joints, seed: int, widest: float) -> Motion:
    """Return a motion with each joint up to ``widest`` rad from the centre of its range."""
    rng = np.random.default_rng(seed)
    motion = random_motion(tree, seed, 6.0)
    turns = [Rotation.from_quat(motion.orientation[0], scalar_first=True)]
    for i in JOINTS:
        vector = rng.normal(size=3)
        vector *= rng.uniform(0.0, widest) / np.linalg.norm(vector)
        centre = Rotation.from_quat(joints.centre[i], scalar_first=True)
        turns.append(turns[PARENTS[i]] * centre * Rotation.from_rotvec(vector))
        motion.orientation[i] = turns[i].as_quat(scalar_first=True)
    update_kinematics(tree, motion)
    return motion


def bent(tree: Tree, segment: str, turn: Array) -> Motion:
    """Return a standing body at rest with one segment turned by a quaternion."""
    motion = empty_motion(tree.mass.size)
    motion.orientation[SEGMENTS.index(segment)] = turn
    return motion


@pytest.mark.parametrize("seed", range(4))
def test_torque_is_the_gradient_of_the_potential(tree: Tree, joints: Joints, seed: int) -> None:
    motion = motion_near_range(tree, joints, seed, widest=2.6)
    torque, _ = joint_torques(tree, lossless(joints), motion)
    turns, step = rotations(motion), 1e-5
    for i in JOINTS:
        for axis in range(3):
            energies = []
            for sign in (1.0, -1.0):
                # Segment i alone turns; its own joint is entry i - 1.
                turned = motion.orientation.copy()
                turn = Rotation.from_rotvec(sign * step * np.eye(3)[axis]) * turns[i]
                turned[i] = turn.as_quat(scalar_first=True)
                moved = Rotation.from_quat(turned, scalar_first=True)
                energies.append(potentials(joints, moved)[i - 1])
            slope = (energies[0] - energies[1]) / (2.0 * step)
            # 1e-8 of the logarithm's polynomial and of the difference quotient, at 100 N m.
            assert torque[i, axis] == pytest.approx(-slope, abs=1e-5)


def test_standing_body_feels_no_torque(body: Body, tree: Tree, joints: Joints) -> None:
    torque, power = joint_torques(tree, joints, place(standing_posture(body)))
    # The polynomial of the logarithm is good to 1e-8, stiffnesses are below 100 N m/rad.
    np.testing.assert_allclose(torque, 0.0, atol=1e-6)
    np.testing.assert_allclose(power, 0.0, atol=1e-12)


@pytest.mark.parametrize("stops", ["out of reach", "hit"])
def test_lossless_joints_keep_the_energy(tree: Tree, joints: Joints, stops: str) -> None:
    free = lossless(joints)
    if stops == "out of reach":
        free = free._replace(half_range=np.full_like(free.half_range, 4.0))
    motion = motion_near_range(tree, joints, seed=3, widest=0.3)
    start = kinetic_energy(tree, motion) + potentials(free, rotations(motion)).sum()
    excess = 0.0
    for _ in range(30):
        advance_jointed(tree, free, motion, duration=0.01, step=5e-6)
        turns = rotations(motion)
        energy = kinetic_energy(tree, motion) + potentials(free, turns).sum()
        assert energy == pytest.approx(start, rel=1e-6)
        beyond = np.abs(rotation_vectors(joints, turns)) - free.half_range[1:]
        excess = max(excess, float(beyond.max()))
    assert (excess > 0.02) == (stops == "hit")


def test_losses_account_for_the_energy(tree: Tree, joints: Joints) -> None:
    motion = motion_near_range(tree, joints, seed=4, widest=0.3)
    energies = [kinetic_energy(tree, motion) + potentials(joints, rotations(motion)).sum()]
    lost = 0.0
    for _ in range(40):
        work = advance_jointed(tree, joints, motion, duration=0.005, step=1e-5)
        assert work[1] < 0.0
        lost += work[1]
        energies.append(kinetic_energy(tree, motion) + potentials(joints, rotations(motion)).sum())
    assert all(after < before for before, after in pairwise(energies))
    # Work is summed by rectangles; the sum is off by half a step of the first loss, 1.2e-4.
    assert lost == pytest.approx(energies[-1] - energies[0], rel=2e-4)


@pytest.mark.parametrize("seed", range(20))
def test_damping_and_friction_only_dissipate(tree: Tree, joints: Joints, seed: int) -> None:
    motion = motion_near_range(tree, joints, seed, widest=1.5)
    _, power = joint_torques(tree, joints, motion)
    assert power[1] < 0.0
    torque, _ = joint_torques(tree, joints, motion)
    elastic, _ = joint_torques(tree, lossless(joints), motion)
    for i in JOINTS:
        relative = motion.angular_velocity[i] - motion.angular_velocity[PARENTS[i]]
        assert (torque[i] - elastic[i]) @ relative < 0.0


@pytest.mark.parametrize(("rate", "share"), [(3.0, math.sqrt(0.5)), (300.0, 1.0)])
def test_friction_is_bounded(tree: Tree, joints: Joints, rate: float, share: float) -> None:
    # Coulomb friction regularised at 3 rad/s: 71 % of the bound there, the bound far above.
    dry = joints._replace(damping=np.zeros_like(joints.damping))
    knee = SEGMENTS.index("shank_left")
    motion = bent(tree, "shank_left", axis_rotation(1, 1.0))
    for sign in (1.0, -1.0):
        motion.angular_velocity[knee] = [0.0, sign * rate, 0.0]
        torque, _ = joint_torques(tree, dry, motion)
        # 2.3 N m: joints.toml.
        assert torque[knee, 1] == pytest.approx(-sign * share * 2.3, rel=1e-4)


@pytest.mark.parametrize("side", ["left", "right"])
def test_knee_bends_one_way(tree: Tree, joints: Joints, side: str) -> None:
    knee = SEGMENTS.index(f"shank_{side}")
    # Flexion turns the shank about +y: free to the mean range of boys, 147.8 deg (data sheet, 2.1).
    for degrees in (0.0, 30.0, 90.0, 140.0):
        motion = bent(tree, f"shank_{side}", axis_rotation(1, math.radians(degrees)))
        assert np.abs(joint_torques(tree, joints, motion)[0][knee]).max() < 1e-6
    # Beyond 1.6 deg the other way: 100 N m/rad, faded in over 10 deg.
    torques = []
    for degrees in (-3.0, -8.0, -15.0, -25.0):
        motion = bent(tree, f"shank_{side}", axis_rotation(1, math.radians(degrees)))
        torque = joint_torques(tree, joints, motion)[0][knee]
        assert np.abs(torque[[0, 2]]).max() < 1e-6
        torques.append(torque[1])
    assert all(b > a > 0.0 for a, b in pairwise(torques))
    assert torques[2] == pytest.approx(100.0 * math.radians(15.0 - 1.6 - 5.0), rel=1e-6)
    # Past full flexion it is pushed back as well.
    motion = bent(tree, f"shank_{side}", axis_rotation(1, math.radians(160.0)))
    assert joint_torques(tree, joints, motion)[0][knee, 1] < -1.0


@pytest.mark.parametrize(
    ("segment", "axis", "free", "stopped"),
    [
        # Ends of the ranges in the data sheet, 2.1; flexion of hip and elbow is about -y.
        ("thigh_left", 1, (-125.0, 25.0), (-150.0, 45.0)),
        ("thigh_right", 1, (-125.0, 25.0), (-150.0, 45.0)),
        ("forearm_left", 1, (-150.0, 1.0), (-170.0, 15.0)),
        ("foot_left", 1, (-20.0, 50.0), (-40.0, 75.0)),
        ("thigh_left", 0, (-25.0, 44.0), (-45.0, 64.0)),
        ("thigh_right", 0, (-44.0, 25.0), (-64.0, 45.0)),
    ],
)
def test_ranges_of_motion(
    tree: Tree,
    joints: Joints,
    segment: str,
    axis: int,
    free: tuple[float, float],
    stopped: tuple[float, float],
) -> None:
    i = SEGMENTS.index(segment)
    for degrees in free:
        motion = bent(tree, segment, axis_rotation(axis, math.radians(degrees)))
        assert np.abs(joint_torques(tree, joints, motion)[0][i]).max() < 1e-6
    for degrees in stopped:
        motion = bent(tree, segment, axis_rotation(axis, math.radians(degrees)))
        assert -math.copysign(1.0, degrees) * joint_torques(tree, joints, motion)[0][i, axis] > 1.0


@pytest.mark.parametrize("region", ["upper_arm", "forearm", "thigh", "shank", "foot"])
def test_right_side_mirrors_the_left(tree: Tree, joints: Joints, region: str) -> None:
    rng = np.random.default_rng(8)
    for _ in range(10):
        vector = rng.normal(0.0, 0.8, 3)
        torques = []
        for side, mirror in (("left", 1.0), ("right", -1.0)):
            # A mirror in y turns the x and z components of rotations and torques round.
            flip = np.array([mirror, 1.0, mirror])
            turn = Rotation.from_rotvec(flip * vector).as_quat(scalar_first=True)
            motion = bent(tree, f"{region}_{side}", turn)
            i = SEGMENTS.index(f"{region}_{side}")
            motion.angular_velocity[i] = flip * [3.0, -2.0, 1.0]
            torques.append(flip * joint_torques(tree, joints, motion)[0][i])
        np.testing.assert_allclose(torques[0], torques[1], rtol=1e-9, atol=1e-9)


def test_neck_stiffness_and_muscle_tone_act_where_they_say(body: Body, joints: Joints) -> None:
    stiff = build_joints(body, neck_stiffness=2.0, muscle_tone=3.0)
    neck = np.array([name in ("neck", "head") for name in SEGMENTS])
    factor = np.where(neck, 2.0, 1.0)[:, None]
    for name in ("stiffness_low", "stiffness_high", "stop_low", "stop_high", "damping"):
        np.testing.assert_allclose(getattr(stiff, name), factor * getattr(joints, name))
    np.testing.assert_allclose(stiff.friction, 3.0 * joints.friction)
    for name in ("centre", "half_range", "neutral", "onset"):
        np.testing.assert_array_equal(getattr(stiff, name), getattr(joints, name))


def test_joints_scale_with_size_and_modulus(joints: Joints) -> None:
    # Irwin and Mertz, SAE 973317: moment lE lL^3, rotational damping lL^4 sqrt(lE); modulus of
    # the adult 1, at 7 years between 0.667 (6) and 0.854 (10).
    adult = build_joints(build_body(20.0, 1.74, 75.7))
    length, modulus = 1.74 / 1.22, 1.0 / (0.667 + 0.25 * (0.854 - 0.667))
    np.testing.assert_allclose(adult.stop_high, modulus * length**3 * joints.stop_high)
    np.testing.assert_allclose(adult.damping, math.sqrt(modulus) * length**4 * joints.damping)
    weight = 75.7 * 1.74 / (23.2 * 1.22)
    np.testing.assert_allclose(adult.friction, weight * joints.friction)
