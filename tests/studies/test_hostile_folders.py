"""Results folders and study files from other people: one line and an exit code, never a traceback.

Nothing outside the folder that is named may change.
"""

import contextlib
import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from headform_studies import without_figures
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from studies import api, cli

QUIET = settings(
    derandomize=True, deadline=None, database=None, max_examples=25,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip
STUDY = """\
format = "mcstudy-study/1"
kind = "{kind}"
name = "hostile"
title = "Hostile"

[model]
name = "headform"

[design]
{design}

[inputs.impact_speed]
distribution = "uniform"
unit = "m/s"
low = 6.0
high = 9.0

[inputs.headform_mass]
distribution = "uniform"
unit = "kg"
low = 2.0
high = 3.0
"""
DESIGNS = {
    "monte-carlo": "n = 120\nreplicate_size = 20",
    "morris": "n = 20",
    "sobol": "n = 64\nstart = 64",
}
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=6,
)  # fmt: skip


@pytest.fixture(scope="module", params=DESIGNS)
def finished(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    base = tmp_path_factory.mktemp("hostile")
    path = base / "study.toml"
    path.write_text(STUDY.format(kind=request.param, design=DESIGNS[request.param]))
    with without_figures():
        api.run_study(path, out=base / "out", workers=1)
    return base / "out"


def call(*arguments: str | Path) -> tuple[int, str]:
    """Return exit code and what a command says on standard error."""
    said = io.StringIO()
    with (
        mock.patch("sys.argv", ["mcstudy", *map(str, arguments)]),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(said),
        without_figures(),
        pytest.raises(SystemExit) as end,
    ):
        cli.main()
    return int(end.value.code or 0), said.getvalue()


def check(folder: Path, outside: Path) -> None:
    before = sorted(path for path in outside.iterdir() if path != folder)
    for command in ("status", "report", "sensitivity"):
        code, said = call(command, folder)
        assert code in (0, 1, 2), said
        assert "Traceback" not in said
        if code:
            assert said.startswith("mcstudy: ")
            assert said.count("\n") == 1
    assert sorted(path for path in outside.iterdir() if path != folder) == before


def spoil_text(name: str) -> Callable[[Path, st.DataObject], None]:
    def spoil(folder: Path, data: st.DataObject) -> None:
        content = (folder / name).read_bytes()
        cut = data.draw(st.integers(0, len(content)))
        (folder / name).write_bytes(content[:cut] + data.draw(st.binary(max_size=20)))

    return spoil


def spoil_manifest(folder: Path, data: st.DataObject) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    key = data.draw(st.sampled_from([*manifest, *(f"design.{k}" for k in manifest["design"])]))
    table, _, inner = key.partition(".")
    if inner:
        manifest[table][inner] = data.draw(JSON)
    else:
        manifest[table] = data.draw(JSON)
    if data.draw(st.booleans()):
        manifest.setdefault("design", {})
        if isinstance(manifest["design"], dict):
            manifest["design"]["cells"] = data.draw(st.sampled_from([["../x"], ["/etc"], [1], "a"]))
    (folder / "manifest.json").write_text(json.dumps(manifest))


def spoil_runs(folder: Path, data: st.DataObject) -> None:
    runs = pd.read_parquet(folder / "runs.parquet")
    name = data.draw(st.sampled_from(list(runs.columns)))
    what = data.draw(st.sampled_from(["drop", "text", "nan", "inf", "empty", "twice", "order"]))
    if what == "drop":
        runs = runs.drop(columns=name)
    elif what == "text":
        runs[name] = "<script>alert(1)</script>"
    elif what in ("nan", "inf"):
        runs[name] = np.nan if what == "nan" else np.inf
    elif what == "empty":
        runs = runs.iloc[:0]
    elif what == "twice":
        runs = pd.concat([runs, runs])
    else:
        runs = runs.sample(frac=0.5, random_state=1)
    runs.to_parquet(folder / "runs.parquet")


SPOILS = {
    "manifest": spoil_manifest,
    "runs": spoil_runs,
    "torn manifest": spoil_text("manifest.json"),
    "torn study": spoil_text("study.toml"),
    "torn runs": spoil_text("runs.parquet"),
}


@pytest.mark.parametrize("how", SPOILS)
@QUIET
@given(data=st.data())
def test_a_spoilt_folder_is_told_in_one_line(
    finished: Path, tmp_path_factory: pytest.TempPathFactory, how: str, data: st.DataObject
) -> None:
    outside = tmp_path_factory.mktemp("outside")
    folder = outside / "folder"
    shutil.copytree(finished, folder)
    SPOILS[how](folder, data)
    check(folder, outside)
    shutil.rmtree(outside)


@pytest.mark.parametrize("name", ["manifest.json", "study.toml", "runs.parquet"])
def test_a_missing_file_is_told_in_one_line(finished: Path, tmp_path: Path, name: str) -> None:
    folder = tmp_path / "folder"
    shutil.copytree(finished, folder)
    (folder / name).unlink()
    check(folder, tmp_path)


def test_text_in_the_runs_is_no_markup_in_the_report(finished: Path, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    shutil.copytree(finished, folder)
    runs = pd.read_parquet(folder / "runs.parquet")
    runs.loc[runs.index[-1], ["status", "reason"]] = ["<script>x</script>", "<script>y</script>"]
    runs.to_parquet(folder / "runs.parquet")
    code, _ = call("report", folder)
    if code == 0:
        assert "<script>x" not in (folder / "report.html").read_text()
