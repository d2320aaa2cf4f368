"""The reconstruction of the reference case."""

import json
from pathlib import Path

import pytest

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.measurement.isomme import read_test
from models.criteria import head_injury_criterion
from studies.kinds import load_study, parse_study
from studies.reconstruction.schema import Reconstruction
from studies.reconstruction.study import reconstruct, write_reconstruction

CASE = Path("configs/paper_case.toml")


@pytest.fixture(scope="module")
def study() -> Reconstruction:
    loaded = load_study(CASE)
    assert isinstance(loaded, Reconstruction)
    return loaded


def test_prints_our_row_beside_the_published_ones(study: Reconstruction) -> None:
    run, tables = reconstruct(study)
    first, second, _ = tables
    assert [label for label, _ in first.rows][-1] == "this run"
    assert first.rows[-1][1][0] == pytest.approx(run.outputs["throw_distance"])
    assert dict(first.rows)["MBS model"][:2] == [13.5, 1.32]
    assert dict(second.rows)["facet model"][1] == 1865.0
    # Units of the printed table: the angle is in degrees there.
    assert tables[2].head[2] == "head impact angle [deg]"
    assert 40.0 < (tables[2].rows[-1][1][2] or 0.0) < 95.0


def test_writes_the_whole_folder(study: Reconstruction, tmp_path: Path) -> None:
    folder = ResultsFolder(tmp_path / "case")
    run, tables = reconstruct(study)
    write_reconstruction(study, CASE.read_text(), run, tables, folder)
    figures = {path.name for path in (folder.path / "figures").iterdir()}
    assert {"kinematics.png", "head_velocity.svg", "head_acceleration.png", "crash.gif"} <= figures
    assert (folder.path / "figures" / "crash.gif").read_bytes()[:6] == b"GIF89a"
    html = (folder.path / "report.html").read_text()
    assert "MBS model" in html
    assert 'src="http' not in html
    analysis = json.loads((folder.path / "analysis.json").read_text())
    assert analysis["outputs"]["hic15"] == pytest.approx(run.outputs["hic15"])
    assert folder.history(0)["head"].shape[0] > 1000
    # Each impact is a test of its own, whose HIC15 is that of the table; samples have seven digits.
    for name, output in (("paper_case", "hic15"), ("paper_case_road", "ground_hic15")):
        test = read_test(folder.path / "iso_mme" / name / f"{name}.mme")
        head = next(channel for channel in test.channels if channel.code.endswith("ACRA"))
        found = head_injury_criterion(head.time, head.values, 0.015)[0]
        assert found == pytest.approx(run.outputs[output], rel=1e-5)
        assert "a test of its own" in test.header["comments"]
        assert head.time[0 if "road" in name else -1] == pytest.approx(
            run.outputs["ground_time"], abs=2e-4
        )


def test_a_table_without_units_for_a_value_is_refused() -> None:
    text = CASE.read_text().replace("values = { throw_distance = 13.6, wad = 1.33 }",
                                    "values = { clip_3ms = 13.6 }")  # fmt: skip
    study = parse_study(text)
    assert isinstance(study, Reconstruction)
    with pytest.raises(UserError, match=r"tables\[0\]\.rows\[1\]\.values\.clip_3ms"):
        reconstruct(study)


def test_a_table_with_a_wrong_unit_is_refused() -> None:
    study = parse_study(CASE.read_text().replace('wad = "m"', 'wad = "kg"'))
    assert isinstance(study, Reconstruction)
    with pytest.raises(UserError, match="unit 'm' measures length"):
        reconstruct(study)
