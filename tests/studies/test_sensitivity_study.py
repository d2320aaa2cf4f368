"""Sensitivity from the runs of any folder: known indices, what is refused, what is left alone."""

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from headform_studies import (
    FAILING,
    INPUTS,
    SPREADS,
    assert_stands_alone,
    by_formula,
    contents,
    copy_of,
    first_order,
    global_state,
    mcstudy,
    run_text,
    shares,
    study_text,
    told,
    unfinished,
    without_figures,
)

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.sensitivity import delta, given_data
from mcstudy.typed_json import from_plain, to_plain
from studies.sensitivity import measure as given_data_study
from studies.sensitivity import report as sensitivity_report
from studies.sensitivity.analysis import MeasuredOutput

DESIGNS = {
    "monte-carlo": 'method = "monte-carlo"\nn = 512',
    "latin-hypercube": 'method = "latin-hypercube"\nn = 512\nreplicate_size = 128',
    "sobol": 'method = "sobol"\nn = 512\nreplicate_size = 128',
}
SMALL = 'method = "latin-hypercube"\nn = 256\nreplicate_size = 64'
NOTHING = """
[inputs.friction_body_car]
distribution = "uniform"
low = 0.2
high = 0.3
"""
"""Friction does nothing where the headform strikes perpendicularly."""
DEPENDENT = '[dependence]\ncorrelations = [["impact_speed", "headform_mass", 0.6]]\n'
MEASURES = ("first_order", "delta", "pawn")


@pytest.fixture(scope="module", autouse=True)
def formula() -> Iterator[None]:
    """Run every study by formula."""
    with by_formula():
        yield


def measure_sensitivity(
    source: ResultsFolder, out: ResultsFolder | None = None, **options: Any
) -> dict[str, Any]:
    """Return the analysis as it is in JSON."""
    plain: dict[str, Any] = to_plain(given_data_study.measure_sensitivity(source, out, **options))
    return plain


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Leave the figures out, and most of delta's resamples and of the dummies."""
    monkeypatch.setattr(delta, "RESAMPLES", 4)
    monkeypatch.setattr(given_data, "DUMMIES", 8)
    with without_figures():
        yield


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Return a Monte Carlo folder with an input that does nothing."""
    results = ResultsFolder(tmp_path_factory.mktemp("sources") / "small")
    with without_figures():
        run_text(study_text("monte-carlo", SMALL, inputs=INPUTS + NOTHING), results)
    return results


@pytest.fixture(scope="module")
def saltelli(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Return the folder of a Sobol' study of 128 base points, with second order."""
    results = ResultsFolder(tmp_path_factory.mktemp("sources") / "saltelli")
    with without_figures():
        run_text(study_text("sobol", "n = 128\nsecond_order = true"), results)
    return results


@pytest.fixture(scope="module")
def drawn(
    source: ResultsFolder, tmp_path_factory: pytest.TempPathFactory
) -> tuple[ResultsFolder, dict[str, Any]]:
    """Return a report with its figures, and its analysis."""
    out = ResultsFolder(tmp_path_factory.mktemp("drawn") / "report")
    return out, measure_sensitivity(source, out, outputs=["hic15"], quiet=True)


