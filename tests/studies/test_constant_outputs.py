"""Outputs and inputs that do not vary, and numbers of any size: in words, drawn, no warning."""

import html
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
from headform_studies import (
    INPUTS,
    by_formula,
    closed_form,
    copy_of,
    mcstudy,
    run_text,
    study_text,
    without_figures,
)
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from numpy.typing import NDArray

from mcstudy.errors import StudyError
from mcstudy.execution.results import ResultsFolder
from mcstudy.figures import style
from mcstudy.report import document
from models.registry import load_model
from studies import api

pytestmark = pytest.mark.filterwarnings("error")

Figures = dict[str, Figure]
Results = tuple[NDArray[np.float64], list[str]]

FLAT_SPEED = """
[inputs.impact_speed]
distribution = "uniform"
unit = "km/h"
low = 30.0
high = 30.00000000000001
"""
ONE_SPEED = """
[inputs.impact_speed]
distribution = "uniform"
unit = "km/h"
low = 29.0
high = 31.0
"""


def rounded(argument: Mapping[str, Any], rows: NDArray[np.float64], started: object) -> Results:
    """Return what the formula gives, with a HIC15 that rounding alone tells from 700.1."""
    outputs, _ = closed_form(argument, rows)
    names = [item.name for item in load_model(argument["name"], argument["options"]).outputs]
    outputs[:, names.index("hic15")] = 700.1 * (1.0 + 1e-15 * np.round(rows[:, 0] % 1.0 * 5.0))
    return outputs, ["ok"] * len(rows)


def harmless(argument: Mapping[str, Any], rows: NDArray[np.float64], started: object) -> Results:
    return 0.0 * rounded(argument, rows, started)[0], ["ok"] * len(rows)


def failing(argument: Mapping[str, Any], rows: NDArray[np.float64], started: object) -> Results:
    return np.nan * rounded(argument, rows, started)[0], ["time_limit"] * len(rows)


@pytest.fixture(autouse=True)
def drawn() -> Iterator[Figures]:
    """Run by formula, constant in HIC15; draw every figure once, and keep them."""
    held: Figures = {}

    def save(figures: Figures, _: Path) -> None:
        held.clear()
        held.update(figures)
        for figure in figures.values():
            figure.draw_without_rendering()

    with (
        by_formula(rounded),
        mock.patch.object(style, "save", save),
        mock.patch.object(document, "png_bytes", lambda *_: b""),
    ):
        yield held


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ResultsFolder]:
    """Return a finished folder of each kind, of an output that varies."""
    base = tmp_path_factory.mktemp("sources")
    with by_formula(), without_figures():
        return {
            kind: ran(study_text(kind, inputs=ONE_SPEED, outputs=("hic15",)), base / kind)
            for kind in ("monte-carlo", "sobol", "morris")
        }


def words_of(folder: ResultsFolder) -> str:
    """Return the words of a report, checked to hold no word of the program's for nothing."""
    text = (folder.path / "report.html").read_text(encoding="utf-8")
    text = html.unescape(re.sub(r"<[^>]+>", " ", re.sub(r"(?s)<style>.*?</style>", "", text)))
    assert not re.search(r"\b(nan|inf|None|null)\b", text.replace("None of them", ""))
    return " ".join(text.split())


def ran(text: str, path: Path) -> ResultsFolder:
    folder = ResultsFolder(path)
    run_text(text, folder)
    return folder


def legend_of(figure: Figure) -> list[str]:
    """Return the words of all legends of a figure, on one line each."""
    legends = figure.findobj(Legend)
    texts = [text.get_text() for legend in legends for text in legend.get_texts()]
    return [text.removeprefix("\N{ZERO WIDTH SPACE}").replace("\n", " ") for text in texts]


def cells_of(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.axes[0].texts]


