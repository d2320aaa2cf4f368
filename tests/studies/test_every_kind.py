"""What every kind of study does: from a file to a folder, again, on, further, and what it refuses.

Runs are made by formula where the model is not the subject.
"""

import json
import re
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from headform_studies import (
    FAILING,
    assert_stands_alone,
    by_formula,
    contents,
    global_state,
    mcstudy,
    recorded_parts,
    run_text,
    study_text,
    told,
    without_figures,
)
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder, digest
from mcstudy.sensitivity import delta, given_data
from studies import api
from studies.kinds import KINDS

LARGER = {
    "monte-carlo": "n = 140\nreplicate_size = 20",
    "sobol": "n = 128",
    "morris": "n = 24",
    "injury": "n = 80\nreplicate_size = 10",
    "model-comparison": "n = 80\nreplicate_size = 10",
    "map": "n = 20\nreplicate_size = 4",
    "multi-fidelity": "cpu_time = 120.0",
    "model-chain": "n = 80\nreplicate_size = 10",
    "posterior": 'method = "sobol"\nn = 192\nreplicate_size = 64',
}
FIGURES = {
    "monte-carlo": {"distributions", "rank_correlation", "convergence", "impact_speed"},
    "sobol": {"indices", "heatmap", "convergence", "main_effects_hic15"},
    "morris": {"mean_effects", "elementary_effects"},
    "injury": {"ais", "risk_hic15", "exceedance", "roc"},
    "model-comparison": {"variance", "pairs_soft_stiff", "breaking_soft_stiff", "along_soft_stiff"},
    "map": {"map_hic15", "exceedance_hic15"},
    "multi-fidelity": {"exceedance_hic15"},
    "model-chain": {"split_hic15"},
    "posterior": {"posterior", "evidence", "assumptions", "ranks"},
}
SOFT = FAILING.replace("median = 8.4", "median = 2.0")
"""Hoods of which one in ten is too soft."""
text_of = partial(study_text, outputs=("hic15",))
FINISHED: dict[str, ResultsFolder] = {}


