"""The comparison of models: headforms on two hoods, whose difference is known, and two crashes."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from headform_studies import mcstudy, study_text, told, without_figures

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.results import ResultsFolder
from models.registry import load_model
from studies import api
from studies.kind import Finished
from studies.kinds import load_study, parse_study
from studies.model_comparison.numbers import ComparisonAnalysis
from studies.model_comparison.schema import ModelComparison
from studies.model_comparison.study import NOMINAL, Comparison

FACTOR = 2.0**0.75
"""HIC15 of a straight hood goes with the stiffness to the power of 0.75."""
FIXED = """
[fixed]
hood_damping = { value = 0.0, unit = "N s/m" }
friction_body_car = { value = 0.0 }
"""
TABLES = """
[[tables]]
title = "Published"
units = { hic15 = "1", peak_force = "kN" }
rows = [
    { label = "method A", values = { hic15 = 900, peak_force = 4.0 } },
    { label = "method B", values = { hic15 = 1100, peak_force = 5.0 } },
    { label = "test", kind = "observed", values = { hic15 = 5000 } },
]
"""


def text_of(n: int = 200, **options: Any) -> str:
    design = f"n = {n}\nreplicate_size = 40"
    return study_text("model-comparison", design, more=FIXED, **options) + TABLES


def write(folder: Path, text: str) -> Path:
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def hoods(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    base = tmp_path_factory.mktemp("hoods")
    with without_figures():
        return api.run_study(write(base, text_of()), out=base / "out", workers=1)


def cell(folder: ResultsFolder, label: str) -> ResultsFolder:
    return ResultsFolder(folder.path / "cells" / label)


def test_a_run_has_the_same_inputs_in_every_model(hoods: ResultsFolder) -> None:
    soft, stiff = (cell(hoods, label).runs() for label in ("soft", "stiff"))
    for name in ("run", "impact_speed", "headform_mass", "hood_force_scale"):
        np.testing.assert_array_equal(soft[name], stiff[name])
    assert len(soft) == 200


def test_agreement_is_that_of_the_known_factor(hoods: ResultsFolder) -> None:
    found = hoods.read_json("analysis.json")["outputs"]["hic15"]
    pair, values = found["pairs"]["soft/stiff"], cell(hoods, "soft").runs()["hic15"].to_numpy()
    assert pair["rank_correlation"]["value"] == pytest.approx(1.0, abs=1e-3)
    assert pair["bias"]["value"] == pytest.approx((FACTOR - 1.0) * values.mean(), rel=0.01)
    assert pair["spread"]["value"] == pytest.approx((FACTOR - 1.0) * values.std(ddof=1), rel=0.02)
    low, high = pair["lower"]["value"], pair["upper"]["value"]
    assert 0.5 * (low + high) == pytest.approx(pair["bias"]["value"])
    # Y and c Y: the method's mean shift, what the inputs do alike, and by how much c stretches it.
    mean, variance = values.mean(), values.var(ddof=1)
    shift, stretch = 0.5 * (FACTOR - 1.0), 0.5 * (FACTOR + 1.0)
    components = {
        "method": shift**2 * mean**2,
        "inputs": stretch**2 * variance,
        "together": shift**2 * variance,
    }
    for key, part in components.items():
        share = found["variance"][key]["value"]
        assert share == pytest.approx(part / sum(components.values()), abs=0.01), key


def test_published_methods_stand_beside_ours(hoods: ResultsFolder) -> None:
    analysis = hoods.read_json("analysis.json")
    published = analysis["published"]
    assert published["hic15"] == {
        "unit": "1", "methods": 2, "mean": 1000.0, "sd": pytest.approx(math.sqrt(2.0) * 100.0),
    }  # fmt: skip
    assert published["peak_force"]["mean"] == pytest.approx(4500.0)
    for label in ("soft", "stiff"):
        study = load_study(hoods.path / "study.toml")
        assert isinstance(study, ModelComparison)
        options = study.models[label].options
        nominal = load_model("headform", options).run({}).outputs
        assert analysis["nominal"][label]["hic15"] == pytest.approx(nominal["hic15"])
    report = (hoods.path / "report.html").read_text(encoding="utf-8")
    for shown in ("method A", "method B", "test", "soft, nominal", "stiff, nominal"):
        assert shown in report


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('["hic15", "peak_force"]', '["throw_distance"]', "no output 'throw_distance'"),
        ("[fixed]", "[inputs.stature]\ndistribution = 'uniform'\nlow = 1.0\nhigh = 2.0\n[fixed]",
         "models.soft: inputs.stature"),
        ("[0.1, 10000.0]", "[0.1, -1.0]", "models.soft: model"),
        ('[models.stiff]\nname = "headform"', '[models."../stiff"]\nname = "headform"', "folder"),
        ("peak_force = ", "peak_farce = ", "tables"),
        ('hic15 = "1"', 'hic15 = "m"', "tables"),
        # A unit is checked in a table without published simulations, too.
        (TABLES.partition("    { label = \"test\"")[0],
         '\n[[tables]]\ntitle = "One test"\nunits = { hic15 = "m" }\nrows = [\n',
         "tables[0].units.hic15"),
        ('kind = "observed"', 'kind = "guessed"', "kind"),
        ("[models.stiff]", "[models.soft]", "soft"),
    ],
)  # fmt: skip
def test_a_wrong_study_file_is_one_line(old: str, new: str, said: str, tmp_path: Path) -> None:
    text = text_of().replace(old, new)
    assert text != text_of()
    study = write(tmp_path, text)
    assert said in told(mcstudy("run", study, "--out", tmp_path / "out", "--workers", "1"))
    assert not (tmp_path / "out").exists()


def test_one_model_is_no_comparison() -> None:
    text = text_of()
    start, end = text.index("[models.stiff]"), text.index("[design]")
    with pytest.raises(UserError, match="models"):
        parse_study(text[:start] + text[end:])


def test_too_many_failures_name_the_model(tmp_path: Path, undrawn: None) -> None:
    # A hood of 1 N/mm: the contact lasts more than a second and every run fails.
    text = text_of(n=40, force=0.1)
    with pytest.raises(StudyError, match="soft: 100"):
        api.run_study(write(tmp_path, text), out=tmp_path / "out", workers=1)


CRASHES = """\
format = "mcstudy-study/1"
kind = "model-comparison"
name = "two_crashes"
title = "In space and in the plane"

