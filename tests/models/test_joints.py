"""Joint resistance: a potential inside, losses outside, and which way the joints bend."""

import math
from itertools import pairwise

import numpy as np
import pytest
from builders import CHILD, Array, quiet
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tree_stepping import advance_jointed, joint_torques, kinetic_energy, random_motion, rotations

from models.component.joint_moment import passive_moment
from models.multibody.kinematics import update_kinematics
from models.multibody.setup import build_tree, place
from models.multibody.tree import Motion, empty_motion
from models.pedestrian.anthropometry import PARENTS, SEGMENTS, build_body
from models.pedestrian.joints import Joints, build_joints
from models.pedestrian.posture import standing_posture
from models.rotation import axis_rotation

INNER = list(range(1, len(SEGMENTS)))
OUTER = [PARENTS[i] for i in INNER]
TREE, JOINTS = build_tree(CHILD), build_joints(CHILD)
LOSSLESS = JOINTS._replace(
    damping=np.zeros_like(JOINTS.damping), friction=np.zeros_like(JOINTS.friction)
)
ONSET = 10.0
"""deg, over which a stop fades in."""
RANGES = {
    # Data sheet, 2.1: degrees about y, and the stops of 2.2 (N m/rad) on either side.
    "thigh": (-131.1, 28.3, 60.0, 60.0),
    "shank": (-1.6, 147.8, 100.0, 60.0),
    "foot": (-22.8, 55.8, 25.0, 25.0),
    "forearm": (-151.4, 2.2, 30.0, 30.0),
}


def moments(segment: str, degrees: Array, joints: Joints = JOINTS) -> Array:
    """Return the passive moments about y of the child's joint."""
    return passive_moment(CHILD, joints, segment, np.radians(degrees))


def rotation_vectors(turns: Rotation) -> Array:
    """Return (14, 3) rotation vectors of the joints from the centres of their ranges."""
    centres = Rotation.from_quat(JOINTS.centre, scalar_first=True)
    relative = centres[INNER].inv() * turns[OUTER].inv() * turns[INNER]
    return np.asarray(relative.as_rotvec())


def potentials(joints: Joints, turns: Rotation) -> Array:
    """Return the (14,) energies stored in the joints, J, integrated from the formulas."""
    phi, rows = rotation_vectors(turns), slice(1, None)
    rest = phi - joints.neutral[rows]
    stiffness = np.where(rest > 0.0, joints.stiffness_high[rows], joints.stiffness_low[rows])
    onset = joints.onset[rows, None]
    excess = np.maximum(np.abs(phi) - joints.half_range[rows], 0.0)
    stop = np.where(phi > 0.0, joints.stop_high[rows], joints.stop_low[rows])
    below = excess**3 / (6.0 * onset)
    beyond = 0.5 * (excess - 0.5 * onset) ** 2 + onset**2 / 24.0
    stored = 0.5 * stiffness * rest**2 + stop * np.where(excess < onset, below, beyond)
    return np.asarray(stored.sum(axis=1))


def motion_near_range(seed: int, widest: float) -> Motion:
    """Return a motion with each joint up to ``widest`` rad from the centre of its range."""
    rng = np.random.default_rng(seed)
    motion = random_motion(TREE, seed, 6.0)
    turns = [Rotation.from_quat(motion.orientation[0], scalar_first=True)]
    for i in INNER:
        vector = rng.normal(size=3)
        vector *= rng.uniform(0.0, widest) / np.linalg.norm(vector)
        centre = Rotation.from_quat(JOINTS.centre[i], scalar_first=True)
        turns.append(turns[PARENTS[i]] * centre * Rotation.from_rotvec(vector))
        motion.orientation[i] = turns[i].as_quat(scalar_first=True)
    update_kinematics(TREE, motion)
    return motion


def bent(segment: str, turn: Array) -> Motion:
    """Return a standing body at rest with one segment turned by a quaternion."""
    motion = empty_motion(TREE.mass.size)
    motion.orientation[SEGMENTS.index(segment)] = turn
    return motion


# -- potential and losses --------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_torque_is_the_gradient_of_the_potential(seed: int) -> None:
    motion = motion_near_range(seed, widest=2.6)
    torque, _ = joint_torques(TREE, LOSSLESS, motion)
    turns, step = rotations(motion), 1e-5
    for i in INNER:
        for axis in range(3):
            energies = []
            for sign in (1.0, -1.0):
                # Segment i alone turns; its own joint is entry i - 1.
                moved = motion.orientation.copy()
                turn = Rotation.from_rotvec(sign * step * np.eye(3)[axis]) * turns[i]
                moved[i] = turn.as_quat(scalar_first=True)
                all_turns = Rotation.from_quat(moved, scalar_first=True)
                energies.append(potentials(JOINTS, all_turns)[i - 1])
            slope = (energies[0] - energies[1]) / (2.0 * step)
            # 1e-8 of the logarithm's polynomial and of the difference quotient, at 100 N m.
            assert torque[i, axis] == pytest.approx(-slope, abs=1e-5)


