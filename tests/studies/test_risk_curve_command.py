"""Injury-risk curves of a table of cases, from the command line to the folder."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from headform_studies import (
    assert_stands_alone,
    by_formula,
    contents,
    mcstudy,
    study_text,
    told,
    without_figures,
)
from numpy.typing import NDArray

from mcstudy.execution.results import ResultsFolder
from mcstudy.injury import risk_curve as describing
from mcstudy.injury.observations import Observations, observe
from mcstudy.injury.survival import FAMILIES, RiskFit, fit_risk_curve, quality_class
from studies.api import run_study

Array = NDArray[np.float64]

MEDIAN, SPREAD = 800.0, 0.4
"""Of the HIC that the made-up people stand, lognormal."""


@pytest.fixture
def undrawn() -> Iterator[None]:
    """Leave the figure out, and the fits without each case."""
    with without_figures(), mock.patch.object(describing, "MAX_REFITTED", 60):
        yield


def people(n: int = 150, seed: int = 3) -> pd.DataFrame:
    """Return blows, what each person stands, and whether it was injured."""
    rng = np.random.default_rng(seed)
    hic = 800.0 * np.exp(0.6 * rng.standard_normal(n))
    stands = MEDIAN * np.exp(SPREAD * rng.standard_normal(n))
    return pd.DataFrame({"hic": hic, "stands": stands, "injured": (hic > stands).astype(int)})


def saved(path: Path, table: pd.DataFrame) -> Path:
    if path.suffix == ".parquet":
        table.to_parquet(path)
    else:
        table.to_csv(path, index=False)
    return path


def fitted(tmp_path: Path, source: Path, *options: str, stimulus: str = "hic") -> dict[str, Any]:
    """Return the analysis that the command line prints."""
    out = tmp_path / "out"
    answer = mcstudy("risk-curve", source, "--stimulus", stimulus, "--out", out, "--json", *options)
    assert answer.code == 0, answer.err
    assert answer.err == ""
    told = json.loads(answer.out)
    assert set(told) == {"folder", "analysis"}
    assert told["folder"] == str(out)
    analysis = ResultsFolder(out).read_json("analysis.json")
    assert told["analysis"] == analysis
    return analysis


def assert_fits(analysis: dict[str, Any], observations: Observations) -> RiskFit:
    """Check an analysis against the fits themselves and return the best of them."""
    fits = {name: fit_risk_curve(observations, name) for name in FAMILIES}
    assert set(analysis["families"]) == set(FAMILIES)
    for name, fit in fits.items():
        found = analysis["families"][name]
        assert found["intercept"] == pytest.approx(fit.intercept, rel=1e-12)
        assert found["slope"] == pytest.approx(fit.slope, rel=1e-12)
        assert found["log_likelihood"] == pytest.approx(fit.log_likelihood, rel=1e-12)
        assert found["aic"] == pytest.approx(4.0 - 2.0 * fit.log_likelihood, rel=1e-12)
        assert found["median"] == pytest.approx(fit.stimulus_at(0.5)[0], rel=1e-12)
    best = min(fits.values(), key=lambda fit: fit.aic)
    assert analysis["family"] == best.family
    aics = [entry["aic"] for entry in analysis["families"].values()]
    assert aics == sorted(aics)
    assert analysis["cases"] == observations.size
    assert analysis["injured"] == int(observations.injured.sum())
    assert analysis["exact"] == int(observations.exact.sum())
    for p in (0.05, 0.25, 0.5):
        entry = analysis["at"][f"{p:g}"]
        value, low, high = best.stimulus_at(p)
        assert (entry["value"], entry["low"], entry["high"]) == pytest.approx((value, low, high))
        assert entry["quality_index"] == pytest.approx((high - low) / value)
        assert entry["quality"] == quality_class((high - low) / value)
    x = np.array(analysis["curve"]["stimulus"])
    assert analysis["curve"]["risk"] == pytest.approx(best.risk(x), rel=1e-9)
    for side, wanted in zip(("low", "high"), best.band(x), strict=True):
        assert analysis["curve"][side] == pytest.approx(wanted, rel=1e-9, abs=1e-300)
    return best


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_cases_with_a_column_injured(tmp_path: Path, undrawn: None, ending: str) -> None:
    table = people()
    analysis = fitted(tmp_path, saved(tmp_path / f"cases.{ending}", table[["hic", "injured"]]))
    wanted = observe(table["hic"].to_numpy(), table["injured"].to_numpy() == 1)
    assert_fits(analysis, wanted)
    assert analysis["injury"] == "injury"
    assert analysis["stimulus"] == "hic"
    low, high = (analysis["at"]["0.5"][side] for side in ("low", "high"))
    assert low < MEDIAN < high
    assert analysis["rug"]["injured"] == (table["injured"] == 1).tolist()


def test_the_log_logistic_curve_is_a_logistic_regression(tmp_path: Path, undrawn: None) -> None:
    table = people()
    analysis = fitted(tmp_path, saved(tmp_path / "cases.csv", table[["hic", "injured"]]))
    known = sm.Logit(table["injured"], sm.add_constant(np.log(table[["hic"]]))).fit(disp=0)
    found = analysis["families"]["log-logistic"]
    assert (found["intercept"], found["slope"]) == pytest.approx(tuple(known.params), rel=1e-5)
    assert found["log_likelihood"] == pytest.approx(known.llf, rel=1e-9)


@pytest.mark.parametrize(
    "words", [("yes", "no"), ("True", "False"), ("1.0", "0.0"), (" YES", "No ")]
)
def test_injured_may_be_said_in_words(
    tmp_path: Path, undrawn: None, words: tuple[str, str]
) -> None:
    table = people()
    said = table.assign(injured=np.where(table["injured"] == 1, *words))[["hic", "injured"]]
    analysis = fitted(tmp_path, saved(tmp_path / "cases.csv", said))
    assert analysis["injured"] == table["injured"].sum()


@pytest.mark.parametrize("level", [2, 3, 5])
def test_cases_with_an_ais_and_a_level(tmp_path: Path, undrawn: None, level: int) -> None:
    table = people()
    ais = np.clip(np.floor(3.0 * table["hic"] / table["stands"]), 0, 6).astype(int)
    source = saved(tmp_path / "cases.csv", table[["hic"]].assign(ais=ais))
    analysis = fitted(tmp_path, source, "--level", str(level))
    assert_fits(analysis, observe(table["hic"].to_numpy(), np.asarray(ais >= level)))
    assert analysis["injury"] == f"AIS{level}+"
    truth = MEDIAN * level / 3.0
    at = analysis["at"]["0.5"]
    reach = at["high"] - at["low"]
    assert at["low"] - 0.5 * reach < truth < at["high"] + 0.5 * reach


def test_the_level_of_the_ais_is_three_unless_told(tmp_path: Path, undrawn: None) -> None:
    table = people().assign(ais=lambda t: 3 * t["injured"] + 1)
    analysis = fitted(tmp_path, saved(tmp_path / "cases.csv", table[["hic", "ais"]]))
    assert analysis["injury"] == "AIS3+"
    assert analysis["injured"] == table["injured"].sum()


def test_cases_between_two_bounds(tmp_path: Path, undrawn: None) -> None:
    table = people()
    stands = table["stands"].to_numpy()
    grid = np.array([300.0, 500.0, 700.0, 900.0, 1200.0, 1800.0])
    place = np.searchsorted(grid, stands)
    low = np.where(place > 0, grid[np.maximum(place - 1, 0)], np.nan)
    high = np.where(place < grid.size, grid[np.minimum(place, grid.size - 1)], np.nan)
    source = saved(tmp_path / "cases.csv", pd.DataFrame({"hic_low": low, "hic_high": high}))
    analysis = fitted(tmp_path, source)
    wanted = Observations(np.nan_to_num(low), np.where(np.isnan(high), np.inf, high))
    best = assert_fits(analysis, wanted)
    assert best.stimulus_at(0.5)[0] == pytest.approx(MEDIAN, rel=0.1)


def test_exact_cases_say_more(tmp_path: Path, undrawn: None) -> None:
    table = people()
    hit = table["injured"] == 1
    known = table[["injured"]].assign(
        hic=np.where(hit, table["stands"], table["hic"]), exact=hit.astype(int)
    )
    analysis = fitted(tmp_path, saved(tmp_path / "cases.csv", known))
    wanted = observe(known["hic"].to_numpy(), hit.to_numpy(), hit.to_numpy())
    assert_fits(analysis, wanted)
    assert analysis["exact"] == hit.sum()
    told = mcstudy(
        "risk-curve", tmp_path / "cases.csv", "--stimulus", "hic", "--out", tmp_path / "o"
    )
    assert told.code == 0
    assert f"{hit.sum()} exact" in (tmp_path / "o" / "report.html").read_text()


def test_one_case_that_carries_the_curve_is_named(tmp_path: Path, undrawn: None) -> None:
    hic = [100.0, 200.0, 300.0, 400.0, 1000.0, 500.0, 600.0, 700.0, 800.0]
    table = pd.DataFrame({"hic": hic, "injured": [0, 0, 0, 0, 0, 1, 1, 1, 1]})
    source = saved(tmp_path / "cases.csv", table)
    analysis = fitted(tmp_path, source)
    assert analysis["influence"]["influential"] >= 1
    assert analysis["influence"]["largest"][0] == {"case": 5, "shift": None}
    told = mcstudy("risk-curve", source, "--stimulus", "hic", "--out", tmp_path / "told")
    assert "leaving out case 5 leaves no curve" in told.line


def test_influence_is_that_of_leaving_each_case_out(tmp_path: Path, undrawn: None) -> None:
    table = people(40)
    analysis = fitted(tmp_path, saved(tmp_path / "cases.csv", table[["hic", "injured"]]))
    whole = observe(table["hic"].to_numpy(), table["injured"].to_numpy() == 1)
    fit = fit_risk_curve(whole, analysis["family"])
    largest = []
    for k in range(40):
        without = fit_risk_curve(whole.without(k), analysis["family"])
        shifts = []
        for p in (0.05, 0.25, 0.5):
            value, low, high = np.log(without.stimulus_at(p))
            shifts.append((value - np.log(fit.stimulus_at(p)[0])) / ((high - low) / 3.919927969))
        largest.append(max(shifts, key=abs))
    order = np.argsort(-np.abs(largest))[:5]
    found = analysis["influence"]["largest"]
    assert [entry["case"] for entry in found] == (order + 1).tolist()
    wanted = [largest[k] for k in order]
    assert [entry["shift"] for entry in found] == pytest.approx(wanted, rel=1e-6)
    assert analysis["influence"]["influential"] == int(np.sum(np.abs(largest) > 1.0))


@pytest.mark.parametrize("kind", ["injured", "exact", "bounds"])
def test_thousands_of_cases_are_not_refitted_each(tmp_path: Path, undrawn: None, kind: str) -> None:
    table = people(2000)
    hit = (table["injured"] == 1) & (table.index % 4 == 0)
    if kind == "exact":
        table = table.assign(hic=np.where(hit, table["stands"], table["hic"]), exact=hit * 1)
    if kind == "bounds":
        edges = np.round(table["stands"], -2)
        table = pd.DataFrame({"hic_low": edges - 50.0, "hic_high": edges + 50.0})
        table.loc[::3, "hic_high"] = np.nan
    analysis = fitted(tmp_path, saved(tmp_path / "cases.csv", table))
    assert (analysis["cases"], analysis["influence"]) == (2000, None)
    if kind != "bounds":
        assert analysis["at"]["0.5"]["value"] == pytest.approx(MEDIAN, rel=0.05)


def test_the_same_cases_give_the_same_bytes(tmp_path: Path) -> None:
    source = saved(tmp_path / "cases.csv", people(60)[["hic", "injured"]])
    folders = [tmp_path / name for name in ("one", "two")]
    for out in folders:
        assert mcstudy("risk-curve", source, "--stimulus", "hic", "--out", out).code == 0
    one, two = (contents(out) for out in folders)
    assert one == two
    assert {"analysis.json", "report.html", "figures/risk_curve.png",
            "figures/risk_curve.svg"} <= set(one)  # fmt: skip


def test_the_command_line_says_the_result(tmp_path: Path, undrawn: None) -> None:
    source = saved(tmp_path / "cases.csv", people()[["hic", "injured"]])
    answer = mcstudy("risk-curve", source, "--stimulus", "hic", "--out", tmp_path / "out")
    assert answer.code == 0
    analysis = ResultsFolder(tmp_path / "out").read_json("analysis.json")
    for word in (analysis["family"], "150 cases", "AIC", "quality index", "report.html"):
        assert word in answer.line
    assert "None" not in answer.line
    quiet = mcstudy("risk-curve", source, "--stimulus", "hic", "--out", tmp_path / "q", "--quiet")
    assert (quiet.code, quiet.out, quiet.err) == (0, "", "")


def test_the_folder_is_named_after_cases_and_stimulus(
    tmp_path: Path, undrawn: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    saved(tmp_path / "mine.csv", people(60)[["hic", "injured"]])
    assert mcstudy("risk-curve", "mine.csv", "--stimulus", "hic").code == 0
    assert (tmp_path / "results" / "risk_mine_hic" / "report.html").exists()


@pytest.mark.parametrize("stimulus", ["HIC/1000", "x/../../../../outside"])
def test_a_stimulus_does_not_choose_the_folder(
    tmp_path: Path, undrawn: None, monkeypatch: pytest.MonkeyPatch, stimulus: str
) -> None:
    work = tmp_path / "a" / "b"
    work.mkdir(parents=True)
    monkeypatch.chdir(work)
    saved(work / "mine.csv", people(60).rename(columns={"hic": stimulus})[[stimulus, "injured"]])
    assert mcstudy("risk-curve", "mine.csv", "--stimulus", stimulus).code == 0
    assert [[path.name for path in folder.iterdir()] for folder in (tmp_path, work.parent)] == [
        ["a"], ["b"]
    ]  # fmt: skip
    (folder,) = (work / "results").iterdir()
    assert (folder / "report.html").exists()


@pytest.mark.parametrize("stimulus", ["<script>alert(1)</script>", "$\\bad{$ a_b"])
def test_the_report_stands_alone_and_draws_any_name(tmp_path: Path, stimulus: str) -> None:
    table = people(60).rename(columns={"hic": stimulus})[[stimulus, "injured"]]
    source = saved(tmp_path / "a<b>&c.csv", table)
    answer = mcstudy("risk-curve", source, "--stimulus", stimulus, "--out", tmp_path / "out")
    assert (answer.code, answer.err) == (0, "")
    html = (tmp_path / "out" / "report.html").read_text()
    assert_stands_alone(html)
    assert "a&lt;b&gt;&amp;c.csv" in html
    svg = (tmp_path / "out" / "figures" / "risk_curve.svg").read_text()
    assert "<script" not in svg.lower()


def test_bounds_without_an_ais_are_no_ais(tmp_path: Path, undrawn: None) -> None:
    rows = {
        "hic_low": [np.nan, 500.0, 700.0, 600.0, 900.0],
        "hic_high": [650.0, 800.0, np.nan, 1000.0, np.nan],
    }
    analysis = fitted(tmp_path, saved(tmp_path / "cases.csv", pd.DataFrame(rows)))
    assert analysis["injury"] == "injury"


GOOD = people(40)[["hic", "injured"]]


def refused(tmp_path: Path, source: Path, *options: str, stimulus: str = "hic") -> str:
    """Return the one line with which a table is refused; nothing is written."""
    out = tmp_path / "out"
    said = told(mcstudy("risk-curve", source, "--stimulus", stimulus, "--out", out, *options))
    assert str(source) in said
    assert not out.exists()
    return said


def with_first(column: str, value: object) -> pd.DataFrame:
    """Return good cases of which the third has another value."""
    table = GOOD.astype({column: object})
    table.loc[2, column] = value
    return table


SEPARATE = pd.DataFrame({"hic": [100.0, 200.0, 300.0, 400.0], "injured": [0, 0, 1, 1]})
WRONG: dict[str, tuple[pd.DataFrame, str]] = {
    "no stimulus": (GOOD.rename(columns={"hic": "HIC"}), "no column 'hic'; it has HIC, injured"),
    "no outcome": (GOOD[["hic"]], "neither a column 'injured' nor 'ais'"),
    "text": (with_first("hic", "many"), "line 4: column 'hic' must hold numbers, not 'many'"),
    "comma": (with_first("hic", "1,5"), "line 4: column 'hic' must hold numbers, not '1,5' (a dec"),
    "injured 2": (with_first("injured", 2), "column 'injured', case 3: '2' is neither 0 nor 1"),
    "injured empty": (with_first("injured", None), "column 'injured', case 3"),
    "ais text": (
        with_first("injured", "severe").rename(columns={"injured": "ais"}),
        "line 4: column 'ais' must hold numbers, not 'severe'",
    ),
    "injured at zero": (with_first("hic", 0.0).assign(injured=[1, 0] * 20), "case 3: the stimulus"),
    "negative": (with_first("hic", -5.0), "case 3: the stimulus must be a positive number"),
    "missing": (with_first("hic", None), "case 3: the stimulus must be a positive number"),
    "separation": (SEPARATE, "complete separation"),
    "all injured": (GOOD.assign(injured=1), "all cases are injured"),
    "none injured": (GOOD.assign(injured=0), "no case is injured"),
    "falling": (GOOD.assign(injured=(people(40)["hic"] < people(40, 9)["hic"]).astype(int)),
                "risk does not rise"),
    "two cases": (GOOD.iloc[:2], "2 cases are too few"),
    "head alone": (GOOD.iloc[:0], "0 cases are too few"),
    "exact uninjured": (GOOD.assign(exact=1), "is exact and not injured"),
    "uninjured at zero": (with_first("hic", 0.0).assign(injured=[0, 1] * 20), "case 3"),
    "infinite": (with_first("hic", "inf").assign(injured=[1, 0] * 20), "case 3"),
    "open": (
        pd.DataFrame({"hic_low": [np.nan, 500.0, 700.0, np.nan],
                      "hic_high": [600.0, 800.0, np.nan, np.nan]}),
        "case 4",
    ),
    "empty interval": (
        pd.DataFrame({"hic_low": [5.0, 1.0, 2.0], "hic_high": [4.0, 2.0, np.nan]}),
        "case 1: the interval 5 to 4 is empty",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", list(WRONG))
def test_wrong_tables_get_one_line(tmp_path: Path, case: str) -> None:
    table, message = WRONG[case]
    assert message in refused(tmp_path, saved(tmp_path / "cases.csv", table))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("cases.csv", b""),
        ("cases.csv", b"\n\n"),
        ("cases.csv", bytes(range(256)) * 40),
        ("cases.csv", b"\x89PNG\r\n\x1a\n" + b"\x00\xff" * 300),
        ("cases.csv", b'"h\nic",injured\n1,0\n2,1\n'),
        ("cases.csv", b"hic,injured\n1,2,3,4\n1,2\n1,2,3,4,5\n"),
        ("cases.parquet", b"hic,injured\n1,0\n"),
        ("cases.parquet", b""),
    ],
)
def test_what_is_no_table_gets_one_line(tmp_path: Path, name: str, content: bytes) -> None:
    source = tmp_path / name
    source.write_bytes(content)
    refused(tmp_path, source)


def test_what_a_table_does_not_have_gets_one_line(tmp_path: Path) -> None:
    refused(tmp_path, tmp_path / "none.csv")
    (tmp_path / "folder").mkdir()
    refused(tmp_path, tmp_path / "folder")
    source = saved(tmp_path / "cases.csv", GOOD.rename(columns={"injured": "ais"}))
    assert "no scenario 'slower'" in refused(tmp_path, source, "--scenario", "slower")
    command = ("risk-curve", source, "--out", tmp_path / "out")
    assert "--stimulus" in told(mcstudy(*command))
    for level in ("0", "-1", "7"):
        assert "--level" in told(mcstudy(*command, "--stimulus", "hic", "--level", level))


@pytest.mark.parametrize("value", [None, 9, 7, -1, 2.5])
def test_an_unknown_ais_is_no_outcome(tmp_path: Path, value: float | None) -> None:
    """An AIS of 9 is an injury of unknown severity; an empty one says nothing."""
    table = with_first("injured", value).rename(columns={"injured": "ais"})
    table["ais"] = pd.to_numeric(table["ais"]) * np.where(table.index == 2, 1, 4)
    assert "case 3" in refused(tmp_path, saved(tmp_path / "cases.csv", table))


SPEED = """
[inputs.impact_speed]
distribution = "uniform"
unit = "km/h"
low = 10.0
high = 40.0
[scenarios.softer]
title = "softer"
fixed = { hood_force_scale = { value = 0.5 } }
"""
STUDY = study_text("injury", "n = 120\nreplicate_size = 20", inputs=SPEED)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an injury study whose speed is all that varies."""
    path = tmp_path_factory.mktemp("risk") / "study.toml"
    path.write_text(STUDY)
    with by_formula(), without_figures():
        return run_study(path, out=path.parent / "out", workers=1).path


