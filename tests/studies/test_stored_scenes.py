"""Runs of a study that are kept in three dimensions: which, why, and only once."""

from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd
import pytest

from mcstudy.execution.results import ResultsFolder
from mcstudy.studyfile.schema import SampledStudy
from models.registry import load_model
from studies.kinds import parse_study
from studies.stored_scenes import Measured, keep_scenes, notable_runs, stored_scenes

STUDY = """
format = "mcstudy-study/1"
kind = "monte-carlo"
name = "kept"
title = "Kept"
[model]
name = "multibody"
[design]
n = 60
replicate_size = 60
[inputs.impact_speed]
distribution = "uniform"
low = 8.0
high = 12.0
[report]
outputs = ["hic15", "wad"]
"""
MODEL = load_model("multibody")


def table(n: int = 400) -> pd.DataFrame:
    rng = np.random.default_rng(4)
    hic = rng.permutation(np.arange(n, dtype=float))
    frame = pd.DataFrame(
        {"run": np.arange(n) + 100, "status": "ok", "hic15": hic, "wad": 1.0 + hic / n}
    )
    frame.loc[7, ["status", "hic15", "wad"]] = ["no_head_contact", np.nan, np.nan]
    frame.loc[[9, 11], ["status", "hic15", "wad"]] = ["not_finite", np.nan, np.nan]
    return frame


def test_extremes_medians_failures_and_the_nearest_runs_are_notable() -> None:
    runs = table()
    whole = runs.dropna()
    found = notable_runs(MODEL, runs, ["hic15"], [Measured("hic15", 33.4, 1.0)])
    by_hic = whole.sort_values("hic15")["run"].to_list()
    near = whole.iloc[(whole["hic15"] - 33.4).abs().argsort()]["run"].to_list()
    assert list(found)[:2] == near[:2]
    assert found[near[0]] == "nearest to the accident"
    assert found[by_hic[0]] == "smallest HIC15"
    assert found[by_hic[-1]] == "largest HIC15"
    assert found[by_hic[len(by_hic) // 2]] == "median HIC15"
    # Without head contact a run is whole; a state that is not finite is a failure.
    assert found[109] == "not finite, one of 2 runs"
    assert len(found) == 6


def test_one_run_may_be_notable_twice_and_few_are_kept_of_a_small_study() -> None:
    found = notable_runs(MODEL, table(), ["hic15", "wad"])
    assert any(why.startswith("largest HIC15, largest wrap-around") for why in found.values())
    assert len(notable_runs(MODEL, table(45), ["hic15", "wad"])) == 2
    empty = table(20).assign(status="not_finite", hic15=np.nan)
    assert list(notable_runs(MODEL, empty, ["hic15"], [Measured("hic15", 1.0, 1.0)])) == [100]


def test_scenes_are_kept_once_and_stale_ones_go(tmp_path: Path) -> None:
    study = parse_study(STUDY)
    assert isinstance(study, SampledStudy)
    runs = pd.DataFrame({item.name: np.full(60, item.nominal) for item in MODEL.inputs})
    runs["impact_speed"] = np.linspace(8.0, 12.0, 60)
    runs = runs.assign(run=np.arange(60), status="ok", hic15=np.arange(60.0), wad=np.arange(60.0))
    folder = ResultsFolder(tmp_path / "study")
    with folder.open_for_writing():
        folder.write_text("scenes/run-000031.json", "{}")
        keep_scenes(study, MODEL, runs, folder)
        first = stored_scenes(folder)
        assert [entry.run for entry in first] == [59, 30, 0]
        assert [entry.packed["label"] for entry in first] == ["run 59", "run 30", "run 0"]
        assert not (folder.path / "scenes/run-000031.json").exists()
        with mock.patch.object(type(MODEL), "run", side_effect=AssertionError):
            keep_scenes(study, MODEL, runs, folder)
    assert stored_scenes(folder) == first


def test_a_model_without_a_scene_keeps_none(tmp_path: Path) -> None:
    text = STUDY.replace('"multibody"', '"headform"').replace('"wad"', '"permanent_dent"')
    study, model = parse_study(text), load_model("headform")
    assert isinstance(study, SampledStudy)
    runs = pd.DataFrame({item.name: np.full(60, item.nominal) for item in model.inputs})
    runs = runs.assign(run=np.arange(60), status="ok", hic15=1.0, permanent_dent=0.1)
    folder = ResultsFolder(tmp_path / "study")
    with folder.open_for_writing():
        keep_scenes(study, model, runs, folder)
    assert stored_scenes(folder) == []
    assert stored_scenes(ResultsFolder(tmp_path)) == []


@pytest.mark.parametrize("content", ['{"5": "x"}', "[]"])
def test_a_damaged_folder_is_told(tmp_path: Path, content: str) -> None:
    from mcstudy.errors import UserError

    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "index.json").write_text(content)
    with pytest.raises(UserError, match="scenes"):
        stored_scenes(ResultsFolder(tmp_path))