@pytest.fixture(params=list(KINDS))
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def finished(kind: str, tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Return a finished folder, drawn once for all tests; copy it before it is changed."""
    if kind not in FINISHED:
        FINISHED[kind] = ResultsFolder(tmp_path_factory.mktemp("finished") / kind)
        with by_formula():
            run_text(text_of(kind), FINISHED[kind])
    return FINISHED[kind]


@pytest.fixture
def folder(finished: ResultsFolder, tmp_path: Path) -> ResultsFolder:
    """Return a copy of a finished folder."""
    return ResultsFolder(shutil.copytree(finished.path, tmp_path / "copy"))


def parts_of(folder: ResultsFolder) -> list[ResultsFolder]:
    """Return the folders that hold runs: the study's own or those of its cells."""
    names = folder.read_json("manifest.json")["design"].get("cells")
    return [ResultsFolder(folder.path / "cells" / name) for name in names] if names else [folder]


def digests(folder: ResultsFolder) -> list[str]:
    return [part.read_json("manifest.json")["digest"] for part in parts_of(folder)]


def cut(folder: ResultsFolder, keep: Callable[[pd.DataFrame], Any]) -> None:
    """Leave a folder as a kill does: some of its runs, in parts, and no analysis."""
    for part in parts_of(folder):
        runs = part.runs()
        left, half = runs[keep(runs)], len(runs) // 3
        (part.path / "runs.parquet").unlink()
        with part.open_for_writing():
            part.add_part(left.iloc[half:])
            part.add_part(left.iloc[:half])
        manifest = part.read_json("manifest.json")
        part.write_json("manifest.json", manifest | {"finished": False})
    (folder.path / "analysis.json").unlink()


def study_file(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_the_folder_holds_study_runs_analysis_figures_and_report(
    kind: str, finished: ResultsFolder
) -> None:
    assert (finished.path / "study.toml").read_text() == text_of(kind)
    manifest, analysis = finished.read_json("manifest.json"), finished.read_json("analysis.json")
    assert manifest["finished"]
    runs = [part.runs() for part in parts_of(finished)]
    assert digests(finished) == [digest(table) for table in runs]
    total = sum(map(len, runs))
    assert manifest["counts"] == analysis["status"] == {"ok": total}
    assert manifest["design"]["n"] == analysis["runs"] == total
    assert finished.progress() == (total, {"ok": total})
    assert not list(finished.path.rglob("parts"))
    for table in runs:
        assert table["run"].tolist() == list(range(len(table)))
    assert not re.search(r"\b(NaN|Infinity)\b", (finished.path / "analysis.json").read_text())
    found = {path.stem for path in (finished.path / "figures").iterdir()}
    assert FIGURES[kind] <= found
    for name in found:
        for ending, start in ((".png", b"\x89PNG"), (".svg", b"<?xml")):
            content = (finished.path / "figures" / f"{name}{ending}").read_bytes()
            assert content.startswith(start) and len(content) > 1000
            assert b"<script" not in content


def test_the_report_stands_alone_and_escapes_what_users_write(
    kind: str, finished: ResultsFolder
) -> None:
    html = (finished.path / "report.html").read_text()
    assert_stands_alone(html)
    assert "Headform &amp; &lt;script&gt;hood&lt;/script&gt; [bold]" in html.replace(
        "Headform &lt;", "Headform &amp; &lt;"
    )
    assert html.count("data:image/png") >= len(FIGURES[kind])
    if kind == "injury":
        assert "low &lt;b&gt; [red] $x$ %" in html


def test_one_and_two_workers_give_the_same_bits(kind: str, tmp_path: Path, undrawn: None) -> None:
    found = []
    for workers in (1, 2):
        folder = ResultsFolder(tmp_path / str(workers))
        analysis = run_text(text_of(kind), folder, workers=workers)
        found.append((analysis, digests(folder)))
    assert found[0] == found[1]
    # And so does any run that is run again, where a run is of the study itself.
    if parts_of(folder) != [folder]:
        with pytest.raises(UserError):
            api.rerun(folder, 13)
        return
    row, again = folder.runs().iloc[13], api.rerun(folder, 13)
    assert {name: row[name] for name in again.outputs} == dict(again.outputs)
    with pytest.raises(UserError, match="has no run 9999"):
        api.rerun(folder, 9999)


def test_the_same_command_again_runs_nothing_and_changes_nothing(
    kind: str, folder: ResultsFolder, fast: None
) -> None:
    before = contents(folder.path)
    np.random.seed(5)  # noqa: NPY002
    state = global_state()
    with recorded_parts() as ids:
        run_text(text_of(kind), folder)
    assert ids == []
    assert global_state() == state
    after = contents(folder.path)
    changed = {name for name in before if before[name] != after[name]}
    # The time that the runs took is added up, and the pictures are left out here.
    assert {Path(name).name for name in changed} <= {"manifest.json", "report.html"}


def test_a_killed_study_goes_on_to_the_same_bits(
    kind: str, finished: ResultsFolder, folder: ResultsFolder, fast: None
) -> None:
    cut(folder, lambda runs: (runs["run"] % 7 != 3) & ~runs["run"].between(10, 25))
    if kind in ("injury", "model-comparison", "multi-fidelity", "model-chain"):
        shutil.rmtree(parts_of(folder)[0].path)
    held = [part.runs()["run"] for part in parts_of(folder) if part.path.exists()]
    with recorded_parts() as ids:
        analysis = run_text(text_of(kind), folder)
    assert len(ids) == sum(len(part.runs()) for part in parts_of(folder)) - sum(map(len, held))
    assert digests(folder) == digests(finished)
    assert analysis == finished.read_json("analysis.json")


def test_a_larger_design_keeps_what_was_run_and_a_smaller_drops_nothing(
    kind: str, finished: ResultsFolder, folder: ResultsFolder, tmp_path: Path, fast: None
) -> None:
    before = [part.runs() for part in parts_of(folder)]
    with recorded_parts() as ids:
        analysis = run_text(text_of(kind, LARGER[kind]), folder)
    after = [part.runs() for part in parts_of(folder)]
    assert sorted(ids) == sorted(
        run for small, large in zip(before, after, strict=True)
        for run in range(len(small), len(large))
    )  # fmt: skip
    for small, large in zip(before, after, strict=True):
        pd.testing.assert_frame_equal(large.iloc[: len(small)], small, check_exact=True)
    fresh = ResultsFolder(tmp_path / "fresh")
    assert run_text(text_of(kind, LARGER[kind]), fresh) == analysis
    assert digests(fresh) == digests(folder)
    with recorded_parts() as ids:
        assert run_text(text_of(kind), folder) == finished.read_json("analysis.json")
    assert ids == []
    assert [len(part.runs()) for part in parts_of(folder)] == list(map(len, after))
    done, _ = folder.progress()
    assert done == sum(map(len, before)) == folder.design()["n"]


def test_a_report_is_rebuilt_from_the_folder_alone(
    finished: ResultsFolder, folder: ResultsFolder, fast: None
) -> None:
    for name in ("analysis.json", "report.html"):
        (folder.path / name).unlink()
    answer = mcstudy("report", folder.path)
    assert (answer.code, answer.err) == (0, "")
    before = (finished.path / "analysis.json").read_bytes()
    assert (folder.path / "analysis.json").read_bytes() == before
    pages = [(it.path / "report.html").read_text() for it in (finished, folder)]
    first, again = (re.sub(r"(?s)\s*<figure>.*?</figure>", "", page) for page in pages)
    assert first == again


def test_the_command_line_prints_the_result_as_words_or_as_one_object(
    kind: str, folder: ResultsFolder, tmp_path: Path, fast: None
) -> None:
    study = study_file(tmp_path / "study.toml", text_of(kind))
    command = ("run", study, "--out", folder.path, "--workers", "1")
    answer = mcstudy(*command)
    assert (answer.code, answer.err) == (0, "")
    total = folder.read_json("analysis.json")["runs"]
    assert f"{total} runs: {total} ok report: {folder.path / 'report.html'}" in answer.line
    assert "None" not in answer.out
    assert ("low <b> [red] $x$ %" in answer.line) == (kind == "injury")
    assert mcstudy("report", folder.path).out == answer.out
    content = {"folder": str(folder.path), "analysis": folder.read_json("analysis.json")}
    assert json.loads(mcstudy("report", folder.path, "--json").out) == content
    assert mcstudy("report", folder.path, "--quiet").out == ""
    assert json.loads(mcstudy(*command, "--json").out) == content
    assert mcstudy("status", folder.path).out == (
        f"headform_{kind}: {total} of {total} runs done ({total} ok)\n"
    )
    status = {"done": total, "total": total, "counts": {"ok": total}}
    assert json.loads(mcstudy("status", folder.path, "--json").out) == status
    # From Python, to the same numbers.
    again = api.run_study(study, out=tmp_path / "again", workers=1)
    assert again.read_json("analysis.json") == content["analysis"] == api.build_report(again)


@pytest.mark.parametrize(
    ("edit", "differs"),
    [
        (("sigma = 0.2", "sigma = 0.21"), "inputs.headform_mass"),
        (("seed = 11", "seed = 12"), "seed"),
        (("channel_class = 0.0", "channel_class = 1000.0"), "model"),
    ],
)
def test_another_study_is_refused_with_what_differs_and_changes_nothing(
    kind: str, finished: ResultsFolder, tmp_path: Path, edit: tuple[str, str], differs: str
) -> None:
    text, before = text_of(kind).replace(*edit, 1), contents(finished.path)
    assert text != text_of(kind)
    said = told(mcstudy("run", study_file(tmp_path / "s.toml", text), "--out", finished.path))
    assert f"holds another study (it differs in {differs})" in said
    if kind in ("injury", "model-comparison", "model-chain"):
        assert "scenario reference, front car: " in said or ": models.soft: " in said
    assert contents(finished.path) == before


def test_a_folder_of_another_kind_is_refused(
    kind: str, finished: ResultsFolder, tmp_path: Path
) -> None:
    other = {"monte-carlo": "sobol", "sobol": "morris", "morris": "monte-carlo"}.get(kind)
    if other is None:
        return
    study = study_file(tmp_path / "s.toml", text_of(other))
    assert "holds another study" in told(mcstudy("run", study, "--out", finished.path))


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (("[design]\nn = ", "[design]\nn = -"), "design.n"),
        (('unit = "km/h"', 'unit = "kg"'), "inputs.impact_speed.unit: unit 'kg' measures mass"),
        (('name = "headform"', 'name = "headfrom"'), "model: unknown model 'headfrom'"),
        (("hood_curve = ", "curve = "), "model: "),
        (("[0.1, ", "[-0.1, "), "model: "),
        (("seed = 11", "sede = 11"), "sede: unknown key"),
        (('distribution = "lognormal"', 'distribution = "gauss"'), "inputs.impact_speed"),
        (("sigma = 0.12", "sigma = -0.12"), "inputs.impact_speed.sigma"),
        (("[inputs.headform_mass]", "[inputs.hood_colour]"), "inputs.hood_colour"),
        (('["hic15"]', '["throw_distance"]'), "no output 'throw_distance'"),
        (('["hic15"]', '["hic15", "hic15"]'), "report.outputs: names 'hic15' twice"),
        (("[design]", '[dependence]\ncorrelations = [["impact_speed", "nope", 0.5]]\n[design]'),
         "'nope' is not a sampled input"),
    ],
)  # fmt: skip
def test_a_wrong_study_file_is_told_in_one_line_and_makes_no_folder(
    kind: str, tmp_path: Path, edit: tuple[str, str], message: str
) -> None:
    text = text_of(kind).replace(*edit, 1)
    if text == text_of(kind):
        assert (kind == "injury" and "outputs" not in text) or "[design]" in edit[0]
        return
    study = study_file(tmp_path / "bad.toml", text)
    assert message in told(mcstudy("run", study, "--out", tmp_path / "deep" / "out"))
    assert [path.name for path in tmp_path.iterdir()] == ["bad.toml"]