@pytest.mark.parametrize("scenario", ["reference", "softer", None])
def test_a_study_against_its_impact_speed(
    study: Path, tmp_path: Path, undrawn: None, scenario: str | None
) -> None:
    options = [] if scenario is None else ["--scenario", scenario]
    analysis = fitted(tmp_path, study, *options, stimulus="impact_speed")
    cases = pd.read_parquet(study / "cases.parquet")
    # One scenario alone: others are the same people once more.
    held = cases[cases["scenario"] == (scenario or "reference")]
    speed = 3.6 * held["impact_speed"].to_numpy(dtype=float)
    best = fit_risk_curve(observe(speed, (held["ais"] >= 3).to_numpy()), analysis["family"])
    value, low, high = best.stimulus_at(0.5)
    at = analysis["at"]["0.5"]
    assert (at["value"], at["low"], at["high"]) == pytest.approx((value, low, high), rel=1e-5)
    assert (analysis["unit"], analysis["injury"]) == ("km/h", "AIS3+")
    assert analysis["cases"] == len(held)
    assert analysis["injured"] == (held["ais"] >= 3).sum()
    # Softer hoods need higher speeds.
    assert (at["value"] > 40.0) == (scenario == "softer")


def test_a_studys_level_and_output_can_be_chosen(
    study: Path, tmp_path: Path, undrawn: None
) -> None:
    analysis = fitted(tmp_path, study, "--level", "2", stimulus="hic15")
    cases = pd.read_parquet(study / "cases.parquet")
    cases = cases[cases["scenario"] == "reference"]
    assert analysis["injured"] == (cases["ais"] >= 2).sum()
    assert_fits(analysis, observe(cases["hic15"].to_numpy(), (cases["ais"] >= 2).to_numpy()))


