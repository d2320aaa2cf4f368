"""``mcstudy diagnose``: from a folder of tests to an answer, a report and an extended model."""

import contextlib
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from headform_studies import assert_stands_alone, mcstudy, told, without_figures

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.measurement.measured_data import load_measured
from studies.api import run_study
from studies.diagnosis import study as diagnosis
from studies.diagnosis import words
from studies.diagnosis.causes import causes_of
from studies.diagnosis.model_choice import choose_model
from studies.diagnosis.study import diagnose
from studies.kinds import load_study
from studies.monte_carlo.schema import MonteCarloStudy
from studies.validation.diagnosis.hidden_effects import make_tests
from studies.validation.diagnosis.laboratory import Hidden, Laboratory

LABORATORY = Laboratory(tests=8)
FEW = ("sensor_gain", "hood_bottoming", "rate_dependent_hood", "mass_error", "sensor_offset")
"""Causes between which the fast tests choose; ``test_hidden_effects`` takes all."""
Change = Callable[[Path], None]


@contextlib.contextmanager
def few_causes() -> Iterator[None]:
    few = [cause for cause in causes_of("headform") if cause.name in FEW]
    with mock.patch.object(diagnosis, "causes_of", lambda *_: few):
        yield


@pytest.fixture(scope="module")
def gain(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ResultsFolder, dict[str, Any]]:
    """A diagnosis of tests whose accelerometer reads 8 % too high."""
    root = tmp_path_factory.mktemp("gain")
    make_tests(root / "data", [Hidden("sensor_gain", "", {"factor": 1.08})], 5, LABORATORY)
    folder = ResultsFolder(root / "out")
    with few_causes():
        return root / "data", folder, diagnose(root / "data", folder, workers=1)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("plain")
    make_tests(root / "data", [], 6, LABORATORY)
    return root / "data"


def test_the_answer_names_the_cause_and_its_size(gain: Any) -> None:
    _, _, answer = gain
    assert answer["adequate"] is False
    assert answer["p_value"] <= 0.05
    assert answer["cause"] == "sensor_gain"
    assert answer["second_cause"] is None
    factor = answer["parameters"]["sensor_gain"][0]
    assert factor["low"] < 1.08 < factor["high"]
    best = answer["effects"][0]
    assert best["name"] == "sensor_gain"
    assert best["log_evidence"] == max(row["log_evidence"] for row in answer["effects"])
    assert {row["cause"] for row in answer["visible"]} == set(FEW)
    seen = next(row for row in answer["visible"] if row["cause"] == "sensor_gain")
    assert 1.0 < seen["value"] < 1.12
    # An extra measurement is recommended.
    assert "load cell" in " ".join(row["title"] for row in answer["worth"])
    assert all(row["visibility"] > 0.9 for row in answer["worth"])


def test_the_answer_is_on_disk_with_a_report_that_says_it(gain: Any) -> None:
    _, folder, answer = gain
    held = json.loads((folder.path / "diagnosis.json").read_text())
    assert held == answer
    report = (folder.path / "report.html").read_text()
    assert "The accelerometer reads" in report
    assert_stands_alone(report)
    for name in ("pulses_head_acceleration", "where", "evidence", "gain", "conclusions"):
        assert (folder.path / "figures" / f"{name}.png").stat().st_size > 5000


def test_the_gain_is_that_of_held_out_tests(gain: Any) -> None:
    _, _, answer = gain
    rows = {(g["score"], g["region"]): g for g in answer["gain"]}
    for region in ("inside", "above"):
        for score in ("crps_hic15", "log_score", "rmse_head_acceleration", "rmse_hic15"):
            row = rows[score, region]
            difference = row["difference"]
            assert difference["low"] <= difference["value"] <= difference["high"]
            assert np.isfinite([row["base"], row["extended"], row["gaussian_process"]]).all()
    assert rows["log_score", "inside"]["difference"]["low"] > 0.0


def test_the_extended_model_is_a_study_that_runs(gain: Any, tmp_path: Path) -> None:
    data, folder, answer = gain
    text = (folder.path / "extended.toml").read_text()
    study = load_study(folder.path / "extended.toml")
    assert isinstance(study, MonteCarloStudy)
    assert list(study.effects) == ["sensor_gain"]
    choice = choose_model(load_measured(data), folder.path / "extended.toml")
    assert list(choice.effects) == ["sensor_gain"]
    short = text.replace("n = 1000", "n = 200")
    assert short != text
    (tmp_path / "short.toml").write_text(short)
    with without_figures():
        runs = run_study(tmp_path / "short.toml", out=tmp_path / "out", workers=1).runs()
    fitted = answer["parameters"]["sensor_gain"][0]
    assert runs["sensor_gain_factor"].median() == pytest.approx(fitted["value"], rel=0.01)


