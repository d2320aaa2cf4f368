"""Impossible bodies, and values that no model takes, through files and the command line."""

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcstudy.execution.results import ResultsFolder
from models.pedestrian.anthropometry import build_body, is_possible
from models.registry import load_model
from studies import cli

CASE = """\
format = "mcstudy-study/1"
kind = "reconstruction"
name = "refusals"
title = "What is refused"

[model]
name = "multibody"

[fixed]
"""
STUDY = (
    CASE.replace("reconstruction", "monte-carlo")
    .replace(
        "[fixed]\n",
        """\
[design]
method = "latin-hypercube"
n = 4
replicate_size = 4

[inputs.impact_speed]
distribution = "uniform"
unit = "km/h"
low = 30.0
high = 40.0

[report]
histories = 0

[fixed]
""",
    )
    .replace("[model]", "max_failure_rate = 0.0\n\n[model]")
)
IMPOSSIBLE = 'stature = { value = 2.1, unit = "m" }\nbody_mass = { value = 13.2, unit = "kg" }\n'


@pytest.mark.parametrize(
    ("stature", "body_mass", "head_mass", "possible"),
    [
        (1.22, 23.2, 3.26, True),
        (2.1, 13.2, 3.26, False),  # 3 kg/m2
        (1.0, 8.0, 1.5, True),
        (1.0, 7.99, 1.5, False),
        (1.0, 80.0, 3.0, True),
        (1.0, 80.01, 3.0, False),
        (0.9, 10.0, 4.99, True),
        (0.9, 10.0, 5.0, False),  # half of the body
    ],
)
def test_what_body_can_be(
    stature: float, body_mass: float, head_mass: float, possible: bool
) -> None:
    assert is_possible(stature, body_mass, head_mass) is possible
    if possible:
        body = build_body(7.0, stature, body_mass, head_mass)
        assert body.mass.sum() == pytest.approx(body_mass, rel=1e-12)
        assert (body.mass > 0.0).all() and (body.inertia > 0.0).all()
    elif body_mass >= 9.0:
        inputs = {"stature": stature, "body_mass": body_mass, "head_mass": head_mass}
        run = load_model("multibody").run(inputs)
        assert run.status == "impossible_body"
        assert all(math.isnan(value) for value in run.outputs.values())


@pytest.mark.parametrize(
    "body",
    [
        {"stature": 1.1, "body_mass": 9.7, "head_mass": 1.5},  # 8.02 kg/m2
        {"stature": 1.0, "body_mass": 79.9, "head_mass": 7.0},
        {"stature": 0.8, "body_mass": 9.0, "head_mass": 4.49},
        {"stature": 2.1, "body_mass": 150.0, "head_mass": 1.5, "age": 3.0},
    ],
)
def test_the_strangest_bodies_that_can_be_run_without_an_exception(body: dict[str, float]) -> None:
    run = load_model("multibody").run(body)
    assert run.status not in ("impossible_body", "no_contact")
    assert run.status != "ok" or np.isfinite(list(run.outputs.values())).all()


class Shell:
    """The command line on one study file."""

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch, caught: Any) -> None:
        self.out, self.study = folder / "out", folder / "study.toml"
        self._patch, self._caught = patch, caught

    def __call__(self, verb: str, text: str, *options: str) -> tuple[int, str]:
        """Return exit code and standard error."""
        self.study.write_text(text)
        words = ["mcstudy", verb, str(self.study), "--out", str(self.out), *options]
        self._patch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as ended:
            cli.main()
        assert isinstance(ended.value.code, int)
        return ended.value.code, self._caught.readouterr().err.strip()


@pytest.fixture
def shell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


LINES = {
    'stature = { value = 3.0, unit = "m" }': ("fixed.stature", "3 m", "0.8 to 2.1 m"),
    'stature = { value = 300.0, unit = "cm" }': ("fixed.stature", "3 m", "0.8 to 2.1 m"),
    "hood_stiffness = { value = -0.1 }": ("fixed.hood_stiffness", "-0.1", "0 to 1"),
    "hood_stiffness = { value = nan }": ("fixed.hood_stiffness", "nan", "finite"),
    "hood_stiffness = { value = inf }": ("fixed.hood_stiffness", "inf", "finite"),
    'running_speed = { value = 500.0, unit = "km/h" }': (
        "fixed.running_speed", "138.889 m/s", "0 to 8 m/s"),
    "stature_of_child = { value = 1.2 }": ("fixed.stature_of_child", "no input", "stature"),
}  # fmt: skip


@pytest.mark.parametrize("line", LINES)
@pytest.mark.parametrize(("verb", "text"), [("run", STUDY), ("reconstruct", CASE)])
def test_files_with_bad_values_end_with_code_2(
    shell: Shell, verb: str, text: str, line: str
) -> None:
    code, errors = shell(verb, text + line + "\n")
    assert code == 2 and "\n" not in errors
    assert all(word in errors for word in LINES[line]), errors
    assert not shell.out.exists()


def test_a_distribution_that_leaves_the_range_ends_with_code_2(shell: Shell) -> None:
    code, errors = shell("run", STUDY.replace("high = 40.0", "high = 500.0"))
    assert code == 2 and "\n" not in errors
    assert "inputs.impact_speed" in errors and "0.5 to 40 m/s" in errors
    assert not shell.out.exists()


def test_no_workers_is_a_user_error(shell: Shell) -> None:
    code, errors = shell("run", STUDY, "--workers", "0", "--quiet")
    assert code == 2 and "workers" in errors


def test_a_study_of_impossible_bodies_fails_and_keeps_the_rows(shell: Shell) -> None:
    code, errors = shell("run", STUDY + IMPOSSIBLE, "--workers", "1", "--quiet")
    assert code == 1 and "4 impossible_body" in errors
    runs = ResultsFolder(shell.out).runs()
    assert set(runs["status"]) == {"impossible_body"}
    outputs = [item.name for item in load_model("multibody").outputs]
    assert runs[outputs].isna().to_numpy().all()


def test_a_case_of_an_impossible_body_fails_on_one_line(shell: Shell) -> None:
    code, errors = shell("reconstruct", CASE + IMPOSSIBLE)
    assert code == 1
    assert errors == "mcstudy: the run ended with status 'impossible_body'"
