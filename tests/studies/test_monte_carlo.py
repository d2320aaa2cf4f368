"""The Monte Carlo study of the paper's crash: units, dependence, the accident, histories."""

from pathlib import Path

import numpy as np
import pytest
from headform_studies import run_text, study_text, without_figures

from mcstudy.execution.results import ResultsFolder
from models.registry import load_model
from studies.kind import Finished
from studies.kinds import load_study
from studies.monte_carlo.analysis import MonteCarloAnalysis
from studies.monte_carlo.schema import MonteCarloStudy
from studies.monte_carlo.study import MonteCarlo

PAPER = (
    Path("configs/paper_study.toml")
    .read_text()
    .replace("n = 2000", "n = 16")
    .replace("replicate_size = 200 ", "replicate_size = 8 ")
    .replace("histories = 8", "histories = 1")
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    results = ResultsFolder(tmp_path_factory.mktemp("results") / "small")
    with without_figures():
        run_text(PAPER, results)
    return results


def test_inputs_carry_units_and_dependence(folder: ResultsFolder) -> None:
    runs, model = folder.runs(), load_model("multibody")
    assert {i.name for i in model.inputs} | {o.name for o in model.outputs} <= set(runs.columns)
    # km/h, degrees and centimetres of the file are m/s, rad and m in the table.
    assert runs["impact_speed"].between(36.0 / 3.6, 48.0 / 3.6).all()
    assert runs["stature"].between(1.0, 1.5).all()
    assert runs["stature"].corr(runs["body_mass"], method="spearman") > 0.3


def test_analysis_judges_the_accident(folder: ResultsFolder) -> None:
    analysis, runs = folder.read_json("analysis.json"), folder.runs()
    throw = analysis["observed"]["throw_distance"][0]
    assert throw["percentile"] == pytest.approx((runs["throw_distance"] <= 14.0).mean())
    assert analysis["observed"]["wad"][0]["value"] == pytest.approx(1.35)
    above = analysis["exceedance"]["hic15"][0]["probability_above"]["value"]
    assert above == pytest.approx((runs["hic15"].dropna() > 700.0).mean())


def test_every_figure_is_made(folder: ResultsFolder) -> None:
    study, kind = load_study(folder.path / "study.toml"), MonteCarlo()
    assert isinstance(study, MonteCarloStudy)
    done = Finished(study, kind.results(study, folder), folder.read_analysis(MonteCarloAnalysis))
    figures = kind.draw(done)
    assert {"impact_speed", "throw_and_wad"} <= set(figures)
    shown = [f for part in kind.sections(done, figures) for f in part.figures]
    assert len(shown) >= len(figures)


def test_histories_of_the_first_run_belong_to_it(folder: ResultsFolder) -> None:
    history, row = folder.history(0)["head"], folder.runs().iloc[0]
    primary = history[history["time"] < row["ground_time"]]
    assert primary["acceleration"].max() == pytest.approx(row["peak_head_acceleration"], rel=0.02)
    assert not (folder.path / "histories" / "000001").exists()


@pytest.mark.parametrize("design", ["monte-carlo", "sobol"])
def test_every_design_runs(tmp_path: Path, fast: None, design: str) -> None:
    text = study_text("monte-carlo", f'method = "{design}"\nn = 16\nreplicate_size = 4')
    if design == "monte-carlo":
        text = text.replace("replicate_size = 4", "")
    analysis = run_text(text, ResultsFolder(tmp_path))
    assert analysis["runs"] == 16
    assert np.isfinite(analysis["outputs"]["hic15"]["mean"]["value"])
