"""Effects that are switched on do what their physics says."""

import functools
import math
from collections.abc import Mapping

import numpy as np
import pytest
from builders import GRAVITY
from scipy.signal import sosfiltfilt

from models.criteria.filters import CUTOFF_FACTOR, filter_cfc
from models.effects.registry import effects_of, load_effect
from models.pedestrian.anthropometry import SEGMENTS, build_body
from models.pedestrian.posture import running_posture
from models.protocol import Run
from models.registry import load_model
from models.vehicle.motion import braking_motion, car_state, stopping_distance

Effects = Mapping[str, Mapping[str, float]]

CURVE = [[0.0, 0.0], [0.015, 2600.0], [0.055, 3600.0], [0.1, 5200.0]]
CRASH_SPEED = 11.111111111111111
CRASH = {"late_braking", "brake_dive", "muscle_tone", "braced_posture", "shoulder_compliance",
         "friction_level", "wet_road", "road_slope", "restitution"}  # fmt: skip


def struck(effects: Effects | None = None, channel_class: float = 1000.0, **inputs: float) -> Run:
    options = {"hood_curve": CURVE, "channel_class": channel_class}
    return load_model("headform", options, effects).run({"impact_speed": 9.0} | inputs)


def crash(effects: Effects | None = None, **inputs: float) -> dict[str, float]:
    return dict(load_model("multibody", {}, effects).run(inputs).outputs)


@functools.cache
def plain() -> dict[str, float]:
    return crash()


def test_another_friction_level_is_the_crash_on_that_road() -> None:
    friction = next(
        item.nominal for item in load_model("multibody").inputs if item.name == "friction_body_road"
    )
    slippery = crash({"friction_level": {"factor": 0.7}})
    assert slippery == crash(friction_body_road=0.7 * friction)
    assert slippery["throw_distance"] > 1.1 * plain()["throw_distance"]
    # The feet slide on the road during the impact, which changes the head's blow a little.
    assert slippery["hic15"] == pytest.approx(plain()["hic15"], rel=0.01)


def test_the_crash_has_the_crash_effects() -> None:
    assert set(effects_of("multibody")) >= CRASH
    assert not set(effects_of("headform")) & CRASH


@pytest.mark.parametrize(
    ("effects", "inputs"),
    [
        ({"speed_bias": {"factor": 1.05}}, {"impact_speed": 9.45}),
        ({"speed_bias": {"factor": 1.0, "offset": -0.3}}, {"impact_speed": 8.7}),
        ({"mass_error": {"factor": 1.1}}, {"headform_mass": 2.75}),
        ({"hood_force_scale": {"factor": 1.3}}, {"hood_force_scale": 1.3}),
        ({"sensor_filter": {"channel_class": 180.0}}, {"channel_class": 180.0}),
        (
            {"rate_dependent_hood": {"damping": 80.0, "share": 0.0}},
            {"hood_damping": 80.0, "hood_damping_onset": 0.002},
        ),
    ],
)
def test_a_recording_error_is_the_run_of_another_input(
    effects: Effects, inputs: dict[str, float]
) -> None:
    assert struck(effects).outputs == pytest.approx(struck(**inputs).outputs)


@pytest.mark.parametrize(
    ("effects", "inputs"),
    [
        ({"brake_dive": {"angle": 0.02}}, {"dive_angle": 0.03490658503988659 + 0.02}),
        ({"muscle_tone": {"factor": 2.0}}, {"neck_stiffness": 2.214, "muscle_tone": 2.0}),
        ({"speed_bias": {"factor": 1.1}}, {"impact_speed": 1.1 * CRASH_SPEED}),
    ],
)
def test_a_crash_otherwise_set_up_is_the_crash_of_another_input(
    effects: Effects, inputs: dict[str, float]
) -> None:
    assert crash(effects) == pytest.approx(crash(**inputs))