def test_an_adequate_model_gets_no_cause_and_the_command_prints_one_object(
    plain: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    with few_causes(), without_figures():
        said = mcstudy("diagnose", plain, "--out", out, "--workers", "1", "--json")
    assert (said.code, said.err) == (0, "")
    answer = json.loads(said.out)["analysis"]
    assert answer["adequate"] is True
    assert answer["cause"] is None
    assert answer["p_value"] > 0.05
    assert (answer["effects"], answer["gain"], answer["conclusions"]) == ([], [], None)
    assert answer["visible"]
    assert not (out / "extended.toml").exists()
    assert "within their uncertainty" in (out / "report.html").read_text()


@pytest.mark.slow
def test_the_same_seed_gives_the_same_answer(plain: Path, tmp_path: Path) -> None:
    first = diagnose(plain, ResultsFolder(tmp_path / "a"), workers=1, seed=2)
    second = diagnose(plain, ResultsFolder(tmp_path / "b"), workers=2, seed=2)
    assert first == second


@pytest.mark.slow
def test_a_model_that_has_the_effect_is_adequate(gain: Any, tmp_path: Path) -> None:
    # The extended model as the model to be diagnosed: nothing is left to explain.
    data, folder, _ = gain
    answer = diagnose(
        data, ResultsFolder(tmp_path / "out"), model_config=folder.path / "extended.toml", workers=1
    )
    assert answer["adequate"] is True
    assert "sensor_gain" not in {row["cause"] for row in answer["visible"]}


def edit(path: str, change: Callable[[str], str]) -> Change:
    def apply(folder: Path) -> None:
        target = folder / path
        target.write_text(change(target.read_text()))

    return apply


def replace_line(path: str, number: int, line: str) -> Change:
    def change(text: str) -> str:
        lines = text.splitlines()
        lines[number - 1] = line
        return "\n".join(lines) + "\n"

    return edit(path, change)


def swap(path: str, old: str, new: str) -> Change:
    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new, 1)

    return edit(path, change)


SIGNAL = "signals/t01.csv"
HEADER = "measured.toml"
BAD: dict[str, tuple[Change, str]] = {
    "missing column": (
        swap("tests.csv", "impact_speed", "speed"),
        "tests.csv: column 'impact_speed' is missing",
    ),
    "unknown unit": (
        swap(HEADER, 'unit = "m/s"', 'unit = "furlong"'),
        "inputs.impact_speed.unit: unknown unit",
    ),
    "empty signal": (
        edit(SIGNAL, lambda text: text.splitlines()[0] + "\n"),
        "t01.csv: line 1: column 'head_acceleration' ends after 0",
    ),
    "a NaN": (
        replace_line(SIGNAL, 7, "-0.0037,nan"),
        "t01.csv: line 7: column 'head_acceleration' must hold numbers",
    ),
    "time runs backwards": (replace_line(SIGNAL, 7, "-0.1,0.0"), "t01.csv: line 7: time must rise"),
    "two tests of one name": (swap("tests.csv", "t02", "t01"), "is there already"),
    "unknown model": (
        swap(HEADER, 'model = "headform"', 'model = "sledge"'),
        "no model 'sledge'",
    ),
    "unknown input": (
        swap(HEADER, "headform_mass", "sledge_mass"),
        "fixed.sledge_mass: model 'headform' has no such input",
    ),
    "input out of range": (
        swap(HEADER, "headform_mass = 2.5", "headform_mass = -1.0"),
        "fixed.headform_mass",
    ),
    "unknown channel": (
        swap(HEADER, "signals.head_acceleration", "signals.head_temperature"),
        "head_temperature",
    ),
    "no such column": (edit(HEADER, lambda t: t + "\n[scalars.order]\nsd = 1.0\n"), "order"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_folder_is_told_in_one_line(plain: Path, tmp_path: Path, name: str) -> None:
    change, message = BAD[name]
    copy = Path(shutil.copytree(plain, tmp_path / "data"))
    change(copy)
    said = told(mcstudy("diagnose", copy, "--out", tmp_path / "out", "--workers", "1"))
    assert message in said
    assert not (tmp_path / "out").exists()


def test_a_force_computed_from_the_acceleration_is_refused(plain: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(plain, tmp_path / "data"))
    for path in (copy / "signals").glob("*.csv"):
        frame = pd.read_csv(path)
        frame["hood_force"] = 2.5 * 9.80665 * frame["head_acceleration"]
        frame.to_csv(path, index=False)
    header = copy / "measured.toml"
    header.write_text(
        header.read_text() + '\n[signals.hood_force]\nunit = "N"\nsd = 20.0\nfilter = "CFC1000"\n'
    )
    with pytest.raises(UserError, match=r"signals\.hood_force is mass times"):
        diagnose(copy, ResultsFolder(tmp_path / "out"), workers=1)


def test_data_and_results_may_not_share_a_folder(plain: Path) -> None:
    with pytest.raises(UserError, match="holds the measured data"):
        diagnose(plain, ResultsFolder(plain), workers=1)


@pytest.mark.parametrize(
    ("value", "half", "text"),
    [(0.0278569, 2.67e-5, "27.857 ± 0.027 mm"), (0.0278569, 4e-4, "27.86 ± 0.40 mm"),
     (0.0278569, 0.012, "27.9 ± 12 mm")],
)  # fmt: skip
def test_a_parameter_is_as_exact_as_its_half_width(value: float, half: float, text: str) -> None:
    row = {"unit": "m", "value": value, "low": value - half, "high": value + half}
    assert words.shown(row) == text


@pytest.mark.parametrize(("value", "text"), [(14.0, "14.0 ± 1.4 N"), (1400.0, "1.40 ± 0.14 kN")])
def test_the_friction_of_a_guide_is_shown_in_newtons_the_force_of_a_hood_in_kilonewtons(
    value: float, text: str
) -> None:
    row = {"unit": "N", "value": value, "low": 0.9 * value, "high": 1.1 * value}
    assert words.shown(row) == text
