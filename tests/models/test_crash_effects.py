"""Effects of the crash core: off they change no bit, on they do what their physics says."""

import functools
import math
from collections.abc import Mapping

import numpy as np
import pytest
from scipy.signal import sosfiltfilt

from models.criteria.filters import CUTOFF_FACTOR, filter_cfc
from models.effects.registry import effects_of, load_effect
from models.pedestrian.anthropometry import SEGMENTS, build_body
from models.pedestrian.posture import running_posture
from models.protocol import Run
from models.registry import load_model
from models.vehicle.motion import braking_motion, car_state, stopping_distance

GRAVITY = 9.80665
CRASH = ("late_braking", "brake_dive", "muscle_tone", "braced_posture", "shoulder_compliance",
         "wet_road", "road_slope", "restitution")  # fmt: skip


def crash(effects: Mapping[str, Mapping[str, float]] | None = None, **inputs: float) -> Run:
    return load_model("multibody", {}, effects).run(inputs)


@functools.cache
def plain() -> Run:
    return crash()


def test_the_crash_core_has_the_crash_effects() -> None:
    assert set(CRASH) <= set(effects_of("multibody"))
    assert not set(CRASH) & set(effects_of("headform"))


@pytest.mark.parametrize("name", effects_of("multibody"))
def test_an_effect_at_its_value_for_none_changes_no_bit(name: str) -> None:
    effect = load_effect(name)
    off = {key: entry.none for key, entry in effect.parameters.items()}
    assert crash({name: off}).outputs == plain().outputs


@pytest.mark.parametrize("name", CRASH)
def test_an_effect_changes_the_crash_and_keeps_its_energy(name: str) -> None:
    effect = load_effect(name)
    large = float(effect.parameters[effect.size].prior.quantile(0.9))
    run = crash({name: {effect.size: 8.0 if name == "wet_road" else large}})
    assert run.status == "ok"
    assert run.outputs != plain().outputs
    assert abs(run.outputs["energy_residual"]) < 0.01


def test_recording_errors_are_runs_of_other_inputs() -> None:
    dive = crash({"brake_dive": {"angle": 0.02}}).outputs
    assert dive == pytest.approx(crash(dive_angle=0.03490658503988659 + 0.02).outputs)
    tone = crash({"muscle_tone": {"factor": 2.0}}).outputs
    assert tone == pytest.approx(crash(neck_stiffness=2.214, muscle_tone=2.0).outputs)
    fast = crash({"speed_bias": {"factor": 1.1}}).outputs
    assert fast == pytest.approx(crash(impact_speed=1.1 * 11.111111111111111).outputs)


def test_a_wet_road_lengthens_the_throw_of_those_who_reach_it_and_nothing_before() -> None:
    reached = crash({"wet_road": {"place": 6.0, "factor": 0.5}})
    missed = crash({"wet_road": {"place": 100.0, "factor": 0.5}})
    assert reached.outputs["throw_distance"] > plain().outputs["throw_distance"] + 1.0
    assert missed.outputs == plain().outputs
    for name in ("hic15", "wad", "head_impact_time"):
        assert reached.outputs[name] == plain().outputs[name]


def test_late_braking_adds_the_way_of_the_delay() -> None:
    speed, delay = 11.0, 0.4
    motion = braking_motion(speed, 0.7, 0.0, 1.7)._replace(onset=delay)
    expected = speed * delay + speed**2 / (2.0 * 0.7 * GRAVITY)
    assert stopping_distance(motion) == pytest.approx(expected, rel=1e-12)
    car = np.zeros(6)
    car_state(motion, 100.0, car)
    assert car[0] == pytest.approx(expected, rel=1e-9)
    car_state(motion, 0.5 * delay, car)
    assert car[3] == pytest.approx(speed)
    assert car[0] == pytest.approx(0.5 * speed * delay)


@pytest.mark.parametrize("angle", [-0.05, 0.05])
def test_a_falling_road_lengthens_car_and_throw(angle: float) -> None:
    run = crash({"road_slope": {"angle": angle}})
    speed = 11.111111111111111
    braking = 0.7 * GRAVITY - GRAVITY * math.sin(angle)
    assert run.outputs["car_stopping_distance"] == pytest.approx(speed**2 / (2.0 * braking))
    longer = run.outputs["throw_distance"] - plain().outputs["throw_distance"]
    assert math.copysign(1.0, longer) == math.copysign(1.0, angle)


def test_more_returned_energy_is_a_longer_throw() -> None:
    stiff = crash({"restitution": {"factor": 0.3}}).outputs["throw_distance"]
    springy = crash({"restitution": {"factor": 3.0}}).outputs["throw_distance"]
    assert springy > stiff


def test_a_braced_body_does_not_swing_its_limbs() -> None:
    body = build_body(7.5, 1.18, 21.8, 3.26)
    braced = running_posture(body, gait_phase=0.3, facing_angle=1.6, running_speed=2.8, braced=1.0)
    running = running_posture(body, gait_phase=0.3, facing_angle=1.6, running_speed=2.8)
    assert np.abs(braced.angular_velocity).max() == 0.0
    assert np.abs(running.angular_velocity).max() > 1.0
    left, right = (braced.orientation[SEGMENTS.index(f"upper_arm_{side}")] for side in
                   ("left", "right"))  # fmt: skip
    np.testing.assert_allclose(left, right, atol=1e-12)


def test_a_gain_reaches_hic_of_the_crash() -> None:
    loud = crash({"sensor_gain": {"factor": 1.1}}).outputs
    assert loud["hic15"] == pytest.approx(1.1**2.5 * plain().outputs["hic15"], rel=1e-9)
    assert loud["throw_distance"] == plain().outputs["throw_distance"]


@pytest.mark.parametrize("size", [2, 30, 61, 500])
@pytest.mark.parametrize("channel_class", [60.0, 180.0, 1000.0])
def test_our_filter_is_that_of_scipy(size: int, channel_class: float) -> None:
    rng = np.random.default_rng(size)
    x = rng.standard_normal((size, 2))
    wa = math.tan(math.pi * channel_class * CUTOFF_FACTOR / 20_000.0)
    scale = 1.0 + math.sqrt(2.0) * wa + wa * wa
    gain = wa * wa / scale
    sections = np.array([[gain, 2 * gain, gain, 1.0, 2.0 * (wa * wa - 1.0) / scale,
                          (1.0 - math.sqrt(2.0) * wa + wa * wa) / scale]])  # fmt: skip
    theirs = sosfiltfilt(sections, x, axis=0, padlen=min(size - 1, 60))
    np.testing.assert_allclose(filter_cfc(x, 20_000.0, channel_class), theirs, atol=1e-11)
