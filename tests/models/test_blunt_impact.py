"""Blunt impacts against the closed forms of two bodies and a straight law."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from models.component.blunt_impact import STEP, BluntImpact, strike_region
from models.contact.law import ForceCurve
from models.pedestrian.anthropometry import SEGMENTS, Body, build_body
from models.pedestrian.joints import Joints, build_joints
from models.pedestrian.tissue import build_tissue

Array = NDArray[np.float64]

REGIONS = ("head", "chest", "abdomen", "hip")
QUIET = settings(
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=25,
    suppress_health_check=[HealthCheck.too_slow],
)


@pytest.fixture(scope="module")
def child() -> Body:
    # The reference body: its tissue is that of the data file.
    return build_body(7.0, 1.22, 23.2, 3.26)


@pytest.fixture(scope="module")
def joints(child: Body) -> Joints:
    return build_joints(child)


def law(body: Body, region: str) -> tuple[ForceCurve, float]:
    """Return a region's law and its first slope (N/m)."""
    curve = build_tissue(body)[region]
    return curve, float(curve.force[1] / curve.penetration[1])


def lump(body: Body, region: str, mass: float) -> Body:
    """Return a body that is all in one segment, its ellipsoid about its centre of mass."""
    i = SEGMENTS.index(region)
    masses = np.full(len(SEGMENTS), 1e-7 * mass)
    masses[i] = mass
    ellipsoid = body.ellipsoid.copy()
    ellipsoid[i] = body.centre[i]
    return dataclasses.replace(
        body,
        mass=masses,
        inertia=body.inertia * (masses / body.mass)[:, None],
        ellipsoid=ellipsoid,
    )


def loose(joints: Joints) -> Joints:
    """Return joints without resistance whose points stay together."""
    zero = {
        name: np.zeros_like(getattr(joints, name))
        for name in ("stiffness_low", "stiffness_high", "stop_low", "stop_high", "damping",
                     "friction")
    }  # fmt: skip
    return joints._replace(**zero, yields=np.zeros_like(joints.yields))


def impulse(impact: BluntImpact) -> Array:
    return np.asarray(cumulative_trapezoid(impact.force, impact.time, initial=0.0))


def speeds(impact: BluntImpact, mass: float, speed: float) -> tuple[Array, Array]:
    """Return the speed of impactor and of the struck surface, both into the body."""
    impactor = speed - impulse(impact) / mass
    return impactor, impactor - np.gradient(impact.deflection, STEP)


@pytest.mark.parametrize(
    ("region", "mass", "speed", "body_mass"),
    [("chest", 3.5, 1.5, 10.0), ("chest", 1.0, 3.0, 5.0), ("abdomen", 2.0, 3.0, 4.0),
     ("hip", 6.0, 1.0, 6.0), ("head", 3.0, 1.0, 4.5)],
)  # fmt: skip
def test_two_free_bodies_and_a_straight_law(
    child: Body, joints: Joints, region: str, mass: float, speed: float, body_mass: float
) -> None:
    # Half a period of loading, then unloading at ratio times the slope: restitution 1/sqrt(ratio).
    curve, slope = law(child, region)
    ratio = curve.unloading_ratio
    impact = strike_region(lump(child, region, body_mass), loose(joints), region, mass, speed)
    reduced = mass * body_mass / (mass + body_mass)
    assert impact.deflection.max() < curve.penetration[1]
    # The step over the shortest time constant, squared.
    fine = (STEP * math.sqrt(ratio * slope / reduced)) ** 2
    assert fine < 0.01
    assert impact.force.max() == pytest.approx(speed * math.sqrt(slope * reduced), rel=fine)
    assert impact.deflection.max() == pytest.approx(speed * math.sqrt(reduced / slope), rel=fine)
    total = reduced * speed * (1.0 + 1.0 / math.sqrt(ratio))
    assert impulse(impact)[-1] == pytest.approx(total, rel=fine)
    quarter = 0.5 * math.pi * math.sqrt(reduced / slope)
    duration = quarter * (1.0 + 1.0 / math.sqrt(ratio))
    # The first step without force ends the record.
    assert duration - STEP <= impact.time[-1] <= duration + 2.0 * STEP
    assert impact.hysteresis == pytest.approx(1.0 - 1.0 / ratio, rel=fine)


@pytest.mark.parametrize(("region", "mass", "body_mass"), [("chest", 3.5, 10.0), ("hip", 2.0, 5.0)])
def test_the_body_gains_what_the_impactor_loses(
    child: Body, joints: Joints, region: str, mass: float, body_mass: float
) -> None:
    speed = 2.0
    impact = strike_region(lump(child, region, body_mass), loose(joints), region, mass, speed)
    impactor, surface = speeds(impact, mass, speed)
    lost, gained = mass * (speed - impactor), body_mass * surface
    assert lost.max() > 0.3 * mass * speed
    # Difference quotients over a step: half a step's force at the ends, 1e-4 within.
    np.testing.assert_allclose(gained[1:-1], lost[1:-1], atol=2e-4 * mass * speed)
    # What is left of the energy: nothing but loading's work minus the elastic return.
    energy = 0.5 * mass * impactor[-2] ** 2 + 0.5 * body_mass * surface[-2] ** 2
    work = np.trapezoid(impact.force, impact.deflection)
    assert 0.5 * mass * speed**2 - energy == pytest.approx(work, rel=1e-3)