def test_too_many_failed_runs_end_the_study_and_its_report_with_1(
    kind: str, tmp_path: Path, fast: None
) -> None:
    text = text_of(kind, inputs=SOFT, force=100.0)
    study, out = study_file(tmp_path / "s.toml", text), tmp_path / "out"
    command = ("run", study, "--out", out, "--workers", "1")
    said = told(mcstudy(*command), 1)
    assert re.search(r"\d\.\d% of the runs failed \(\d+ time_limit\)", said)
    assert "max_failure_rate = 2.0%" in said
    assert not (out / "analysis.json").exists()
    if parts_of(ResultsFolder(out)) == [ResultsFolder(out)]:
        assert told(mcstudy("report", out), 1) == said
    # With the limit raised everything that ran is used, and what failed is told.
    study.write_text(text.replace("rate = 0.02", "rate = 0.5"))
    answer = mcstudy(*command)
    assert (answer.code, answer.err) == (0, "")
    failures = ResultsFolder(out).read_json("analysis.json")["failures"]
    lost = sum((part.runs()["status"] != "ok").sum() for part in parts_of(ResultsFolder(out)))
    assert lost > 0
    if kind not in ("morris", "model-comparison"):
        assert failures["runs"] == lost
        assert failures["where"]["hood_force_scale"]["place"] == "low"
        assert "hood force scale low" in (out / "report.html").read_text()
    assert f"{lost} time_limit" in answer.line


