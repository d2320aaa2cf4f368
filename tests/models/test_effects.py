"""Effects of the headform: off they do nothing, on they do what their physics says."""

from collections.abc import Mapping

import numpy as np
import pytest

from models.effects.registry import EFFECTS, effects_of, load_effect
from models.protocol import Run
from models.registry import load_model

CURVE = [[0.0, 0.0], [0.015, 2600.0], [0.055, 3600.0], [0.1, 5200.0]]


def struck(
    effects: Mapping[str, Mapping[str, float]] | None = None,
    *,
    channel_class: float = 1000.0,
    **inputs: float,
) -> Run:
    options = {"hood_curve": CURVE, "channel_class": channel_class}
    return load_model("headform", options, effects).run({"impact_speed": 9.0} | inputs)


@pytest.mark.parametrize("name", effects_of("headform"))
def test_an_effect_at_its_value_for_none_changes_no_bit(name: str) -> None:
    effect = load_effect(name)
    off = struck({name: {key: entry.none for key, entry in effect.parameters.items()}})
    assert off.outputs == struck().outputs


@pytest.mark.parametrize("name", effects_of("headform"))
def test_parameters_are_inputs_of_the_extended_model(name: str) -> None:
    effect = load_effect(name)
    model = load_model("headform", {"hood_curve": CURVE}, {name: {}})
    plain = load_model("headform", {"hood_curve": CURVE})
    added = [item.name for item in model.inputs[len(plain.inputs) :]]
    assert added == [f"{name}_{key}" for key in effect.parameters]
    for item in model.inputs[len(plain.inputs) :]:
        assert item.low <= item.nominal <= item.high
    # Given in the study file or as an input: the same run.
    key, entry = next(iter(effect.parameters.items()))
    value = float(np.clip(entry.prior.quantile(0.7), entry.input.low, entry.input.high))
    assert struck({name: {key: value}}).outputs == pytest.approx(
        struck({name: {}}, **{f"{name}_{key}": value}).outputs
    )


@pytest.mark.parametrize("name", effects_of("headform"))
def test_every_effect_says_what_it_is_and_what_it_looks_like(name: str) -> None:
    effect = load_effect(name)
    assert (effect.title and effect.signature and effect.separated_by) or not effect.confusable
    assert "[" in effect.source or "SAE" in effect.source
    assert set(effect.confusable) <= set(EFFECTS)
    for entry in effect.parameters.values():
        assert entry.input.low <= entry.none <= entry.input.high


def test_a_gain_multiplies_every_sample_and_hic_with_its_power() -> None:
    # HIC goes with acceleration to the power 2.5.
    base, loud = struck(), struck({"sensor_gain": {"factor": 1.1}})
    assert loud.outputs["hic15"] == pytest.approx(1.1**2.5 * base.outputs["hic15"], rel=1e-9)
    assert loud.outputs["peak_force"] == base.outputs["peak_force"]


def test_recording_errors_are_runs_of_other_inputs() -> None:
    faster = struck({"speed_bias": {"factor": 1.05}})
    assert faster.outputs == pytest.approx(struck(impact_speed=9.0 * 1.05).outputs)
    heavier = struck({"mass_error": {"factor": 1.1}})
    assert heavier.outputs == pytest.approx(struck(headform_mass=2.75).outputs)
    stiffer = struck({"hood_force_scale": {"factor": 1.3}})
    assert stiffer.outputs == pytest.approx(struck(hood_force_scale=1.3).outputs)


def test_an_offset_is_there_before_contact() -> None:
    history = struck({"sensor_offset": {"offset": 4.0}}).histories["head"]
    before = history.channels["acceleration_normal"][history.time < -0.002]
    np.testing.assert_allclose(before, 4.0, atol=0.05)


def test_saturation_clips_the_raw_signal() -> None:
    clipped = struck({"sensor_saturation": {"limit": 100.0}}, channel_class=0.0)
    assert clipped.outputs["peak_head_acceleration"] == pytest.approx(100.0)
    assert struck(channel_class=0.0).outputs["peak_head_acceleration"] > 120.0


def test_another_filter_class_is_that_of_the_option() -> None:
    other = struck({"sensor_filter": {"channel_class": 180.0}})
    assert other.outputs == pytest.approx(struck(channel_class=180.0).outputs)


def test_a_slow_clock_stretches_the_pulse_and_leaves_its_height() -> None:
    base, slow = (struck(effects, channel_class=0.0) for effects in
                  (None, {"time_scale": {"factor": 1.2}}))  # fmt: skip
    # HIC goes with time at equal heights.
    assert slow.outputs["hic15"] == pytest.approx(1.2 * base.outputs["hic15"], rel=0.01)
    assert slow.outputs["peak_head_acceleration"] == pytest.approx(
        base.outputs["peak_head_acceleration"], rel=1e-3
    )


def test_bottoming_begins_at_its_clearance_and_adds_its_stiffness() -> None:
    base = struck().outputs["hood_intrusion"]
    deep = {"clearance": base + 0.001, "stiffness": 4e5, "power": 1.0}
    assert struck({"hood_bottoming": deep}).outputs == pytest.approx(struck().outputs, abs=1e-9)
    hit = struck({"hood_bottoming": deep | {"clearance": 0.03}})
    depth = hit.outputs["hood_intrusion"]
    assert 0.03 < depth < base
    below = 3600.0 - (0.055 - depth) * 1000.0 / 0.04
    assert hit.outputs["peak_force"] == pytest.approx(below + 4e5 * (depth - 0.03), rel=1e-3)
    assert abs(hit.outputs["energy_residual"]) < 1e-3