def test_a_gain_multiplies_every_sample_and_hic_with_its_power() -> None:
    # HIC goes with acceleration to the power 2.5. Effects act together.
    both = {"sensor_gain": {"factor": 1.1}, "speed_bias": {"factor": 1.05}}
    base, loud = struck(impact_speed=9.45).outputs, struck(both).outputs
    assert loud["hic15"] == pytest.approx(1.1**2.5 * base["hic15"], rel=1e-9)
    assert loud["peak_force"] == pytest.approx(base["peak_force"], rel=1e-12)
    other = crash({"sensor_gain": {"factor": 1.1}})
    assert other["hic15"] == pytest.approx(1.1**2.5 * plain()["hic15"], rel=1e-9)
    assert other["throw_distance"] == plain()["throw_distance"]


def test_a_sensor_is_off_zero_before_contact_and_clips_the_raw_signal() -> None:
    history = struck({"sensor_offset": {"offset": 4.0}}).histories["head"]
    before = history.channels["acceleration_normal"][history.time < -0.002]
    np.testing.assert_allclose(before, 4.0, atol=0.05)
    clipped = struck({"sensor_saturation": {"limit": 100.0}}, channel_class=0.0)
    assert clipped.outputs["peak_head_acceleration"] == pytest.approx(100.0)
    assert struck(channel_class=0.0).outputs["peak_head_acceleration"] > 120.0


def test_a_slow_clock_stretches_the_pulse_and_leaves_its_height() -> None:
    base, slow = (
        struck(effects, channel_class=0.0).outputs
        for effects in (None, {"time_scale": {"factor": 1.2}})
    )
    # HIC goes with time at equal heights.
    assert slow["hic15"] == pytest.approx(1.2 * base["hic15"], rel=0.01)
    name = "peak_head_acceleration"
    assert slow[name] == pytest.approx(base[name], rel=1e-3)


@pytest.mark.parametrize("size", [2, 30, 61, 500])
@pytest.mark.parametrize("channel_class", [60.0, 180.0, 1000.0])
def test_our_filter_is_that_of_scipy(size: int, channel_class: float) -> None:
    x = np.random.default_rng(size).standard_normal((size, 2))
    wa = math.tan(math.pi * channel_class * CUTOFF_FACTOR / 20_000.0)
    scale = 1.0 + math.sqrt(2.0) * wa + wa * wa
    gain = wa * wa / scale
    sections = np.array([[gain, 2 * gain, gain, 1.0, 2.0 * (wa * wa - 1.0) / scale,
                          (1.0 - math.sqrt(2.0) * wa + wa * wa) / scale]])  # fmt: skip
    theirs = sosfiltfilt(sections, x, axis=0, padlen=min(size - 1, 60))
    np.testing.assert_allclose(filter_cfc(x, 20_000.0, channel_class), theirs, atol=1e-11)


def test_bottoming_begins_at_its_clearance_and_adds_its_stiffness() -> None:
    base = struck().outputs["hood_intrusion"]
    deep = {"clearance": base + 0.001, "stiffness": 4e5, "power": 1.0}
    assert struck({"hood_bottoming": deep}).outputs == pytest.approx(struck().outputs, abs=1e-9)
    hit = struck({"hood_bottoming": deep | {"clearance": 0.03}}).outputs
    depth = hit["hood_intrusion"]
    assert 0.03 < depth < base
    below = 3600.0 - (0.055 - depth) * 1000.0 / 0.04
    assert hit["peak_force"] == pytest.approx(below + 4e5 * (depth - 0.03), rel=1e-3)
    assert abs(hit["energy_residual"]) < 1e-3


def test_powers_of_bottoming_meet_at_ten_millimetres() -> None:
    effect, model = load_effect("hood_bottoming"), load_model("headform", {"hood_curve": CURVE})
    curve = model.hood_curve({item.name: item.nominal for item in model.inputs})  # type: ignore[attr-defined]
    usual = {name: entry.input.nominal for name, entry in effect.parameters.items()}
    linear, square = (
        effect.apply(curve, usual | {"clearance": 0.03, "stiffness": 3e5, "power": power})
        for power in (1.0, 2.0)
    )
    at = np.array([0.04])
    for found in (linear, square):
        np.testing.assert_allclose(found.at(at), curve.at(at) + 3000.0, rtol=1e-9)
    assert square.at(np.array([0.06]))[0] > linear.at(np.array([0.06]))[0]