@pytest.mark.parametrize("method", DESIGNS)
def test_first_order_indices_are_those_of_the_closed_form(
    tmp_path: Path, undrawn: None, method: str
) -> None:
    results = ResultsFolder(tmp_path / method)
    run_text(study_text("monte-carlo", DESIGNS[method], inputs=INPUTS + NOTHING), results)
    analysis = measure_sensitivity(results, quiet=True)
    assert list(analysis["outputs"]) == ["hic15", "peak_force"]
    assert analysis["runs"] == 512
    assert analysis["dependent"] == []
    for output, entry in analysis["outputs"].items():
        assert entry["runs"] == 512
        assert list(entry["measures"]) == list(MEASURES)
        table = entry["measures"]["first_order"]["inputs"]
        truth = first_order(shares(output)) | {"friction_body_car": 0.0}
        assert list(table) == list(truth)
        for name, value in truth.items():
            row = table[name]
            assert row["low"] < row["value"] < row["high"]
            assert abs(row["value"] - value) <= 1.5 * (row["high"] - row["value"])
            assert row["value"] == pytest.approx(value, abs=0.1)
        for measure in MEASURES:
            rows = entry["measures"][measure]["inputs"]
            for row in rows.values():
                assert row["clear"] == (row["value"] > entry["measures"][measure]["noise"])
            weakest = min(rows, key=lambda name: rows[name]["value"])
            assert weakest == "friction_body_car"
            strongest = max(rows, key=lambda name: rows[name]["value"])
            assert strongest == max(truth, key=lambda name: truth[name])
    assert analysis["outputs"]["hic15"]["measures"]["delta"]["inputs"]["impact_speed"]["clear"]


def test_of_a_sobol_study_only_independent_runs_are_used(
    saltelli: ResultsFolder, tmp_path: Path, undrawn: None
) -> None:
    analysis = measure_sensitivity(saltelli, ResultsFolder(tmp_path / "out"), quiet=True)
    assert analysis["kind"] == "sobol"
    assert (analysis["runs"], len(saltelli.runs())) == (256, 1280)
    truth = first_order(shares("hic15"))
    table = analysis["outputs"]["hic15"]["measures"]["first_order"]["inputs"]
    for name in SPREADS:
        half = table[name]["high"] - table[name]["value"]
        assert abs(table[name]["value"] - truth[name]) <= 1.5 * half
    own = saltelli.read_json("analysis.json")["outputs"]["hic15"]["first"]
    for name in SPREADS:
        assert table[name]["value"] == pytest.approx(own[name]["value"], abs=0.15)


def test_the_numbers_are_a_function_of_the_folder(
    source: ResultsFolder, tmp_path: Path, undrawn: None
) -> None:
    np.random.seed(5)  # noqa: NPY002
    before = global_state()
    first, second = (ResultsFolder(tmp_path / name) for name in ("first", "second"))
    measure_sensitivity(source, first, quiet=True)
    measure_sensitivity(source, second, quiet=True)
    assert global_state() == before
    for name in ("analysis.json", "report.html"):
        assert (first.path / name).read_bytes() == (second.path / name).read_bytes()


def test_main_effects_follow_the_power_of_the_input(
    drawn: tuple[ResultsFolder, dict[str, Any]],
) -> None:
    effects = drawn[1]["main_effects"]["hic15"]
    speed = effects["impact_speed"]
    slope = np.polyfit(np.log(speed["x"]), np.log(speed["mean"]), 1)[0]
    assert slope == pytest.approx(2.5, abs=0.5)
    flat = effects["friction_body_car"]
    assert np.ptp(flat["mean"]) < 0.5 * np.ptp(speed["mean"])
    assert list(effects) == [*SPREADS, "friction_body_car"]


def test_failed_runs_are_left_out(tmp_path: Path, undrawn: None) -> None:
    results = ResultsFolder(tmp_path / "failing")
    text = study_text(
        "monte-carlo", SMALL, inputs=FAILING,
        force=100.0, limit=0.5, outputs=("hic15",),
    )  # fmt: skip
    run_text(text, results)
    runs = results.runs()
    failed = runs["status"] != "ok"
    assert failed.sum() > 5
    # Numbers that a failed run leaves behind are no outcome.
    runs.loc[failed, "hic15"] = 1e9
    analysis = measure_sensitivity(copy_of(results, tmp_path / "spoilt", runs), quiet=True)
    assert analysis["runs"] == analysis["outputs"]["hic15"]["runs"] == 256 - failed.sum()
    assert max(analysis["main_effects"]["hic15"]["hood_force_scale"]["mean"]) < 1e6


