"""The contract of a model (models/protocol.py), held by every model that there is."""

import math
from typing import Any

import joblib
import numpy as np
import pytest
from builders import Array

from models.effects.registry import EFFECTS, effects_of, load_effect
from models.protocol import Model, complete_status
from models.registry import load_model, model_names

EVERY: dict[str, Model] = {name: load_model(name) for name in model_names()}
MODELS = {name: model for name, model in EVERY.items() if model.cost < 10.0}
"""Models whose runs take minutes are held by tests of their own (test_fem_model.py)."""
NAMES = tuple(MODELS)
VARIANTS: dict[str, Model] = MODELS | {
    "curve": load_model("headform", {"hood_curve": [[0.0, 0.0], [0.1, 1e4]], "channel_class": 0.0}),
    "skin": load_model("headform", {"corridor": "working_curves", "skin": "vinyl"}),
}
ENDS: dict[str, list[tuple[str, dict[str, float]]]] = {
    # So soft and heavy that the contact takes longer than a second.
    "headform": [
        ("time_limit", {"headform_mass": 20.0, "hood_force_scale": 0.001, "impact_speed": 0.2,
                        "hood_unloading_ratio": 1.01}),
    ],
    "multibody": [
        ("impossible_body", {"body_mass": 9.5, "head_mass": 6.0}),
        ("no_contact", {"lateral_offset": -1.9}),
    ],
    "facet": [
        ("impossible_body", {"body_mass": 9.5, "head_mass": 6.0}),
        ("no_contact", {"lateral_offset": -1.9}),
    ],
    "planar": [("impossible_body", {"body_mass": 9.5, "head_mass": 6.0})],
}  # fmt: skip
LARGE = {"wet_road": 8.0, "sensor_saturation": 60.0, "hood_bottoming": 0.03}
"""Where the prior's 90 % is no large effect: the size that is one."""
EVERY_EFFECT = [(name, effect) for name in NAMES for effect in effects_of(name)]


def nominal(model: Model, n: int = 1, **changes: float) -> Array:
    """Return n rows of nominal values, but for the inputs given."""
    return np.tile([changes.get(item.name, item.nominal) for item in model.inputs], (n, 1))


def anywhere(model: Model, n: int, seed: int) -> Array:
    """Return rows of which a third has every input at an end of its range."""
    share = np.random.default_rng(seed).random((n, len(model.inputs)))
    share[::3] = np.round(share[::3])
    low, high = (np.array([getattr(i, end) for i in model.inputs]) for end in ("low", "high"))
    return np.asarray(low + share * (high - low))


def some_rows(name: str, n: int) -> Array:
    """Return rows half way from the nominal ones to anywhere; the last ones end otherwise."""
    model = VARIANTS[name]
    rows = 0.5 * (nominal(model, n) + anywhere(model, n, 5))
    ends = [nominal(model, **changes) for _, changes in ENDS[model.name]]
    return np.concatenate([rows, *ends])


def batch_outputs(name: str, rows: Array) -> Array:
    return load_model(name).run_batch(rows).outputs


@pytest.mark.parametrize("name", NAMES)
def test_inputs_and_outputs_are_declared(name: str) -> None:
    model = MODELS[name]
    assert model.name == name and model.version
    for item in model.inputs:
        assert item.low <= item.nominal <= item.high, item.name
        assert item.unit and item.meaning and item.source, item.name
    for output in model.outputs:
        assert output.unit and output.meaning and output.low < output.high, output.name
    run = model.run({})
    assert run.status == "ok" and run.end_reason
    assert run.inputs == {item.name: item.nominal for item in model.inputs}
    assert list(run.outputs) == [output.name for output in model.outputs]
    assert all(item.low <= run.outputs[item.name] <= item.high for item in model.outputs)
    for history in run.histories.values():
        assert set(history.units) == set(history.channels)
        assert all(values.shape == history.time.shape for values in history.channels.values())


