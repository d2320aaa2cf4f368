"""A diagnosis of every kind of data: ISO-MME, full-scale tests and accidents of the crash core."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mcstudy.diagnosis.base_model import fit_base
from mcstudy.diagnosis.problem import Cause
from mcstudy.diagnosis.screening import score_templates
from mcstudy.diagnosis.search import search
from mcstudy.diagnosis.templates import cause_templates, named_forms
from mcstudy.execution.results import ResultsFolder
from mcstudy.measurement.isomme import write_test
from mcstudy.measurement.measured_data import load_measured
from studies.diagnosis import accidents
from studies.diagnosis.causes import causes_of
from studies.diagnosis.model_choice import choose_model
from studies.diagnosis.problem import build_problem
from studies.diagnosis.study import diagnose, simulation_of
from studies.validation.diagnosis.hidden_accidents import make_accidents
from studies.validation.diagnosis.hidden_crashes import make_crashes
from studies.validation.diagnosis.hidden_effects import make_tests
from studies.validation.diagnosis.laboratory import CURVE, Hidden, Laboratory

ACCIDENTS = Path("configs/accidents.toml")

STUDY = f"""format = "mcstudy-study/1"
kind = "monte-carlo"
name = "hood"
title = "Hood"
[model]
name = "headform"
options = {{ hood_curve = {[list(knot) for knot in CURVE]} }}
[design]
method = "latin-hypercube"
n = 200
[inputs.impact_speed]
distribution = "uniform"
unit = "m/s"
low = 7.0
high = 11.0
[inputs.hood_force_scale]
distribution = "lognormal"
median = 1.0
sigma = 0.1
[fixed.hood_unloading_ratio]
value = {Laboratory().ratio}
"""
ACCELERATION = "11HEAD0000H3ACRA"


def isomme_of(source: Path, folder: Path) -> None:
    """Write the tests of a folder in the measured-data format as ISO-MME tests."""
    rows = pd.read_csv(source / "tests.csv")
    for name, speed in zip(rows["test"], rows["impact_speed"], strict=True):
        signal = pd.read_csv(source / "signals" / f"{name}.csv").to_numpy()
        time = signal[:, 0]
        write_test(
            folder / name, name.upper(), {ACCELERATION: (signal[:, 1], "g")},
            start=float(time[0]), interval=float(np.diff(time).mean()),
            velocity=float(speed), mass=Laboratory().mass,
        )  # fmt: skip


@pytest.mark.slow
def test_isomme_tests_are_diagnosed_with_the_model_of_a_study_file(tmp_path: Path) -> None:
    laboratory = Laboratory(tests=8, speed_sd=0.0)
    hidden = [Hidden("sensor_saturation", "", {"limit": 110.0})]
    make_tests(tmp_path / "data", hidden, 3, laboratory)
    isomme_of(tmp_path / "data", tmp_path / "mme")
    (tmp_path / "hood.toml").write_text(STUDY)
    answer = diagnose(
        tmp_path / "mme", ResultsFolder(tmp_path / "out"),
        model_config=tmp_path / "hood.toml", workers=1,
    )  # fmt: skip
    assert answer["cause"] == "sensor_saturation"
    limit = answer["parameters"]["sensor_saturation"][0]
    assert limit["value"] == pytest.approx(110.0, abs=2.0)
    # The hood's stiffness is what the study file samples and the tests do not state.
    assert "[inputs.hood_force_scale]" in (tmp_path / "out" / "extended.toml").read_text()


def chosen(*names: str) -> tuple[Cause, ...]:
    return tuple(cause for cause in causes_of("multibody") if cause.name in names)


@pytest.mark.slow
def test_full_scale_tests_of_the_crash_core_show_a_clipped_signal(tmp_path: Path) -> None:
    make_crashes(tmp_path / "data", [Hidden("sensor_saturation", "", {"limit": 60.0})], 1, tests=3)
    data = load_measured(tmp_path / "data")
    choice = choose_model(data, None)
    problem = build_problem(data, choice, simulation_of(data, choice))
    # HIC15 follows from the signal; throw and wrap-around distance are evidence of their own.
    assert [scalar.name for scalar in problem.tests[0].scalars] == ["throw_distance", "wad"]
    layouts, base = fit_base(problem)
    causes = chosen("sensor_saturation", "sensor_offset", "wet_road")
    bank = cause_templates(problem, layouts, base, named_forms(causes))
    score, information = score_templates(base, layouts, bank)
    standard = np.abs(score) / np.sqrt(np.where(information > 0.0, information, np.inf))
    best = bank[int(np.argmax(standard))]
    assert best.form.cause == "sensor_saturation"
    assert standard.max() > 4.0


@pytest.mark.slow
def test_accidents_with_a_wet_road_are_diagnosed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(accidents, "POOL", 160)
    monkeypatch.setattr(accidents, "PAIRED", 60)
    hidden = [Hidden("wet_road", "", {"place": 5.0, "factor": 0.5})]
    make_accidents(tmp_path / "data", ACCIDENTS, hidden, 4)
    data = load_measured(tmp_path / "data")
    choice = choose_model(data, ACCIDENTS)
    problem = build_problem(data, choice, simulation_of(data, choice))
    causes = chosen("wet_road", "brake_dive")
    surfaces = accidents.fit_surfaces(problem, data, choice, causes, seed=1, workers=1, quiet=True)
    problem, emulator = surfaces.problem_of(problem), surfaces.emulator
    found = search(problem, causes)
    assert found.cause == "wet_road"
    # Signals it has none; a further scalar it has.
    seen = emulator.widened({}, ["log_head_impact_time"])(problem.tests[0].inputs, {})
    assert seen is not None
    assert not seen.signals
    assert set(seen.scalars) == {
        *(s.name for s in problem.tests[0].scalars),
        "log_head_impact_time",
    }


def test_the_motion_before_the_heads_impact_is_no_noise(tmp_path: Path) -> None:
    make_crashes(tmp_path / "data", [], 2, 3)
    data = load_measured(tmp_path / "data")
    choice = choose_model(data, None)
    problem = build_problem(data, choice, simulation_of(data, choice))
    assert {(s.sd, s.correlation) for test in problem.tests for s in test.signals} == {(1.0, 0.0)}