def test_runs_without_a_value_are_left_out_of_that_output(
    source: ResultsFolder, tmp_path: Path, undrawn: None
) -> None:
    runs = source.runs()
    held = runs["hic15"].where(runs["run"] % 4 != 0)
    analysis = measure_sensitivity(
        copy_of(source, tmp_path / "part", runs.assign(hic15=held)), quiet=True
    )
    assert [entry["runs"] for entry in analysis["outputs"].values()] == [192, 256]
    part = copy_of(source, tmp_path / "none", runs.assign(hic15=np.nan))
    with pytest.raises(UserError, match="hic15: 0 runs have a value"):
        measure_sensitivity(part, quiet=True)
    analysis = measure_sensitivity(part, outputs=["peak_force"], quiet=True)
    assert list(analysis["outputs"]) == ["peak_force"]


def test_an_unfinished_folder_is_measured(
    source: ResultsFolder, tmp_path: Path, undrawn: None
) -> None:
    runs = source.runs()
    part = unfinished(source, tmp_path / "part", runs[runs["run"] % 3 != 1])
    answer = mcstudy("sensitivity", part.path, "--output", "hic15", "--json")
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["analysis"]["runs"] == 171


def test_dependent_inputs_are_named(tmp_path: Path, undrawn: None) -> None:
    results = ResultsFolder(tmp_path / "dependent")
    design = SMALL
    run_text(study_text("monte-carlo", design, inputs=INPUTS + NOTHING, more=DEPENDENT), results)
    analysis = measure_sensitivity(results, quiet=True)
    assert analysis["dependent"] == ["headform_mass", "impact_speed"]
    html = (results.path / "sensitivity" / "report.html").read_text()
    assert "headform mass, impact speed depend on each other" in html
    # The mass goes with the speed: its share of HIC15 shows less of it than it has alone, and what
    # goes with the speed is closed-form as well.
    own, mass, scale = 2.5 * 0.12, -0.75 * 0.2, 0.75 * 0.3
    both = own**2 + mass**2 + 2.0 * 0.6 * own * mass + scale**2
    seen = (own + 0.6 * mass) ** 2
    truth = math.expm1(seen) / math.expm1(both)
    row = analysis["outputs"]["hic15"]["measures"]["first_order"]["inputs"]["impact_speed"]
    assert abs(row["value"] - truth) <= 1.5 * (row["high"] - row["value"])


def test_dependence_within_a_group_of_a_sobol_study_is_named(tmp_path: Path, undrawn: None) -> None:
    results = ResultsFolder(tmp_path / "grouped")
    more = f'[groups]\ntest = ["impact_speed", "headform_mass"]\n{DEPENDENT}'
    run_text(study_text("sobol", "n = 64", more=more), results)
    analysis = measure_sensitivity(results, quiet=True)
    assert analysis["dependent"] == ["headform_mass", "impact_speed"]
    assert list(analysis["outputs"]["hic15"]["measures"]["delta"]["inputs"]) == list(SPREADS)


def test_an_unknown_output_is_refused(source: ResultsFolder) -> None:
    said = told(mcstudy("sensitivity", source.path, "--output", "hic15", "--output", "hic16"))
    assert "--output: model 'headform' has no output 'hic16'" in said
    assert "hic36" in said
    assert not (source.path / "sensitivity").exists()


def test_too_few_runs_are_refused(source: ResultsFolder, tmp_path: Path) -> None:
    few = copy_of(source, tmp_path / "few", source.runs().iloc[:99])
    said = told(mcstudy("sensitivity", few.path))
    assert "hic15: 99 runs have a value, 100 are needed" in said
    assert not (few.path / "sensitivity").exists()


