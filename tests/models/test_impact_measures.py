"""Contact window, effective mass and impact angle."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.criteria import contact_window, effective_mass, impact_angle

GRAVITY = 9.80665
MEASURED = Path(__file__).parents[3] / "shared" / "measured" / "q3_child_dummy_head_impact.csv"


def test_window_is_the_contact_that_holds_the_peak() -> None:
    time = 1e-3 * np.arange(12)
    force = [0.0, 300.0, 40.0, 0.0, 60.0, 500.0, 1000.0, 400.0, 51.0, 50.0, 700.0, 0.0]
    # Above 5 % of 1000 N around sample 6; sample 9 is at the bound, not above it.
    assert contact_window(time, force) == (4, 8)
    assert contact_window(time, force, end_of_contact=0.02) == (4, 10)
    assert contact_window(time, force, end_of_contact=0.45) == (5, 6)


def test_window_may_run_to_the_ends_of_the_record() -> None:
    assert contact_window([0.0, 1.0, 2.0], [5.0, 10.0, 8.0]) == (0, 2)
    assert contact_window([0.0, 1.0, 2.0], [10.0, 0.0, 0.0]) == (0, 0)


@pytest.mark.parametrize("force", [[0.0, 0.0], [-1.0, -2.0], [1.0, 2.0, 3.0], [math.nan, 1.0]])
def test_window_needs_a_force(force: list[float]) -> None:
    with pytest.raises(ValueError, match="force"):
        contact_window([0.0, 1.0], force)


def test_empty_record_has_no_window() -> None:
    with pytest.raises(ValueError, match="force"):
        contact_window([], [])


@pytest.mark.parametrize("mass", [0.5, 3.26])
def test_free_body_has_its_own_mass(mass: float) -> None:
    time = np.linspace(0.0, 0.02, 401)
    force = 4000.0 * np.sin(np.pi * time / 0.02) ** 2
    acceleration = force / mass / GRAVITY
    for bound in (0.02, 0.05, 0.10):
        assert effective_mass(time, force, acceleration, bound) == pytest.approx(mass, rel=1e-12)


def test_acceleration_after_the_contact_does_not_count() -> None:
    time = np.arange(8.0)
    force = np.array([0.0, 0.0, 10.0, 10.0, 10.0, 0.0, 0.0, 0.0])
    acceleration = np.array([9.0, 9.0, 2.0, 2.0, 2.0, 7.0, 7.0, 7.0])
    assert effective_mass(time, force, acceleration) == pytest.approx(5.0 / GRAVITY, rel=1e-12)


def test_contact_of_one_sample_has_no_mass() -> None:
    assert math.isnan(effective_mass([0.0, 1.0, 2.0], [0.0, 5.0, 0.0], [0.0, 1.0, 0.0]))


@pytest.mark.measured
@pytest.mark.skipif(not MEASURED.exists(), reason="the measurements are not part of the project")
@pytest.mark.parametrize(("speed", "mass"), [(1.0, 2.69), (1.5, 2.63), (3.1, 2.58)])
def test_measured_dummy_head_impacts(speed: float, mass: float) -> None:
    # Q3 (Paez-Granados and Billard 2022), end of contact at 5 % of the peak (data sheet, 1.4).
    # The sheet integrates from the first sample, the function from 5 % as well: the foot of the
    # pulse, 8 samples of 76 at 3.1 m/s and below 5 %, is worth up to half a per cent.
    table = np.genfromtxt(MEASURED, delimiter=",", names=True)
    test = table[table["test_speed_m_s"] == speed]
    time, force = 1e-3 * test["time_ms"], test["impact_force_N"]
    assert effective_mass(time, force, test["head_acc_g"]) == pytest.approx(mass, rel=0.005)


@pytest.mark.parametrize("degrees", [-90.0, -20.0, 0.0, 35.0, 60.0, 84.0, 90.0])
def test_impact_angle_is_measured_from_the_surface(degrees: float) -> None:
    # A hood rising rearwards by 11 deg; the head comes down at ``degrees`` to it.
    slope, angle = math.radians(11.0), math.radians(degrees)
    rearwards = np.array([-math.cos(slope), 0.0, math.sin(slope)])
    normal = np.array([math.sin(slope), 0.0, math.cos(slope)])
    velocity = 9.0 * (math.cos(angle) * rearwards - math.sin(angle) * normal)
    assert impact_angle(velocity, normal) == pytest.approx(angle, abs=1e-7)


@settings(derandomize=True, deadline=None)
@given(
    st.tuples(*[st.floats(-20.0, 20.0)] * 3).filter(lambda v: math.hypot(*v) > 1e-3),
    st.floats(0.1, 50.0),
)
def test_impact_angle_depends_on_the_direction_only(
    velocity: tuple[float, float, float], factor: float
) -> None:
    angle = impact_angle(velocity, [0.0, 0.0, 1.0])
    assert angle == pytest.approx(math.atan2(-velocity[2], math.hypot(*velocity[:2])), abs=1e-7)
    assert impact_angle(factor * np.array(velocity), [0.0, 0.0, 1.0]) == pytest.approx(
        angle, abs=1e-7
    )


def test_head_at_rest_has_no_impact_angle() -> None:
    assert math.isnan(impact_angle([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]))