def test_monte_carlo_says_and_draws_what_is_constant(tmp_path: Path, drawn: Figures) -> None:
    inputs = FLAT_SPEED + INPUTS[INPUTS.index("[inputs.headform_mass]") :]
    references = (
        'references = [{ output = "hic15", value = 650.0, label = "_limit of 2020" },'
        ' { output = "hic15", value = 1e250, label = "far" }]\n'
    )
    text = study_text("monte-carlo", inputs=inputs)
    folder = ran(text + references, tmp_path / "out")
    assert "HIC15 does not vary: it is 700.1 in all 120 runs." in words_of(folder)
    entry = folder.read_json("analysis.json")["outputs"]["hic15"]
    assert entry["sd"]["value"] == 0.0
    assert entry["mean"]["value"] == pytest.approx(700.1)
    correlations = folder.read_json("analysis.json")["rank_correlation"]
    assert set(correlations["hic15"].values()) == {None}
    assert correlations["peak_force"]["impact_speed"] is None
    assert correlations["peak_force"]["hood_force_scale"] > 0.5
    assert cells_of(drawn["rank_correlation"]).count("–") == 4
    assert "impact_speed" not in drawn
    assert legend_of(drawn["distributions"])[:3] == [
        "700.1 in all 120 runs", "_limit of 2020", "far (1e+250, beyond the picture)",
    ]  # fmt: skip
    low, high = drawn["distributions"].axes[0].get_xlim()
    assert 600.0 < low < 650.0 and 700.1 < high < 750.0
    low, high = drawn["convergence"].axes[0].get_ylim()
    assert 600.0 < low < 700.0 < high < 800.0


def test_sobol_says_and_hatches_a_constant(tmp_path: Path, drawn: Figures) -> None:
    folder = ran(study_text("sobol"), tmp_path / "out")
    text = words_of(folder)
    assert "HIC15 does not vary." in text
    assert "No index is given where an output does not vary: HIC15, HIC36," in text
    assert folder.read_json("analysis.json")["outputs"]["hic15"]["variance"] == 0.0
    # Ten of twelve outputs are constant; three factors and the dummy.
    assert cells_of(drawn["heatmap"]).count("–") == 4 * 10
    assert [axes.get_title() for axes in drawn["indices"].axes] == ["peak force"]


@pytest.mark.parametrize("row", [8, 9], ids=["a base row", "an exchanged row"])
def test_an_output_that_hardly_ever_changes_has_indices_without_intervals(
    row: int, sources: dict[str, ResultsFolder], tmp_path: Path, drawn: Figures
) -> None:
    runs = sources["sobol"].runs()
    values = np.where(runs["run"] == row, 5.0, 1.0)
    rare = copy_of(sources["sobol"], tmp_path / "rare", runs.assign(hic15=values))
    answer = mcstudy("report", rare.path)
    assert answer.code == 0, answer.err
    assert "HIC15 hardly ever changes" in answer.line
    assert "have no intervals" in words_of(rare)
    assert {"indices", "heatmap", "convergence"} <= set(drawn)


def test_morris_says_a_constant_and_draws_the_others(tmp_path: Path, drawn: Figures) -> None:
    folder = ran(study_text("morris"), tmp_path / "out")
    assert "HIC15 does not vary." in words_of(folder)
    factors = folder.read_json("analysis.json")["outputs"]["hic15"]["factors"]
    assert {row["value"] for row in factors.values()} == {0.0}
    assert [axes.get_title() for axes in drawn["mean_effects"].axes] == ["peak force"]


@pytest.mark.parametrize("kind", ["sobol", "morris"])
def test_a_study_of_a_constant_alone_is_reported(kind: str, tmp_path: Path, drawn: Figures) -> None:
    text = study_text(kind, inputs=ONE_SPEED, outputs=("hic15",))
    assert "HIC15 does not vary." in words_of(ran(text, tmp_path / "out"))
    assert drawn == {}


def test_sensitivity_of_a_finished_folder_says_a_constant(
    sources: dict[str, ResultsFolder], tmp_path: Path
) -> None:
    runs = sources["monte-carlo"].runs()
    values = 700.1 * (1.0 + 1e-15 * (runs["run"] % 5))
    flat = copy_of(sources["monte-carlo"], tmp_path / "flat", runs.assign(hic15=values))
    answer = mcstudy("sensitivity", flat.path)
    assert answer.code == 0, answer.err
    assert "HIC15 does not vary." in answer.line
    assert answer.err == ""


