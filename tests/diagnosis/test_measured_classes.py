"""A simulated test passes the filters that the measured one passed, whatever the model."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mcstudy.measurement.measured_data import load_measured
from models.criteria.filters import filter_cfc
from models.registry import load_model
from studies.diagnosis.model_choice import choose_model
from studies.diagnosis.problem import build_problem
from studies.diagnosis.study import simulation_of

HEADER = """\
format = "mcstudy-measured/1"
title = "Four crashes"
model = "{model}"
[inputs.impact_speed]
unit = "m/s"
sd = 0.1
[signals.head_acceleration]
unit = "g"
sd = 1.0
filter = "{linear}"
[signals.head_angular_velocity]
unit = "rad/s"
sd = 0.5
filter = "{angular}"
"""
SPEEDS = (8.0, 9.0, 10.0, 11.0)


def measured(folder: Path, model: str, linear: str, angular: str) -> Path:
    """Write crashes of a model as a laboratory without any filter of its own records them."""
    (folder / "signals").mkdir(parents=True)
    (folder / "measured.toml").write_text(
        HEADER.format(model=model, linear=linear, angular=angular)
    )
    pd.DataFrame({"test": [f"T{k}" for k in range(4)], "impact_speed": SPEEDS}).to_csv(
        folder / "tests.csv", index=False
    )
    raw = load_model(model, {"channel_class": 0.0, "angular_class": 0.0})
    for k, speed in enumerate(SPEEDS):
        head = raw.run({"impact_speed": speed}).histories["head"]
        columns = {"time": head.time}
        for name in ("acceleration", "angular_velocity"):
            columns[f"head_{name}"] = head.channels[name]
        pd.DataFrame(columns).iloc[:2500].to_csv(folder / "signals" / f"T{k}.csv", index=False)
    return folder


@pytest.mark.parametrize("model", ["multibody", "planar"])
def test_a_class_of_the_data_is_the_class_of_the_simulation(tmp_path: Path, model: str) -> None:
    data = load_measured(measured(tmp_path / "data", model, "none", "none"))
    choice = choose_model(data, None)
    assert (choice.options["channel_class"], choice.options["angular_class"]) == (0.0, 0.0)
    simulation = simulation_of(data, choice)
    problem = build_problem(data, choice, simulation)
    run = simulation(problem.tests[1].inputs, {})
    assert run is not None
    for signal in problem.tests[1].signals:
        time, simulated = run.signals[signal.name]
        seen = np.interp(signal.time, time, simulated)
        np.testing.assert_allclose(signal.values, seen, atol=1e-5 * np.abs(seen).max())


def test_axes_pass_each_filter_once() -> None:
    raw = load_model("multibody", {"channel_class": 0.0, "angular_class": 0.0}).run({})
    lower = load_model("multibody", {"channel_class": 60.0, "angular_class": 60.0}).run({})
    for axis in "xyz":
        name = f"angular_velocity_{axis}"
        once = filter_cfc(raw.histories["head"].channels[name], 10_000.0, 60.0)
        np.testing.assert_allclose(lower.histories["head"].channels[name], once, atol=1e-9)
    peaks = [run.outputs["peak_head_acceleration"] for run in (raw, lower)]
    assert peaks[1] != pytest.approx(peaks[0], rel=1e-3)


@pytest.mark.parametrize("value", [-1.0, 3000.0])
def test_a_class_that_the_sampling_rate_does_not_allow_is_refused(value: float) -> None:
    for option in ("channel_class", "angular_class"):
        with pytest.raises(ValueError, match=f"{option} must lie within 0 and 2400"):
            load_model("multibody", {option: value})
