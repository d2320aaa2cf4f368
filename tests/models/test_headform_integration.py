"""Headform model against an independent integration, and its histories against themselves."""

import itertools
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pytest
from builders import Array, quiet
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid, solve_ivp

from models.criteria import clip_level, head_injury_criterion
from models.criteria.units import STANDARD_GRAVITY
from models.headform.target import SAMPLING_RATE
from models.protocol import Run
from models.registry import load_model

KNOTS = [[0.0, 0.0], [0.012, 1900.0], [0.05, 3000.0], [0.08, 6500.0]]
MODEL = load_model("headform", {"hood_curve": KNOTS, "channel_class": 0.0})
INERTIA = 0.0036
"""kg m2 of the EEVC child headform of 2.5 kg and 130 mm (models/data/headforms.toml)."""
STEP = 1e-5
"""s, a fifth of a sample: the model's step here."""


class Reference(NamedTuple):
    """What the independent integration gives."""

    intrusion: float
    peak_force: float
    duration: float
    rebound: float
    slide: float
    spin: float


def loading_force(depth: float) -> float:
    """Return the force (N) of the knots, with the last slope beyond them."""
    pairs = itertools.pairwise(KNOTS)
    (d0, f0), (d1, f1) = next((pair for pair in pairs if depth <= pair[1][0]), KNOTS[-2:])
    return f0 + (f1 - f0) * (depth - d0) / (d1 - d0)


def inertia_of(values: Mapping[str, float]) -> float:
    """Return the inertia: it keeps its share of mass times radius squared (headform.toml)."""
    return INERTIA * (values["headform_mass"] / 2.5) * (values["headform_diameter"] / 0.13) ** 2


def integrate(values: Mapping[str, float]) -> Reference:
    """Integrate a test: loading up to the turning point, then the unloading line to zero force."""
    mass, radius = values["headform_mass"], 0.5 * values["headform_diameter"]
    inertia = inertia_of(values)
    scale, ratio = values["hood_force_scale"], values["hood_unloading_ratio"]
    damping, onset = values["hood_damping"], values["hood_damping_onset"]
    friction = values["friction_body_car"]
    speed, angle = values["impact_speed"], values["impact_angle"]

    def motion(force: float, state: Array) -> list[float]:
        _, rate, slide, spin = state
        slip = slide - radius * spin
        # Coulomb friction, regularised at 0.1 m/s, below 600 / s per mass (friction.py).
        drag = min(friction * force / math.hypot(slip, 0.1), 600.0 * mass) * slip
        return [rate, -force / mass, -drag / mass, drag * radius / inertia]

    def loading(_: float, state: Array) -> float:
        depth, rate = max(state[0], 0.0), max(state[1], 0.0)
        fade = min(depth / onset, 1.0) if onset > 0.0 else 1.0
        return scale * loading_force(depth) + damping * rate * fade

    def turning(_: float, state: Array) -> float:
        return float(state[1])

    turning.terminal, turning.direction = True, -1.0
    start = [0.0, speed * math.cos(angle), speed * math.sin(angle), 0.0]
    accuracy = {"rtol": 1e-9, "atol": 1e-11, "max_step": 2e-4}
    down = solve_ivp(
        lambda t, y: motion(loading(t, y), y),
        (0.0, 2.0), start, events=turning, dense_output=True, **accuracy,
    )  # fmt: skip
    deepest = float(down.y[0, -1])
    top = scale * loading_force(deepest)

    def unloading(_: float, state: Array) -> float:
        return top * (1.0 - ratio * (deepest - state[0]) / deepest)

    unloading.terminal = True
    up = solve_ivp(
        lambda t, y: motion(max(unloading(t, y), 0.0), y),
        (down.t[-1], 3.0), down.y[:, -1], events=unloading, **accuracy,
    )  # fmt: skip
    forces = [loading(t, down.sol(t)) for t in np.linspace(0.0, down.t[-1], 2001)]
    end = up.y[:, -1]
    return Reference(deepest, max(forces), up.t[-1], -end[1], end[2], end[3])