def test_standing_body_feels_no_torque() -> None:
    torque, power = joint_torques(TREE, JOINTS, place(standing_posture(CHILD)))
    # The polynomial of the logarithm is good to 1e-8, stiffnesses are below 100 N m/rad.
    np.testing.assert_allclose(torque, 0.0, atol=1e-6)
    np.testing.assert_allclose(power, 0.0, atol=1e-12)


@pytest.mark.parametrize("hit", [False, True])
def test_lossless_joints_keep_the_energy(hit: bool) -> None:
    free = LOSSLESS
    if not hit:
        free = free._replace(half_range=np.full_like(free.half_range, 4.0))
    motion, excess = motion_near_range(seed=3, widest=0.3), 0.0
    start = kinetic_energy(TREE, motion) + potentials(free, rotations(motion)).sum()
    for _ in range(30):
        advance_jointed(TREE, free, motion, duration=0.01, step=5e-6)
        turns = rotations(motion)
        energy = kinetic_energy(TREE, motion) + potentials(free, turns).sum()
        assert energy == pytest.approx(start, rel=1e-6)
        beyond = np.abs(rotation_vectors(turns)) - free.half_range[1:]
        excess = max(excess, float(beyond.max()))
    assert (excess > 0.02) == hit


def test_losses_account_for_the_energy() -> None:
    motion, lost = motion_near_range(seed=4, widest=0.3), 0.0

    def energy() -> float:
        return float(kinetic_energy(TREE, motion) + potentials(JOINTS, rotations(motion)).sum())

    energies = [energy()]
    for _ in range(40):
        work = advance_jointed(TREE, JOINTS, motion, duration=0.005, step=1e-5)
        assert work[1] < 0.0
        lost += work[1]
        energies.append(energy())
    assert all(after < before for before, after in pairwise(energies))
    # Work is summed by rectangles; the sum is off by half a step of the first loss, 1.2e-4.
    assert lost == pytest.approx(energies[-1] - energies[0], rel=2e-4)


@pytest.mark.parametrize("seed", range(6))
def test_damping_and_friction_only_dissipate(seed: int) -> None:
    motion = motion_near_range(seed, widest=1.5)
    torque, power = joint_torques(TREE, JOINTS, motion)
    assert power[1] < 0.0
    loss = torque - joint_torques(TREE, LOSSLESS, motion)[0]
    for i, parent in zip(INNER, OUTER, strict=True):
        assert loss[i] @ (motion.angular_velocity[i] - motion.angular_velocity[parent]) < 0.0


@pytest.mark.parametrize(("rate", "share"), [(3.0, math.sqrt(0.5)), (300.0, 1.0)])
def test_friction_is_bounded(rate: float, share: float) -> None:
    # Coulomb friction regularised at 3 rad/s: 71 % of the bound there, the bound far above.
    dry = JOINTS._replace(damping=np.zeros_like(JOINTS.damping))
    knee, motion = SEGMENTS.index("shank_left"), bent("shank_left", axis_rotation(1, 1.0))
    for sign in (1.0, -1.0):
        motion.angular_velocity[knee] = [0.0, sign * rate, 0.0]
        torque, _ = joint_torques(TREE, dry, motion)
        # 2.3 N m: joints.toml.
        assert torque[knee, 1] == pytest.approx(-sign * share * 2.3, rel=1e-4)
    # Neither acts at rest.
    at = np.array([-40.0, 20.0, 160.0])
    calm, tense = (moments("shank_left", at, build_joints(CHILD, muscle_tone=t)) for t in (0, 5))
    np.testing.assert_array_equal(calm, tense)


# -- ranges ----------------------------------------------------------------------------------


@pytest.mark.parametrize("region", RANGES)
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_limb_moves_freely_within_its_range_and_is_stopped_beyond(region: str, side: str) -> None:
    low, high, stop_low, stop_high = RANGES[region]
    segment = f"{region}_{side}"
    # The polynomial of the logarithm is good to 1e-8, the stops are below 100 N m/rad.
    inside = moments(segment, np.linspace(low + 1.0, high - 1.0, 41))
    np.testing.assert_allclose(inside, 0.0, atol=1e-6)
    further = np.linspace(ONSET + 1.0, ONSET + 20.0, 20)
    for stop, edge, sign in ((stop_low, low, -1.0), (stop_high, high, 1.0)):
        rising = -sign * moments(segment, edge + sign * np.arange(2.0, 26.0, 2.0))
        assert rising[0] > 0.0 and (np.diff(rising) > 0.0).all()
        if region != "thigh":
            # These joints turn about y alone: no cross terms of other axes.
            expected = -sign * stop * np.radians(further - 0.5 * ONSET)
            found = moments(segment, edge + sign * further)
            np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("segment", "axis", "free", "stopped"),
    [
        # Ends of the ranges in the data sheet, 2.1; flexion of hip, elbow is about -y, knee +y.
        ("thigh_left", 1, (-125.0, 25.0), (-150.0, 45.0)),
        ("shank_right", 1, (0.0, 140.0), (-15.0, 160.0)),
        ("thigh_left", 0, (-25.0, 44.0), (-45.0, 64.0)),
        ("thigh_right", 0, (-44.0, 25.0), (-64.0, 45.0)),
    ],
)
def test_ranges_of_motion_in_the_tree(
    segment: str, axis: int, free: tuple[float, float], stopped: tuple[float, float]
) -> None:
    i = SEGMENTS.index(segment)
    for degrees in (*free, *stopped):
        motion = bent(segment, axis_rotation(axis, math.radians(degrees)))
        torque = joint_torques(TREE, JOINTS, motion)[0][i]
        if degrees in free:
            assert np.abs(torque).max() < 1e-6
        else:
            assert -math.copysign(1.0, degrees) * torque[axis] > 1.0