def test_a_free_form_whose_weights_are_equal_is_the_named_form() -> None:
    forces = {f"at_{depth}_mm": 480.0 for depth in (2, 5, 10, 20, 40)}
    dashpot = struck({"rate_dependent_hood": {"damping": 60.0, "share": 0.0}})
    free = struck({
        "rate_dependent_hood": {"damping": 0.0, "share": 0.0, "exponent": 1.0} | forces
    })  # fmt: skip
    for channel, values in dashpot.histories["head"].channels.items():
        np.testing.assert_allclose(free.histories["head"].channels[channel], values, rtol=1e-6)
    linear = {"clearance": 0.03, "stiffness": 3e5, "power": 1.0}
    slopes = {"to_8_mm": 1.0 + 1e-12, "beyond_8_mm": 1.0}
    named = struck({"hood_bottoming": linear})
    assert struck({"hood_bottoming": linear | slopes}).outputs == pytest.approx(
        named.outputs, rel=1e-6, nan_ok=True
    )


def test_what_is_left_out_of_an_effect_does_not_act() -> None:
    # Parameters of other forms take their defaults, not their prior medians.
    inertia = load_effect("hood_inertia")
    for name in ("stiffness", "damping_ratio", "at_2_mm"):
        assert inertia.parameters[name].input.nominal == 0.0
    for model, has in (("headform", True), ("multibody", False)):
        names = {i.name for i in load_model(model, {}, {"unloading_slope": {}}).inputs}
        assert ("unloading_slope_curvature" in names) is has
    with pytest.raises(ValueError, match="has no parameter 'growth', only factor"):
        load_model("headform", {"surface": "facet"}, {"unloading_slope": {"growth": 0.1}})


@pytest.mark.parametrize("clearance", [0.015, 0.035, 0.035 + 1e-9, 0.1])
@pytest.mark.parametrize("power", [1.0, 2.0])
def test_a_structure_below_the_hood_may_begin_at_a_knot(clearance: float, power: float) -> None:
    # Depths beyond the clearance that fall on a knot of the curve, to rounding.
    numbers = {"clearance": clearance, "stiffness": 2e5, "power": power}
    assert struck({"hood_bottoming": numbers}).status == "ok"


def test_a_yielding_a_resilient_and_a_padded_hood() -> None:
    base = struck().outputs
    yielding = struck({"hood_yield": {"force": 2000.0, "remaining": 0.02}}).outputs
    assert yielding["peak_force"] < 2000.0 + 0.02 * 3600.0
    assert yielding["hood_intrusion"] > base["hood_intrusion"]
    assert yielding["contact_duration"] > base["contact_duration"]
    # A steeper unloading is seen in the rebound alone.
    steep = struck({"unloading_slope": {"factor": 2.0}}).outputs
    assert steep["peak_force"] == pytest.approx(base["peak_force"], rel=1e-6)
    assert steep["rebound_speed"] < base["rebound_speed"]
    soft = struck({"skin_compliance": {"compliance": 2e-6}}).outputs
    assert soft["peak_force"] < base["peak_force"]
    assert soft["rebound_speed"] > base["rebound_speed"]
    assert abs(soft["energy_residual"]) < 1e-3


@pytest.mark.parametrize("exponent", [0.0, 1.0])
@pytest.mark.parametrize("speed", [4.0, 10.0])
def test_a_guide_is_felt_before_and_after_contact_and_takes_energy(
    exponent: float, speed: float
) -> None:
    # Force over mass, against the motion; the hood's force channel feels nothing of it.
    usual = struck(impact_speed=speed)
    rubbing = {"guide_friction": {"force": 50.0, "exponent": exponent}}
    run = struck(rubbing, impact_speed=speed)
    head, hood = run.histories["head"], run.histories["hood"].channels["force"]
    mass = run.inputs["headform_mass"]
    after = run.outputs["rebound_speed"]

    def felt(rate: float) -> float:
        return 50.0 * (rate / 8.0) ** exponent / mass / 9.80665

    acceleration = head.channels["acceleration_normal"]
    assert acceleration[head.time < -0.003] == pytest.approx(felt(speed), rel=1e-3)
    assert acceleration[-20:] == pytest.approx(-felt(after), rel=1e-3)
    assert not np.any(hood[head.time < 0.0])
    assert after < usual.outputs["rebound_speed"]
    assert abs(run.outputs["energy_residual"]) < 1e-3


