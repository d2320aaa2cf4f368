"""The Morris study from file to folder: effects against the runs' own, failures, what it says."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from headform_studies import (
    FRAME,
    SPREADS,
    by_formula,
    copy_of,
    mcstudy,
    run_text,
    study_text,
    told,
    without_figures,
)
from scipy import special

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.typed_json import from_plain
from studies import api
from studies.morris import report as morris_report
from studies.morris.analysis import MorrisAnalysis, RankedOutput

BLOCK = 5
"""Rows of a trajectory: its start, three inputs and the dummy."""
MEDIANS = {"impact_speed": 30.0 / 3.6, "headform_mass": 2.5, "hood_force_scale": 1.0}
SPAN = 0.95
"""Probability between the lowest and the highest place of an input."""


def plain(n: int = 24, levels: int = 4, **options: Any) -> str:
    return study_text("morris", f"n = {n}\nlevels = {levels}", **options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Return a study of 24 trajectories."""
    results = ResultsFolder(tmp_path_factory.mktemp("morris") / "drawn")
    with without_figures():
        run_text(plain(), results)
    return results


@pytest.fixture(scope="module")
def failing(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Return a study in which slow light headforms on soft hoods fail."""
    base = tmp_path_factory.mktemp("morris")
    with by_formula(), without_figures():
        run_text(plain(60, limit=0.5, outputs=("hic15",)), whole := ResultsFolder(base / "whole"))
    runs = whole.runs()
    failed = (runs[list(SPREADS)] < runs[list(SPREADS)].quantile(0.3)).all(axis=1)
    runs.loc[failed, "status"] = "time_limit"
    runs.loc[failed, ["hic15", "peak_force"]] = np.nan
    results = copy_of(whole, base / "failing", runs)
    with without_figures():
        api.build_report(results)
    return results


def effects_of(runs: pd.DataFrame, output: str) -> dict[str, list[float]]:
    """Return the elementary effects of the inputs from the table of runs alone."""
    names = list(SPREADS)
    found: dict[str, list[float]] = {name: [] for name in names}
    for _, part in runs.groupby("replicate"):
        scores = [np.log(part[name] / MEDIANS[name]) / SPREADS[name] for name in names]
        places = special.ndtr(np.stack(scores, axis=1)) / SPAN
        values = part[output].to_numpy()
        for k in range(len(part) - 1):
            # The dummy moves every input, by far less than a step.
            steps = places[k + 1] - places[k]
            moved = np.flatnonzero(np.abs(steps) > 0.05)
            assert moved.size <= 1
            if moved.size:
                step = steps[moved[0]]
                found[names[moved[0]]].append(float((values[k + 1] - values[k]) / step))
    return found


@pytest.mark.parametrize("output", ["hic15", "peak_force"])
def test_effects_are_those_of_the_steps_in_the_table(folder: ResultsFolder, output: str) -> None:
    entry = folder.read_json("analysis.json")["outputs"][output]
    for name, effects in effects_of(folder.runs(), output).items():
        assert len(effects) == 24
        row = entry["factors"][name]
        assert row["value"] == pytest.approx(np.abs(effects).mean(), rel=1e-9)
        assert row["mean"] == pytest.approx(np.mean(effects), rel=1e-9)
        assert row["sigma"] == pytest.approx(np.std(effects, ddof=1), rel=1e-9)
        assert row["low"] < row["value"] < row["high"]
        half = 1.96 * np.std(np.abs(effects), ddof=1) / np.sqrt(24)
        assert row["high"] - row["value"] == pytest.approx(half, rel=0.2)


def test_factors_are_ranked_as_their_exponents_say(folder: ResultsFolder) -> None:
    analysis = folder.read_json("analysis.json")
    assert analysis["factors"] == [*SPREADS, "dummy"]
    assert analysis["ranked"] == ["hic15", "peak_force"]
    factors = analysis["outputs"]["hic15"]["factors"]
    order = sorted(factors, key=lambda name: -factors[name]["value"])
    assert order == ["impact_speed", "hood_force_scale", "headform_mass", "dummy"]
    assert [factors[name]["clear"] for name in order] == [True, True, True, False]
    assert factors["dummy"]["value"] < 1e-2 * factors["headform_mass"]["value"]
    # A heavier headform lowers HIC15 and raises the force.
    assert factors["headform_mass"]["mean"] == -factors["headform_mass"]["value"]
    force = analysis["outputs"]["peak_force"]["factors"]["headform_mass"]
    assert force["mean"] == force["value"]


def test_every_output_of_the_model_has_its_effects(folder: ResultsFolder) -> None:
    analysis = folder.read_json("analysis.json")
    assert analysis["trajectories"] == 24
    assert analysis["runs"] == 24 * BLOCK
    for entry in analysis["outputs"].values():
        assert entry["trajectories"] == 24
        assert list(entry["factors"]) == [*SPREADS, "dummy"]
    # Perpendicular and without friction nothing turns the headform.
    turned = analysis["outputs"]["head_angular_velocity"]["factors"]
    assert {row["value"] for row in turned.values()} == {0.0}


def test_inputs_stay_within_the_central_95_percent(folder: ResultsFolder) -> None:
    runs = folder.runs()
    scores = np.log(runs["hood_force_scale"]) / SPREADS["hood_force_scale"]
    assert 1.7 < np.abs(scores).max() < 1.97


def test_a_group_of_dependent_inputs_has_a_size_and_no_sign(tmp_path: Path, fast: None) -> None:
    more = (
        '[groups]\ntest = ["impact_speed", "headform_mass"]\n'
        '[dependence]\ncorrelations = [["impact_speed", "headform_mass", 0.6]]\n'
    )
    results = ResultsFolder(tmp_path / "group")
    analysis = run_text(plain(more=more), results)
    assert analysis["factors"] == ["test", "hood_force_scale", "dummy"]
    assert len(results.runs()) == 24 * 4
    test = analysis["outputs"]["hic15"]["factors"]["test"]
    assert test["mean"] is None
    assert test["sigma"] is None
    assert test["clear"]
    html = (results.path / "report.html").read_text()
    assert "test: impact speed, headform mass" in html
    assert "nan" not in re.sub(FRAME, "", html).lower().replace("distinguishable", "")


def test_groups_alone_are_drawn(tmp_path: Path, fast: None) -> None:
    more = '[groups]\nall = ["impact_speed", "headform_mass", "hood_force_scale"]\n'
    results = ResultsFolder(tmp_path / "groups")
    analysis = run_text(plain(8, more=more, outputs=("hic15",)), results)
    assert analysis["factors"] == ["all", "dummy"]
    assert {"mean_effects", "elementary_effects"} == set(
        morris_report.draw(from_plain(MorrisAnalysis, analysis))
    )


def test_a_child_on_the_road_in_few_runs(tmp_path: Path, undrawn: None) -> None:
    """The growth chart of a group gets its age from the same group."""
    text = Path("configs/paper_morris.toml").read_text()
    head, _, rest = text.partition("[inputs.impact_speed]")
    tables = re.findall(r"\[inputs\.(\w+)\][^\[]*(?:\[[^\]a-z]*\][^\[]*)*", rest)
    assert "stature" in tables
    wanted = {"age", "stature", "body_mass", "head_mass"}
    parts = re.split(r"\n(?=\[)", f"[inputs.impact_speed]{rest}")
    inputs = [
        part
        for part in parts
        if not part.startswith("[inputs.") or part.split("]")[0][8:] in wanted | {"impact_speed"}
    ]
    small = head.replace("n = 60 ", "n = 8 ") + "\n".join(inputs)
    results = ResultsFolder(tmp_path / "child")
    analysis = run_text(small, results)
    assert analysis["factors"] == ["impact_speed", "child", "dummy"]
    assert analysis["runs"] == 8 * 4
    assert analysis["ranked"] == ["hic15", "throw_distance", "wad"]
    wad = analysis["outputs"]["wad"]["factors"]
    assert wad["child"]["value"] > wad["dummy"]["value"]
    assert results.runs()["stature"].nunique() > 4


@pytest.mark.parametrize(
    ("edit", "differs"),
    [
        (("levels = 4", "levels = 6"), "design.levels"),
        (("[report]", '[groups]\npair = ["impact_speed", "headform_mass"]\n[report]'), "groups"),
    ],
)
def test_a_changed_study_is_refused_with_what_differs(
    folder: ResultsFolder, edit: tuple[str, str], differs: str
) -> None:
    text = plain().replace(*edit, 1)
    assert text != plain()
    with pytest.raises(UserError, match=rf"differs in {re.escape(differs)}\)"):
        run_text(text, folder)


@pytest.mark.parametrize(
    "design", ["n = 1", "levels = 5", "levels = 0", "n = 64\nstart = 8", "n = 4"]
)
def test_wrong_designs_are_users_errors(tmp_path: Path, design: str) -> None:
    study = tmp_path / "design.toml"
    study.write_text(study_text("morris", design))
    assert "design" in told(mcstudy("run", study, "--out", tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_trajectories_with_a_failed_run_are_left_out_whole(failing: ResultsFolder) -> None:
    runs, analysis = failing.runs(), failing.read_json("analysis.json")
    failed = runs["status"] != "ok"
    hit = runs["replicate"][failed].nunique()
    assert 0 < hit <= 12
    failures = analysis["failures"]
    assert set(failures["where"]) == set(SPREADS)
    assert (failures["runs"], failures["blocks"]) == (int(failed.sum()), hit)
    assert analysis["outputs"]["hic15"]["trajectories"] == 60 - hit
    assert failures["where"]["hood_force_scale"]["mean_rank"] < 0.3
    assert {entry["place"] for entry in failures["where"].values()} == {"low"}
    html = (failing.path / "report.html").read_text()
    assert "runs failed" in html
    assert "hood force scale low" in html
    assert "failures" in morris_report.draw(from_plain(MorrisAnalysis, analysis))


def test_an_output_with_too_few_values_is_not_ranked(
    folder: ResultsFolder, tmp_path: Path, undrawn: None
) -> None:
    runs = folder.runs()
    runs.loc[(runs["run"] % BLOCK == 2) & (runs["replicate"] < 5), "hic15"] = np.nan
    part = copy_of(folder, tmp_path / "values", runs)
    analysis = api.build_report(part)
    assert analysis["outputs"]["hic15"] == {"unit": "1", "trajectories": 19}
    assert analysis["ranked"] == ["peak_force"]
    none = copy_of(folder, tmp_path / "none", runs.assign(peak_force=np.nan))
    with pytest.raises(StudyError, match="hic15, peak_force: too few of the 24 trajectories"):
        api.build_report(none)


def test_effects_of_what_is_left_are_those_of_the_table(
    folder: ResultsFolder, tmp_path: Path, undrawn: None
) -> None:
    runs = folder.runs()
    lost = (2, 9, 17)
    runs.loc[(runs["run"] % BLOCK == 3) & runs["replicate"].isin(lost), "hic15"] = np.nan
    part = copy_of(folder, tmp_path / "three", runs)
    entry = api.build_report(part)["outputs"]["hic15"]
    assert entry["trajectories"] == 21
    whole = runs[~runs["replicate"].isin(lost)]
    for name, effects in effects_of(whole, "hic15").items():
        row = entry["factors"][name]
        assert row["value"] == pytest.approx(np.abs(effects).mean(), rel=1e-9)
        assert row["mean"] == pytest.approx(np.mean(effects), rel=1e-9)


def test_run_prints_what_matters(folder: ResultsFolder, tmp_path: Path, undrawn: None) -> None:
    answer = mcstudy("report", copy_of(folder, tmp_path / "out").path)
    assert re.search(r"HIC15 is most sensitive to impact speed \([\d,.]+ ± [\d,.]+\), "
                     r"hood force scale",
                     answer.line)  # fmt: skip
    assert re.search(r"Peak force is most sensitive to .*? N\)", answer.line)
    assert "Noise floor" in answer.line


def effect(
    value: float, half: float, *, clear: bool, spread: float | None = 0.0
) -> dict[str, float | bool | None]:
    return {
        "mean": value, "value": value, "low": value - half, "high": value + half,
        "sigma": spread, "clear": clear,
    }  # fmt: skip


def test_a_sentence_ranks_says_what_is_curved_and_names_the_weak() -> None:
    entry = {
        "unit": "m",
        "trajectories": 60,
        "factors": {
            "gait_phase": effect(2.0, 0.25, clear=True, spread=1.5),
            "impact_speed": effect(5.0, 0.5, clear=True, spread=0.5),
            "child": effect(1.0, 0.2, clear=True, spread=None),
            "yaw_rate": effect(0.1, 0.1, clear=False),
            "dummy": effect(0.12, 0.03, clear=False),
        },
    }
    text = morris_report.sentence("throw_distance", from_plain(RankedOutput, entry))
    assert text.startswith(
        "Throw distance is most sensitive to impact speed (5.00 ± 0.50 m), gait phase "
        "(2.00 ± 0.25 m), child (1.00 ± 0.20 m)."
    )
    curved = re.search(r"[^.]*curvature or interactions[^.]*\.", text)
    assert curved is not None
    assert "gait phase" in curved.group()
    assert "impact speed" not in curved.group()
    assert "child" not in curved.group()
    assert "Not distinguishable from noise: yaw rate." in text
    assert text.endswith("Noise floor: 0.12 m.")


def test_a_sentence_names_at_most_four_factors_and_no_weak_ones_if_there_are_none() -> None:
    entry = {
        "unit": "1",
        "trajectories": 60,
        "factors": {f"input_{k}": effect(10.0 - k, 0.1, clear=True) for k in range(6)}
        | {"dummy": effect(0.0, 0.0, clear=False)},
    }
    text = morris_report.sentence("hic15", from_plain(RankedOutput, entry))
    assert "input 3" in text
    assert "input 4" not in text
    assert "Not distinguishable" not in text
    noise = {"age": effect(0.1, 0.1, clear=False), "dummy": effect(0.1, 0.1, clear=False)}
    text = morris_report.sentence("hic15", from_plain(RankedOutput, entry | {"factors": noise}))
    assert text == "HIC15: no factor is distinguishable from noise."
