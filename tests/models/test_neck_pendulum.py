"""Head and neck on a pendulum against a planar double pendulum written down a second time."""

import dataclasses
import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid, solve_ivp

from models.component.neck_pendulum import STEP, PendulumTest, swing_neck
from models.pedestrian.anthropometry import HEAD, SEGMENTS, Body, build_body
from models.pedestrian.joints import Joints, build_joints

Array = NDArray[np.float64]
Resistance = Callable[[int, float, float], float]

ARM, GAUGE = 1.80, 1.657
"""m, 49 CFR 572.33 (recalled)."""
GRAVITY = 9.80665
SPEED = 4.95
"""m/s, flexion test of 49 CFR 572.123 (data sheet, 2.3)."""
ROWS = (SEGMENTS.index("neck"), HEAD)
DIRECTIONS = ("flexion", "extension")
QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


@pytest.fixture(scope="module")
def body() -> Body:
    return build_body(6.0, 1.17, 23.4, 3.47)


def ramp(duration: float, speed: float = SPEED, start: float = STEP) -> Array:
    """Return a pulse that stops the pendulum evenly; nothing is lost in the first step."""
    rows = [[0.0, 0.0], [start, 0.0], [start + duration, speed]]
    return np.array(rows if start > 0.0 else rows[1:])


def without(joints: Joints, *kept: str) -> Joints:
    """Return joints without resistance but for the arrays named."""
    resistances = {"stiffness_low", "stiffness_high", "stop_low", "stop_high", "damping"}
    gone = (resistances | {"friction"}) - set(kept)
    return exact(joints)._replace(**{name: np.zeros_like(getattr(joints, name)) for name in gone})


def exact(joints: Joints) -> Joints:
    """Return joints whose points stay together."""
    return joints._replace(yields=np.zeros_like(joints.yields))


def resistance_of(joints: Joints, sense: float) -> Resistance:
    """Return the moment of a joint over relative angle and rate in a sense about the y axis."""

    def moment(k: int, angle: float, rate: float) -> float:
        i = ROWS[k]
        centre = 2.0 * math.atan2(joints.centre[i, 2], joints.centre[i, 0])
        phi = sense * angle - centre
        rest, excess = phi - joints.neutral[i, 1], abs(phi) - joints.half_range[i, 1]
        total = rest * (joints.stiffness_high if rest > 0.0 else joints.stiffness_low)[i, 1]
        if excess > 0.0:
            onset = joints.onset[i]
            shape = excess**2 / (2.0 * onset) if excess < onset else excess - 0.5 * onset
            total += (
                math.copysign(shape, phi)
                * (joints.stop_high if phi > 0.0 else joints.stop_low)[i, 1]
            )
        return float(-sense * total - joints.damping[i, 1] * rate)

    return moment


def no_resistance(k: int, angle: float, rate: float) -> float:
    return 0.0


