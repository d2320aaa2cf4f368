"""Head and neck on a sled against an inverted pendulum, and what a neck's stiffness must do."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from models.component.neck_sled import ride_sled
from models.pedestrian.anthropometry import HEAD, SEGMENTS, Body, build_body
from models.pedestrian.joints import Joints, build_joints

Array = NDArray[np.float64]

GRAVITY = 9.80665
NECK = SEGMENTS.index("neck")
PULSE = np.array([[0.0, 0.0], [0.028, 110.0], [0.065, 0.0]])


@pytest.fixture(scope="module")
def body() -> Body:
    return build_body(49.0, 1.776, 69.9, 4.5)


def stiff_neck_loose_head(joints: Joints) -> Joints:
    """Return joints whose points stay together, the lower one stiff, the upper one free."""
    gone = ("stiffness_low", "stiffness_high", "stop_low", "stop_high", "damping", "friction")
    loose = {name: np.zeros_like(getattr(joints, name)) for name in gone}
    loose["stiffness_low"][NECK] = loose["stiffness_high"][NECK] = 2e5
    loose["damping"][NECK] = 30.0
    return joints._replace(**loose, yields=np.zeros_like(joints.yields))


def test_a_loose_head_on_a_stiff_neck_is_an_inverted_pendulum(body: Body) -> None:
    centre = body.centre.copy()
    lever = float(centre[HEAD, 2] - body.joint[HEAD, 2])
    centre[HEAD, :2] = body.joint[HEAD, :2]
    straight = dataclasses.replace(body, centre=centre)
    test = ride_sled(straight, stiff_neck_loose_head(build_joints(body)), PULSE)
    mass, inertia = body.mass[HEAD], body.inertia[HEAD, 1]

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


def test_without_a_pulse_the_head_stays_where_it_is(body: Body) -> None:
    still = ride_sled(body, build_joints(body), np.array([[0.0, 0.0], [0.1, 0.0]]))
    assert np.abs(still.rotation).max() < math.radians(3.0)
    # The head's weight rests on the neck.
    assert still.tension[-1] == pytest.approx(-body.mass[HEAD] * GRAVITY, rel=0.05)


def test_a_stiffer_neck_turns_less_and_sooner(body: Body) -> None:
    tests = [ride_sled(body, build_joints(body, neck_stiffness=f), PULSE) for f in (0.5, 1, 2, 4)]
    for soft, hard in pairwise(tests):
        assert hard.rotation.max() < soft.rotation.max()
        assert np.argmax(hard.rotation) < np.argmax(soft.rotation)


def test_a_pulse_that_runs_backwards_is_refused(body: Body) -> None:
    with pytest.raises(ValueError, match="times rising"):
        ride_sled(body, build_joints(body), np.array([[0.0, 0.0], [0.0, 1.0]]))
