"""Head and neck on a pendulum and on a sled against pendulums written down a second time."""

import dataclasses
import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from builders import GRAVITY, Array, turned
from scipy.integrate import cumulative_trapezoid, solve_ivp

from models.component.neck_pendulum import STEP, PendulumTest, swing_neck
from models.component.neck_sled import ride_sled
from models.pedestrian.anthropometry import HEAD, SEGMENTS, build_body
from models.pedestrian.joints import Joints, build_joints

Resistance = Callable[[int, float, float], float]

ARM, GAUGE = 1.80, 1.657
"""m, 49 CFR 572.33 (recalled)."""
SPEED = 4.95
"""m/s, flexion test of 49 CFR 572.123 (data sheet, 2.3)."""
ROWS = (SEGMENTS.index("neck"), HEAD)
DIRECTIONS = ("flexion", "extension")
BOTH = pytest.mark.parametrize("direction", DIRECTIONS)
PULSE = np.array([[0.0, 0.0], [0.028, 110.0], [0.065, 0.0]])
"""Of the sled: times s, accelerations m/s^2."""
BODY = build_body(6.0, 1.17, 23.4, 3.47)
ADULT = build_body(49.0, 1.776, 69.9, 4.5)
JOINTS = build_joints(BODY)
QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


def ramp(duration: float, speed: float = SPEED, start: float = STEP) -> Array:
    """Return a pulse that stops the pendulum evenly; nothing is lost in the first step."""
    rows = [[0.0, 0.0], [start, 0.0], [start + duration, speed]]
    return np.array(rows if start > 0.0 else rows[1:])


def exact(joints: Joints) -> Joints:
    """Return joints whose points stay together."""
    return joints._replace(yields=np.zeros_like(joints.yields))


def without(joints: Joints) -> Joints:
    """Return joints without resistance."""
    gone = ("stiffness_low", "stiffness_high", "stop_low", "stop_high", "damping", "friction")
    return exact(joints)._replace(**{name: np.zeros_like(getattr(joints, name)) for name in gone})


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
            stop = (joints.stop_high if phi > 0.0 else joints.stop_low)[i, 1]
            total += math.copysign(shape, phi) * stop
        return float(-sense * total - joints.damping[i, 1] * rate)

    return moment


def no_resistance(k: int, angle: float, rate: float) -> float:
    return 0.0


def planar(
    direction: str, pulse: Array, times: Array, resistance: Resistance = no_resistance
) -> Array:
    """Return angle and rate of pendulum, neck and head (6, n) by d'Alembert's principle.

    In the plane of the swing, angles counter-clockwise from hanging straight down; the pendulum
    swings counter-clockwise and its angular acceleration is constant within a row of the pulse.
    """
    (i, j), body = ROWS, BODY
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
        A, D, B1 = turned(p) @ arm, turned(p1) @ link, turned(p1) @ levers[0]
        B2 = turned(p2) @ levers[1]
        jD, j1, j2 = QUARTER_TURN @ D, QUARTER_TURN @ B1, QUARTER_TURN @ B2
        base = slowing * (QUARTER_TURN @ A) - wp**2 * A - weight
        M = np.array([[I1 + m1 * j1 @ j1 + m2 * jD @ jD, m2 * jD @ j2],
                      [m2 * jD @ j2, I2 + m2 * j2 @ j2]])  # fmt: skip
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


@BOTH
@pytest.mark.parametrize(("stop", "start"), [(2e-2, STEP), (STEP, STEP), (STEP, 0.0), (1e-3, 0.0)])
def test_without_resistance_it_is_a_double_pendulum(
    direction: str, stop: float, start: float
) -> None:
    pulse = ramp(stop, start=start)
    test = swing_neck(BODY, without(JOINTS), direction, SPEED, pulse)
    at = first(test, 0.06)
    expected = planar(direction, pulse, at)
    assert not test.moment.any()
    # The head folds by more than a right angle, at up to 70 rad/s: half a step is 7e-4 rad.
    assert np.ptp(expected[4]) > 2.0
    np.testing.assert_allclose(test.angle[: at.size], expected[4] - expected[0], atol=1e-3)