@pytest.mark.parametrize("name", VARIANTS)
def test_a_row_depends_on_itself_alone_and_is_the_run_of_its_inputs(name: str) -> None:
    model = VARIANTS[name]
    rows = some_rows(name, 20 if model.name == "headform" else 4)
    batch = model.run_batch(rows)
    assert batch.outputs.shape == (len(rows), len(model.outputs))
    ends = [status for status, _ in ENDS[model.name]]
    assert batch.status[-len(ends) :] == ends
    assert "ok" in batch.status[: -len(ends)]
    for row, found, status in zip(rows, batch.outputs, batch.status, strict=True):
        run = model.run(dict(zip((item.name for item in model.inputs), row, strict=True)))
        assert run.status == status
        np.testing.assert_array_equal(found, list(run.outputs.values()))
        assert status in complete_status(model) or np.isnan(found).all()
    order = np.random.default_rng(5).permutation(len(rows))
    shuffled = model.run_batch(rows[order])
    np.testing.assert_array_equal(shuffled.outputs, batch.outputs[order])
    assert shuffled.status == [batch.status[k] for k in order]
    np.testing.assert_array_equal(model.run_batch(rows[3:4]).outputs[0], batch.outputs[3])
    assert model.run_batch(rows[:0]).outputs.shape == (0, len(model.outputs))


