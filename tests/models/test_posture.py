"""Running posture: on the road, moving as its own change in time says, and turned as a whole."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from models.pedestrian.anthropometry import PARENTS, SEGMENTS, Body, build_body, region_of
from models.pedestrian.posture import (
    Posture,
    cycle_frequency,
    joint_flexion,
    running_posture,
    segment_centres,
    standing_posture,
)

Array = NDArray[np.float64]

PHASES = (0.0, 0.13, 0.30, 0.5, 0.667, 0.81, 0.999)


@pytest.fixture(scope="module")
def body() -> Body:
    return build_body(7.0, 1.22, 23.2, 3.26)


def run(body: Body, phase: float, facing: float = 0.4, speed: float = 2.8) -> Posture:
    return running_posture(body, gait_phase=phase, facing_angle=facing, running_speed=speed)


def turns(posture: Posture) -> Rotation:
    return Rotation.from_quat(posture.orientation, scalar_first=True)


def lowest_point(body: Body, posture: Posture) -> float:
    """Return the lowest height of all ellipsoids, from sampled surface points and the support."""
    R = turns(posture).as_matrix()
    centre = segment_centres(body, posture.orientation, posture.root_position)
    middle = centre + np.einsum("nij,nj->ni", R, body.ellipsoid - body.centre)
    # Lowest point of each ellipsoid: the one whose outward normal is -z, in own axes.
    down = -R[:, 2, :]
    u = body.semi_axes * down
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    points = middle + np.einsum("nij,nj->ni", R, body.semi_axes * u)
    return float(points[:, 2].min())


@pytest.mark.parametrize("phase", PHASES)
def test_lowest_point_is_on_the_road(body: Body, phase: float) -> None:
    for facing in (0.0, 1.7, -2.5):
        assert abs(lowest_point(body, run(body, phase, facing))) < 1e-9


def test_standing_body_is_upright_and_at_rest(body: Body) -> None:
    posture = standing_posture(body)
    np.testing.assert_allclose(
        segment_centres(body, posture.orientation, posture.root_position), body.centre, atol=1e-15
    )
    assert abs(lowest_point(body, posture)) < 1e-9
    assert not posture.root_velocity.any()
    assert not posture.angular_velocity.any()


@pytest.mark.parametrize("phase", PHASES)
def test_angular_velocities_are_the_rates_of_the_orientations(body: Body, phase: float) -> None:
    step = 1e-5
    before, at, after = (run(body, phase + k * step) for k in (-1.0, 0.0, 1.0))
    # Two phases of 1e-5 apart, at so many cycles a second.
    interval = 2.0 * step / cycle_frequency(2.8, body.stature)
    measured = (turns(after) * turns(before).inv()).as_rotvec() / interval
    # Third derivatives of the splines, some 1e5 rad, times step^2 / 6.
    np.testing.assert_allclose(at.angular_velocity, measured, atol=1e-5)
    assert np.abs(at.angular_velocity).max() > 1.0


def test_gait_repeats_after_a_cycle_and_swaps_sides_after_half(body: Body) -> None:
    one, cycle = run(body, 0.2), run(body, 1.2)
    np.testing.assert_allclose(cycle.orientation, one.orientation, atol=1e-12)
    half = run(body, 0.7)
    for i, segment in enumerate(SEGMENTS):
        other = segment.replace("left", "right")
        if segment.endswith("_right"):
            other = segment.replace("right", "left")
        k = SEGMENTS.index(other)
        np.testing.assert_allclose(half.orientation[k], one.orientation[i], atol=1e-12)
        np.testing.assert_allclose(half.angular_velocity[k], one.angular_velocity[i], atol=1e-9)


def test_facing_angle_turns_everything(body: Body) -> None:
    ahead = run(body, 0.3, facing=0.0)
    for facing in (math.pi / 2.0, -0.7, 3.0):
        turned, heading = run(body, 0.3, facing), Rotation.from_rotvec([0.0, 0.0, facing])
        np.testing.assert_allclose(
            turns(turned).as_matrix(), (heading * turns(ahead)).as_matrix(), atol=1e-12
        )
        for name in ("angular_velocity", "root_velocity", "root_position"):
            np.testing.assert_allclose(
                getattr(turned, name), heading.apply(getattr(ahead, name)), atol=1e-12
            )


def test_body_runs_where_it_faces(body: Body) -> None:
    # From x towards y: a quarter turn left is the car's left.
    posture = run(body, 0.3, facing=math.pi / 2.0, speed=2.78)
    assert posture.root_velocity == pytest.approx([0.0, 2.78, 0.0], abs=1e-12)


def test_child_at_rest_in_a_running_posture(body: Body) -> None:
    posture = run(body, 0.3, speed=0.0)
    assert not posture.root_velocity.any()
    np.testing.assert_array_equal(posture.angular_velocity, 0.0)


@pytest.mark.parametrize("phase", PHASES)
def test_joints_bend_the_human_way(body: Body, phase: float) -> None:
    # Pitch of a segment against its parent about +y: knees bend forwards (positive), elbows the
    # other way; sagittal only, so nothing leaves the plane.
    posture = run(body, phase, facing=0.0)
    R = turns(posture)
    for i, segment in enumerate(SEGMENTS):
        if i == 0:
            continue
        x, y, z = (R[PARENTS[i]].inv() * R[i]).as_rotvec(degrees=True)
        assert abs(x) < 1e-9 and abs(z) < 1e-9
        region = region_of(segment)
        if region == "shank":
            assert 0.0 < y < 110.0
        if region == "forearm":
            assert y == pytest.approx(-90.0, abs=1e-6)


def test_joint_angles_of_the_table() -> None:
    # Novacheck 1998 and Fukuchi 2017 shapes as written in data/gait/running.toml.
    for phase, hip, knee, ankle in ((0.0, 30.0, 18.0, 8.0), (0.5, 0.0, 50.0, -15.0)):
        flexion = joint_flexion(phase)
        found = [math.degrees(flexion[name][0]) for name in ("thigh", "shank", "foot")]
        assert found == pytest.approx([hip, knee, ankle], abs=1e-9)


def test_arm_swings_against_the_leg_of_its_side() -> None:
    phases = np.linspace(0.0, 1.0, 200, endpoint=False)
    hip, shoulder = (
        np.array([joint_flexion(p)[name][0] for p in phases]) for name in ("thigh", "upper_arm")
    )
    assert np.corrcoef(hip, shoulder)[0, 1] < -0.8
    assert math.degrees(shoulder.max()) == pytest.approx(35.0, abs=0.1)


def test_cycle_frequency_grows_with_the_square_root_of_speed_over_stature() -> None:
    # 1.78 cycles a second at 2.8 m/s and 1.22 m (data/gait/running.toml).
    assert cycle_frequency(2.8, 1.22) == pytest.approx(1.78)
    assert cycle_frequency(4.0 * 2.8, 1.22) == pytest.approx(2.0 * 1.78)
    assert cycle_frequency(2.8, 4.0 * 1.22) == pytest.approx(0.5 * 1.78)
