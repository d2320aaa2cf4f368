"""Crashes that differ only in how they were recorded are stepped once."""

import gc

import pytest

from models.crash.memory import MOST, CrashMemory
from models.crash.outcome import Raw
from models.effects.chain import build_chain
from models.multibody.model import MultibodyModel
from models.protocol import Run
from models.registry import load_model

SEEN, OUTPUTS = ("head_acceleration",), ("throw_distance", "wad", "hic15")


class _Counting(MultibodyModel):
    """The multibody model with a counter of step loops."""

    loops = 0

    def _step(self, values: dict[str, float]) -> Raw | None:
        _Counting.loops += 1
        return super()._step(values)


def _observe(model: MultibodyModel, speed: float, factor: float) -> Run:
    return model.observe({"impact_speed": speed, "sensor_gain_factor": factor}, SEEN, OUTPUTS)


def test_sizes_of_a_sensor_error_share_a_crash_and_nothing_else_does() -> None:
    _Counting.loops = 0
    model = _Counting(effects={"sensor_gain": {}})
    runs = [(9.0, 1.0), (9.5, 1.0), (9.0, 1.1), (9.5, 0.9), (9.0, 1.0)]
    seen = [_observe(model, *pair) for pair in runs]
    assert _Counting.loops == 2
    assert [run.recalled for run in seen] == [False, False, True, True, True]
    for (speed, factor), run in zip(runs, seen, strict=True):
        inputs = {"impact_speed": speed, "sensor_gain_factor": factor}
        alone = MultibodyModel(effects={"sensor_gain": {}}).run(inputs)
        assert run.outputs == {name: alone.outputs[name] for name in OUTPUTS}
        assert run.inputs == alone.inputs
        found, true = (r.histories["head"].channels["acceleration"] for r in (run, alone))
        assert (found == true).all()


def test_effects_on_the_crash_are_stepped_anew() -> None:
    _Counting.loops = 0
    model = _Counting(effects={"hood_bottoming": {}})
    sizes = (model._chain.inputs[0].nominal, model._chain.inputs[0].high)
    outcomes = [
        model.observe({model._chain.inputs[0].name: size}, SEEN, OUTPUTS).outputs for size in sizes
    ]
    assert _Counting.loops == 2
    assert outcomes[0] != outcomes[1]


@pytest.mark.parametrize("name", ["multibody", "planar"])
def test_a_crash_is_kept_while_others_run(name: str) -> None:
    model = load_model(name, {}, {"time_scale": {}})
    factor = model.inputs[-1].name
    first = model.observe({"impact_speed": 8.0}, SEEN, OUTPUTS)
    model.observe({"impact_speed": 12.0}, SEEN, OUTPUTS)
    again = model.observe({"impact_speed": 8.0, factor: 1.0}, SEEN, OUTPUTS)
    assert first.outputs == again.outputs


def test_many_models_keep_no_more_crashes_than_one() -> None:
    """A search holds a model for each effect; each of its own kept 128 MB of crashes."""
    models = [load_model("planar", {}, {"sensor_gain": {}, "sensor_offset": {}}) for _ in range(3)]
    gc.collect()
    for k in range(MOST + 4):
        models[k % 3].observe({"impact_speed": 9.0 + 0.01 * k}, SEEN, ())
    held = [entry for entry in gc.get_objects() if isinstance(entry, Raw)]
    assert len(held) <= MOST + 1


def test_models_that_differ_in_the_instrument_share_a_crash_and_others_do_not() -> None:
    _Counting.loops = 0
    loud = _Counting(effects={"sensor_gain": {"factor": 1.1}})
    clipped = _Counting(effects={"sensor_saturation": {"limit": 60.0}})
    plain = _Counting()
    seen = [
        model.observe({"impact_speed": 9.25}, SEEN, OUTPUTS) for model in (loud, clipped, plain)
    ]
    assert _Counting.loops == 1
    apart = [
        load_model("multibody", {}, effects).observe({"impact_speed": 9.25}, SEEN, OUTPUTS).outputs
        for effects in (
            {"sensor_gain": {"factor": 1.1}},
            {"sensor_saturation": {"limit": 60.0}},
            {},
        )
    ]
    assert [run.outputs for run in seen] == apart
    assert apart[0] != apart[1] != apart[2]
    stiff = _Counting(hood_curve=[[0.0, 0.0], [0.05, 9000.0]])
    filtered = _Counting(channel_class=180.0)
    others = [m.observe({"impact_speed": 9.25}, SEEN, OUTPUTS).outputs for m in (stiff, filtered)]
    assert others[0]["hic15"] != apart[2]["hic15"] != others[1]["hic15"]


def test_a_recalled_crash_is_recorded_by_the_instrument_of_the_run() -> None:
    setup, values = ("a car",), {"impact_speed": 9.0}
    CrashMemory(build_chain("planar", {})).keep(setup, values, "no_contact")
    loud = CrashMemory(build_chain("planar", {"sensor_gain": {}}))
    assert loud.recall(setup, values | {"sensor_gain_factor": 1.2}) == "no_contact"
    assert loud.recall(("another car",), values) is None
    stiff = CrashMemory(build_chain("planar", {"hood_bottoming": {}}))
    assert stiff.recall(setup, values | {"hood_bottoming_clearance": 0.04}) is None