def test_a_studys_own_report_is_not_overwritten(study: Path, tmp_path: Path, undrawn: None) -> None:
    before = contents(study)
    fitted(tmp_path, study, stimulus="hic15")
    told(mcstudy("risk-curve", study, "--stimulus", "hic15", "--out", study))
    assert contents(study) == before


def test_what_a_study_does_not_have_gets_one_line(study: Path, tmp_path: Path) -> None:
    assert "no scenario 'faster'" in refused(
        tmp_path, study, "--scenario", "faster", stimulus="hic15"
    )
    assert "no column 'bric'" in refused(tmp_path, study, stimulus="bric")


def test_a_study_that_was_not_finished_has_no_cases(study: Path, tmp_path: Path) -> None:
    part = tmp_path / "part"
    part.mkdir()
    (part / "study.toml").write_text(STUDY)
    assert "cases.parquet" in refused(tmp_path, part, stimulus="hic15")


def test_no_blow_is_no_case(study: Path, tmp_path: Path, undrawn: None) -> None:
    copy = tmp_path / "missed"
    copy.mkdir()
    (copy / "study.toml").write_text(STUDY)
    cases = pd.read_parquet(study / "cases.parquet")
    missed = cases["run"] % 5 == 0
    cases.loc[missed, "hic15"] = np.nan
    cases.loc[missed, "ais"] = 0
    cases.to_parquet(copy / "cases.parquet")
    analysis = fitted(tmp_path, copy, stimulus="hic15")
    held = cases["scenario"] == "reference"
    assert analysis["cases"] == held.sum() - (missed & held).sum()