def test_sensitivity_is_measured_where_runs_are_a_sample_alone(
    kind: str, folder: ResultsFolder, undrawn: None
) -> None:
    answer = mcstudy("sensitivity", folder.path, "--quiet")
    if kind in ("monte-carlo", "sobol", "posterior"):
        assert (answer.code, answer.err) == (0, "")
        return
    refused = f"is the folder of a study of kind {kind}"
    assert ("of a Morris study" if kind == "morris" else refused) in told(answer)
    assert not (folder.path / "sensitivity").exists()


def test_an_unfinished_folder_tells_to_go_on_or_reports_its_whole_parts(
    kind: str, finished: ResultsFolder, folder: ResultsFolder, undrawn: None
) -> None:
    total = folder.design()["n"]
    lost = sum(len(part.runs()) > 50 for part in parts_of(folder))
    cut(folder, lambda runs: runs["run"] != 50)
    status = json.loads(mcstudy("status", folder.path, "--json").out)
    assert status == {"done": total - lost, "total": total, "counts": {"ok": total - lost}}
    answer = mcstudy("report", folder.path, "--json")
    if kind in ("injury", "model-comparison", "multi-fidelity", "model-chain"):
        assert "run the study again" in told(answer)
        return
    wanted = {
        "monte-carlo": 119,
        "sobol": 50 // 6 * 6,
        "morris": 50 // 5 * 5,
        "map": 66,
        "posterior": 127,
    }[kind]
    assert json.loads(answer.out)["analysis"]["runs"] == wanted
    if kind in ("sobol", "morris"):
        shutil.rmtree(folder.path)
        shutil.copytree(finished.path, folder.path)
        cut(folder, lambda runs: runs["run"] != 20)
        assert "too few runs are done" in told(mcstudy("report", folder.path))