def test_a_guide_and_a_hood_with_mass_keep_the_balance_of_momentum() -> None:
    """The reading times the mass is the hood's force and the guide's: a hood that moves along."""
    for inertia in ({"mass": 0.3, "depth": 0.008}, {"mass": 0.3, "stiffness": 3e6,
                                                    "damping_ratio": 0.1}):  # fmt: skip
        run = struck(
            {"hood_inertia": inertia, "guide_friction": {"force": 80.0}}, channel_class=0.0
        )
        head, hood = run.histories["head"], run.histories["hood"].channels["force"]
        time, speed = head.time, head.channels["velocity_normal"]
        mass = run.inputs["headform_mass"]
        pressed = hood > 0.0
        impulse = np.trapezoid(mass * 9.80665 * head.channels["acceleration_normal"], time)
        # The guide's impulses of as much time before the contact as after it cancel.
        assert impulse == pytest.approx(mass * (speed[0] - speed[-1]), rel=0.01)
        felt = mass * 9.80665 * head.channels["acceleration_normal"] - hood
        inward = pressed & (speed > 0.1)
        outward = pressed & (speed < -0.1)
        np.testing.assert_allclose(felt[inward], 80.0, rtol=1e-6)
        np.testing.assert_allclose(felt[outward], -80.0, rtol=1e-6)


@pytest.mark.parametrize("exponent", [0.3, 1.0])
def test_the_rate_raises_the_force_by_its_share(exponent: float) -> None:
    # At equal penetration early in the pulse, where the rate is nearly that of the impact.
    effects = {"rate_dependent_hood": {"damping": 0.0, "share": 0.2, "exponent": exponent}}
    for speed in (4.0, 8.0, 16.0):
        forces = []
        for chosen in (None, effects):
            hood = struck(chosen, channel_class=0.0, impact_speed=speed).histories["hood"]
            force, depth = hood.channels["force"], hood.channels["penetration"]
            rising = slice(0, int(force.argmax()))
            forces.append(float(np.interp(0.002, depth[rising], force[rising])))
        expected = 1.0 + 0.2 * (speed / 8.0) ** exponent
        assert forces[1] / forces[0] == pytest.approx(expected, rel=0.01)


def heavy_hood(mass: float, speed: float) -> Run:
    """Strike a hood without stiffness that has a mass."""
    options = {"hood_curve": [[0.0, 0.0], [1.0, 0.001]], "channel_class": 0.0}
    model = load_model("headform", options, {"hood_inertia": {"mass": mass, "depth": 0.01}})
    return model.run({"impact_speed": speed, "headform_mass": 2.5})


@pytest.mark.parametrize("mass", [0.2, 1.0])
def test_the_hoods_mass_takes_its_share_of_the_momentum(mass: float) -> None:
    # m v = (m + M) u once all of the hood's mass is reached (inelastic impact).
    run = heavy_hood(mass, 8.0)
    far = run.histories["hood"].channels["penetration"] > 0.05
    speed = run.histories["head"].channels["velocity_normal"][far]
    np.testing.assert_allclose(speed, 2.5 * 8.0 / (2.5 + mass), rtol=2e-4)


def test_the_first_peak_of_a_heavy_hood_grows_with_the_square_of_the_speed() -> None:
    slow, fast = (heavy_hood(0.5, v).histories["hood"].channels["force"].max() for v in (5.0, 10.0))
    assert fast / slow == pytest.approx(4.0, rel=1e-2)


@pytest.mark.parametrize("model", ["multibody", "planar"])
def test_a_wet_road_lengthens_the_throw_of_those_who_reach_it_and_nothing_before(
    model: str,
) -> None:
    dry, reached, missed = (
        load_model(model, {}, effects).run({}).outputs
        for effects in (None, *({"wet_road": {"place": p, "factor": 0.5}} for p in (6.0, 100.0)))
    )
    assert reached["throw_distance"] > dry["throw_distance"] + 1.0
    assert missed == dry
    for name in ("hic15", "wad", "head_impact_time"):
        assert reached[name] == dry[name]