def test_the_source_is_left_as_it_was_and_the_report_lies_beside(
    source: ResultsFolder, tmp_path: Path, undrawn: None
) -> None:
    results = copy_of(source, tmp_path / "source")
    for name in ("analysis.json", "report.html"):
        results.write_text(name, (source.path / name).read_text())
    before = contents(results.path)
    answer = mcstudy("sensitivity", results.path)
    assert answer.code == 0, answer.err
    after = contents(results.path)
    assert {name: after[name] for name in before} == before
    added = set(after) - set(before)
    assert {name.split("/")[0] for name in added} == {"sensitivity"}
    assert {"sensitivity/analysis.json", "sensitivity/report.html"} <= added
    assert str(results.path / "sensitivity" / "report.html") in answer.out
    assert "HIC15" in answer.line
    assert "impact speed" in answer.line
    assert answer.err == ""


def test_out_json_and_quiet(source: ResultsFolder, tmp_path: Path, undrawn: None) -> None:
    out = tmp_path / "elsewhere"
    command = ("sensitivity", source.path, "--out", out, "--output", "peak_force")
    content = json.loads(mcstudy(*command, "--json").out)
    analysis = json.loads((out / "analysis.json").read_text())
    assert content == {"folder": str(out), "analysis": analysis}
    assert analysis["source"] == str(source.path)
    assert not (source.path / "sensitivity").exists()
    quiet = mcstudy(*command, "--quiet")
    assert (quiet.code, quiet.out, quiet.err) == (0, "", "")
    # An output has the same numbers alone and among others.
    both = measure_sensitivity(source, ResultsFolder(tmp_path / "both"), quiet=True)
    assert analysis["outputs"] == {"peak_force": both["outputs"]["peak_force"]}
    told(mcstudy("sensitivity", source.path, "--out", source.path))


def test_report_is_self_contained_and_drawn(drawn: tuple[ResultsFolder, dict[str, Any]]) -> None:
    folder = drawn[0].path
    html = (folder / "report.html").read_text()
    assert_stands_alone(html)
    assert "depend on each other" not in html
    assert "256 runs of the monte-carlo study headform_monte-carlo" in html
    assert "noise line" in html
    assert "None of them detects an input that acts through interactions alone" in html
    names = {file.stem for file in (folder / "figures").iterdir()}
    assert names == {"measures_hic15", "main_effects_hic15"}
    row = re.search(r"<tr><td[^>]*>friction body–car</td>(.*?)</tr>", html)
    assert row is not None
    assert len(re.findall(r"<td", row.group(1))) == len(MEASURES)


def made_up(**rows: tuple[float, bool, bool, bool]) -> MeasuredOutput:
    """Return an entry of inputs with a first-order value and what is clear in each measure."""
    plain = {
        "unit": "1",
        "runs": 500,
        "measures": {
            measure: {
                "noise": 0.05,
                "inputs": {
                    name: {"value": row[0], "low": row[0] - 0.03, "high": row[0] + 0.03,
                           "clear": row[1 + k]}
                    for name, row in rows.items()
                },
            }
            for k, measure in enumerate(MEASURES)
        },
    }  # fmt: skip
    return from_plain(MeasuredOutput, plain)


def test_a_sentence_names_shares_shape_and_none() -> None:
    text = sensitivity_report.sentence(
        "hic15",
        made_up(
            age=(0.01, False, False, False),
            gait_phase=(0.2, True, True, True),
            impact_speed=(0.5, True, True, True),
            yaw_rate=(0.02, False, True, True),
            dive_angle=(-0.01, False, True, False),
        ),
    )
    assert "impact speed 50 ± 3 %, gait phase 20 ± 3 %" in text
    assert "Its distribution also depends on yaw rate, dive angle" in text
    assert text.endswith("Not distinguishable from zero: age.")


def test_a_sentence_without_a_clear_input() -> None:
    text = sensitivity_report.sentence("wad", made_up(age=(-0.01, False, False, False)))
    assert text.startswith("No input has a clear first-order effect on wrap-around distance")
    assert text.endswith("Not distinguishable from zero: age.")
    assert "-" not in text.replace("wrap-around", "").replace("first-order", "")