def test_sensitivity_to_an_input_that_is_not_finite_is_refused(
    sources: dict[str, ResultsFolder], tmp_path: Path
) -> None:
    runs = sources["monte-carlo"].runs()
    lost = copy_of(sources["monte-carlo"], tmp_path / "out", runs.assign(impact_speed=np.inf))
    answer = mcstudy("sensitivity", lost.path)
    assert answer.code == 2
    assert "a run has no finite value of its input impact_speed" in answer.err


def test_a_comparison_says_and_hatches_a_constant(tmp_path: Path, drawn: Figures) -> None:
    folder = ran(study_text("model-comparison"), tmp_path / "out")
    text = words_of(folder)
    assert "HIC15 does not vary in any model." in text
    assert "HIC15: soft and stiff give the same value in every run." in text
    assert "HIC15: there is no rank correlation to analyse." in text
    assert "does not vary" in cells_of(drawn["variance"])
    pair = folder.read_json("analysis.json")["outputs"]["hic15"]["pairs"]["soft/stiff"]
    assert pair["rank_correlation"]["value"] is pair["breaking"]["noise"] is None
    assert pair["spread"]["value"] == 0.0


def test_an_injury_study_of_a_constant_judges_no_limit(tmp_path: Path, drawn: Figures) -> None:
    text = words_of(ran(study_text("injury"), tmp_path / "out"))
    assert text.count("the limit cannot be rated, as the runs do not differ.") == 2
    assert "Constant: HIC15." in text
    assert "slow <b> [red] $x$ %" in legend_of(drawn["exceedance"])
    assert "roc" not in drawn


def test_a_risk_of_zero_has_no_half(tmp_path: Path) -> None:
    with by_formula(harmless), without_figures():
        folder = ran(study_text("injury", "n = 120\nreplicate_size = 20"), tmp_path / "out")
    halved = folder.read_json("analysis.json")["speed"]["halved"]
    assert {entry["value"] for entry in halved.values()} == {None}
    assert "All outcomes are AIS 0, so there is no correlation." in words_of(folder)


def test_an_injury_study_without_a_run_left_says_where(tmp_path: Path) -> None:
    said = "scenario reference, front car: all runs failed"
    with by_formula(failing), pytest.raises(StudyError, match=said):
        ran(study_text("injury", limit=1.0), tmp_path / "out")


def sizes(kind: str, entry: Mapping[str, Any]) -> list[float]:
    """Return what a kind of study finds of an output that grows with it, or does not feel it."""
    if kind == "monte-carlo":
        return [entry["sd"]["value"]]
    table = entry["factors" if kind == "morris" else "total"]
    return [row["value"] for row in table.values()]


@pytest.mark.parametrize(
    ("kind", "factor"), [("monte-carlo", 1e250), ("morris", 1e250), ("sobol", -1e-250)]
)
def test_numbers_of_any_size_are_ranked_as_others(
    kind: str, factor: float, sources: dict[str, ResultsFolder], tmp_path: Path
) -> None:
    source = sources[kind]
    runs = source.runs()
    scaled = copy_of(source, tmp_path / "out", runs.assign(hic15=factor * runs["hic15"]))
    found = sizes(kind, api.build_report(scaled)["outputs"]["hic15"])
    words_of(scaled)
    plain = sizes(kind, source.read_json("analysis.json")["outputs"]["hic15"])
    grown = 1.0 if kind == "sobol" else abs(factor)
    np.testing.assert_allclose(found, grown * np.array(plain), rtol=1e-9)


@pytest.mark.parametrize(
    ("held", "value", "said"),
    [
        (slice(0), 1.0, "HIC15: no run has a value."),
        (slice(7, 8), 1.0, "HIC15: only one run has a value."),
        (slice(12, None), 42.0, "it is 42.00 in all 108 runs that have a value."),
    ],
)
def test_few_values_and_constants_with_holes_are_told(
    sources: dict[str, ResultsFolder], tmp_path: Path, held: slice, value: float, said: str
) -> None:
    runs = sources["monte-carlo"].runs().assign(hic15=np.nan)
    runs.loc[runs.index[held], "hic15"] = value
    folder = copy_of(sources["monte-carlo"], tmp_path / "out", runs)
    api.build_report(folder)
    assert said in words_of(folder)