@BOTH
@pytest.mark.parametrize("factor", [0.5, 4.0])
def test_own_resistance_against_the_same_formulas(direction: str, factor: float) -> None:
    joints = exact(build_joints(BODY, neck_stiffness=factor))
    pulse = np.array([[0.0, 0.0], [STEP, 0.0], [0.01, 1.3], [0.025, 3.6], [0.034, SPEED]])
    test = swing_neck(BODY, joints, direction, SPEED, pulse)
    at = first(test, 0.2)
    resistance = resistance_of(joints, 1.0 if direction == "flexion" else -1.0)
    expected = planar(direction, pulse, at, resistance)
    relative = zip(expected[4] - expected[2], expected[5] - expected[3], strict=True)
    moment = np.array([-resistance(1, a, w) for a, w in relative])
    # The pendulum is stopped within a step: histories may be shifted by that much in time.
    for ours, theirs in ((test.angle, expected[4] - expected[0]), (test.moment, moment)):
        shift = STEP * np.abs(np.gradient(theirs, STEP)).max()
        np.testing.assert_allclose(ours[: at.size], theirs, atol=shift)
    assert test.moment.max() == pytest.approx(moment.max(), rel=2e-3)


@BOTH
def test_impulse_of_the_moment_is_the_change_of_angular_momentum(direction: str) -> None:
    # A head balanced on its joint feels no other torque.
    centre = BODY.centre.copy()
    centre[HEAD] = BODY.joint[HEAD]
    balanced, pulse = dataclasses.replace(BODY, centre=centre), ramp(0.03)
    test = swing_neck(balanced, JOINTS, direction, SPEED, pulse)
    swing = (SPEED - np.interp(test.time, pulse[:, 0], pulse[:, 1])) / GAUGE
    turning = swing + np.gradient(test.angle, STEP)
    impulse = cumulative_trapezoid(test.moment, test.time, initial=0.0)
    inertia = BODY.inertia[HEAD, 1]
    assert np.ptp(impulse) > 2.0 * inertia * SPEED / GAUGE
    # Half a step of the pendulum's deceleration, and the ends of the difference quotient.
    slack = inertia * STEP * SPEED / GAUGE / 0.03
    momentum = inertia * (SPEED / GAUGE - turning)
    np.testing.assert_allclose(impulse[1:-1], momentum[1:-1], atol=slack)


def test_extension_is_flexion_of_a_body_turned_round() -> None:
    # The front is the back; rotations about y and z change their sense.
    back, about = np.array([-1.0, 1.0, 1.0]), np.array([False, True, True])
    pairs = [("stiffness_low", "stiffness_high"), ("stop_low", "stop_high")]
    other = {one: np.where(about, getattr(JOINTS, two), getattr(JOINTS, one))
             for pair in pairs for one, two in (pair, pair[::-1])}  # fmt: skip
    joints = JOINTS._replace(
        centre=JOINTS.centre * [1.0, 1.0, -1.0, -1.0],
        neutral=np.where(about, -JOINTS.neutral, JOINTS.neutral),
        **other,
    )
    body = dataclasses.replace(BODY, joint=back * BODY.joint, centre=back * BODY.centre)
    flexion, extension = (swing_neck(BODY, JOINTS, d, SPEED, ramp(0.03)) for d in DIRECTIONS)
    round_ = swing_neck(body, joints, "extension", SPEED, ramp(0.03))
    np.testing.assert_allclose(round_.angle, flexion.angle, atol=1e-9)
    np.testing.assert_allclose(round_.moment, flexion.moment, atol=1e-7)
    assert abs(extension.angle.max() - flexion.angle.max()) > 0.1


@BOTH
def test_a_rigid_neck_moves_with_the_pendulum(direction: str) -> None:
    # As stiff as the step allows with the neck's own inertia of 1e-3 kg m2, damped to settle.
    hard = np.full_like(JOINTS.stiffness_low, 1e4)
    stiff = without(JOINTS)._replace(
        stiffness_low=hard, stiffness_high=hard, damping=np.full_like(JOINTS.damping, 18.0)
    )
    stop = 0.15
    test = swing_neck(BODY, stiff, direction, SPEED, ramp(stop))
    # Closed form at the end of the even stop: head turned about the pivot with the pendulum.
    sense = 1.0 if direction == "flexion" else -1.0
    slowing = SPEED / GAUGE / stop
    turn = turned(0.5 * slowing * stop**2)
    lever, link = (
        turn @ [sense * v[0], -v[2]]
        for v in (BODY.centre[HEAD] - BODY.joint[HEAD], BODY.joint[HEAD] - BODY.joint[ROWS[0]])
    )
    from_pivot = turn @ [0.0, -ARM] + link + lever
    inertial = BODY.mass[HEAD] * (-slowing * QUARTER_TURN @ from_pivot - [0.0, -GRAVITY])
    torque = lever[0] * inertial[1] - lever[1] * inertial[0]
    expected = -(torque - BODY.inertia[HEAD, 1] * slowing)
    assert expected > 5.0
    # Two joints under 7 and 16 N m, over 1e4 N m/rad: 2.3e-3 rad, at most twice as the stop sets
    # in at once; the pendulum itself turns by 0.22 rad.
    assert np.abs(test.angle).max() < 2.0 * 2.3e-3
    # The ringing of 70 Hz has died down to 1e-3 by then.
    last = int(np.searchsorted(test.time, stop))
    assert test.moment[last] == pytest.approx(expected, rel=2e-3)


