"""Passive moments of joints over their angle: range, stops, sides, potential."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from models.component.joint_moment import passive_moment
from models.pedestrian.anthropometry import SEGMENTS, Body, build_body
from models.pedestrian.joints import Joints, build_joints

Array = NDArray[np.float64]

RANGES = {
    # Data sheet, 2.1: degrees about y, and the stops of 2.2 (N m/rad) on either side.
    "thigh": (-131.1, 28.3, 60.0, 60.0),
    "shank": (-1.6, 147.8, 100.0, 60.0),
    "foot": (-22.8, 55.8, 25.0, 25.0),
    "forearm": (-151.4, 2.2, 30.0, 30.0),
}
ONSET = 10.0
"""deg, over which a stop fades in."""
QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=60)


@pytest.fixture(scope="module")
def child() -> Body:
    # The reference body of the joints' data file: all scales are 1.
    return build_body(7.0, 1.22, 23.2, 3.26)


@pytest.fixture(scope="module")
def joints(child: Body) -> Joints:
    return build_joints(child)


def moments(body: Body, joints: Joints, segment: str, degrees: Array) -> Array:
    return passive_moment(body, joints, segment, np.radians(degrees))


def rotation_vectors(joints: Joints, segment: str, angles: Array) -> Array:
    """Return the (n, 3) rotation vectors from the centre of the range, the segment turned by y."""
    centre = Rotation.from_quat(joints.centre[SEGMENTS.index(segment)], scalar_first=True)
    turned = Rotation.from_rotvec(np.outer(angles, [0.0, 1.0, 0.0]))
    return np.asarray((centre.inv() * turned).as_rotvec())


def potential(joints: Joints, segment: str, angles: Array) -> Array:
    """Return the energy (J) that a joint stores at angles about y."""
    i = SEGMENTS.index(segment)
    phi = rotation_vectors(joints, segment, angles)
    rest = phi - joints.neutral[i]
    stiffness = np.where(rest > 0.0, joints.stiffness_high[i], joints.stiffness_low[i])
    excess = np.maximum(np.abs(phi) - joints.half_range[i], 0.0)
    stop = np.where(phi > 0.0, joints.stop_high[i], joints.stop_low[i])
    onset = joints.onset[i]
    shape = np.where(
        excess < onset,
        excess**3 / (6.0 * onset),
        0.5 * (excess - 0.5 * onset) ** 2 + onset**2 / 24.0,
    )
    return np.asarray((0.5 * stiffness * rest**2 + stop * shape).sum(axis=1))


@pytest.mark.parametrize("region", RANGES)
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_limb_moves_freely_within_its_range(
    child: Body, joints: Joints, region: str, side: str
) -> None:
    low, high, _, _ = RANGES[region]
    inside = moments(child, joints, f"{region}_{side}", np.linspace(low + 1.0, high - 1.0, 41))
    # The polynomial of the logarithm is good to 1e-8, the stops are below 100 N m/rad.
    np.testing.assert_allclose(inside, 0.0, atol=1e-6)


@pytest.mark.parametrize("region", ["shank", "foot", "forearm"])
def test_beyond_the_onset_a_stop_has_its_stiffness(
    child: Body, joints: Joints, region: str
) -> None:
    # These joints turn about y alone: no cross terms of other axes.
    low, high, stop_low, stop_high = RANGES[region]
    further = np.linspace(ONSET + 1.0, ONSET + 20.0, 20)
    for stop, edge, sign in ((stop_low, low, -1.0), (stop_high, high, 1.0)):
        found = moments(child, joints, f"{region}_left", edge + sign * further)
        np.testing.assert_allclose(
            found, -sign * stop * np.radians(further - 0.5 * ONSET), rtol=1e-6
        )


@pytest.mark.parametrize("region", RANGES)
def test_a_stop_pushes_back_ever_harder(child: Body, joints: Joints, region: str) -> None:
    low, high, _, _ = RANGES[region]
    for edge, sign in ((low, -1.0), (high, 1.0)):
        found = -sign * moments(
            child, joints, f"{region}_left", edge + sign * np.arange(2.0, 26.0, 2.0)
        )
        assert found[0] > 0.0
        assert all(b > a for a, b in pairwise(found))


@pytest.mark.parametrize("segment", ["neck", "head", "chest", "abdomen"])
def test_the_spine_is_at_rest_upright_and_pulls_back_everywhere(
    child: Body, joints: Joints, segment: str
) -> None:
    degrees = np.array([-60.0, -30.0, -10.0, -1.0, 0.0, 1.0, 10.0, 30.0, 60.0])
    found = moments(child, joints, segment, degrees)
    assert found[4] == pytest.approx(0.0, abs=1e-6)
    assert (np.diff(found) < 0.0).all()
    assert (np.sign(found[[0, -1]]) == [1.0, -1.0]).all()


def test_neck_stiffness_of_the_data_sheet(child: Body, joints: Joints) -> None:
    # 2.3: twice the whole neck's, mean of initial and later motion: flexion 24, extension 18.
    mean = (15.9 + 8.5, 13.0 + 5.4)
    for segment in ("neck", "head"):
        found = moments(child, joints, segment, np.array([20.0, -20.0]))
        per_radian = np.abs(found) / math.radians(20.0)
        np.testing.assert_allclose(per_radian, mean, rtol=0.03)


@QUIET
@given(
    region=st.sampled_from(["upper_arm", *RANGES]),
    degrees=st.floats(-100.0, 100.0),
    size=st.floats(0.9, 1.8),
)
def test_left_and_right_feel_the_same(region: str, degrees: float, size: float) -> None:
    body = build_body(10.0, size, 16.0 * size**2)
    joints = build_joints(body)
    left, right = (
        moments(body, joints, f"{region}_{side}", np.array([degrees])) for side in ("left", "right")
    )
    np.testing.assert_allclose(left, right, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    "segment",
    ["thigh_left", "shank_left", "foot_left", "upper_arm_left", "forearm_left", "neck", "head",
     "chest"],
)  # fmt: skip
def test_moment_is_the_slope_of_the_potential(child: Body, joints: Joints, segment: str) -> None:
    angles = np.radians(np.arange(-178.0, 179.0, 1.7))
    # Beyond half a turn from the centre of the range the shorter way round is the other one.
    near = np.linalg.norm(rotation_vectors(joints, segment, angles), axis=1) < math.pi - 0.05
    angles, step = angles[near], 1e-5
    slope = (
        potential(joints, segment, angles + step) - potential(joints, segment, angles - step)
    ) / (2.0 * step)
    found = passive_moment(child, joints, segment, angles)
    assert np.abs(found).max() > 10.0
    # Rounding of energies of 100 J over the step, and 1e-8 of the logarithm's polynomial.
    np.testing.assert_allclose(found, -slope, atol=1e-5)


def test_friction_and_damping_do_not_act_at_rest(child: Body) -> None:
    angles = np.radians([-40.0, 20.0, 160.0])
    calm, tense = (
        passive_moment(child, build_joints(child, muscle_tone=tone), "shank_left", angles)
        for tone in (0.0, 5.0)
    )
    np.testing.assert_array_equal(calm, tense)


def test_moments_scale_with_modulus_and_length_cubed(child: Body, joints: Joints) -> None:
    # Irwin and Mertz, SAE 973317: lE lL^3; modulus 0.667 at 6 years, 0.854 at 10.
    body = build_body(10.0, 1.40, 32.0)
    scale = 0.854 / (0.667 + 0.25 * (0.854 - 0.667)) * (1.40 / 1.22) ** 3
    for segment, degrees in (("shank_left", 165.0), ("head", -25.0), ("foot_right", 80.0)):
        at = np.array([degrees])
        assert moments(body, build_joints(body), segment, at) == pytest.approx(
            scale * moments(child, joints, segment, at), rel=1e-9
        )
