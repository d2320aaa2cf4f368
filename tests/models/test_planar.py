"""The planar crash as a whole, through the model protocol."""

import math
from collections.abc import Callable
from typing import Any

import joblib
import numpy as np
import pytest

from models.crash.model import TICK
from models.effects.registry import effects_of, load_effect
from models.planar.model import PlanarModel
from models.protocol import Run
from models.registry import load_model, model_names
from models.rotation import matrix_of
from models.vehicle.motion import braking_motion, stopping_distance

Array = np.ndarray


@pytest.fixture(scope="module")
def model() -> PlanarModel:
    return PlanarModel()


@pytest.fixture(scope="module")
def nominal(model: PlanarModel) -> Run:
    return model.run({})


def rows_around_nominal(model: PlanarModel, n: int) -> Array:
    rng = np.random.default_rng(7)
    rows = np.tile([item.nominal for item in model.inputs], (n, 1))
    names = [item.name for item in model.inputs]
    rows[:, names.index("gait_phase")] = rng.uniform(size=n)
    rows[:, names.index("impact_speed")] = rng.uniform(7.0, 14.0, n)
    rows[:, names.index("facing_angle")] = rng.uniform(-math.pi, math.pi, n)
    rows[:, names.index("stature")] = rng.uniform(1.12, 1.35, n)
    return rows


def outputs_of(rows: Array) -> Array:
    return PlanarModel().run_batch(rows).outputs


def test_the_nominal_run_lies_near_the_case_without_a_calibration_of_its_own(nominal: Run) -> None:
    # Table 1 of the case, multibody row, and the span of HIC15 of Table 2 with some room.
    assert nominal.status == "ok"
    assert nominal.end_reason == "rest_on_road"
    assert nominal.outputs["throw_distance"] == pytest.approx(13.5, abs=2.0)
    assert nominal.outputs["wad"] == pytest.approx(1.32, abs=0.08)
    assert 900.0 <= nominal.outputs["hic15"] <= 2000.0


def test_nominal_values_are_those_of_the_spatial_model(model: PlanarModel) -> None:
    spatial = load_model("multibody")
    assert [(i.name, i.nominal, i.low, i.high, i.unit) for i in model.inputs] == [
        (i.name, i.nominal, i.low, i.high, i.unit) for i in spatial.inputs
    ]
    units = {item.name: item.unit for item in spatial.outputs}
    assert {item.name: item.unit for item in model.outputs}.items() <= units.items()
    assert "ground_hic15" not in {item.name for item in model.outputs}


@pytest.mark.parametrize("gait_phase", [0.1, 0.4844, 0.8])
@pytest.mark.parametrize("facing_angle", [0.0, 1.651, math.pi])
def test_hic_has_a_limit_as_the_step_shrinks(gait_phase: float, facing_angle: float) -> None:
    values = {"gait_phase": gait_phase, "facing_angle": facing_angle}
    coarse, fine = (PlanarModel(tick=t).run(values).outputs for t in (TICK, TICK / 4.0))
    assert coarse["hic15"] == pytest.approx(fine["hic15"], rel=0.05)
    assert coarse["head_impact_speed"] == pytest.approx(fine["head_impact_speed"], rel=0.02)


def test_what_the_plane_makes_nothing_of_is_marked_and_changes_no_bit(model: PlanarModel) -> None:
    ignored = [item for item in model.inputs if item.ignored]
    assert [item.name for item in ignored] == ["lateral_offset", "yaw_rate"]
    rows = np.tile([item.nominal for item in model.inputs], (2, 1))
    for item in ignored:
        rows[1, [i.name for i in model.inputs].index(item.name)] = item.high
    found = model.run_batch(rows).outputs
    np.testing.assert_array_equal(found[0], found[1])
    assert not any(item.ignored for item in load_model("multibody").inputs)


def test_a_row_has_the_same_bits_alone_in_a_batch_and_in_another_process(
    model: PlanarModel,
) -> None:
    rows = rows_around_nominal(model, 6)
    together = model.run_batch(rows).outputs
    for k in (5, 0, 3):
        np.testing.assert_array_equal(outputs_of(rows[k : k + 1])[0], together[k])
    with joblib.parallel_config(backend="loky", n_jobs=2):
        apart = joblib.Parallel()(joblib.delayed(outputs_of)(part) for part in np.split(rows, 3))
    np.testing.assert_array_equal(np.concatenate(apart), together)


def test_run_batch_and_observe_give_the_same_numbers(model: PlanarModel, nominal: Run) -> None:
    batch = model.run_batch(np.array([[item.nominal for item in model.inputs]]))
    named = dict(zip((o.name for o in model.outputs), batch.outputs[0], strict=True))
    assert named == dict(nominal.outputs)
    seen = model.observe({}, ["head_acceleration"], ["hic15"])
    assert seen.outputs == {"hic15": nominal.outputs["hic15"]}
    np.testing.assert_array_equal(
        seen.histories["head"].channels["acceleration"],
        nominal.histories["head"].channels["acceleration"],
    )


def test_in_its_own_plane_it_follows_the_spatial_model() -> None:
    # A child that runs ahead of the car's middle moves in the plane by itself; what is left is
    # the method, and the arms, which the plane lets pass.
    values = {"facing_angle": 0.0, "lateral_offset": 0.0, "yaw_rate": 0.0}
    plane, space = (load_model(name).run(values).outputs for name in ("planar", "multibody"))
    for name, tolerance in (
        ("wad", 0.03), ("head_impact_time", 0.15), ("throw_distance", 0.15), ("launch_speed", 0.1),
    ):  # fmt: skip
        assert plane[name] == pytest.approx(space[name], rel=tolerance), name


