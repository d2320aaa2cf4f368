"""One case through two methods: tables with means, figures of both, and what is refused."""

import re
from html import unescape
from pathlib import Path

import pytest
from headform_studies import FRAME, Answer, assert_stands_alone, mcstudy, told

from mcstudy.execution.results import ResultsFolder
from mcstudy.text import number
from models.registry import load_model
from studies.kinds import load_study, parse_study
from studies.method_comparison.schema import MethodComparison
from studies.published_tables import compare_methods_with_table

CASE = Path("configs/three_methods.toml")


def two_methods() -> str:
    """The case without its finite-element model, whose run takes a minute, and its dents."""
    text = re.sub(r"(?s)\[models\.fem\].*?\n\n", "", CASE.read_text())
    return text[: text.index('[[tables]]\ntitle = "Dents"')]


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[Answer, ResultsFolder]:
    place = tmp_path_factory.mktemp("methods")
    (place / "case.toml").write_text(two_methods())
    answer = mcstudy("run", place / "case.toml", "--out", place / "out", "--workers", "1")
    return answer, ResultsFolder(place / "out")


def test_prints_our_methods_beside_the_mean_of_the_published_ones(
    case: tuple[Answer, ResultsFolder],
) -> None:
    answer, folder = case
    assert (answer.code, answer.err) == (0, "")
    methods = folder.read_json("analysis.json")["methods"]
    assert list(methods) == ["multibody", "facet"]
    throws = [methods[label]["outputs"]["throw_distance"] for label in methods]
    lines = [[cell.strip() for cell in line.split("│")] for line in answer.out.splitlines()]
    row = next(line for line in lines if "throw distance [m]" in line)
    mean = sum(throws) / 2.0
    assert row[2:-1] == ["13.47", "14.00", *(number(value, 4) for value in (*throws, mean))]
    assert str(folder.path / "report.html") in answer.line


def test_a_run_is_that_of_its_model_alone(case: tuple[Answer, ResultsFolder]) -> None:
    study = load_study(CASE)
    assert isinstance(study, MethodComparison)
    assert list(study.models) == ["multibody", "facet", "fem"]
    alone = load_model("multibody").run(
        {"impact_speed": 40.0 / 3.6, "running_speed": 10.0 / 3.6, "head_mass": 3.26,
         "friction_body_road": 0.6, "friction_tyre_road": 0.7, "dive_angle": 0.034906585039886591,
         "yaw_rate": 1.0}
    )  # fmt: skip
    found = case[1].read_json("analysis.json")["methods"]["multibody"]["outputs"]
    assert found["hic15"] == pytest.approx(alone.outputs["hic15"], rel=1e-12)


def test_writes_report_figures_and_histories(case: tuple[Answer, ResultsFolder]) -> None:
    folder = case[1]
    figures = {path.stem for path in (folder.path / "figures").iterdir()}
    assert figures == {
        "kinematics", "head_velocity", "head_acceleration", "head_angular_acceleration"
    }  # fmt: skip
    html = (folder.path / "report.html").read_text()
    assert_stands_alone(html)
    for words in ("published mean", "our mean", "MBS model", "FEM model", "accident"):
        assert words in html
    assert folder.history(1)["head"].shape[0] > 1000
    (page,) = re.findall(FRAME, html)
    assert '"label": "multibody"' in unescape(page)
    assert '"label": "facet"' in unescape(page)
    assert "drawn again by 'mcstudy run'" in told(mcstudy("report", folder.path))


def test_a_mean_is_given_where_all_methods_have_a_value() -> None:
    study = parse_study(CASE.read_text())
    assert isinstance(study, MethodComparison)
    ours = {"one": {"wad": 1.0}, "two": {"wad": 2.0, "throw_distance": 5.0}}
    si = dict.fromkeys(study.tables[0].units, "m")
    rows = dict(compare_methods_with_table(study.tables[0], ours, si).rows)
    place = list(study.tables[0].units).index
    assert rows["our mean"][place("wad")] == pytest.approx(1.5)
    assert rows["our mean"][place("throw_distance")] is None
    assert rows["published mean"][place("wad")] == pytest.approx((1.32 + 1.33 + 1.30) / 3.0)
    assert rows["published mean"][place("head_dent_distance")] is None
    assert list(rows)[-1] == "our mean"


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (("yaw_rate = {", "yaw_raet = {"), "models.multibody: fixed.yaw_raet"),
        (('wad = "m"', 'wad = "kg"'), "unit 'm' measures length"),
        (('wad = "m"', 'wda = "m"'), "tables[0].units: no model has an output 'wda'"),
        (('name = "facet"', 'name = "facets"'), "models.facet: unknown model 'facets'"),
        (("[models.facet]", '[models."a/b"]'), "models: name 'a/b'"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(
    edit: tuple[str, str], message: str, tmp_path: Path
) -> None:
    text = two_methods().replace(*edit)
    assert text != two_methods()
    (tmp_path / "case.toml").write_text(text)
    assert message in told(mcstudy("run", tmp_path / "case.toml", "--out", tmp_path / "out"))
    assert not (tmp_path / "out").exists()