def test_powers_of_bottoming_meet_at_ten_millimetres() -> None:
    effect = load_effect("hood_bottoming")
    model = load_model("headform", {"hood_curve": CURVE})
    curve = model.hood_curve({item.name: item.nominal for item in model.inputs})  # type: ignore[attr-defined]
    linear, square = (
        effect.apply(curve, {"clearance": 0.03, "stiffness": 3e5, "power": power})
        for power in (1.0, 2.0)
    )
    at = np.array([0.04])
    np.testing.assert_allclose(linear.at(at), curve.at(at) + 3000.0, rtol=1e-9)
    np.testing.assert_allclose(square.at(at), curve.at(at) + 3000.0, rtol=1e-9)
    assert square.at(np.array([0.06]))[0] > linear.at(np.array([0.06]))[0]


def test_a_yielding_hood_has_a_plateau() -> None:
    yielding = struck({"hood_yield": {"force": 2000.0, "remaining": 0.02}})
    base = struck()
    assert yielding.outputs["peak_force"] < 2000.0 + 0.02 * 3600.0
    assert yielding.outputs["hood_intrusion"] > base.outputs["hood_intrusion"]
    assert yielding.outputs["contact_duration"] > base.outputs["contact_duration"]


def test_unloading_slope_is_seen_in_the_rebound_alone() -> None:
    steep = struck({"unloading_slope": {"factor": 2.0}})
    base = struck()
    assert steep.outputs["peak_force"] == pytest.approx(base.outputs["peak_force"], rel=1e-6)
    assert steep.outputs["rebound_speed"] < base.outputs["rebound_speed"]


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
        assert forces[1] / forces[0] == pytest.approx(
            1.0 + 0.2 * (speed / 8.0) ** exponent, rel=0.01
        )


def test_a_dashpot_is_the_damping_of_the_base_law() -> None:
    dashpot = struck({"rate_dependent_hood": {"damping": 80.0, "share": 0.0}})
    assert dashpot.outputs == pytest.approx(
        struck(hood_damping=80.0, hood_damping_onset=0.002).outputs
    )


def test_a_soft_skin_softens_the_start_and_springs_back() -> None:
    soft = struck({"skin_compliance": {"compliance": 2e-6}})
    base = struck()
    assert soft.outputs["peak_force"] < base.outputs["peak_force"]
    assert soft.outputs["rebound_speed"] > base.outputs["rebound_speed"]
    assert abs(soft.outputs["energy_residual"]) < 1e-3


@pytest.mark.parametrize("mass", [0.2, 1.0])
def test_the_hoods_mass_takes_its_share_of_the_momentum(mass: float) -> None:
    # A hood without stiffness: m v = (m + M) u once all of its mass is reached (inelastic impact).
    options = {"hood_curve": [[0.0, 0.0], [1.0, 0.001]], "channel_class": 0.0}
    effects = {"hood_inertia": {"mass": mass, "depth": 0.01}}
    run = load_model("headform", options, effects).run({"impact_speed": 8.0, "headform_mass": 2.5})
    head, hood = run.histories["head"], run.histories["hood"]
    speed = head.channels["velocity_normal"]
    far = hood.channels["penetration"] > 0.05
    np.testing.assert_allclose(speed[far], 2.5 * 8.0 / (2.5 + mass), rtol=2e-4)


def test_the_first_peak_of_a_heavy_hood_grows_with_the_square_of_the_speed() -> None:
    options = {"hood_curve": [[0.0, 0.0], [1.0, 0.001]], "channel_class": 0.0}
    effects = {"hood_inertia": {"mass": 0.5, "depth": 0.01}}
    model = load_model("headform", options, effects)
    slow, fast = (
        model.run({"impact_speed": speed}).histories["hood"].channels["force"].max()
        for speed in (5.0, 10.0)
    )
    assert fast / slow == pytest.approx(4.0, rel=1e-2)


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ({"hood_botoming": {}}, "no effect 'hood_botoming'; there are speed_bias"),
        ({"hood_bottoming": {"depth": 0.1}}, "has no parameter 'depth', only clearance"),
        ({"hood_bottoming": {"clearance": 3.0}}, r"hood_bottoming.clearance: 3 m is outside"),
        ({"sensor_gain": {"factor": float("nan")}}, "is outside"),
    ],
)  # fmt: skip
def test_what_cannot_be_switched_on_is_refused(
    effects: dict[str, dict[str, float]], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        load_model("headform", {"hood_curve": CURVE}, effects)


def test_effects_act_together() -> None:
    both = struck({"sensor_gain": {"factor": 1.1}, "speed_bias": {"factor": 1.05}})
    assert both.outputs["hic15"] == pytest.approx(
        1.1**2.5 * struck(impact_speed=9.45).outputs["hic15"], rel=1e-9
    )


@pytest.mark.parametrize("clearance", [0.015, 0.035, 0.035 + 1e-9, 0.1])
@pytest.mark.parametrize("power", [1.0, 2.0])
def test_a_structure_below_the_hood_may_begin_at_a_knot(clearance: float, power: float) -> None:
    # Depths beyond the clearance that fall on a knot of the curve, to rounding.
    numbers = {"clearance": clearance, "stiffness": 2e5, "power": power}
    assert struck({"hood_bottoming": numbers}).status == "ok"
