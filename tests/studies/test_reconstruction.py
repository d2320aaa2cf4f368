"""The reconstruction of the reference case."""

import contextlib
import io
from pathlib import Path

import pytest
from headform_studies import Answer, assert_stands_alone, mcstudy, told

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.measurement.isomme import read_test
from mcstudy.text import number
from models.criteria import head_injury_criterion
from models.registry import load_model
from studies.kinds import parse_study
from studies.published_tables import as_table, compare_with_table
from studies.reconstruction.schema import Reconstruction
from studies.reconstruction.study import reconstruct
from studies.terminal import print_table

CASE = Path("configs/paper_case.toml")


def case_of(text: str) -> Reconstruction:
    study = parse_study(text)
    assert isinstance(study, Reconstruction)
    return study


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[Answer, ResultsFolder]:
    out = tmp_path_factory.mktemp("case") / "out"
    return mcstudy("reconstruct", CASE, "--out", out), ResultsFolder(out)


def test_prints_our_column_beside_the_published_ones(case: tuple[Answer, ResultsFolder]) -> None:
    answer, folder = case
    assert (answer.code, answer.err) == (0, "")
    outputs = folder.read_json("analysis.json")["outputs"]
    lines = [[cell.strip() for cell in line.split("│")] for line in answer.out.splitlines()]
    first = next(line for line in lines if "throw distance [m]" in line)
    assert first[2] == "13.50"
    assert number(outputs["throw_distance"], 4) == first[-2]
    for word in ("MBS model", "facet model", "this run", "head impact angle [deg]", "ended: "):
        assert word in answer.out
    assert str(folder.path / "report.html") in answer.line


def test_no_value_or_heading_breaks_over_lines_in_80_columns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TERM", "dumb")
    si = {item.name: item.unit for item in load_model("multibody").outputs}
    ours = {"this run": dict.fromkeys(si, -1234.5678)}
    for published in case_of(CASE.read_text()).tables:
        table = as_table(compare_with_table(published, ours, si))
        with contextlib.redirect_stdout(Terminal()) as shown:
            print_table(table.caption, table.head, table.rows)
        lines = shown.getvalue().splitlines()
        assert max(map(len, lines)) <= 80
        for cell in [*table.head, *(cell for row in table.rows for cell in row[1:])]:
            assert any(cell in line for line in lines), cell


def test_writes_the_whole_folder(case: tuple[Answer, ResultsFolder]) -> None:
    folder = case[1]
    outputs = folder.read_json("analysis.json")["outputs"]
    figures = {path.name for path in (folder.path / "figures").iterdir()}
    assert {"kinematics.png", "head_velocity.svg", "head_acceleration.png", "crash.gif"} <= figures
    assert (folder.path / "figures" / "crash.gif").read_bytes()[:6] == b"GIF89a"
    html = (folder.path / "report.html").read_text()
    assert "MBS model" in html
    assert_stands_alone(html)
    assert folder.history(0)["head"].shape[0] > 1000
    # Each impact is a test of its own, whose HIC15 is that of the table; samples have seven digits.
    for name, output in (("paper_case", "hic15"), ("paper_case_road", "ground_hic15")):
        test = read_test(folder.path / "iso_mme" / name / f"{name}.mme")
        head = next(channel for channel in test.channels if channel.code.endswith("ACRA"))
        found = head_injury_criterion(head.time, head.values, 0.015)[0]
        assert found == pytest.approx(outputs[output], rel=1e-5)
        assert "a test of its own" in test.header["comments"]
        end = head.time[0 if "road" in name else -1]
        assert end == pytest.approx(outputs["ground_time"], abs=2e-4)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (("values = { throw_distance = 13.6, wad = 1.33 }", "values = { clip_3ms = 13.6 }"),
         r"tables\[0\]\.rows\[1\]\.values\.clip_3ms"),
        (('wad = "m"', 'wad = "kg"'), "unit 'm' measures length"),
    ],
)  # fmt: skip
def test_a_table_without_units_for_a_value_or_with_wrong_ones_is_refused(
    edit: tuple[str, str], message: str
) -> None:
    text = CASE.read_text()
    assert edit[0] in text
    with pytest.raises(UserError, match=message):
        reconstruct(case_of(text.replace(*edit)))


def test_a_reconstruction_is_no_study_of_runs(case: tuple[Answer, ResultsFolder]) -> None:
    said = told(mcstudy("sensitivity", case[1].path))
    assert "is the folder of a study of kind reconstruction" in said
    assert "drawn again by 'mcstudy reconstruct'" in told(mcstudy("report", case[1].path))


VARIANTS = """\
format = "mcstudy-study/1"
kind = "reconstruction"
name = "hoods"
title = "Two hoods"
[model]
name = "headform"
options = { hood_curve = [[0.0, 0.0], [0.1, 10000.0]] }
[fixed]
hood_damping = { value = 0.0, unit = "N s/m" }
friction_body_car = { value = 0.0 }
[[tables]]
title = "Published"
units = { hic15 = "1", peak_force = "kN" }
rows = [{ label = "a test", values = { hic15 = 700.0 } }]
[[variants]]
label = "soft"
model = { name = "headform", options = { hood_curve = [[0.0, 0.0], [0.1, 10000.0]] } }
[[variants]]
label = "stiff"
model = { name = "headform", options = { hood_curve = [[0.0, 0.0], [0.1, 20000.0]] } }
"""


def test_variants_differ_by_what_they_do_not_share(tmp_path: Path) -> None:
    path = tmp_path / "hoods.toml"
    path.write_text(VARIANTS)
    out = ResultsFolder(tmp_path / "out")
    assert mcstudy("reconstruct", path, "--out", out.path).code == 0
    analysis = out.read_json("analysis.json")
    soft, stiff = analysis["variants"]
    assert [soft["label"], stiff["label"]] == ["soft", "stiff"]
    assert soft["runs"] == stiff["runs"] == 24
    assert soft["outputs"]["hic15"]["nominal"] == analysis["outputs"]["hic15"]
    # HIC goes with the stiffness to the power of 0.75, the peak force with its root.
    for key in ("nominal", "low", "median", "high"):
        ratio = {name: stiff["outputs"][name][key] / soft["outputs"][name][key]
                 for name in ("hic15", "peak_force")}  # fmt: skip
        assert ratio["hic15"] == pytest.approx(2.0**0.75, rel=2e-3)
        assert ratio["peak_force"] == pytest.approx(2.0**0.5, rel=2e-3)
    # 0.3 % of the speed alone are 0.75 % of HIC15.
    hic15 = soft["outputs"]["hic15"]
    assert 0.99 < hic15["low"] / hic15["nominal"] < 0.998
    assert hic15["low"] < hic15["median"] < hic15["high"]
    report = (out.path / "report.html").read_text()
    assert "One change at a time" in report and "stiff" in report


@pytest.mark.parametrize(("old", "new", "said"), [
    ('label = "stiff"', 'label = "soft"', "the label 'soft' stands twice"),
    ('[[0.0, 0.0], [0.1, 20000.0]]', '[[0.0, 0.0], [0.1, -1.0]]', "variants[1]: model: "),
    ('model = { name = "headform", options = { hood_curve = [[0.0, 0.0], [0.1, 20000.0]] } }',
     'model = { name = "multibody" }', "variants[1]"),
])  # fmt: skip
def test_a_wrong_variant_is_named(old: str, new: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "hoods.toml"
    assert old in VARIANTS
    path.write_text(VARIANTS.replace(old, new))
    assert said in told(mcstudy("reconstruct", path, "--out", tmp_path / "out"))
    assert not (tmp_path / "out").exists()
