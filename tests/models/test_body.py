"""The body: segments, growth and posture against data sheet, charts and similarity."""

import math
from itertools import pairwise

import numpy as np
import pytest
from builders import CHILD, Array, quiet
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from models.pedestrian.anthropometry import HEAD, PARENTS, SEGMENTS, Body, build_body, region_of
from models.pedestrian.growth import parameters, value_at
from models.pedestrian.posture import (
    Posture,
    cycle_frequency,
    joint_flexion,
    running_posture,
    segment_centres,
    standing_posture,
)
from models.pedestrian.scaling import Scale, modulus_ratio, scale_between

ADULT = build_body(20.0, 1.74, 75.7)
PHASES = (0.0, 0.13, 0.30, 0.667, 0.999)
Z95 = 1.6448536269514722
bodies = st.floats(2.0, 80.0), st.floats(0.8, 1.9), st.floats(10.0, 120.0)


def share(body: Body, *regions: str) -> float:
    """Return the share of the body's mass in regions, both sides together."""
    rows = [region_of(segment) in regions for segment in SEGMENTS]
    return float(body.mass[rows].sum() / body.body_mass)


def row(segment: str) -> int:
    return SEGMENTS.index(segment)


# -- segments --------------------------------------------------------------------------------


def test_child_masses_and_inertias_of_the_data_sheet() -> None:
    # Table of 1.3: mass, and the moments of homogeneous ellipsoids to the printed digit; head
    # with 15 % more; our arms are 7 % thinner than the table's.
    table = {
        "head": (3.26, 0.0098 * 1.15, 0.0118 * 1.15, 0.0086 * 1.15),
        "neck": (0.50, 0.0005, 0.0005, 0.0004),
        "chest": (4.70, 0.0278, 0.0214, 0.0185),
        "abdomen": (1.96, 0.0057, 0.0041, 0.0055),
        "hip": (3.10, 0.0123, 0.0088, 0.0110),
        "upper_arm_left": (0.72, 0.0026, 0.0026, 0.0003),
        "forearm_right": (0.58, 0.0032, 0.0032, 0.0002),
        "thigh_left": (2.10, 0.0127, 0.0127, 0.0025),
        "shank_right": (1.02, 0.0049, 0.0049, 0.0007),
        "foot_left": (0.42, 0.0002, 0.0008, 0.0009),
    }
    for segment, (mass, *moments) in table.items():
        assert CHILD.mass[row(segment)] == pytest.approx(mass, abs=1e-12)
        assert CHILD.inertia[row(segment)] == pytest.approx(moments, abs=6e-5)