CENTRE = {
    "impact_speed": 9.0, "impact_angle": 0.7, "headform_mass": 2.5, "headform_diameter": 0.13,
    "hood_force_scale": 1.0, "hood_unloading_ratio": 7.0, "hood_damping": 0.0,
    "hood_damping_onset": 0.0, "friction_body_car": 0.25,
}  # fmt: skip


def compare(values: Mapping[str, float]) -> None:
    run = MODEL.run(values)
    assert run.status == "ok"
    expected, found = integrate(values), run.outputs
    mass, radius = values["headform_mass"], 0.5 * values["headform_diameter"]
    ratio, friction = values["hood_unloading_ratio"], values["friction_body_car"]
    normal = values["impact_speed"] * math.cos(values["impact_angle"])
    tangential = values["impact_speed"] * math.sin(values["impact_angle"])
    stiffest = ratio * values["hood_force_scale"] * 1900.0 / 0.012
    # Rates of change (1/s): the contact's natural frequency and its damping. The method is of
    # second order in the step, but for a few steps that hold a knot or the end of the onset.
    rate = math.sqrt(stiffest / mass) + values["hood_damping"] / mass
    error = 2e-6 + (rate * STEP) ** 2
    assert found["hood_intrusion"] == pytest.approx(expected.intrusion, rel=error)
    assert found["rebound_speed"] == pytest.approx(expected.rebound, rel=error)
    assert found["contact_duration"] == pytest.approx(expected.duration, rel=error, abs=STEP)
    # The samples may miss the peak: by the change within half a sample where it is a corner (end
    # of the onset), by half the square of that where it is round.
    corner = values["hood_damping"] > 0.0
    if corner and values["hood_damping_onset"] > 0.0:
        rate += normal / values["hood_damping_onset"]
    half = 0.5 * rate / SAMPLING_RATE
    missed = error + (half if corner else 0.5 * half**2)
    assert expected.peak_force * (1.0 - missed) <= found["peak_force"]
    assert found["peak_force"] <= expected.peak_force * (1.0 + error)
    # Friction acts in up to one sample after the last: there the force is a triangle.
    late = 0.5 * friction * stiffest * expected.rebound / SAMPLING_RATE**2 / mass
    head, slack = run.histories["head"].channels, late + error * (tangential + 0.1)
    assert head["velocity_tangential"][-1] == pytest.approx(expected.slide, abs=slack)
    share = mass * radius / inertia_of(values)
    assert head["angular_velocity"][-1] == pytest.approx(expected.spin, abs=share * slack)


@pytest.mark.parametrize(
    "change",
    [{"impact_angle": 0.0}, {"friction_body_car": 0.0}, {}, {"hood_damping": 150.0},
     {"hood_damping": 150.0, "hood_damping_onset": 0.005},
     {"impact_angle": 1.3, "impact_speed": 15.0}, {"friction_body_car": 1.2},
     {"headform_mass": 4.8, "headform_diameter": 0.165},
     {"impact_speed": 14.0, "impact_angle": 0.1}, {"impact_speed": 0.5},
     {"hood_unloading_ratio": 1.01}],
    ids=str,
)  # fmt: skip
def test_law_integrated_independently(change: dict[str, float]) -> None:
    compare(CENTRE | change)


@pytest.mark.slow
@quiet(60)
@given(
    st.fixed_dictionaries(
        {
            "impact_speed": st.floats(0.5, 15.0),
            "impact_angle": st.floats(0.0, 1.35),
            "headform_mass": st.floats(1.0, 8.0),
            "headform_diameter": st.floats(0.08, 0.2),
            "hood_force_scale": st.floats(0.3, 3.0),
            "hood_unloading_ratio": st.floats(1.01, 12.0),
            "hood_damping": st.sampled_from([0.0, 0.0, 50.0, 300.0]),
            "hood_damping_onset": st.sampled_from([0.0, 0.002, 0.02]),
            "friction_body_car": st.floats(0.0, 1.4),
        }
    )
)
def test_random_tests_integrated_independently(values: dict[str, float]) -> None:
    compare(values)


@pytest.fixture(scope="module")
def run() -> Run:
    return MODEL.run(CENTRE | {"hood_damping": 100.0, "hood_damping_onset": 0.005})