@pytest.mark.parametrize("name", ["manifest.json", "study.toml", "runs.parquet", "cells"])
def test_a_folder_that_lacks_something_is_told_in_one_line(
    folder: ResultsFolder, name: str, undrawn: None
) -> None:
    path = folder.path / name
    if not path.exists():
        return
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    assert_told(folder.path)
    if name != "manifest.json":
        assert mcstudy("report", folder.path).code == 2


def assert_told(folder: Path) -> None:
    """Check that every command on a folder succeeds in silence or says one line of why not."""
    for command in ("status", "report", "sensitivity"):
        answer = mcstudy(command, folder)
        if answer.code:
            assert len(told(answer, answer.code)) < 2100
            assert answer.code in (1, 2)
        else:
            assert answer.err == ""


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=6,
)  # fmt: skip
Changed = Callable[[pd.DataFrame, str], Any]
RUNS: dict[str, Changed] = {
    "drop": lambda runs, name: runs.drop(columns=name),
    "text": lambda runs, name: runs.assign(**{name: "<script>alert(1)</script>"}),
    "nan": lambda runs, name: runs.assign(**{name: np.nan}),
    "inf": lambda runs, name: runs.assign(**{name: np.inf}),
    "empty": lambda runs, _: runs.iloc[:0],
    "twice": lambda runs, _: pd.concat([runs, runs]),
    "order": lambda runs, _: runs.sample(frac=0.5, random_state=1),
}