def planar(
    body: Body,
    direction: str,
    pulse: Array,
    times: Array,
    resistance: Resistance = no_resistance,
) -> Array:
    """Return angle and rate of pendulum, neck and head (6, n) by d'Alembert's principle.

    In the plane of the swing, angles counter-clockwise from hanging straight down; the pendulum
    swings counter-clockwise and its angular acceleration is constant within a row of the pulse.
    """
    i, j = ROWS
    sense = 1.0 if direction == "flexion" else -1.0

    def hanging(vector: Array) -> Array:
        # Upside down, face forward (flexion) or backward (extension).
        return np.array([sense * vector[0], -vector[2]])

    arm = np.array([0.0, -ARM])
    link = hanging(body.joint[j] - body.joint[i])
    levers = [hanging(body.centre[k] - body.joint[k]) for k in (i, j)]
    m1, m2 = body.mass[[i, j]]
    I1, I2 = body.inertia[[i, j], 1]
    weight = np.array([0.0, -GRAVITY])

    def rates(_: float, y: Array, slowing: float) -> Array:
        p, wp, p1, w1, p2, w2 = y
        turn = [
            np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]]) for a in (p, p1, p2)
        ]
        A, D, B1, B2 = turn[0] @ arm, turn[1] @ link, turn[1] @ levers[0], turn[2] @ levers[1]
        jD, j1, j2 = QUARTER_TURN @ D, QUARTER_TURN @ B1, QUARTER_TURN @ B2
        base = slowing * (QUARTER_TURN @ A) - wp**2 * A - weight
        M = np.array(
            [
                [I1 + m1 * j1 @ j1 + m2 * jD @ jD, m2 * jD @ j2],
                [m2 * jD @ j2, I2 + m2 * j2 @ j2],
            ]
        )
        neck, head = base - w1**2 * B1, base - w1**2 * D - w2**2 * B2
        lower, upper = resistance(0, p1 - p, w1 - wp), resistance(1, p2 - p1, w2 - w1)
        right = [lower - upper - m1 * neck @ j1 - m2 * head @ jD, upper - m2 * head @ j2]
        alpha = np.linalg.solve(M, right)
        return np.array([wp, slowing, w1, alpha[0], w2, alpha[1]])

    speed = pulse[-1, 1] / GAUGE
    state, parts = np.array([0.0, speed] * 3), []
    rows = [*pulse, np.array([times[-1] + STEP, pulse[-1, 1]])]
    for first, last in pairwise(rows):
        slowing = -(last[1] - first[1]) / (last[0] - first[0]) / GAUGE
        at = times[(times >= first[0]) & (times < last[0])]
        found = solve_ivp(
            rates, (first[0], last[0]), state, args=(slowing,), t_eval=np.append(at, last[0]),
            method="DOP853", rtol=1e-9, atol=1e-11,
        )  # fmt: skip
        parts.append(found.y[:, :-1])
        state = found.y[:, -1]
    return np.concatenate(parts, axis=1)


def first(test: PendulumTest, duration: float) -> Array:
    return test.time[test.time <= duration]


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("stop", [STEP, 2e-2])
def test_without_resistance_it_is_a_double_pendulum(
    body: Body, direction: str, stop: float
) -> None:
    free, pulse = without(build_joints(body)), ramp(stop)
    test = swing_neck(body, free, direction, SPEED, pulse)
    at = first(test, 0.06)
    expected = planar(body, direction, pulse, at)
    assert not test.moment.any()
    # The head folds by more than a right angle, at up to 70 rad/s: half a step is 7e-4 rad.
    assert np.ptp(expected[4]) > 2.0
    np.testing.assert_allclose(test.angle[: at.size], expected[4] - expected[0], atol=1e-3)


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("factor", [0.5, 1.0, 4.0])
def test_own_resistance_against_the_same_formulas(
    body: Body, direction: str, factor: float
) -> None:
    joints = exact(build_joints(body, neck_stiffness=factor))
    pulse = np.array([[0.0, 0.0], [STEP, 0.0], [0.01, 1.3], [0.025, 3.6], [0.034, SPEED]])
    test = swing_neck(body, joints, direction, SPEED, pulse)
    at = first(test, 0.2)
    resistance = resistance_of(joints, 1.0 if direction == "flexion" else -1.0)
    expected = planar(body, direction, pulse, at, resistance)
    angle = expected[4] - expected[0]
    moment = np.array(
        [-resistance(1, a, w) for a, w in zip(expected[4] - expected[2],
                                              expected[5] - expected[3], strict=True)]
    )  # fmt: skip
    # The pendulum is stopped within a step: histories may be shifted by that much in time.
    for ours, theirs in ((test.angle, angle), (test.moment, moment)):
        shift = STEP * np.abs(np.gradient(theirs, STEP)).max()
        np.testing.assert_allclose(ours[: at.size], theirs, atol=shift)
    assert test.moment.max() == pytest.approx(moment.max(), rel=2e-3)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_impulse_of_the_moment_is_the_change_of_angular_momentum(
    body: Body, direction: str
) -> None:
    # A head balanced on its joint feels no other torque.
    centre = body.centre.copy()
    centre[HEAD] = body.joint[HEAD]
    balanced = dataclasses.replace(body, centre=centre)
    pulse = ramp(0.03)
    test = swing_neck(balanced, build_joints(body), direction, SPEED, pulse)
    swing = (SPEED - np.interp(test.time, pulse[:, 0], pulse[:, 1])) / GAUGE
    turning = swing + np.gradient(test.angle, STEP)
    impulse = cumulative_trapezoid(test.moment, test.time, initial=0.0)
    momentum = body.inertia[HEAD, 1] * (SPEED / GAUGE - turning)
    assert np.ptp(impulse) > 2.0 * body.inertia[HEAD, 1] * SPEED / GAUGE
    # Half a step of the pendulum's deceleration, and the ends of the difference quotient.
    slack = body.inertia[HEAD, 1] * STEP * SPEED / GAUGE / 0.03
    np.testing.assert_allclose(impulse[1:-1], momentum[1:-1], atol=slack)