@BOTH
def test_a_stiffer_neck_bends_less_and_a_faster_pendulum_more(direction: str) -> None:
    tests = [
        swing_neck(BODY, build_joints(BODY, neck_stiffness=f), direction, SPEED, ramp(0.034))
        for f in (0.5, 1.0, 2.0, 5.0, 30.0)
    ]
    for soft, stiff in pairwise(tests):
        assert stiff.angle.max() < soft.angle.max()
        assert stiff.decay_time(5.0) < soft.decay_time(5.0)
    assert tests[0].angle[0] == pytest.approx(0.0, abs=1e-12)
    assert tests[0].moment[0] == pytest.approx(0.0, abs=1e-6)
    tests = [swing_neck(BODY, JOINTS, direction, v, ramp(0.034, v)) for v in (1.0, 2.0, 4.0)]
    for slow, fast in pairwise(tests):
        assert fast.angle.max() > slow.angle.max()
        assert fast.moment.max() > slow.moment.max()


def test_decay_time_counts_from_the_peak() -> None:
    moment = np.array([0.0, 4.0, 8.0, 10.0, 8.0, 6.0, 4.0, 2.0, 6.0, 0.0, 0.0])
    test = PendulumTest(np.linspace(0.0, 1.0, 11), np.zeros(11), moment)
    assert test.decay_time(5.0) == pytest.approx(0.6)
    assert test.decay_time(6.0) == pytest.approx(0.5)
    assert math.isnan(test.decay_time(-1.0))


@pytest.mark.parametrize(
    ("direction", "pulse", "message"),
    [
        ("lateral", ramp(0.03), r"one of flexion, extension.*'lateral'"),
        ("flexion", ramp(0.03, 4.0), r"ends at 4 m/s, not at the speed 4\.95 m/s"),
        ("flexion", np.array([[0.0, 1.0], [0.03, SPEED]]), "pulse"),
        ("flexion", np.array([[0.0, SPEED], [0.03, SPEED]]), "pulse"),
    ],
)
def test_bad_tests_are_refused(direction: str, pulse: Array, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        swing_neck(BODY, JOINTS, direction, SPEED, pulse)


def test_a_loose_head_on_a_stiff_neck_is_an_inverted_pendulum() -> None:
    centre, neck = ADULT.centre.copy(), ROWS[0]
    lever = float(centre[HEAD, 2] - ADULT.joint[HEAD, 2])
    centre[HEAD, :2] = ADULT.joint[HEAD, :2]
    joints = without(build_joints(ADULT))
    joints.stiffness_low[neck] = joints.stiffness_high[neck] = 2e5
    joints.damping[neck] = 30.0
    test = ride_sled(dataclasses.replace(ADULT, centre=centre), joints, PULSE)
    mass, inertia = ADULT.mass[HEAD], ADULT.inertia[HEAD, 1]

    def rates(time: float, state: Array) -> list[float]:
        push = float(np.interp(time, PULSE[:, 0], PULSE[:, 1], left=0.0, right=0.0))
        turning = mass * lever * (push * math.cos(state[0]) + GRAVITY * math.sin(state[0]))
        return [float(state[1]), turning / (inertia + mass * lever**2)]

    last = np.searchsorted(test.time, 0.12)
    found = solve_ivp(
        rates, (0.0, 0.12), [0.0, 0.0], t_eval=test.time[:last], max_step=1e-4, rtol=1e-9
    )
    assert found.y[0].max() > 0.5
    np.testing.assert_allclose(test.rotation[:last], found.y[0], atol=0.01 * found.y[0].max())


def test_a_stiffer_neck_turns_less_and_sooner_and_without_a_pulse_not_at_all() -> None:
    tests = [ride_sled(ADULT, build_joints(ADULT, neck_stiffness=f), PULSE) for f in (0.5, 1, 2, 4)]
    for soft, hard in pairwise(tests):
        assert hard.rotation.max() < soft.rotation.max()
        assert np.argmax(hard.rotation) < np.argmax(soft.rotation)
    still = ride_sled(ADULT, build_joints(ADULT), np.array([[0.0, 0.0], [0.1, 0.0]]))
    assert np.abs(still.rotation).max() < math.radians(3.0)
    # The head's weight rests on the neck.
    assert still.tension[-1] == pytest.approx(-ADULT.mass[HEAD] * GRAVITY, rel=0.05)
    with pytest.raises(ValueError, match="times rising"):
        ride_sled(ADULT, build_joints(ADULT), np.array([[0.0, 0.0], [0.0, 1.0]]))