@pytest.mark.parametrize("name", NAMES)
def test_observing_gives_what_a_run_gives(name: str) -> None:
    model = MODELS[name]
    seen, run = model.observe({}, ["head_acceleration"], ["hic15"]), model.run({})
    assert seen.outputs == {"hic15": run.outputs["hic15"]}
    assert [*seen.histories] == ["head"] and [*seen.histories["head"].channels] == ["acceleration"]
    for history in (seen.histories["head"], run.histories["head"]):
        assert history.units["acceleration"] == "g"
    np.testing.assert_array_equal(
        seen.histories["head"].channels["acceleration"],
        run.histories["head"].channels["acceleration"],
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_another_process_gives_the_same_bits(name: str) -> None:
    rows = some_rows(name, 6)
    with joblib.parallel_config(backend="loky", n_jobs=2):
        apart = joblib.Parallel()(
            joblib.delayed(batch_outputs)(name, part) for part in np.array_split(rows, 3)
        )
    np.testing.assert_array_equal(np.concatenate(apart), batch_outputs(name, rows))


@pytest.mark.parametrize("name", NAMES)
def test_what_lies_outside_a_range_is_refused_in_one_line(name: str) -> None:
    model = MODELS[name]
    for k, item in enumerate(model.inputs):
        beyond = np.nextafter(item.low, -np.inf), np.nextafter(item.high, np.inf)
        for value in (*map(float, beyond), 1e9, math.nan, math.inf, -math.inf):
            rows = nominal(model, 3)
            rows[1, k] = value
            for refused in (
                lambda name=item.name, value=value: model.run({name: value}),
                lambda name=item.name, value=value: model.observe({name: value}, []),
                lambda rows=rows: model.run_batch(rows),
            ):
                with pytest.raises(ValueError) as caught:
                    refused()
                assert str(caught.value) == (
                    f"input {item.name!r} = {value:g} {item.unit} is outside the valid range "
                    f"{item.low:g} to {item.high:g} {item.unit} of model {name!r}"
                )


@pytest.mark.parametrize("name", NAMES)
def test_what_there_is_not_is_refused_with_what_there_is(name: str) -> None:
    model, effect = MODELS[name], effects_of(name)[0]
    with pytest.raises(ValueError, match=r"no input 'impact_sped'; it has .*impact_speed"):
        model.run({"impact_sped": 10.0})
    for rows in (nominal(model, 2)[:, 1:], nominal(model)[0], np.tile(nominal(model), (1, 2))):
        with pytest.raises(ValueError, match=rf"shape \(n, {len(model.inputs)}\)"):
            model.run_batch(rows)
    with pytest.raises(ValueError, match=rf"model '{name}' has no option 'colour'; it has .*veh"):
        load_model(name, {"colour": "red"})
    with pytest.raises(ValueError, match=r"unknown model '.*x': choose one of .*multibody"):
        load_model(name + "x")
    with pytest.raises(ValueError, match="no vehicle 'tank'"):
        load_model(name, {"vehicle": "tank"})
    key, entry = next(iter(load_effect(effect).parameters.items()))
    other = next(e for e in EFFECTS if e not in effects_of("planar") or name == "multibody")
    refused: list[tuple[dict[str, Any], str]] = [
        ({"magic": {}}, "no effect 'magic'; there are speed_bias"),
        ({effect: {"depth": 0.1}}, f"has no parameter 'depth', only {key}"),
        ({effect: {key: 1e9}}, rf"{effect}.{key}: 1e\+09 {entry.input.unit} is outside"),
        ({effect: {key: math.nan}}, "is outside"),
    ]
    if other not in effects_of(name):
        refused.append(({other: {}}, f"does not apply to model '{name}', only to"))
    for effects, message in refused:
        with pytest.raises(ValueError, match=message):
            load_model(name, {}, effects)


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_says_what_it_is_and_what_it_looks_like(effect: str) -> None:
    entry = load_effect(effect)
    assert (entry.title and entry.signature and entry.separated_by) or not entry.confusable
    assert "[" in entry.source or "SAE" in entry.source
    assert set(entry.confusable) <= set(EFFECTS) and set(entry.models) <= set(EVERY)
    for parameter in entry.parameters.values():
        assert parameter.input.low <= parameter.none <= parameter.input.high
        assert parameter.input.unit and parameter.input.meaning


@pytest.mark.parametrize(("name", "effect"), EVERY_EFFECT)
def test_an_effect_is_inputs_more_and_none_of_it_is_nothing(name: str, effect: str) -> None:
    entry, plain = load_effect(effect), MODELS[name]
    model = load_model(name, {}, {effect: {}})
    added = model.inputs[len(plain.inputs) :]
    parameters = {key: p for key, p in entry.parameters.items() if name in p.models}
    assert [item.name for item in added] == [f"{effect}_{key}" for key in parameters]
    assert all(item.low <= item.nominal <= item.high for item in added)
    off = {f"{effect}_{key}": parameter.none for key, parameter in parameters.items()}
    without = plain.run({}).outputs
    assert model.run(off).outputs == without
    # Switched on in a study's file or by an input: the same run, and another one than without.
    size = entry.parameters[entry.size]
    value = float(np.clip(size.prior.quantile(0.9), size.input.low, size.input.high))
    value = LARGE.get(effect, value)
    on = load_model(name, {}, {effect: {entry.size: value}}).run({})
    assert on.status == "ok"
    assert on.outputs == model.run({f"{effect}_{entry.size}": value}).outputs
    assert on.outputs != without
    assert abs(on.outputs.get("energy_residual", 0.0)) < 0.01


def check_range(name: str, n: int) -> None:
    model = MODELS[name]
    low, high = (np.array([getattr(i, end) for i in model.outputs]) for end in ("low", "high"))
    for seed in range(-(-n // 500)):
        found = model.run_batch(anywhere(model, min(500, n), seed))
        status = np.array(found.status)
        ok = found.outputs[status == "ok"]
        assert np.isfinite(ok).all() and not np.isinf(found.outputs).any()
        assert np.isnan(found.outputs[~np.isin(status, [*complete_status(model)])]).all()
        # What is not physical the runner refuses; it must stay rare.
        assert ((ok < low) | (ok > high)).any(axis=1).sum() <= 5


@pytest.mark.parametrize(
    ("name", "n"), [("headform", 300), ("multibody", 15), ("planar", 15), ("facet", 15)]
)
def test_the_whole_range_gives_numbers(name: str, n: int) -> None:
    check_range(name, n)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_twenty_thousand_rows_give_numbers(name: str) -> None:
    check_range(name, 20_000)
