"""Runs of a study in the viewer."""

import json
import re
from pathlib import Path

import pytest
from headform_studies import by_formula, mcstudy, run_text, study_text, told

from mcstudy.execution.results import ResultsFolder

CRASHES = """\
format = "mcstudy-study/1"
kind = "monte-carlo"
name = "crashes"
title = "Two crashes"
[model]
name = "multibody"
[design]
method = "monte-carlo"
n = 2
[inputs.impact_speed]
distribution = "uniform"
unit = "km/h"
low = 35.0
high = 45.0
[report]
outputs = ["hic15"]
histories = 0
"""


@pytest.fixture(scope="module")
def crashes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("crashes")
    (place / "s.toml").write_text(CRASHES)
    answer = mcstudy("run", place / "s.toml", "--out", place / "out", "--workers", "1")
    assert (answer.code, answer.err) == (0, "")
    return place / "out"


def test_any_run_of_a_study_is_shown(crashes: Path, tmp_path: Path) -> None:
    page = tmp_path / "deep" / "page.html"
    answer = mcstudy("view", crashes, "--run", "1", "--run", "0", "--out", page)
    assert (answer.code, answer.err) == (0, "")
    assert str(page) in answer.line
    found = re.search(r'(?s)id="content">(.*?)</script>', page.read_text())
    assert found is not None
    content = json.loads(found[1])
    assert [run["label"] for run in content["runs"]] == ["run 1", "run 0"]
    labels = [curve["label"] for curve in content["runs"][0]["curves"]]
    assert "head acceleration [g]" in labels
    assert "contact force, hood [kN]" in labels
    events = content["runs"][0]["events"]
    assert 0.02 < events["head meets the car"] < events["landing"] < 3.0


def test_the_same_run_of_two_studies_is_shown_together(crashes: Path, tmp_path: Path) -> None:
    softer = CRASHES.replace("[design]", "[fixed]\nhood_stiffness = { value = 0.0 }\n[design]")
    (tmp_path / "s.toml").write_text(softer)
    other = tmp_path / "softer"
    assert mcstudy("run", tmp_path / "s.toml", "--out", other, "--workers", "1").code == 0
    page = tmp_path / "both.html"
    answer = mcstudy("view", crashes, "--run", "1", "--beside", other, "--out", page)
    assert (answer.code, answer.err) == (0, "")
    found = re.search(r'(?s)id="content">(.*?)</script>', page.read_text())
    assert found is not None
    assert [run["label"] for run in json.loads(found[1])["runs"]] == ["run 1", "softer, run 1"]


def test_a_run_that_is_not_there_and_a_model_without_a_scene(crashes: Path, tmp_path: Path) -> None:
    assert "has no run 2, only 0 to 1" in told(mcstudy("view", crashes, "--run", "2"))
    folder = ResultsFolder(tmp_path / "headform")
    with by_formula():
        run_text(study_text("monte-carlo"), folder)
    assert "has no scene to view" in told(mcstudy("view", folder.path, "--run", "0"))
