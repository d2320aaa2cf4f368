"""Measured headform records from their folder to the report: what was taken, left out and told."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from headform_studies import mcstudy, quick_fits, told
from numpy.typing import NDArray

from mcstudy.execution.results import ResultsFolder
from mcstudy.measurement.measured_data import load_measured
from studies.diagnosis.model_choice import choose_model
from studies.diagnosis.problem import build_problem
from studies.diagnosis.study import simulation_of
from studies.headform_records import keep_first_impacts
from tests.closed_form_pulse import LARGEST, MASS, PERMANENT, SPEED, filtered, pulse

Array = NDArray[np.float64]

HEADER = """\
format = "mcstudy-measured/1"
title = "One drop"
model = "headform"
[fixed]
hood_curve = [[0.0, 0.0], [0.1, 7500.0]]
hood_unloading_ratio = 4.0
[inputs.impact_speed]
unit = "m/s"
[inputs.headform_mass]
unit = "Kg"
[signals.head_acceleration]
unit = "g"
sd = 0.3
filter = "{name}"
"""
RATE = 10_000.0
TIME = np.arange(-0.04, 0.3, 1.0 / RATE)


def folder_of(base: Path, values: Array, name: str = "none", time: Array = TIME, digits: int = 7,
              tests: int = 1) -> Path:  # fmt: skip
    (base / "signals").mkdir(parents=True)
    (base / "measured.toml").write_text(HEADER.format(name=name))
    rows = [f"T{k},{SPEED},{MASS}" for k in range(tests)]
    (base / "tests.csv").write_text("\n".join(["test,impact_speed,headform_mass", *rows, ""]))
    lines = [f"{t:.{digits}f},{v:.6f}" for t, v in zip(time, values, strict=True)]
    for k in range(tests):
        content = "\n".join(["time,head_acceleration", *lines, ""])
        (base / "signals" / f"T{k}.csv").write_text(content)
    return base


def fitted(base: Path, source: Path) -> dict[str, Any]:
    with quick_fits():
        answer = mcstudy("fit-stiffness", source, "--out", base / "out")
    assert answer.code == 0, answer.err
    analysis = ResultsFolder(base / "out").read_json("analysis.json")
    for note in analysis["notes"]:
        assert note in answer.out
        assert note.split(": ")[1][:30] in (base / "out" / "report.html").read_text()
    return analysis


def assert_is_the_pulse(analysis: dict[str, Any]) -> None:
    test = analysis["tests"]["T0"]
    assert test["largest_penetration"] == pytest.approx(LARGEST, rel=3e-3)
    assert test["permanent"]["value"] == pytest.approx(PERMANENT, rel=5e-3)


def test_the_first_of_two_impacts_is_fitted_and_told(tmp_path: Path) -> None:
    values = pulse(TIME) + 2.0 * pulse(TIME - 0.2)
    analysis = fitted(tmp_path, folder_of(tmp_path / "data", values))
    assert_is_the_pulse(analysis)
    assert any("later impact" in note for note in analysis["notes"])
    assert analysis["tests"]["T0"]["offset"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("name", ["CFC60", "CFC180"])
def test_a_low_class_is_fitted_through_its_filter(tmp_path: Path, name: str) -> None:
    values = filtered(pulse(TIME), RATE, float(name.removeprefix("CFC")))
    analysis = fitted(tmp_path, folder_of(tmp_path / "data", values, name))
    assert_is_the_pulse(analysis)
    assert analysis["tests"]["T0"]["pulse_difference"] < 0.01
    assert f"have passed {name}" in (tmp_path / "out" / "report.html").read_text()


def test_a_filtered_record_that_begins_at_contact_is_told(tmp_path: Path) -> None:
    late = TIME >= 0.0
    source = folder_of(tmp_path / "data", filtered(pulse(TIME[late]), RATE, 60.0), "CFC60",
                       TIME[late])  # fmt: skip
    analysis = fitted(tmp_path, source)
    assert any("give the record from before contact" in note for note in analysis["notes"])


def test_a_clipped_sensor_is_told(tmp_path: Path) -> None:
    values = np.minimum(pulse(TIME), 100.0)
    analysis = fitted(tmp_path, folder_of(tmp_path / "data", values))
    assert any("clipped" in note for note in analysis["notes"])


@pytest.mark.parametrize(("rate", "digits"), [(12_800.0, 6), (51_200.0, 7), (10_000.0, 4)])
def test_times_rounded_to_their_digits_are_read(tmp_path: Path, rate: float, digits: int) -> None:
    time = np.arange(-0.04, 0.05, 1.0 / rate)
    source = folder_of(tmp_path / "data", pulse(time), time=time, digits=digits)
    assert_is_the_pulse(fitted(tmp_path, source))


def test_a_missing_line_is_told_with_its_time(tmp_path: Path) -> None:
    lost = np.delete(np.arange(TIME.size), 450)
    source = folder_of(tmp_path / "data", pulse(TIME)[lost], time=TIME[lost])
    said = told(mcstudy("fit-stiffness", source, "--out", tmp_path / "out"))
    assert "test T0: the signal must be sampled uniformly: after 0.0049 s" in said


@pytest.mark.parametrize("name", ["CFC1000", "CFC180", "CFC60"])
def test_a_diagnosis_compares_filtered_with_filtered(tmp_path: Path, name: str) -> None:
    # The true model's residuals are rounding, whatever the class, and no second impact is in them.
    raw = pulse(TIME) + 2.0 * pulse(TIME - 0.2)
    values = filtered(raw, RATE, float(name.removeprefix("CFC")))
    data = keep_first_impacts(load_measured(folder_of(tmp_path, values, name, tests=3)))
    choice = choose_model(data, None)
    simulation = simulation_of(data, choice)
    problem = build_problem(data, choice, simulation)
    (signal,) = problem.tests[0].signals
    assert signal.time[-1] < 0.2
    run = simulation(problem.tests[0].inputs, {})
    assert run is not None
    time, simulated = run.signals["head_acceleration"]
    seen = np.interp(signal.time, time, simulated, left=0.0, right=0.0)
    inside = signal.time < 0.1
    assert np.abs(signal.values - seen)[inside].max() < 0.01 * simulated.max()
