"""The map: its grid, its points on a car's hood, shares of the bands, table and refusals."""

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from headform_studies import GRID, INPUTS, by_formula, mcstudy, run_text, study_text, told

from mcstudy.execution.results import ResultsFolder
from mcstudy.figures.response_map import band_names

HOOD = """\
format = "mcstudy-study/1"
kind = "map"
name = "hood"
title = "Hood"
[model]
name = "headform"
options = { surface = "facet", headform = "gtr_child" }
[axes.wrap_around_distance]
unit = "mm"
values = [900.0, 1300.0]
[axes.lateral_position]
unit = "m"
values = [-0.72, 0.0, 0.3, 0.79, 0.95]
[panels.impact_speed]
unit = "km/h"
values = [20.0, 40.0]
[report]
outputs = ["hic15"]
limits.hic15 = [650.0, 1000.0]
"""


def rows_of(folder: ResultsFolder) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO((folder.path / "map.csv").read_text())))


@pytest.fixture(scope="module")
def hood(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    folder = ResultsFolder(tmp_path_factory.mktemp("map") / "hood")
    run_text(HOOD, folder)
    return folder


def test_every_point_of_the_hood_is_struck_once_and_those_beside_it_are_not(
    hood: ResultsFolder,
) -> None:
    rows = rows_of(hood)
    places = {(row["wrap_around_distance [mm]"], row["lateral_position [m]"]) for row in rows}
    # 0.79 m is the side of the car, 0.95 m beside it.
    assert places == {(w, y) for w in ("900.0", "1300.0") for y in ("-0.72", "0.0", "0.3")}
    assert len(rows) == 12
    assert {row["region"] for row in rows} == {"hood", "fender_side"}
    for row in rows:
        assert float(row["y [m]"]) == pytest.approx(float(row["lateral_position [m]"]))
        assert -1.2 < float(row["x [m]"]) < -0.2
        assert row["hic15 [1] 5 %"] == ""
        above = float(row["hic15 [1] median"]) > 1000.0
        assert float(row["share of hic15 above 1000"]) == above


def test_speed_and_fender_show_in_the_map(hood: ResultsFolder) -> None:
    found = {
        (row["impact_speed [km/h]"], row["lateral_position [m]"]): float(row["hic15 [1] median"])
        for row in rows_of(hood)
        if row["wrap_around_distance [mm]"] == "1300.0"
    }
    # HIC grows with the speed to the power of 2.5 where the force is linear in the penetration.
    ratio = found["40.0", "0.3"] / found["20.0", "0.3"]
    assert ratio == pytest.approx(2.0**2.5, rel=0.06)
    assert found["40.0", "-0.72"] > 1.2 * found["40.0", "0.0"]


def test_the_shares_of_the_bands_add_up(hood: ResultsFolder) -> None:
    output = hood.read_json("analysis.json")["outputs"]["hic15"]
    medians = np.array([cell["median"]["value"] for cell in output["cells"]])
    assert list(output["bands"]) == ["20", "40"]
    for k, bands in enumerate(output["bands"].values()):
        shares = [band["share"]["value"] for band in bands]
        assert sum(shares) == pytest.approx(1.0)
        own = medians[6 * k : 6 * k + 6]
        assert shares[0] == pytest.approx(np.mean(own <= 650.0))
        assert shares[2] == pytest.approx(np.mean(own > 1000.0))


def test_medians_and_probabilities_are_those_of_the_formula(tmp_path: Path) -> None:
    folder = ResultsFolder(tmp_path / "map")
    with by_formula():
        run_text(study_text("map", "n = 512\nreplicate_size = 64", outputs=("hic15",)), folder)
    output = folder.read_json("analysis.json")["outputs"]["hic15"]
    # 30 km/h, 2.5 kg: the medians of the inputs give the median of a product of lognormals.
    median = 6.0 * (30.0 / 3.6) ** 2.5 * 2.5**-0.75
    for cell in output["cells"]:
        assert cell["n"] == 512
        assert cell["median"]["value"] == pytest.approx(median, rel=0.03)
        assert cell["median"]["low"] < median < cell["median"]["high"]
        assert cell["low"] < cell["median"]["value"] < cell["high"]
    runs = folder.runs()
    for limit, above in zip(output["limits"], output["cells"][0]["above"], strict=True):
        assert above["value"] == pytest.approx((runs["hic15"] > limit).mean())


def test_every_point_has_the_same_draws(tmp_path: Path) -> None:
    folder = ResultsFolder(tmp_path / "map")
    with by_formula():
        run_text(study_text("map", outputs=("hic15",)), folder)
    runs = folder.runs()
    points = runs.groupby(["impact_angle", "friction_body_car"])["headform_mass"].apply(list)
    assert len(points) == 6
    assert all(masses == points.iloc[0] for masses in points)


@pytest.mark.parametrize("points", [None, 0, True, 2.5])
def test_a_manifest_without_its_points_is_told(tmp_path: Path, points: object) -> None:
    folder = ResultsFolder(tmp_path / "map")
    with by_formula():
        run_text(study_text("map", outputs=("hic15",)), folder)
    manifest = folder.read_json("manifest.json")
    manifest["design"]["points"] = points
    folder.write_json("manifest.json", manifest)
    said = told(mcstudy("report", folder.path))
    assert "manifest.json: design.points must be a whole number above 0" in said


def test_bands_are_named_from_the_lowest() -> None:
    assert band_names([650.0, 1000.5]) == ["up to 650", "650 to 1000.5", "above 1000.5"]


@pytest.mark.parametrize(
    ("text", "edit", "message"),
    [
        (HOOD, ('unit = "mm"', 'unit = "kg"'), "axes.wrap_around_distance"),
        (HOOD, ("values = [900.0, 1300.0]", "values = [900.0, 900.0]"), "values must rise"),
        (HOOD, ("values = [900.0, 1300.0]", "first = 1.0\nstep = 0.1"), "first, last and step"),
        (HOOD, ("values = [900.0, 1300.0]", "first = 1.0\nlast = 2e9\nstep = 0.1"), "1 to 1000"),
        (HOOD, ("[900.0, 1300.0]", "[9000.0]"), "outside the valid range"),
        (HOOD, ("[panels.impact_speed]", "[panels.lateral_position]"), "is an axis as well"),
        (HOOD, ("[report]", '[points]\nregions = ["boot"]\n[report]'), "no region 'boot'"),
        (HOOD, ("[report]", '[points]\nregions = ["roof"]\n[report]'), "no point lies on"),
        (HOOD, ("[report]", "[design]\nn = 200\n[report]"), "without [inputs]"),
        (HOOD, ("hic15 = [650.0, 1000.0]", "hic15 = [1000.0, 650.0]"), "values must rise"),
        (HOOD, ("limits.hic15", "limits.hic1"), "no output 'hic1'"),
        (HOOD, ("[report]", "[fixed.lateral_position]\nvalue = 0.1\n[report]"),
         "by the map's grid"),
        (study_text("map"), ("[report]", '[points]\nregions = ["hood"]\n[report]'),
         "no places on a surface"),
        (study_text("map"), (GRID, GRID.replace("impact_angle", "impact_speed")),
         "inputs.impact_speed: is given by the map's grid"),
        (study_text("map"), (GRID, "[axes.impact_angle]\nvalues = [0.1]\n"), "axes"),
    ],
)  # fmt: skip
def test_a_wrong_map_is_told_in_one_line(
    tmp_path: Path, text: str, edit: tuple[str, str], message: str
) -> None:
    assert edit[0] in text and INPUTS
    study = tmp_path / "map.toml"
    study.write_text(text.replace(*edit, 1))
    assert message in told(mcstudy("run", study, "--out", tmp_path / "out"))
    assert not (tmp_path / "out").exists()
