"""Blunt impacts against the closed forms of two bodies and a straight law."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from builders import CHILD, Array, quiet
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid

from models.component.blunt_impact import STEP, BluntImpact, strike_region
from models.pedestrian.anthropometry import SEGMENTS, Body, build_body
from models.pedestrian.joints import build_joints
from models.pedestrian.tissue import build_tissue

REGIONS = ("head", "chest", "abdomen", "hip")
JOINTS, TISSUE = build_joints(CHILD), build_tissue(CHILD)


def lump(region: str, mass: float) -> Body:
    """Return a body that is all in one segment, its ellipsoid about its centre of mass."""
    i = SEGMENTS.index(region)
    masses = np.full(len(SEGMENTS), 1e-7 * mass)
    masses[i] = mass
    ellipsoid = CHILD.ellipsoid.copy()
    ellipsoid[i] = CHILD.centre[i]
    inertia = CHILD.inertia * (masses / CHILD.mass)[:, None]
    return dataclasses.replace(CHILD, mass=masses, inertia=inertia, ellipsoid=ellipsoid)


def strike_lump(region: str, body_mass: float, mass: float, speed: float) -> BluntImpact:
    """Strike a lump whose joints do not resist and stay together."""
    gone = ("stiffness_low", "stiffness_high", "stop_low", "stop_high", "damping", "friction")
    loose = JOINTS._replace(
        **{name: np.zeros_like(getattr(JOINTS, name)) for name in gone},
        yields=np.zeros_like(JOINTS.yields),
    )
    return strike_region(lump(region, body_mass), loose, region, mass, speed)


def impulse(impact: BluntImpact) -> Array:
    return np.asarray(cumulative_trapezoid(impact.force, impact.time, initial=0.0))


def speeds(impact: BluntImpact, mass: float, speed: float) -> tuple[Array, Array]:
    """Return the speed of impactor and of the struck surface, both into the body."""
    impactor = speed - impulse(impact) / mass
    return impactor, impactor - np.gradient(impact.deflection, STEP)


@pytest.mark.parametrize(
    ("region", "mass", "speed", "body_mass"),
    [("chest", 3.5, 1.5, 10.0), ("abdomen", 2.0, 3.0, 4.0), ("hip", 6.0, 1.0, 6.0),
     ("head", 3.0, 1.0, 4.5)],
)  # fmt: skip
def test_two_free_bodies_and_a_straight_law(
    region: str, mass: float, speed: float, body_mass: float
) -> None:
    # Half a period of loading, then unloading at ratio times the slope: restitution 1/sqrt(ratio).
    curve, reduced = TISSUE[region], mass * body_mass / (mass + body_mass)
    slope, ratio = float(curve.force[1] / curve.penetration[1]), curve.unloading_ratio
    impact = strike_lump(region, body_mass, mass, speed)
    assert impact.deflection.max() < curve.penetration[1]
    # The step over the shortest time constant, squared.
    fine = (STEP * math.sqrt(ratio * slope / reduced)) ** 2
    assert fine < 0.01
    assert impact.force.max() == pytest.approx(speed * math.sqrt(slope * reduced), rel=fine)
    assert impact.deflection.max() == pytest.approx(speed * math.sqrt(reduced / slope), rel=fine)
    total = reduced * speed * (1.0 + 1.0 / math.sqrt(ratio))
    assert impulse(impact)[-1] == pytest.approx(total, rel=fine)
    duration = 0.5 * math.pi * math.sqrt(reduced / slope) * (1.0 + 1.0 / math.sqrt(ratio))
    # The first step without force ends the record.
    assert duration - STEP <= impact.time[-1] <= duration + 2.0 * STEP
    assert impact.hysteresis == pytest.approx(1.0 - 1.0 / ratio, rel=fine)


def test_the_body_gains_what_the_impactor_loses() -> None:
    mass, speed, body_mass = 3.5, 2.0, 10.0
    impact = strike_lump("chest", body_mass, mass, speed)
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
def test_impactors_from_light_to_heavy(region: str) -> None:
    curve, alone = TISSUE[region], CHILD.mass[SEGMENTS.index(region)]
    slope = float(curve.force[1] / curve.penetration[1])
    # A light one meets the first slope. The body yields by less than the impactor's mass over that
    # of the struck segment alone, and a step resolves the impactor's oscillation to its square.
    mass, speed = 0.01, 2.0
    impact = strike_region(CHILD, JOINTS, region, mass, speed)
    assert impact.deflection.max() < 0.1 * curve.penetration[1]
    yielding, fine = mass / alone, slope / mass * STEP**2
    expected = speed * math.sqrt(slope * mass)
    assert expected * (1.0 - yielding - fine) <= impact.force.max() <= expected * (1.0 + fine)
    # As long as the law is straight, the peak lies between that of the segment alone, struck
    # through its centre, and that of a wall.
    impact = strike_region(CHILD, JOINTS, region, 1.0, 1.0)
    assert impact.deflection.max() < curve.penetration[1]
    wall = math.sqrt(slope)
    assert 0.9 * wall * math.sqrt(alone / (alone + 1.0)) < impact.force.max() < wall
    assert impact.hysteresis == pytest.approx(1.0 - 1.0 / curve.unloading_ratio, rel=2e-3)
    # A faster or a heavier one strikes harder.
    by_speed = [strike_region(CHILD, JOINTS, region, 3.5, v) for v in (0.5, 1.0, 2.0, 7.0)]
    by_mass = [strike_region(CHILD, JOINTS, region, m, 4.0) for m in (0.1, 0.5, 4.0)]
    for small, large in (*pairwise(by_speed), *pairwise(by_mass)):
        assert large.force.max() > small.force.max()
        assert large.deflection.max() > small.deflection.max()
        assert impulse(large)[-1] > impulse(small)[-1]


@quiet(25)
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
    assert impact.deflection.min() >= 0.0 and impact.force.min() >= 0.0 == impact.force[0]
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