@pytest.mark.parametrize("segment", ["neck", "head", "chest", "abdomen"])
def test_the_spine_is_at_rest_upright_and_pulls_back_everywhere(segment: str) -> None:
    found = moments(segment, np.array([-60.0, -30.0, -10.0, -1.0, 0.0, 1.0, 10.0, 30.0, 60.0]))
    assert found[4] == pytest.approx(0.0, abs=1e-6)
    assert (np.diff(found) < 0.0).all()
    if segment in ("neck", "head"):
        # 2.3: twice the whole neck's, mean of initial and later motion: flexion 24, extension 18.
        per_radian = np.abs(moments(segment, np.array([20.0, -20.0]))) / math.radians(20.0)
        np.testing.assert_allclose(per_radian, (15.9 + 8.5, 13.0 + 5.4), rtol=0.03)


# -- sides and sizes -------------------------------------------------------------------------


@quiet(60)
@given(
    st.sampled_from(["upper_arm", *RANGES]),
    st.tuples(*[st.floats(-1.5, 1.5)] * 3),
    st.floats(-100.0, 100.0),
    st.floats(0.9, 1.8),
)
def test_right_side_mirrors_the_left(
    region: str, vector: tuple[float, float, float], degrees: float, size: float
) -> None:
    torques = []
    for side, mirror in (("left", 1.0), ("right", -1.0)):
        # A mirror in y turns the x and z components of rotations and torques round.
        flip, i = np.array([mirror, 1.0, mirror]), SEGMENTS.index(f"{region}_{side}")
        turn = Rotation.from_rotvec(flip * vector).as_quat(scalar_first=True)
        motion = bent(f"{region}_{side}", turn)
        motion.angular_velocity[i] = flip * [3.0, -2.0, 1.0]
        torques.append(flip * joint_torques(TREE, JOINTS, motion)[0][i])
    np.testing.assert_allclose(torques[0], torques[1], rtol=1e-9, atol=1e-9)
    body = build_body(10.0, size, 16.0 * size**2)
    joints, at = build_joints(body), np.radians([degrees])
    left, right = (passive_moment(body, joints, f"{region}_{s}", at) for s in ("left", "right"))
    np.testing.assert_allclose(left, right, rtol=1e-9, atol=1e-9)


def test_neck_stiffness_and_muscle_tone_act_where_they_say() -> None:
    stiff = build_joints(CHILD, neck_stiffness=2.0, muscle_tone=3.0)
    neck = np.array([name in ("neck", "head") for name in SEGMENTS])
    factor = np.where(neck, 2.0, 1.0)[:, None]
    for name in ("stiffness_low", "stiffness_high", "stop_low", "stop_high", "damping"):
        np.testing.assert_allclose(getattr(stiff, name), factor * getattr(JOINTS, name))
    np.testing.assert_allclose(stiff.friction, 3.0 * JOINTS.friction)
    for name in ("centre", "half_range", "neutral", "onset"):
        np.testing.assert_array_equal(getattr(stiff, name), getattr(JOINTS, name))


def test_joints_scale_with_size_and_modulus() -> None:
    # Irwin and Mertz, SAE 973317: moment lE lL^3, rotational damping lL^4 sqrt(lE); modulus of
    # the adult 1, at 7 years between 0.667 (6) and 0.854 (10).
    seven = 0.667 + 0.25 * (0.854 - 0.667)
    adult = build_joints(build_body(20.0, 1.74, 75.7))
    length, modulus = 1.74 / 1.22, 1.0 / seven
    np.testing.assert_allclose(adult.stop_high, modulus * length**3 * JOINTS.stop_high)
    np.testing.assert_allclose(adult.damping, math.sqrt(modulus) * length**4 * JOINTS.damping)
    weight = 75.7 * 1.74 / (23.2 * 1.22)
    np.testing.assert_allclose(adult.friction, weight * JOINTS.friction)
    body = build_body(10.0, 1.40, 32.0)
    scale = 0.854 / seven * (1.40 / 1.22) ** 3
    for segment, degrees in (("shank_left", 165.0), ("head", -25.0), ("foot_right", 80.0)):
        found = passive_moment(body, build_joints(body), segment, np.radians([degrees]))
        assert found == pytest.approx(scale * moments(segment, np.array([degrees])), rel=1e-9)