@pytest.mark.parametrize("region", REGIONS)
def test_a_light_impactor_meets_the_first_slope(child: Body, joints: Joints, region: str) -> None:
    curve, slope = law(child, region)
    mass, speed = 0.01, 2.0
    impact = strike_region(child, joints, region, mass, speed)
    assert impact.deflection.max() < 0.1 * curve.penetration[1]
    # The body yields by less than the impactor's mass over that of the struck segment alone, and
    # a step resolves the impactor's oscillation to its square.
    yielding = mass / child.mass[SEGMENTS.index(region)]
    fine = slope / mass * STEP**2
    expected = speed * math.sqrt(slope * mass)
    assert expected * (1.0 - yielding - fine) <= impact.force.max() <= expected * (1.0 + fine)


@pytest.mark.parametrize("region", REGIONS)
def test_the_whole_body_stands_behind_a_region(child: Body, joints: Joints, region: str) -> None:
    # As long as the law is straight, the peak lies between that of the segment alone, struck
    # through its centre, and that of a wall.
    curve, slope = law(child, region)
    mass, speed = 1.0, 1.0
    impact = strike_region(child, joints, region, mass, speed)
    alone = child.mass[SEGMENTS.index(region)]
    assert impact.deflection.max() < curve.penetration[1]
    wall = speed * math.sqrt(slope * mass)
    assert 0.9 * wall * math.sqrt(alone / (alone + mass)) < impact.force.max() < wall
    assert impact.hysteresis == pytest.approx(1.0 - 1.0 / curve.unloading_ratio, rel=2e-3)


@QUIET
@given(
    region=st.sampled_from(REGIONS),
    mass=st.floats(0.05, 8.0),
    speed=st.floats(0.2, 8.0),
    age=st.floats(3.0, 15.0),
)
def test_impacts_of_any_size_keep_the_law(
    region: str, mass: float, speed: float, age: float
) -> None:
    stature = 0.75 + 0.065 * age
    body = build_body(age, stature, 16.0 * stature**2)
    impact = strike_region(body, build_joints(body), region, mass, speed)
    curve = build_tissue(body)[region]
    assert impact.deflection.min() >= 0.0
    assert impact.force.min() >= 0.0
    assert impact.force[0] == 0.0
    assert impact.time.shape == impact.force.shape == impact.deflection.shape
    # Loading follows the curve. Nothing lies above it, but the unloading line of the base law on a
    # curve that stiffens faster than that line falls.
    peak = int(np.argmax(impact.force))
    np.testing.assert_allclose(
        impact.force[: peak + 1], curve.at(impact.deflection[: peak + 1]), rtol=1e-9, atol=1e-6
    )
    deepest = impact.deflection[peak]
    slope = curve.unloading_ratio * impact.force[peak] / deepest
    line = impact.force[peak] + slope * (impact.deflection - deepest)
    highest = np.maximum(curve.at(impact.deflection), line)
    assert (impact.force <= highest * (1.0 + 1e-9) + 1e-6).all()
    # The impactor is slowed, the deflection its way less the body's.
    impactor, surface = speeds(impact, mass, speed)
    assert impactor[-1] < speed
    assert surface[-2] > 0.0
    assert 0.0 < impact.hysteresis < 1.0


@pytest.mark.parametrize("region", REGIONS)
def test_a_faster_or_heavier_impactor_strikes_harder(
    child: Body, joints: Joints, region: str
) -> None:
    by_speed = [strike_region(child, joints, region, 3.5, v) for v in (0.5, 1.0, 2.0, 4.0, 7.0)]
    by_mass = [strike_region(child, joints, region, m, 4.0) for m in (0.1, 0.5, 2.0, 4.0)]
    for tests in (by_speed, by_mass):
        for small, large in pairwise(tests):
            assert large.force.max() > small.force.max()
            assert large.deflection.max() > small.deflection.max()
            assert impulse(large)[-1] > impulse(small)[-1]


def test_hysteresis_is_the_loops_share_of_the_work() -> None:
    time = np.arange(5) * STEP
    deflection = np.array([0.0, 0.01, 0.02, 0.015, 0.015])
    # Up 0.5 * 0.02 * 200 = 2 J, back 0.5 * 0.005 * 200 = 0.5 J.
    loop = BluntImpact(time, np.array([0.0, 100.0, 200.0, 0.0, 0.0]), deflection)
    assert loop.hysteresis == pytest.approx(0.75)
    elastic = BluntImpact(time, 1e4 * deflection[[0, 1, 2, 1, 0]], deflection[[0, 1, 2, 1, 0]])
    assert elastic.hysteresis == pytest.approx(0.0, abs=1e-12)
    nothing = BluntImpact(time, np.zeros(5), np.zeros(5))
    assert math.isnan(nothing.hysteresis)