def mirrored(body: Body, joints: Joints) -> tuple[Body, Joints]:
    """Return a body whose front is its back."""
    back = np.array([-1.0, 1.0, 1.0])
    about = np.array([False, True, True])  # rotations about y and z change their sense
    low, high = joints.stiffness_low, joints.stiffness_high
    stop_low, stop_high = joints.stop_low, joints.stop_high
    return (
        dataclasses.replace(body, joint=back * body.joint, centre=back * body.centre),
        joints._replace(
            centre=joints.centre * [1.0, 1.0, -1.0, -1.0],
            neutral=np.where(about, -joints.neutral, joints.neutral),
            stiffness_low=np.where(about, high, low),
            stiffness_high=np.where(about, low, high),
            stop_low=np.where(about, stop_high, stop_low),
            stop_high=np.where(about, stop_low, stop_high),
        ),
    )


def test_extension_is_flexion_of_a_body_turned_round(body: Body) -> None:
    joints, pulse = build_joints(body), ramp(0.03)
    flexion = swing_neck(body, joints, "flexion", SPEED, pulse)
    turned = swing_neck(*mirrored(body, joints), "extension", SPEED, pulse)
    np.testing.assert_allclose(turned.angle, flexion.angle, atol=1e-9)
    np.testing.assert_allclose(turned.moment, flexion.moment, atol=1e-7)
    extension = swing_neck(body, joints, "extension", SPEED, pulse)
    assert abs(extension.angle.max() - flexion.angle.max()) > 0.1


