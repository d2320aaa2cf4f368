"""What a study will take, and tables where a terminal has no lines."""

import io
import json
import sys
from pathlib import Path

import pytest
from headform_studies import mcstudy, study_text, told

from studies.expectation import duration
from studies.terminal import print_table


def test_a_dry_run_counts_runs_and_runs_nothing(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(study_text("monte-carlo"))
    command = ("run", tmp_path / "s.toml", "--out", tmp_path / "out", "--workers", "2")
    answer = mcstudy(*command, "--dry-run", "--json")
    assert (answer.code, answer.err) == (0, "")
    found = json.loads(answer.out)["headform"]
    assert (found["runs"], found["done"]) == (120, 0)
    assert found["cost"] > 0.0
    assert not (tmp_path / "out").exists()
    assert mcstudy(*command, "--quiet").code == 0
    again = json.loads(mcstudy(*command, "--dry-run", "--json").out)["headform"]
    assert (again["runs"], again["done"]) == (120, 120)
    assert "time on 2 cores" in mcstudy(*command, "--dry-run").line


def test_every_model_of_a_chain_is_counted(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(study_text("model-chain"))
    answer = mcstudy("run", tmp_path / "s.toml", "--dry-run", "--out", tmp_path / "out")
    assert answer.code == 0
    for words in ("soft", "stiff", "all", "120"):
        assert words in answer.line
    (tmp_path / "m.toml").write_text(study_text("multi-fidelity"))
    assert "Pilot runs only" in mcstudy("run", tmp_path / "m.toml", "--dry-run").line
    said = told(mcstudy("run", "configs/three_methods.toml", "--dry-run"))
    assert "one run a model" in said


@pytest.mark.parametrize(
    ("seconds", "words"), [(0.2, "1 s"), (89.5, "90 s"), (100.0, "2 min"), (9000.0, "2.5 h")]
)
def test_times_are_told_in_units_that_matter(seconds: float, words: str) -> None:
    assert duration(seconds) == words


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "utf-8"])
def test_a_table_is_drawn_in_what_the_terminal_has(
    encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    buffer = io.BytesIO()
    stream = io.TextIOWrapper(buffer, encoding=encoding, errors="replace")
    monkeypatch.setattr(sys, "stdout", stream)
    print_table("Caption", ["one", "two"], [["1", "2"]])
    stream.flush()
    text = buffer.getvalue().decode(encoding)
    assert "?" not in text
    assert ("━" in text) == (encoding == "utf-8")
    assert "| 1   | 2   |" in text or "│ 1   │ 2   │" in text