[models.spatial]
name = "multibody"

[models.planar]
name = "planar"

[design]
n = 20
replicate_size = 10

[inputs.impact_speed]
distribution = "uniform"
unit = "km/h"
low = 36.0
high = 48.0

[inputs.lateral_offset]
distribution = "uniform"
low = -0.5
high = 0.5
unit = "m"
"""


def test_two_crash_models_are_compared_and_drawn_with_any_workers(tmp_path: Path) -> None:
    path = write(tmp_path, CRASHES)
    found = []
    for workers in (1, 2):
        with without_figures():
            folder = api.run_study(path, out=tmp_path / str(workers), workers=workers)
        found.append(folder.read_json("manifest.json")["digests"])
    assert found[0] == found[1]
    analysis = folder.read_json("analysis.json")
    assert analysis["compared"] == ["hic15", "throw_distance", "wad"]
    assert list(analysis["models"]["planar"]["ignored"]) == ["lateral_offset"]
    study = load_study(path)
    assert isinstance(study, ModelComparison)
    comparison = Comparison()
    done = Finished(
        study, comparison.results(study, folder), folder.read_analysis(ComparisonAnalysis)
    )
    figures = comparison.draw(done)
    assert {"kinematics_spatial", "kinematics_planar"} <= set(figures)
    assert cell(folder, "planar").read_json(NOMINAL)["scene"]["names"][0] == "hip"
    # A planar study of one model goes on where it stopped, with the same bits.
    runs = cell(folder, "planar").runs()
    cell(folder, "planar").compact(runs.iloc[:13])
    with without_figures():
        resumed = api.run_study(path, out=folder.path, workers=1)
    pd.testing.assert_frame_equal(cell(resumed, "planar").runs(), runs)