def test_a_symmetric_neck_bends_alike_both_ways(body: Body) -> None:
    on_axis = np.array([0.0, 1.0, 1.0])
    even = dataclasses.replace(body, joint=on_axis * body.joint, centre=on_axis * body.centre)
    joints = build_joints(body)
    level = joints._replace(
        centre=np.tile([1.0, 0.0, 0.0, 0.0], (len(SEGMENTS), 1)),
        neutral=np.zeros_like(joints.neutral),
        stiffness_low=joints.stiffness_high,
        stop_low=joints.stop_high,
    )
    flexion, extension = (swing_neck(even, level, d, SPEED, ramp(0.03)) for d in DIRECTIONS)
    np.testing.assert_allclose(extension.angle, flexion.angle, atol=1e-9)
    np.testing.assert_allclose(extension.moment, flexion.moment, atol=1e-7)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_rigid_neck_moves_with_the_pendulum(body: Body, direction: str) -> None:
    # As stiff as the step allows with the neck's own inertia of 1e-3 kg m2, damped to settle.
    joints = build_joints(body)
    stiff = without(joints)._replace(
        stiffness_low=np.full_like(joints.stiffness_low, 1e4),
        stiffness_high=np.full_like(joints.stiffness_high, 1e4),
        damping=np.full_like(joints.damping, 18.0),
    )
    stop = 0.15
    test = swing_neck(body, stiff, direction, SPEED, ramp(stop))
    # Closed form at the end of the even stop: head turned about the pivot with the pendulum.
    sense = 1.0 if direction == "flexion" else -1.0
    slowing = SPEED / GAUGE / stop
    angle = 0.5 * slowing * stop**2
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    lever, link = (
        turn @ [sense * v[0], -v[2]]
        for v in (body.centre[HEAD] - body.joint[HEAD], body.joint[HEAD] - body.joint[ROWS[0]])
    )
    from_pivot = turn @ [0.0, -ARM] + link + lever
    inertial = body.mass[HEAD] * (-slowing * QUARTER_TURN @ from_pivot - [0.0, -GRAVITY])
    torque = lever[0] * inertial[1] - lever[1] * inertial[0]
    expected = -(torque - body.inertia[HEAD, 1] * slowing)
    last = int(np.searchsorted(test.time, stop))
    assert expected > 5.0
    # Two joints under 7 and 16 N m, over 1e4 N m/rad: 2.3e-3 rad, at most twice as the stop sets
    # in at once; the pendulum itself turns by 0.22 rad.
    assert np.abs(test.angle).max() < 2.0 * 2.3e-3
    # The ringing of 70 Hz has died down to 1e-3 by then.
    assert test.moment[last] == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_stiffer_neck_bends_less_and_returns_sooner(body: Body, direction: str) -> None:
    tests = [
        swing_neck(body, build_joints(body, neck_stiffness=f), direction, SPEED, ramp(0.034))
        for f in (0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0)
    ]
    for soft, stiff in pairwise(tests):
        assert stiff.angle.max() < soft.angle.max()
        assert stiff.decay_time(5.0) < soft.decay_time(5.0)
    for test in tests:
        assert test.angle[0] == pytest.approx(0.0, abs=1e-12)
        assert test.moment[0] == pytest.approx(0.0, abs=1e-6)


def test_a_faster_pendulum_bends_the_neck_further(body: Body) -> None:
    joints = build_joints(body)
    tests = [swing_neck(body, joints, "flexion", v, ramp(0.034, v)) for v in (1.0, 2.0, 4.0, 6.0)]
    for slow, fast in pairwise(tests):
        assert fast.angle.max() > slow.angle.max()
        assert fast.moment.max() > slow.moment.max()


def test_decay_time_counts_from_the_peak() -> None:
    time = np.linspace(0.0, 1.0, 11)
    moment = np.array([0.0, 4.0, 8.0, 10.0, 8.0, 6.0, 4.0, 2.0, 6.0, 0.0, 0.0])
    test = PendulumTest(time, np.zeros(11), moment)
    assert test.decay_time(5.0) == pytest.approx(0.6)
    assert test.decay_time(6.0) == pytest.approx(0.5)
    assert math.isnan(test.decay_time(-1.0))


def test_bad_tests_are_refused(body: Body) -> None:
    joints = build_joints(body)
    with pytest.raises(ValueError, match=r"one of flexion, extension.*'lateral'"):
        swing_neck(body, joints, "lateral", SPEED, ramp(0.03))
    with pytest.raises(ValueError, match=r"ends at 4 m/s, not at the speed 4\.95 m/s"):
        swing_neck(body, joints, "flexion", SPEED, ramp(0.03, 4.0))


@pytest.mark.parametrize("stop", [STEP, 1e-3])
def test_the_pendulum_comes_to_rest_when_the_pulse_starts_at_once(body: Body, stop: float) -> None:
    pulse = ramp(stop, start=0.0)
    test = swing_neck(body, without(build_joints(body)), "flexion", SPEED, pulse)
    at = first(test, 0.06)
    expected = planar(body, "flexion", pulse, at)
    np.testing.assert_allclose(test.angle[: at.size], expected[4] - expected[0], atol=1e-3)


@pytest.mark.parametrize("lost", [1.0, SPEED])
def test_a_pulse_that_begins_with_a_loss_is_refused(body: Body, lost: float) -> None:
    with pytest.raises(ValueError, match="pulse"):
        swing_neck(
            body, build_joints(body), "flexion", SPEED, np.array([[0.0, lost], [0.03, SPEED]])
        )