def test_throw_grows_with_impact_speed_and_stays_near_searle(model: PlanarModel) -> None:
    # Searle 1983, as for the spatial model: v_min = sqrt(2 mu g s / (1 + mu^2)).
    speeds = np.array([20.0, 40.0, 60.0]) / 3.6
    throws = [model.run({"impact_speed": v}).outputs["throw_distance"] for v in speeds]
    assert throws[0] < throws[1] < throws[2]
    for v, s in zip(speeds, throws, strict=True):
        longest = v**2 * (1.0 + 0.6**2) / (2.0 * 0.6 * 9.80665)
        assert 0.5 * longest < s < 1.3 * longest


def test_the_car_is_where_it_brakes_to(nominal: Run) -> None:
    assert nominal.scene is not None
    motion = braking_motion(40.0 / 3.6, 0.7, 0.0, 1.7)
    for time, place in zip(nominal.scene.time, nominal.scene.car, strict=True):
        t = min(time, motion.speed / motion.deceleration)
        expected = motion.speed * t - 0.5 * motion.deceleration * t**2
        assert place == pytest.approx([expected, 0.0, 0.0], abs=1e-6)
    assert nominal.outputs["car_stopping_distance"] == pytest.approx(stopping_distance(motion))


def test_the_scene_is_the_spatial_body_turning_about_y(nominal: Run) -> None:
    scene, spatial = nominal.scene, load_model("multibody").run({}).scene
    assert scene is not None and spatial is not None
    np.testing.assert_allclose(scene.orientation[0], spatial.orientation[0], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(scene.orientation, axis=2), 1.0, atol=1e-12)
    np.testing.assert_array_equal(np.ptp(scene.centre[:, :, 1], axis=0), 0.0)
    for k in (0, 4, 13):
        turn = matrix_of(scene.orientation[60, k]) @ matrix_of(scene.orientation[0, k]).T
        np.testing.assert_allclose(turn[1], [0.0, 1.0, 0.0], atol=1e-12)


def test_the_heads_signals_end_where_the_rigid_road_begins(nominal: Run) -> None:
    assert set(nominal.histories) == {"head", "contact_force", "centre_of_gravity"}
    head, centre = nominal.histories["head"], nominal.histories["centre_of_gravity"]
    assert head.time[-1] <= nominal.outputs["ground_time"]
    assert centre.time[-1] == pytest.approx(nominal.outputs["crash_duration"], abs=1e-3)
    assert "road" not in nominal.histories["contact_force"].channels
    assert "road_force" not in head.channels
    peak = nominal.outputs["peak_head_acceleration"]
    assert head.channels["acceleration"].max() == pytest.approx(peak)
    assert peak < 300.0


@pytest.mark.parametrize("name", effects_of("planar"))
def test_an_effect_at_its_value_for_none_changes_no_bit(name: str, nominal: Run) -> None:
    effect = load_effect(name)
    off = {key: entry.none for key, entry in effect.parameters.items()}
    assert load_model("planar", {}, {name: off}).run({}).outputs == nominal.outputs


def test_effects_of_the_road_reach_pymunks_road(nominal: Run) -> None:
    def throw(**effects: dict[str, float]) -> float:
        return load_model("planar", {}, effects).run({}).outputs["throw_distance"]

    plain = nominal.outputs["throw_distance"]
    assert throw(wet_road={"place": 8.0, "factor": 0.4}) > plain + 1.0
    assert throw(wet_road={"place": 100.0, "factor": 0.4}) == plain
    assert throw(restitution={"factor": 2.0}) != plain


def test_an_impossible_body_is_a_status(model: PlanarModel) -> None:
    run = model.run({"body_mass": 9.5, "head_mass": 6.0})
    assert run.status == "impossible_body"
    assert all(math.isnan(value) for value in run.outputs.values())


@pytest.mark.parametrize("wrong", [{"tick": 1e-3}, {"vehicle": "tank"}, {"effects": {"magic": {}}}])
def test_wrong_options_are_refused(wrong: dict[str, Any]) -> None:
    build: Callable[..., PlanarModel] = PlanarModel
    with pytest.raises(ValueError, match=r"tick|tank|magic"):
        build(**wrong)


def test_it_is_registered() -> None:
    assert "planar" in model_names()
    assert load_model("planar").name == "planar"


def test_a_neck_that_stretches_unburdens_the_head() -> None:
    # The stiffer the neck, the more of the body the hood feels and the shorter the way of the head.
    soft, stiff = (
        load_model("planar").run({"neck_tension_stiffness": k}).outputs for k in (0.4, 4.0)
    )
    assert stiff["effective_head_mass"] > soft["effective_head_mass"] + 0.05
    assert stiff["wad"] < soft["wad"] - 0.01


def test_joints_that_yield_do_not_lose_their_limbs() -> None:
    # Steps of 2 ms on the road, twenty times the finest: the points stay within their ranges.
    scene = load_model("planar").run({}).scene
    assert scene is not None
    chest, arm = scene.names.index("chest"), scene.names.index("upper_arm_left")
    neck, head = scene.names.index("neck"), scene.names.index("head")
    for inner, outer in ((neck, head), (chest, arm)):
        apart = np.linalg.norm(scene.centre[:, outer] - scene.centre[:, inner], axis=1)
        largest = scene.semi_axes[inner].max() + scene.semi_axes[outer].max() + 0.05
        assert apart.max() < largest
