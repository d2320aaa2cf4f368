"""The Monte Carlo study from file to folder, on the real model."""

from pathlib import Path

import numpy as np
import pytest

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.results import ResultsFolder, digest
from models.registry import load_model
from studies.api import build_report, rerun
from studies.kinds import parse_study
from studies.monte_carlo.schema import MonteCarloStudy
from studies.monte_carlo.study import MonteCarlo

SMALL = (
    Path("configs/paper_study.toml")
    .read_text()
    .replace("n = 2000", "n = 24")
    .replace("replicate_size = 200 ", "replicate_size = 8 ")
    .replace("histories = 8", "histories = 1")
)


def load(text: str = SMALL) -> MonteCarloStudy:
    study = parse_study(text)
    assert isinstance(study, MonteCarloStudy)
    return study


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    results = ResultsFolder(tmp_path_factory.mktemp("results") / "small")
    MonteCarlo().run(load(), SMALL, results, workers=2, quiet=True)
    return results


def test_folder_holds_what_the_design_says(folder: ResultsFolder) -> None:
    names = {path.name for path in folder.path.iterdir()}
    assert {"study.toml", "manifest.json", "runs.parquet", "histories", "analysis.json",
            "figures", "report.html"} <= names  # fmt: skip
    assert "parts" not in names
    runs, model = folder.runs(), load_model("multibody")
    assert len(runs) == 24
    assert {i.name for i in model.inputs} | {o.name for o in model.outputs} <= set(runs.columns)
    manifest = folder.read_json("manifest.json")
    assert manifest["digest"] == digest(runs)
    assert manifest["counts"] == runs["status"].value_counts().to_dict()
    assert (folder.path / "study.toml").read_text() == SMALL


def test_inputs_carry_units_and_dependence(folder: ResultsFolder) -> None:
    runs = folder.runs()
    # km/h, degrees and centimetres of the file are m/s, rad and m in the table.
    assert runs["impact_speed"].between(36.0 / 3.6, 48.0 / 3.6).all()
    assert runs["stature"].between(1.0, 1.5).all()
    assert runs["stature"].corr(runs["body_mass"], method="spearman") > 0.3


@pytest.mark.parametrize("workers", [1, 3])
def test_digest_is_the_same_for_any_number_of_workers(
    folder: ResultsFolder, tmp_path: Path, workers: int
) -> None:
    other = ResultsFolder(tmp_path / "other")
    MonteCarlo().run(load(), SMALL, other, workers=workers, quiet=True)
    assert other.read_json("manifest.json")["digest"] == folder.read_json("manifest.json")["digest"]


def test_digest_is_the_same_after_an_interruption(folder: ResultsFolder, tmp_path: Path) -> None:
    part = ResultsFolder(tmp_path / "part")
    manifest = folder.read_json("manifest.json")
    with part.open_for_writing():
        part.write_json("manifest.json", manifest | {"finished": False})
        part.add_part(folder.runs().iloc[5:11])
    MonteCarlo().run(load(), SMALL, part, workers=2, quiet=True)
    assert part.read_json("manifest.json")["digest"] == manifest["digest"]


def test_the_same_command_again_runs_nothing_anew(folder: ResultsFolder) -> None:
    before = (folder.path / "runs.parquet").read_bytes()
    MonteCarlo().run(load(), SMALL, folder, workers=2, quiet=True)
    assert (folder.path / "runs.parquet").read_bytes() == before


def test_another_study_does_not_mix_with_it(folder: ResultsFolder) -> None:
    other = SMALL.replace("mean = 42.0", "mean = 43.0")
    with pytest.raises(UserError, match=r"differs in inputs\.impact_speed"):
        MonteCarlo().run(load(other), other, folder, quiet=True)


def test_report_is_rebuilt_from_the_folder_alone(folder: ResultsFolder) -> None:
    first = (folder.path / "analysis.json").read_text()
    (folder.path / "analysis.json").unlink()
    (folder.path / "report.html").unlink()
    build_report(folder)
    assert (folder.path / "analysis.json").read_text() == first
    assert "Wrap" not in first
    assert (folder.path / "report.html").exists()


def test_analysis_judges_the_accident(folder: ResultsFolder) -> None:
    analysis = folder.read_json("analysis.json")
    throw = analysis["observed"]["throw_distance"][0]
    runs = folder.runs()
    assert throw["percentile"] == pytest.approx((runs["throw_distance"] <= 14.0).mean())
    assert analysis["observed"]["wad"][0]["value"] == pytest.approx(1.35)
    above = analysis["exceedance"]["hic15"][0]["probability_above"]["value"]
    assert above == pytest.approx((runs["hic15"].dropna() > 700.0).mean())


def test_histories_of_the_first_run_belong_to_it(folder: ResultsFolder) -> None:
    history = folder.history(0)["head"]
    row = folder.runs().iloc[0]
    primary = history[history["time"] < row["ground_time"]]
    assert primary["acceleration"].max() == pytest.approx(row["peak_head_acceleration"], rel=0.02)


def test_any_run_can_be_run_again_to_the_same_bits(folder: ResultsFolder) -> None:
    row = folder.runs().iloc[13]
    again = rerun(folder, 13)
    assert {name: row[name] for name in again.outputs} == dict(again.outputs)
    assert again.histories["head"].time.size > 1000
    with pytest.raises(UserError, match="has no run 99"):
        rerun(folder, 99)


def test_too_many_failures_stop_the_study(tmp_path: Path) -> None:
    # Beside the car: no contact, which is a failed run.
    text = SMALL.replace(
        "mean = -0.72\nsd = 0.05\nlow = -0.82\nhigh = -0.57",
        "mean = -1.7\nsd = 0.05\nlow = -1.8\nhigh = -1.6",
    )
    assert text != SMALL
    results = ResultsFolder(tmp_path / "beside")
    with pytest.raises(StudyError, match="24 no_contact"):
        MonteCarlo().run(load(text), text, results, workers=2, quiet=True)
    assert len(results.runs()) == 24


def test_every_design_runs(tmp_path: Path) -> None:
    for method, size in (("monte-carlo", ""), ("sobol", "replicate_size = 4")):
        text = SMALL.replace('method = "latin-hypercube"', f'method = "{method}"')
        lines = [size if line.startswith("replicate_size") else line for line in text.splitlines()]
        text = "\n".join(lines).replace("n = 24", "n = 8")
        results = ResultsFolder(tmp_path / method)
        analysis = MonteCarlo().run(load(text), text, results, workers=2, quiet=True)
        assert analysis["runs"] == 8
        assert np.isfinite(analysis["outputs"]["hic15"]["mean"]["value"])