def test_late_braking_adds_the_way_of_the_delay() -> None:
    speed, delay = 11.0, 0.4
    motion = braking_motion(speed, 0.7, 0.0, 1.7)._replace(onset=delay)
    expected = speed * delay + speed**2 / (2.0 * 0.7 * GRAVITY)
    assert stopping_distance(motion) == pytest.approx(expected, rel=1e-12)
    car = np.zeros(6)
    car_state(motion, 100.0, car)
    assert car[0] == pytest.approx(expected, rel=1e-9)
    car_state(motion, 0.5 * delay, car)
    assert car[[0, 3]] == pytest.approx([0.5 * speed * delay, speed])


@pytest.mark.parametrize("angle", [-0.05, 0.05])
def test_a_falling_road_lengthens_car_and_throw(angle: float) -> None:
    found = crash({"road_slope": {"angle": angle}})
    braking = 0.7 * GRAVITY - GRAVITY * math.sin(angle)
    assert found["car_stopping_distance"] == pytest.approx(CRASH_SPEED**2 / (2.0 * braking))
    longer = found["throw_distance"] - plain()["throw_distance"]
    assert math.copysign(1.0, longer) == math.copysign(1.0, angle)


def test_more_returned_energy_is_a_longer_throw() -> None:
    stiff, springy = (crash({"restitution": {"factor": f}})["throw_distance"] for f in (0.3, 3.0))
    assert springy > stiff


def test_a_braced_body_does_not_swing_its_limbs() -> None:
    body = build_body(7.5, 1.18, 21.8, 3.26)
    running, braced = (
        running_posture(body, gait_phase=0.3, facing_angle=1.6, running_speed=2.8, braced=share)
        for share in (0.0, 1.0)
    )
    assert np.abs(braced.angular_velocity).max() == 0.0
    assert np.abs(running.angular_velocity).max() > 1.0
    left, right = (
        braced.orientation[SEGMENTS.index(f"upper_arm_{side}")] for side in ("left", "right")
    )
    np.testing.assert_allclose(left, right, atol=1e-12)


def test_a_headform_impact_is_kept_for_other_records_of_it_and_for_nothing_else() -> None:
    effects: Effects = {"sensor_gain": {}, "sensor_saturation": {}, "hood_inertia": {}}
    one = load_model("headform", {}, effects)
    for change in (
        {},
        {"sensor_gain_factor": 1.2},
        {"sensor_saturation_limit": 60.0},
        {"hood_inertia_mass": 0.5},
        {"impact_speed": 9.0},
        {"impact_speed": 9.0, "headform_mass": 3.5},
        {"hood_stiffness": 0.9},
        {},
    ):
        alone = load_model("headform", {}, effects).run(change)
        again = one.run(change)
        assert again.outputs == alone.outputs
        for group, history in again.histories.items():
            for name, values in history.channels.items():
                np.testing.assert_array_equal(values, alone.histories[group].channels[name])


@pytest.mark.parametrize(("name", "knots"), [("headform", 16), ("multibody", 8)])
def test_effects_have_room_for_their_knots_beside_the_longest_curve(name: str, knots: int) -> None:
    """A curve of 16 knots used to end a run with effects in an error."""
    depths = np.linspace(0.0, 0.09, knots)
    forces = 5500.0 * (1.0 - np.exp(-depths / 0.03))
    curve = [list(pair) for pair in zip(depths.tolist(), forces.tolist(), strict=True)]
    effects = {
        "hood_yield": {"force": 4000.0, "kept_to_10_percent": 0.6, "kept_to_25_percent": 0.3},
        "hood_bottoming": {"clearance": 0.03, "power": 2.0},
    }
    run = load_model(name, {"hood_curve": curve}, effects).run({})
    assert run.status == "ok"
    assert run.outputs["hic15"] != load_model(name, {"hood_curve": curve}).run({}).outputs["hic15"]