def test_histories_begin_before_contact_and_are_uniform(run: Run) -> None:
    for history in run.histories.values():
        np.testing.assert_allclose(np.diff(history.time), 1.0 / SAMPLING_RATE, rtol=1e-9)
        assert history.time[0] == pytest.approx(-0.005)
        assert 0.0 in history.time
        assert set(history.units) == set(history.channels)
        assert all(values.shape == history.time.shape for values in history.channels.values())


def test_histories_fit_each_other(run: Run) -> None:
    hood, head = run.histories["hood"], run.histories["head"].channels
    time, force, depth = hood.time, hood.channels["force"], hood.channels["penetration"]
    np.testing.assert_allclose(
        head["acceleration_normal"], force / (2.5 * STANDARD_GRAVITY), rtol=1e-12, atol=1e-12
    )
    resultant = np.hypot(head["acceleration_normal"], head["acceleration_tangential"])
    np.testing.assert_allclose(head["acceleration"], resultant, rtol=1e-12)
    before = time < 0.0
    np.testing.assert_array_equal(force[before], 0.0)
    np.testing.assert_allclose(depth[before], 9.0 * math.cos(0.7) * time[before], rtol=1e-9)
    # Chords of 50 us under a pulse of 200 to 600 rad/s.
    speed = head["velocity_normal"][0] - cumulative_trapezoid(force, time, initial=0.0) / 2.5
    np.testing.assert_allclose(head["velocity_normal"], speed, atol=2e-3)
    np.testing.assert_allclose(
        depth - depth[0], cumulative_trapezoid(head["velocity_normal"], time, initial=0.0),
        atol=2e-6,
    )  # fmt: skip
    assert run.outputs["peak_force"] == force.max()
    assert run.outputs["peak_head_acceleration"] == pytest.approx(resultant.max())
    assert run.outputs["hood_intrusion"] == pytest.approx(depth.max(), rel=1e-4)
    assert head["velocity_normal"][-1] == pytest.approx(-run.outputs["rebound_speed"], rel=1e-3)


def test_criteria_are_those_of_the_histories() -> None:
    # A soft hood: the pulse is longer than every window.
    run = MODEL.run(CENTRE | {"hood_force_scale": 0.05, "hood_unloading_ratio": 1.2})
    assert run.outputs["contact_duration"] > 0.04
    head = run.histories["head"]
    pulse = head.time, head.channels["acceleration"]
    for name, window in (("hic15", 0.015), ("hic36", 0.036)):
        assert run.outputs[name] == pytest.approx(head_injury_criterion(*pulse, window)[0])
    assert run.outputs["hic36"] > 1.01 * head_injury_criterion(*pulse, 0.03)[0]
    assert run.outputs["clip_3ms"] == pytest.approx(clip_level(*pulse))
    consecutive = clip_level(*pulse, mode="consecutive")
    assert run.outputs["clip_3ms_consecutive"] == pytest.approx(consecutive)


def test_energy_lost_is_the_area_between_the_branches() -> None:
    found = MODEL.run(CENTRE | {"impact_angle": 0.0}).outputs
    depth = found["hood_intrusion"]
    knots = [d for d, _ in KNOTS if d < depth] + [depth]
    stored = np.trapezoid([loading_force(d) for d in knots], knots)
    # The recovered triangle: force times recovery d / ratio.
    returned = 0.5 * loading_force(depth) * depth / 7.0
    assert stored == pytest.approx(0.5 * 2.5 * 9.0**2, rel=1e-5)
    assert 0.5 * 2.5 * found["rebound_speed"] ** 2 == pytest.approx(returned, rel=1e-5)
    assert found["permanent_dent"] == pytest.approx(depth * 6.0 / 7.0, rel=1e-12)


def test_filter_smooths_the_acceleration_and_keeps_the_force() -> None:
    # A pulse of 1.5 ms in a filter of 100 Hz.
    hard = CENTRE | {"hood_force_scale": 100.0}
    raw = MODEL.run(hard).outputs
    assert raw["contact_duration"] < 0.0015
    found = load_model("headform", {"hood_curve": KNOTS, "channel_class": 60.0}).run(hard).outputs
    assert found["peak_head_acceleration"] < 0.5 * raw["peak_head_acceleration"]
    for name in ("peak_force", "hood_intrusion", "rebound_speed", "contact_duration"):
        assert found[name] == raw[name]