def test_child_as_a_whole() -> None:
    # Q6 type table of UN R129, torso with suit (data sheet, 1.2).
    for part, *regions in (
        (0.172, "head", "neck"), (0.419, "chest", "abdomen", "hip"),
        (0.301, "thigh", "shank", "foot"), (0.108, "upper_arm", "forearm"),
    ):  # fmt: skip
        assert share(CHILD, *regions) == pytest.approx(part, abs=0.015)
    # Data sheet, 1.3: 0.572 H and 0.2415 H about the transverse axis.
    centre = CHILD.mass @ CHILD.centre / CHILD.body_mass
    assert centre[2] == pytest.approx(0.572 * 1.22, abs=0.005)
    assert abs(centre[1]) < 1e-12
    arm = CHILD.centre - centre
    moment = CHILD.inertia[:, 1] + CHILD.mass * (arm[:, 0] ** 2 + arm[:, 2] ** 2)
    radius = math.sqrt(moment.sum() / CHILD.body_mass)
    assert radius == pytest.approx(0.2415 * 1.22, abs=0.002)
    # Table of 1.3: soles at 0.032 - 0.032, vertex at 1.115 + 0.100 within a centimetre of 1.22.
    assert (CHILD.ellipsoid - CHILD.semi_axes)[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    assert (CHILD.ellipsoid + CHILD.semi_axes)[:, 2].max() == pytest.approx(1.22, abs=0.01)
    assert len(SEGMENTS) == 15 and all(p < i for i, p in enumerate(PARENTS))


def test_adult_has_the_fractions_of_winter() -> None:
    # Winter/Dempster table (data sheet, 1.2); both sides together, to half a per cent of the body.
    for part, *regions in (
        (0.081, "head", "neck"), (0.216, "chest"), (0.139, "abdomen"), (0.142, "hip"),
        (2 * 0.028, "upper_arm"), (2 * 0.022, "forearm"), (2 * 0.100, "thigh"),
        (2 * 0.0465, "shank"), (2 * 0.0145, "foot"),
    ):  # fmt: skip
        assert share(ADULT, *regions) == pytest.approx(part, abs=0.0005)
    assert ADULT.mass[HEAD] == pytest.approx(4.54, abs=0.005)  # Hybrid III
    # Same table, centres from the proximal joint over the length; heights to 5 mm of 0.3 m.
    for segment, outer, part in (
        ("upper_arm", "forearm", 0.436), ("thigh", "shank", 0.433), ("shank", "foot", 0.433),
    ):  # fmt: skip
        i, k = row(f"{segment}_left"), row(f"{outer}_left")
        inner = ADULT.joint[i, 2]
        down = (inner - ADULT.centre[i, 2]) / (inner - ADULT.joint[k, 2])
        assert down == pytest.approx(part, abs=0.016)


@pytest.mark.parametrize("age", [3.0, 7.0, 11.0, 60.0])
def test_right_side_mirrors_the_left(age: float) -> None:
    body, mirror = build_body(age, 1.3, 30.0), np.array([1.0, -1.0, 1.0])
    for segment in (name for name in SEGMENTS if name.endswith("_left")):
        left, right = row(segment), row(segment.replace("_left", "_right"))
        for array in (body.centre, body.ellipsoid, body.joint):
            np.testing.assert_array_equal(array[left], mirror * array[right])
        for array in (body.mass, body.inertia, body.semi_axes):
            np.testing.assert_array_equal(array[left], array[right])


def test_head_mass_is_taken_from_the_rest_in_proportion() -> None:
    heavy, others = build_body(7.0, 1.22, 23.2, 3.8), np.arange(15) != HEAD
    assert heavy.mass[HEAD] == 3.8
    rest = CHILD.mass[others] * (23.2 - 3.8) / (23.2 - 3.26)
    np.testing.assert_allclose(heavy.mass[others], rest, rtol=1e-12)
    # Same shape, so inertia follows mass.
    np.testing.assert_array_equal(heavy.semi_axes, CHILD.semi_axes)
    ratio = np.tile(heavy.mass / CHILD.mass, (3, 1)).T
    np.testing.assert_allclose(heavy.inertia / CHILD.inertia, ratio, rtol=1e-12)


@quiet(60)
@given(*bodies, st.floats(0.7, 1.4))
def test_bodies_scale_by_similarity_and_thicken_with_mass(
    age: float, stature: float, mass: float, factor: float
) -> None:
    one, soft = build_body(age, stature, mass), np.arange(15) != HEAD
    assert one.mass.sum() == pytest.approx(mass, rel=1e-12)
    largest = one.inertia.max(axis=1)
    assert (one.inertia > 0.0).all()
    assert (largest <= one.inertia.sum(axis=1) - largest).all()
    # Geometric similarity: mass with H^3, inertia with H^5 (Lebiedowska 1997, data sheet 1.2).
    other = build_body(age, factor * stature, factor**3 * mass)
    np.testing.assert_allclose(other.mass, factor**3 * one.mass, rtol=1e-12)
    np.testing.assert_allclose(other.inertia, factor**5 * one.inertia, rtol=1e-12)
    for name in ("semi_axes", "centre", "ellipsoid", "joint"):
        expected = factor * getattr(one, name)
        np.testing.assert_allclose(getattr(other, name), expected, rtol=1e-12, atol=1e-15)
    # Heavier bodies are thicker and as dense.
    other = build_body(age, stature, factor * mass)
    wider = math.sqrt(factor) * one.semi_axes[soft, :2]
    np.testing.assert_allclose(other.semi_axes[:, 2], one.semi_axes[:, 2], rtol=1e-12)
    np.testing.assert_allclose(other.semi_axes[soft, :2], wider, rtol=1e-12)
    np.testing.assert_array_equal(other.semi_axes[HEAD], one.semi_axes[HEAD])
    density = [b.mass[soft] / b.semi_axes[soft].prod(axis=1) for b in (one, other)]
    np.testing.assert_allclose(density[1], density[0], rtol=1e-12)


def test_proportions_go_from_child_to_adult_and_no_further() -> None:
    def shares(age: float) -> Array:
        return build_body(age, 1.5, 45.0).mass / 45.0

    np.testing.assert_array_equal(shares(4.0), shares(7.0))
    np.testing.assert_array_equal(shares(50.0), shares(20.0))
    np.testing.assert_allclose(shares(13.5), 0.5 * (shares(7.0) + shares(20.0)), rtol=1e-12)
    heads = [shares(age)[HEAD] for age in (7.0, 10.0, 14.0, 20.0)]
    assert all(b < a for a, b in pairwise(heads))


@pytest.mark.parametrize(
    "values",
    [(0.0, 1.2, 23.0), (-1.0, 1.2, 23.0), (7.0, 0.0, 23.0), (7.0, 1.2, -23.0),
     (7.0, math.nan, 23.0), *((7.0, 1.22, 23.2, head) for head in (0.0, -1.0, 11.6, math.nan))],
)  # fmt: skip
def test_impossible_body_or_head_is_refused(values: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="head mass" if len(values) == 4 else "positive"):
        build_body(*values)


# -- scaling and growth ----------------------------------------------------------------------


@quiet(30)
@given(st.floats(0.4, 2.0), st.floats(0.3, 1.2))
def test_mechanical_scaling_follows_dimensional_analysis(length: float, modulus: float) -> None:
    # Density is kept: time scales with lL / sqrt(lE) (Irwin and Mertz, SAE 973317).
    scale, mass, time = Scale(length, modulus), length**3, length / math.sqrt(modulus)
    force = mass * length / time**2
    assert scale.force == pytest.approx(force)
    assert scale.stiffness == pytest.approx(force / length)
    assert scale.moment == pytest.approx(force * length)
    assert scale.rotational_damping == pytest.approx(force * length * time)


def test_modulus_of_children() -> None:
    # Irwin and Mertz 1997 (recalled in the source): set points and straight lines between.
    ages = (1.0, 3.0, 6.0, 8.0, 10.0, 18.0, 40.0)
    expected = (0.32, 0.475, 0.667, 0.5 * (0.667 + 0.854), 0.854, 1.0, 1.0)
    assert [modulus_ratio(age) for age in ages] == pytest.approx(expected, rel=1e-12)
    scale = scale_between(1.74, 18.0, 1.16, 6.0)
    assert (scale.length, scale.modulus) == pytest.approx((1.5, 1.0 / 0.667))


# Data sheet, 1.1 (CDC 2000 statage and wtage): 5, 50 and 95 % of stature in cm and mass in kg.
@pytest.mark.parametrize(
    ("sex", "months", "stature", "mass"),
    [
        ("boy", 36.5, (89.2, 95.3, 101.9), (12.1, 14.4, 17.5)),
        ("boy", 84.5, (113.2, 122.0, 131.0), (18.7, 23.2, 30.9)),
        ("boy", 90.5, (116.1, 125.1, 134.5), (19.7, 24.4, 33.0)),
        ("boy", 144.5, (137.3, 149.3, 161.9), (30.6, 40.7, 59.3)),
        ("girl", 84.5, (113.1, 121.8, 131.3), (18.2, 22.9, 31.5)),
        ("girl", 95.5, (118.1, 127.4, 137.4), (20.0, 25.5, 35.8)),
    ],
)
def test_percentiles_of_the_charts(
    sex: str, months: float, stature: tuple[float, ...], mass: tuple[float, ...]
) -> None:
    age = months / 12.0
    for z, height, weight in zip((-Z95, 0.0, Z95), stature, mass, strict=True):
        assert 100.0 * value_at("stature", age, z, sex) == pytest.approx(height, abs=0.0501)
        assert value_at("body_mass", age, z, sex) == pytest.approx(weight, abs=0.0501)


def test_charts_are_interpolated_and_rise() -> None:
    low, middle, high = (parameters("body_mass", months / 12.0) for months in (84.5, 87.5, 90.5))
    assert middle == pytest.approx([0.5 * (a + b) for a, b in zip(low, high, strict=True)])
    assert parameters("stature", 84.5 / 12.0) == pytest.approx((0.753244, 1.220305, 0.044403))
    # The default is the median boy.
    assert value_at("stature", 7.5) == parameters("stature", 7.5, "boy")[1]
    for quantity in ("stature", "body_mass"):
        by_age = [value_at(quantity, 3.1 + 0.3 * k) for k in range(29)]
        by_z = [value_at(quantity, 7.5, 0.25 * k) for k in range(-10, 11)]
        assert min(np.diff(by_age).min(), np.diff(by_z).min()) > 0.0


@pytest.mark.parametrize(
    ("quantity", "age", "sex", "message"),
    [
        ("head_mass", 7.0, "boy", "quantity"),
        ("stature", 7.5, "child", "sex"),
        ("stature", 2.9, "boy", "outside the boy chart"),
        ("stature", 12.5, "boy", "outside the boy chart"),
        ("body_mass", 6.9, "girl", "outside the girl chart"),
        ("body_mass", math.nan, "boy", "outside the boy chart"),
    ],
)
def test_what_the_charts_do_not_hold_is_refused(
    quantity: str, age: float, sex: str, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        parameters(quantity, age, sex)


# -- posture ---------------------------------------------------------------------------------


def run(phase: float, facing: float = 0.4, speed: float = 2.8) -> Posture:
    return running_posture(CHILD, gait_phase=phase, facing_angle=facing, running_speed=speed)


def turns(posture: Posture) -> Rotation:
    return Rotation.from_quat(posture.orientation, scalar_first=True)


def lowest_point(posture: Posture) -> float:
    """Return the lowest height of all ellipsoids."""
    R = turns(posture).as_matrix()
    centre = segment_centres(CHILD, posture.orientation, posture.root_position)
    middle = centre + np.einsum("nij,nj->ni", R, CHILD.ellipsoid - CHILD.centre)
    # The outward normal there is -z, in own axes.
    u = -CHILD.semi_axes * R[:, 2, :]
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return float((middle + np.einsum("nij,nj->ni", R, CHILD.semi_axes * u))[:, 2].min())


def test_standing_body_is_upright_and_at_rest() -> None:
    posture = standing_posture(CHILD)
    centres = segment_centres(CHILD, posture.orientation, posture.root_position)
    np.testing.assert_allclose(centres, CHILD.centre, atol=1e-15)
    assert abs(lowest_point(posture)) < 1e-9
    assert not posture.root_velocity.any() and not posture.angular_velocity.any()
    still = run(0.3, speed=0.0)
    assert not still.root_velocity.any() and not still.angular_velocity.any()


@pytest.mark.parametrize("phase", PHASES)
def test_running_body_moves_on_the_road_as_its_change_in_time_says(phase: float) -> None:
    for facing in (0.0, 1.7, -2.5):
        assert abs(lowest_point(run(phase, facing))) < 1e-9
    step = 1e-5
    before, at, after = (run(phase + k * step) for k in (-1.0, 0.0, 1.0))
    # Two phases of 1e-5 apart, at so many cycles a second.
    interval = 2.0 * step / cycle_frequency(2.8, CHILD.stature)
    measured = (turns(after) * turns(before).inv()).as_rotvec() / interval
    # Third derivatives of the splines, some 1e5 rad, times step^2 / 6.
    np.testing.assert_allclose(at.angular_velocity, measured, atol=1e-5)
    assert np.abs(at.angular_velocity).max() > 1.0


@pytest.mark.parametrize("phase", PHASES)
def test_the_trunk_leans_and_the_face_stays_upright(phase: float) -> None:
    up = turns(run(phase)).as_matrix()[:, 2, 2]
    lean = math.acos(up[0])
    assert 0.02 < lean < 0.3
    # Two neck joints share the rotation.
    assert math.acos(up[SEGMENTS.index("neck")]) == pytest.approx(0.5 * lean)
    assert up[HEAD] == pytest.approx(1.0, abs=1e-12)


def test_gait_repeats_after_a_cycle_and_swaps_sides_after_half() -> None:
    one, half, cycle = run(0.2), run(0.7), run(1.2)
    np.testing.assert_allclose(cycle.orientation, one.orientation, atol=1e-12)
    swapped = [name.replace("left", "LEFT").replace("right", "left").replace("LEFT", "right")
               for name in SEGMENTS]  # fmt: skip
    other = [row(name) for name in swapped]
    np.testing.assert_allclose(half.orientation[other], one.orientation, atol=1e-12)
    np.testing.assert_allclose(half.angular_velocity[other], one.angular_velocity, atol=1e-9)


def test_facing_angle_turns_everything() -> None:
    ahead = run(0.3, facing=0.0)
    for facing in (math.pi / 2.0, -0.7, 3.0):
        other, heading = run(0.3, facing), Rotation.from_rotvec([0.0, 0.0, facing])
        expected = (heading * turns(ahead)).as_matrix()
        np.testing.assert_allclose(turns(other).as_matrix(), expected, atol=1e-12)
        for name in ("angular_velocity", "root_velocity", "root_position"):
            expected = heading.apply(getattr(ahead, name))
            np.testing.assert_allclose(getattr(other, name), expected, atol=1e-12)
    # From x towards y: a quarter turn left is the car's left.
    left = run(0.3, facing=math.pi / 2.0).root_velocity
    assert left == pytest.approx([0.0, 2.8, 0.0], abs=1e-12)


@pytest.mark.parametrize("phase", PHASES)
def test_joints_bend_the_human_way(phase: float) -> None:
    # Pitch of a segment against its parent about +y: knees bend forwards (positive), elbows the
    # other way; sagittal only, so nothing leaves the plane.
    R = turns(run(phase, facing=0.0))
    for i in range(1, len(SEGMENTS)):
        x, y, z = (R[PARENTS[i]].inv() * R[i]).as_rotvec(degrees=True)
        assert abs(x) < 1e-9 and abs(z) < 1e-9
        if region_of(SEGMENTS[i]) == "shank":
            assert 0.0 < y < 110.0
        if region_of(SEGMENTS[i]) == "forearm":
            assert y == pytest.approx(-90.0, abs=1e-6)


def test_gait_of_the_table() -> None:
    # Novacheck 1998 and Fukuchi 2017 shapes as written in data/gait/running.toml.
    for phase, expected in ((0.0, [30.0, 18.0, 8.0]), (0.5, [0.0, 50.0, -15.0])):
        flexion = joint_flexion(phase)
        found = [math.degrees(flexion[name][0]) for name in ("thigh", "shank", "foot")]
        assert found == pytest.approx(expected, abs=1e-9)
    # The arm swings against the leg of its side.
    flexions = [joint_flexion(p) for p in np.linspace(0.0, 1.0, 200, endpoint=False)]
    hip, shoulder = (np.array([f[name][0] for f in flexions]) for name in ("thigh", "upper_arm"))
    assert np.corrcoef(hip, shoulder)[0, 1] < -0.8
    assert math.degrees(shoulder.max()) == pytest.approx(35.0, abs=0.1)
    # 1.78 cycles a second at 2.8 m/s and 1.22 m, by the root of speed over stature.
    assert cycle_frequency(2.8, 1.22) == pytest.approx(1.78)
    assert cycle_frequency(4.0 * 2.8, 1.22) == pytest.approx(2.0 * 1.78)
    assert cycle_frequency(2.8, 4.0 * 1.22) == pytest.approx(0.5 * 1.78)