def spoil(path: Path, data: st.DataObject) -> None:
    """Damage a file of a folder as bytes, or as what it holds."""
    if path.name == "manifest.json" and data.draw(st.booleans()):
        manifest = json.loads(path.read_text())
        key = data.draw(st.sampled_from([*manifest, *(f"design.{k}" for k in manifest["design"])]))
        table, _, inner = key.partition(".")
        where = manifest[table] if inner else manifest
        where[inner or table] = data.draw(JSON)
        if isinstance(manifest["design"], dict) and data.draw(st.booleans()):
            manifest["design"]["cells"] = data.draw(st.sampled_from([["../x"], ["/etc"], [1], "a"]))
        path.write_text(json.dumps(manifest))
    elif path.suffix == ".parquet" and data.draw(st.booleans()):
        runs = pd.read_parquet(path)
        change = RUNS[data.draw(st.sampled_from(list(RUNS)))]
        change(runs, data.draw(st.sampled_from(list(runs.columns)))).to_parquet(path)
    else:
        raw = path.read_bytes()
        at = data.draw(st.integers(0, len(raw)))
        junk, rest = data.draw(st.binary(max_size=20)), data.draw(st.sampled_from([0, 1, len(raw)]))
        number = data.draw(st.sampled_from([b"0.", b"-1e308", b"null", b"9" * 250, b"[]"]))
        path.write_bytes((raw[:at] + junk + raw[at + rest :]).replace(b"0.", number, 1))


def check_spoilt(kind: str, source: Path, tmp_path_factory: pytest.TempPathFactory,
                 options: settings) -> None:  # fmt: skip
    @options
    @given(st.data())
    def drawn(data: st.DataObject) -> None:
        outside = tmp_path_factory.mktemp("outside")
        folder = Path(shutil.copytree(source, outside / "folder"))
        files = [
            path for path in folder.rglob("*") if path.suffix in (".json", ".toml", ".parquet")
        ]
        spoil(data.draw(st.sampled_from(sorted(files))), data)
        assert_told(folder)
        assert [path.name for path in outside.iterdir()] == ["folder"]
        shutil.rmtree(outside)

    with (
        without_figures(),
        mock.patch.object(delta, "RESAMPLES", 2),
        mock.patch.object(given_data, "DUMMIES", 4),
    ):
        drawn()


FEW = settings(
    derandomize=True, deadline=None, database=None, max_examples=8,
    suppress_health_check=list(HealthCheck),
)  # fmt: skip


def test_a_spoilt_folder_is_told_in_one_line(
    kind: str, finished: ResultsFolder, tmp_path_factory: pytest.TempPathFactory
) -> None:
    with by_formula():
        check_spoilt(kind, finished.path, tmp_path_factory, FEW)


@pytest.mark.slow
def test_hundreds_of_spoilt_folders_are_told_in_one_line(
    kind: str, finished: ResultsFolder, tmp_path_factory: pytest.TempPathFactory
) -> None:
    options = settings(FEW, derandomize=False, max_examples=200, print_blob=True)
    with by_formula():
        check_spoilt(kind, finished.path, tmp_path_factory, options)


Frame = pd.DataFrame
DAMAGE: dict[str, tuple[dict[str, Any], Callable[[Frame], Frame], str]] = {
    "no design": ({"design": 3}, Frame.copy, "has no table 'design'"),
    "cells": ({"design": {"n": 1, "cells": ["../x"]}}, Frame.copy, "must be names of folders"),
    "text": ({}, lambda runs: runs.assign(hic15="x"), "'hic15' of its runs holds no numbers"),
    "no run": ({}, lambda runs: runs.drop(columns="run"), "is no table of runs"),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGE)
def test_known_damage_is_told_as_such(folder: ResultsFolder, name: str, undrawn: None) -> None:
    change, damage, message = DAMAGE[name]
    part = parts_of(folder)[0]
    damage(part.runs()).to_parquet(part.path / "runs.parquet")
    folder.write_json("manifest.json", folder.read_json("manifest.json") | change)
    assert message in told(mcstudy("status" if change else "report", folder.path))


def test_text_in_the_runs_is_no_markup_in_the_report(folder: ResultsFolder, undrawn: None) -> None:
    for part in parts_of(folder):
        runs = part.runs()
        runs.loc[runs.index[-1], ["status", "reason"]] = ["<script>x</script>"] * 2
        part.compact(runs)
    few = min(len(part.runs()) for part in parts_of(folder)) < 100
    assert mcstudy("report", folder.path).code == 0 or few
    assert "<script>x" not in (folder.path / "report.html").read_text()
