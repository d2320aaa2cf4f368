"""Headform model: what it refuses, random inputs, batches."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from models.protocol import Model
from models.registry import load_model

LINEAR = [[0.0, 0.0], [0.1, 1e4]]
"""100 kN/m."""
RAW: dict[str, Any] = {"hood_curve": LINEAR, "channel_class": 0.0}
QUIET = settings(
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow],
)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("headform_mass", -2.5),
        ("headform_mass", 0.0),
        ("impact_speed", 500.0 / 3.6),
        ("impact_speed", 0.0),
        ("impact_angle", -0.1),
        ("impact_angle", 1.5),
        ("hood_stiffness", 1.2),
        ("hood_stiffness", -0.1),
        ("hood_unloading_ratio", 1.0),
        ("hood_damping", -1.0),
        ("friction_body_car", math.nan),
        ("impact_speed", math.nan),
        ("headform_diameter", math.inf),
    ],
)
def test_inputs_outside_their_range_are_named(name: str, value: float) -> None:
    model = load_model("headform")
    item = next(item for item in model.inputs if item.name == name)
    message = rf"{name}.*{item.low:g} to {item.high:g}"
    with pytest.raises(ValueError, match=message):
        model.run({name: value})
    rows = np.array([[entry.nominal for entry in model.inputs]] * 3)
    rows[1, [entry.name for entry in model.inputs].index(name)] = value
    with pytest.raises(ValueError, match=message):
        model.run_batch(rows)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"headform": "dummy"}, "no headform 'dummy': choose one of eevc_child"),
        ({"headform": ""}, "no headform"),
        ({"hood_curve": LINEAR, "vehicle": "family_car_1990s"}, "not several"),
        ({"hood_curve": LINEAR, "corridor": "working_curves"}, "not several"),
        ({"corridor": "working_curves", "vehicle": "family_car_1990s"}, "not several"),
        ({"hood_curve": [[0.0, 0.0]]}, "hood_curve: .*knots"),
        ({"hood_curve": []}, "hood_curve: .*pairs"),
        ({"hood_curve": [[0.0, 0.0, 0.0], [0.1, 1e4, 1.0]]}, "hood_curve: .*pairs"),
        ({"hood_curve": [[0.0, 0.0], [0.1]]}, "hood_curve: "),
        ({"hood_curve": [[0.0, 10.0], [0.1, 1e4]]}, r"hood_curve: .*\(0, 0\)"),
        ({"hood_curve": [[0.0, 0.0], [0.1, 1e4], [0.2, 9e3]]}, "hood_curve: .*rises"),
        ({"hood_curve": [[0.0, 0.0], [0.1, math.nan]]}, "hood_curve: .*finite"),
        ({"hood_curve": [[0.01 * k, 100.0 * k] for k in range(17)]}, "hood_curve: .*2 to 16"),
        ({"hood_curve": "steel"}, "hood_curve: "),
        ({"zone": "door"}, "family_car_1990s.*no zone 'door'; it has .*hood"),
        ({"corridor": "working_curves", "zone": "door"}, "no zone 'door'; it has hood"),
        ({"corridor": "steel"}, "corridor 'steel': choose one of working_curves"),
        ({"corridor": "/nowhere/steel.toml"}, "corridor '/nowhere/steel.toml': "),
        ({"vehicle": "tank"}, "no vehicle 'tank'"),
        ({"skin": "leather"}, "skin must be"),
        ({"channel_class": -1.0}, "channel_class"),
        ({"channel_class": 1e5}, "channel_class"),
        ({"channel_class": math.nan}, "channel_class"),
    ],
)  # fmt: skip
def test_wrong_options_are_refused_in_one_line(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        load_model("headform", options)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("corridor", [5.0, ""])
def test_a_corridor_that_is_no_name_is_refused(corridor: Any) -> None:
    # A study file may give any option as a number (mcstudy.studyfile.config.ModelChoice).
    with pytest.raises((ValueError, TypeError)):
        load_model("headform", {"corridor": corridor})


def test_rows_of_another_shape_are_refused() -> None:
    model = load_model("headform")
    for rows in (np.zeros((2, 3)), np.zeros(10), np.zeros((1, 11))):
        with pytest.raises(ValueError, match=r"\(n, 10\)"):
            model.run_batch(rows)
    assert model.run_batch(np.zeros((0, 10))).outputs.shape == (0, len(model.outputs))


# -- random inputs ---------------------------------------------------------------------------

MODELS: dict[str, Model] = {
    "car": load_model("headform"),
    "curve": load_model("headform", RAW),
    "skin": load_model("headform", {"corridor": "working_curves", "skin": "vinyl"}),
}


@st.composite
def any_inputs(draw: st.DrawFn, model: Model) -> dict[str, float]:
    """Return inputs over their ranges, the wide ones on a logarithmic scale."""
    values = {}
    for item in model.inputs:
        share = draw(st.floats(0.0, 1.0))
        if item.low > 0.0 and item.high > 100.0 * item.low:
            value = item.low * (item.high / item.low) ** share
        else:
            value = item.low + share * (item.high - item.low)
        values[item.name] = min(max(value, item.low), item.high)
    return values


@QUIET
@given(st.data())
def test_any_input_gives_numbers_that_make_sense(data: st.DataObject) -> None:
    model = MODELS[data.draw(st.sampled_from(sorted(MODELS)))]
    values = data.draw(any_inputs(model))
    run = model.run(values)
    assert run.status in ("ok", "time_limit")
    if run.status == "time_limit":
        assert all(math.isnan(value) for value in run.outputs.values())
        return
    found = run.outputs
    assert all(math.isfinite(value) for value in found.values())
    assert found["hood_intrusion"] > 0.0
    assert 0.0 <= found["permanent_dent"] < found["hood_intrusion"]
    assert 0.0 <= found["hic15"] <= found["hic36"] * (1.0 + 1e-12)
    assert 0.0 <= found["clip_3ms_consecutive"] <= found["clip_3ms"] * (1.0 + 1e-12)
    assert found["clip_3ms"] <= found["peak_head_acceleration"]
    normal = values["impact_speed"] * math.cos(values["impact_angle"])
    assert 0.0 <= found["rebound_speed"] <= normal * (1.0 + 1e-6)
    assert 0.0 < found["contact_duration"] <= 1.0


@QUIET
@given(st.data())
def test_energy_is_accounted_for(data: st.DataObject) -> None:
    # Without friction, and with a damping that fades in: the two other cases follow below.
    model = MODELS[data.draw(st.sampled_from(sorted(MODELS)))]
    values = data.draw(any_inputs(model)) | {"friction_body_car": 0.0}
    assume(values["hood_damping"] == 0.0 or values["hood_damping_onset"] > 0.0)
    run = model.run(values)
    if run.status == "ok":
        assert abs(run.outputs["energy_residual"]) < 1e-6


@pytest.mark.parametrize(
    ("angle", "scale"),
    # A hood of 100 kN/m; one of a hundred times that, whose contact takes 1 ms.
    [(1.2, 1.0), (1.2, 100.0)],
)
def test_energy_is_accounted_for_in_a_sliding_impact(angle: float, scale: float) -> None:
    values = {"impact_angle": angle, "hood_force_scale": scale, "friction_body_car": 0.25}
    assert abs(MODELS["curve"].run(values).outputs["energy_residual"]) < 1e-6


@pytest.mark.parametrize(("mass", "damping"), [(2.5, 1000.0), (0.5, 10000.0), (0.1, 10000.0)])
def test_energy_is_accounted_for_under_damping_at_once(mass: float, damping: float) -> None:
    values = {"headform_mass": mass, "hood_damping": damping, "hood_damping_onset": 0.0}
    assert abs(MODELS["curve"].run(values).outputs["energy_residual"]) < 1e-6


# -- batches ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
def test_a_row_is_the_run_of_its_inputs_and_of_nothing_else(name: str) -> None:
    model = MODELS[name]
    rng = np.random.default_rng(5)
    low = np.array([item.low for item in model.inputs])
    high = np.array([item.high for item in model.inputs])
    nominal = np.array([item.nominal for item in model.inputs])
    rows = nominal + (low + (high - low) * rng.random((24, low.size)) - nominal) * 0.5
    # The last: so soft and heavy that the contact takes longer than a second.
    names = [item.name for item in model.inputs]
    rows[-1] = nominal
    rows[-1, [names.index("headform_mass"), names.index("hood_force_scale")]] = 20.0, 0.001
    rows[-1, [names.index("impact_speed"), names.index("hood_unloading_ratio")]] = 0.2, 1.01
    batch = model.run_batch(rows)
    assert batch.outputs.shape == (24, len(model.outputs))
    assert batch.status[-1] == "time_limit"
    assert set(batch.status[:-1]) == {"ok"}
    for row, found, status in zip(rows, batch.outputs, batch.status, strict=True):
        run = model.run(dict(zip(names, row, strict=True)))
        assert run.status == status
        np.testing.assert_array_equal(found, list(run.outputs.values()))
    order = rng.permutation(24)
    shuffled = model.run_batch(rows[order])
    np.testing.assert_array_equal(shuffled.outputs, batch.outputs[order])
    assert shuffled.status == [batch.status[k] for k in order]
    np.testing.assert_array_equal(model.run_batch(rows[3:4]).outputs[0], batch.outputs[3])
