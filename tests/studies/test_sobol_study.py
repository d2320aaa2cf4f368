"""The Sobol' study from file to folder: known indices, doubling, failures, what it says."""

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from headform_studies import (
    EXPONENTS,
    FAILING,
    SOFTEST,
    SPREADS,
    assert_holds,
    by_formula,
    closed_form,
    copy_of,
    first_order,
    mcstudy,
    recorded_parts,
    run_text,
    second_order,
    shares,
    study_text,
    told,
    total_order,
    unfinished,
    without_figures,
)

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder, digest
from mcstudy.typed_json import from_plain
from models.registry import load_model
from studies import api
from studies.failure_report import failure_map
from studies.kind import Finished
from studies.kinds import KINDS, parse_study
from studies.sobol import report as sobol_report
from studies.sobol import study as sobol
from studies.sobol.analysis import IndexedOutput, SobolAnalysis

BLOCK = 6
"""Rows of a base point: A, B, three inputs and the dummy."""
SECOND = study_text("sobol", "n = 128\nsecond_order = true", outputs=("hic15",), force=100000.0)


def plain(n: int = 64, **options: Any) -> str:
    return study_text("sobol", f"n = {n}", **options)


def doubling(tolerance: float, start: int = 64, n: int = 256) -> str:
    return study_text("sobol", f"start = {start}\nn = {n}\ntolerance = {tolerance}")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Return a study of 128 base points with second order."""
    results = ResultsFolder(tmp_path_factory.mktemp("sobol") / "second")
    with without_figures():
        run_text(SECOND, results)
    return results


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Return a study of 64 base points by formula, without figures."""
    results = ResultsFolder(tmp_path_factory.mktemp("sobol") / "small")
    with by_formula(), without_figures():
        run_text(plain(), results)
    return results


@pytest.fixture(scope="module")
def failing(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Return a study in which the softest hoods fail, within its limit, with the map of it."""
    results = ResultsFolder(tmp_path_factory.mktemp("sobol") / "failing")
    with by_formula(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(sobol, "draw", failure_map)
        run_text(plain(inputs=FAILING, force=100.0, limit=0.5, outputs=("hic15",)), results)
    return results


def test_the_formula_is_the_headform_model() -> None:
    model = load_model("headform", {"hood_curve": [[0.0, 0.0], [0.1, 100.0]], "channel_class": 0.0})
    names = [item.name for item in model.inputs]
    rows = np.tile([item.nominal for item in model.inputs], (5, 1))
    rows[:, names.index("hood_force_scale")] = (0.9 * SOFTEST, 1.1 * SOFTEST, 60.0, 100.0, 150.0)
    rows[:, names.index("impact_speed")] = (8.0, 8.0, 6.0, 8.0, 11.0)
    rows[:, names.index("headform_mass")] = (2.5, 2.5, 2.0, 2.5, 3.5)
    batch = model.run_batch(rows)
    argument = {"name": "headform", "options": {"hood_curve": [[0.0, 0.0], [0.1, 100.0]]}}
    outputs, status = closed_form(argument, rows)
    assert batch.status == status == ["time_limit", "ok", "ok", "ok", "ok"]
    for name in EXPONENTS:
        place = [item.name for item in model.outputs].index(name)
        ratio = batch.outputs[2:, place] / outputs[2:, place]
        assert ratio == pytest.approx(ratio[0], rel=2e-3)


@pytest.mark.parametrize("output", list(EXPONENTS))
def test_indices_are_those_of_the_closed_form(folder: ResultsFolder, output: str) -> None:
    entry = folder.read_json("analysis.json")["outputs"][output]
    parts = shares(output)
    for name in SPREADS:
        assert_holds(entry["first"][name], first_order(parts)[name])
        assert_holds(entry["total"][name], total_order(parts)[name])
        assert entry["total"][name]["value"] == pytest.approx(total_order(parts)[name], abs=0.1)
    for pair, truth in second_order(parts).items():
        assert_holds(entry["second"][pair], truth)


def test_analysis_names_every_factor_the_dummy_and_every_pair(folder: ResultsFolder) -> None:
    analysis = folder.read_json("analysis.json")
    factors = [*SPREADS, "dummy"]
    assert analysis["factors"] == factors
    assert analysis["runs"] == 128 * 10
    assert analysis["base_points"] == 128
    assert analysis["status"] == {"ok": 1280}
    assert analysis["failures"]["runs"] == 0
    for entry in analysis["outputs"].values():
        assert list(entry["first"]) == list(entry["total"]) == factors
        pairs = [f"{a} x {b}" for a, b in itertools.combinations(factors, 2)]
        assert list(entry["second"]) == pairs
        assert entry["base_points"] == 128
    assert analysis["outputs"]["hic15"]["total"]["dummy"]["high"] < 1e-5


def test_the_variance_is_that_of_the_runs(folder: ResultsFolder) -> None:
    runs = folder.runs()
    base = runs[runs["run"] % 10 % 9 == 0]
    entry = folder.read_json("analysis.json")["outputs"]["hic15"]
    assert entry["variance"] == pytest.approx(base["hic15"].var(ddof=0), rel=1e-9)


def test_inputs_of_a_block_are_those_of_a_with_one_from_b(folder: ResultsFolder) -> None:
    runs, names = folder.runs(), list(SPREADS)
    cube = runs[names].to_numpy().reshape(128, 10, 3)
    for k in range(3):
        others = [j for j in range(3) if j != k]
        assert np.array_equal(cube[:, 1 + k, others], cube[:, 0, others])
        assert np.array_equal(cube[:, 5 + k, others], cube[:, 9, others])
        assert np.all(np.abs(cube[:, 1 + k, k] / cube[:, 9, k] - 1.0) < 0.05)
    moved = np.abs(cube[:, 4] / cube[:, 0] - 1.0)
    assert 0.0 < moved.max() < 0.05
    speed = runs["impact_speed"]
    assert speed.median() == pytest.approx(30.0 / 3.6, rel=0.01)


def test_convergence_ends_with_the_whole_design(folder: ResultsFolder) -> None:
    analysis = folder.read_json("analysis.json")
    steps = analysis["convergence"]["hic15"]
    assert [step["n"] for step in steps] == [8, 16, 32, 64, 128]
    entry = analysis["outputs"]["hic15"]
    for name in analysis["factors"]:
        last = steps[-1]["total"][name]["value"]
        assert last == pytest.approx(entry["total"][name]["value"], rel=1e-12)


def test_main_effect_follows_the_power_of_the_input(folder: ResultsFolder) -> None:
    effect = folder.read_json("analysis.json")["main_effects"]["hic15"]["impact_speed"]
    slope = np.polyfit(np.log(effect["x"]), np.log(effect["mean"]), 1)[0]
    assert slope == pytest.approx(2.5, abs=0.3)


def test_widest_is_the_widest_total_interval_of_the_reported_outputs(
    small: ResultsFolder,
) -> None:
    analysis = small.read_json("analysis.json")
    widths = [
        entry["high"] - entry["low"]
        for output in ("hic15", "peak_force")
        for name, entry in analysis["outputs"][output]["total"].items()
        if name != "dummy"
    ]
    assert analysis["widest"] == pytest.approx(max(widths), rel=1e-12)


def test_a_group_of_dependent_inputs_has_the_index_of_its_sum(tmp_path: Path, fast: None) -> None:
    text = plain(
        256,
        more='[groups]\ntest = ["impact_speed", "headform_mass"]\n'
        '[dependence]\ncorrelations = [["impact_speed", "headform_mass", 0.6]]\n',
    )
    analysis = run_text(text, ResultsFolder(tmp_path / "group"))
    assert analysis["factors"] == ["test", "hood_force_scale", "dummy"]
    speed, mass = 2.5 * 0.12, -0.75 * 0.2
    parts = {
        "test": speed**2 + mass**2 + 2.0 * 0.6 * speed * mass,
        "hood_force_scale": (0.75 * 0.3) ** 2,
    }
    entry = analysis["outputs"]["hic15"]
    for name in parts:
        assert_holds(entry["first"][name], first_order(parts)[name])
        assert_holds(entry["total"][name], total_order(parts)[name])
    html = (tmp_path / "group" / "report.html").read_text()
    assert "test: impact speed, headform mass" in html


def test_every_figure_is_made(folder: ResultsFolder) -> None:
    study, kind, analysis = parse_study(SECOND), KINDS["sobol"], folder.read_analysis(SobolAnalysis)
    figures = sobol_report.draw(analysis)
    wanted = {"indices", "heatmap", "convergence", "main_effects_hic15", "second_order_hic15"}
    assert set(figures) == wanted
    done = Finished(study, kind.results(study, folder), analysis)
    sections = kind.sections(done, figures)
    assert sum(len(section.figures) for section in sections) == len(wanted)


def test_doubling_stops_at_the_first_design_within_the_tolerance(
    tmp_path: Path, fast: None
) -> None:
    results = ResultsFolder(tmp_path)
    early = run_text(doubling(0.9), results)
    assert early["base_points"] == results.design()["base_points"] == 64
    assert early["widest"] <= early["tolerance"] == 0.9
    assert len(results.runs()) == 64 * BLOCK
    assert "The study asked for 0.9: met." in (results.path / "report.html").read_text()
    tolerance = 0.6 * early["widest"]
    with recorded_parts() as ids:
        analysis = run_text(doubling(tolerance, n=1024), results)
    assert 64 < analysis["base_points"] <= 1024
    assert analysis["widest"] <= tolerance
    # What the looser tolerance had run is not run again.
    assert sorted(ids) == list(range(64 * BLOCK, analysis["base_points"] * BLOCK))


def test_doubling_spends_the_budget_and_repeats_no_run(tmp_path: Path, fast: None) -> None:
    results, at_once = ResultsFolder(tmp_path / "budget"), ResultsFolder(tmp_path / "at_once")
    with recorded_parts() as ids:
        analysis = run_text(doubling(1e-6), results)
    assert sorted(ids) == list(range(256 * BLOCK))
    assert analysis["base_points"] == 256
    assert "The study asked for 1e-06: NOT met" in (results.path / "report.html").read_text()
    run_text(plain(256), at_once)
    assert digest(results.runs()) == at_once.read_json("manifest.json")["digest"]
    # A start above the budget is cut.
    assert run_text(doubling(1e-6, start=256, n=64), at_once)["base_points"] == 64


@pytest.mark.parametrize(
    ("edit", "differs"),
    [
        (("n = 64", "n = 64\nsecond_order = true"), "design.second_order"),
        (("[report]", '[groups]\npair = ["impact_speed", "headform_mass"]\n[report]'), "groups"),
    ],
)
def test_a_changed_study_is_refused_with_what_differs(
    small: ResultsFolder, edit: tuple[str, str], differs: str
) -> None:
    text = plain().replace(*edit, 1)
    assert text != plain()
    before = (small.path / "manifest.json").read_bytes()
    with pytest.raises(UserError, match=rf"differs in {re.escape(differs)}\)"):
        run_text(text, small)
    assert (small.path / "manifest.json").read_bytes() == before


def test_a_kill_while_doubling_is_gone_on_with(
    small: ResultsFolder, tmp_path: Path, fast: None
) -> None:
    whole = ResultsFolder(tmp_path / "whole")
    run_text(doubling(1e-6, n=128), whole)
    runs = whole.runs()
    part = unfinished(whole, tmp_path / "part", runs[runs["run"] < 100 * BLOCK + 1])
    assert api.build_report(part)["base_points"] == 100
    with recorded_parts() as ids:
        analysis = run_text(doubling(1e-6, n=128), part)
    assert sorted(ids) == list(range(100 * BLOCK + 1, 128 * BLOCK))
    assert analysis == whole.read_json("analysis.json")


@pytest.mark.parametrize("kind", ["sobol", "morris"])
@pytest.mark.parametrize("group", ["", '[groups]\ntest = ["impact_speed", "hood_force_scale"]\n'])
def test_dependent_inputs_of_two_factors_are_refused(tmp_path: Path, kind: str, group: str) -> None:
    study = tmp_path / "dependent.toml"
    more = group + '[dependence]\ncorrelations = [["impact_speed", "headform_mass", 0.5]]\n'
    study.write_text(study_text(kind, more=more))
    said = told(mcstudy("run", study, "--out", tmp_path / "out"))
    for word in ("'impact_speed' and 'headform_mass' depend", kind, "group", "mcstudy sensitivity"):
        assert word in said
    assert not (tmp_path / "out").exists()


def test_an_input_drawn_given_another_is_dependent_too(tmp_path: Path) -> None:
    text = Path("configs/paper_sobol.toml").read_text()
    text = re.sub(r"\nchild = .*", "", text)
    text = re.sub(r"\[dependence\].*?(?=\[report\])", "", text, flags=re.DOTALL)
    with pytest.raises(UserError, match="'stature' and 'age' depend on each other"):
        run_text(text, ResultsFolder(tmp_path / "out"))


@pytest.mark.parametrize(
    ("design", "groups", "message"),
    [
        ("n = 64", 'pair = ["impact_speed", "nope"]', "'nope' is not a sampled input"),
        ("n = 64", 'impact_speed = ["headform_mass"]', "an input has this name already"),
        ("n = 64", 'a = ["impact_speed"]\nb = ["impact_speed"]', "in groups 'a' and 'b'"),
        ("n = 64", 'dummy = ["impact_speed"]', "dummy"),
        ("n = 100", "", "design"),
        ("n = 32", "", "design"),
        ("n = 64\nstart = 96", "", "design"),
        ("tolerance = 0.0", "", "design"),
    ],
)
def test_wrong_groups_and_designs_are_users_errors(
    tmp_path: Path, design: str, groups: str, message: str
) -> None:
    study = tmp_path / "groups.toml"
    study.write_text(study_text("sobol", design, more=f"[groups]\n{groups}\n"))
    assert message in told(mcstudy("run", study, "--out", tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_base_points_with_a_failed_run_are_left_out_whole(failing: ResultsFolder) -> None:
    runs, analysis = failing.runs(), failing.read_json("analysis.json")
    block = 5
    failed = (runs["status"] != "ok").to_numpy()
    assert 0 < failed.sum() == analysis["failures"]["runs"]
    hit = np.unique(np.flatnonzero(failed) // block)
    assert analysis["failures"]["blocks"] == hit.size
    assert analysis["failures"]["share"] == pytest.approx(failed.mean())
    assert analysis["base_points"] == 64
    assert analysis["outputs"]["hic15"]["base_points"] == 64 - hit.size
    assert analysis["status"] == runs["status"].value_counts().to_dict()
    # Without the lost base points the variance is that of the whole ones.
    kept = runs[~np.isin(runs["run"] // block, hit)]
    base = kept[kept["run"] % block == 0]["hic15"].to_numpy()
    other = kept[kept["run"] % block == block - 1]["hic15"].to_numpy()
    centred = np.concatenate([base, other])
    assert analysis["outputs"]["hic15"]["variance"] == pytest.approx(centred.var(), rel=1e-9)


def test_failures_are_located(failing: ResultsFolder) -> None:
    failures = failing.read_json("analysis.json")["failures"]
    assert failures["where"]["hood_force_scale"]["mean_rank"] < 0.1
    assert failures["where"]["hood_force_scale"]["place"] == "low"
    share = failures["map"]["hood_force_scale"]
    assert share[0] > 0.3
    assert share[1:] == [0.0] * 9
    html = (failing.path / "report.html").read_text()
    assert "runs failed" in html
    assert "hood force scale low" in html
    assert "Share of failed runs in each tenth of each input." in html
    assert (failing.path / "figures" / "failures.svg").stat().st_size > 1000


def test_failed_runs_do_not_enter_the_main_effects(
    failing: ResultsFolder, tmp_path: Path, fast: None
) -> None:
    runs = failing.runs()
    # A model may leave numbers in a failed run; they are no outcome.
    runs.loc[runs["status"] != "ok", "hic15"] = 1e9
    spoilt = copy_of(failing, tmp_path / "spoilt", runs)
    effects = api.build_report(spoilt)["main_effects"]["hic15"]
    assert max(effects["hood_force_scale"]["mean"]) < 1e6


def test_an_output_with_too_few_values_gets_no_index(
    small: ResultsFolder, tmp_path: Path, fast: None
) -> None:
    runs = small.runs()
    # One row of each of fourteen base points, more than a fifth of 64, and of two in another.
    lost = runs["run"] % BLOCK == 2
    runs.loc[lost & (runs["run"] // BLOCK < 14), "clip_3ms"] = np.nan
    runs.loc[lost & (runs["run"] // BLOCK < 2), "peak_force"] = np.nan
    part = copy_of(small, tmp_path / "values", runs)
    analysis = api.build_report(part)
    clip, force = (analysis["outputs"][name] for name in ("clip_3ms", "peak_force"))
    assert clip == {"unit": "g", "base_points": 50}
    assert force["base_points"] == 62
    assert_holds(force["total"]["impact_speed"], total_order(shares("peak_force"))["impact_speed"])
    assert analysis["outputs"]["hic15"] == small.read_json("analysis.json")["outputs"]["hic15"]
    html = (part.path / "report.html").read_text()
    assert "No index is given" in html
    assert "3 ms head acceleration (50 of 64)" in html
    # A reported output without any value leaves the others.
    runs = small.runs().assign(hic15=np.nan)
    part = copy_of(small, tmp_path / "one", runs)
    answer = mcstudy("report", part.path)
    assert (answer.code, answer.err) == (0, "")
    assert "of peak force" in answer.line.lower()
    assert "HIC15 (0 of 64)" in (part.path / "report.html").read_text()
    none = copy_of(small, tmp_path / "none", runs.assign(peak_force=np.nan))
    assert "hic15, peak_force: too few of the 64" in told(mcstudy("report", none.path), 1)


def estimate(value: float, half: float) -> dict[str, float]:
    return {"value": value, "low": value - half, "high": value + half}


def made_up(
    first: dict[str, tuple[float, float]],
    total: dict[str, tuple[float, float]],
    *,
    unit: str = "1",
    variance: float = 1e4,
    noise_sd: float = 0.1,
) -> IndexedOutput:
    plain = {
        "unit": unit,
        "base_points": 256,
        "variance": variance,
        "noise_sd": noise_sd,
        "alone": estimate(
            sum(value for value, _ in first.values()),
            sum(half**2 for _, half in first.values()) ** 0.5,
        ),
        "first": {name: estimate(*pair) for name, pair in first.items()},
        "total": {name: estimate(*pair) for name, pair in total.items()},
    }
    return from_plain(IndexedOutput, plain)


def test_a_sentence_names_shares_largest_first_and_weak_factors() -> None:
    entry = made_up(
        {"gait_phase": (0.2, 0.03), "impact_speed": (0.5, 0.04), "age": (0.0, 0.02),
         "dummy": (0.0, 0.0)},
        {"gait_phase": (0.4, 0.04), "impact_speed": (0.6, 0.04), "age": (0.0, 0.001),
         "dummy": (0.0, 0.0002)},
    )  # fmt: skip
    text = sobol_report.sentence("hic15", entry)
    assert text.startswith(
        "Impact speed explains 50 ± 4 % of the variance of HIC15, gait phase 20 ± 3 %."
    )
    assert "on their own explain 70 ± 5 %; the rest are interactions." in text
    assert "gait phase (20 % alone, 40 % with interactions)" in text
    assert "Not distinguishable from zero, even with interactions: age." in text
    assert "chaos" not in text
    assert not re.search(r"-0\b|nan|None", text)


def test_a_sentence_says_where_chaos_is_and_in_which_unit() -> None:
    entry = made_up(
        {"impact_speed": (0.6, 0.04), "dummy": (0.0, 0.05)},
        {"impact_speed": (0.95, 0.04), "dummy": (0.25, 0.03)},
        unit="m", variance=4.0, noise_sd=1.0,
    )  # fmt: skip
    text = sobol_report.sentence("throw_distance", entry)
    assert "interactions and chaos." in text
    assert re.search(r"25 ± 3 % of the variance is not attributable to any input", text)
    assert "1.0 m" in text


def test_negative_estimates_are_no_negative_shares() -> None:
    entry = made_up(
        {"impact_speed": (-0.004, 0.02), "age": (-0.002, 0.02), "dummy": (0.0, 0.0)},
        {"impact_speed": (0.5, 0.1), "age": (0.9, 0.05), "dummy": (0.0, 0.0001)},
    )
    text = sobol_report.sentence("wad", entry)
    assert text.startswith("No first-order index of wrap-around")
    assert "is distinguishable from zero" in text
    assert "-0 %" not in text
    assert "on their own explain 0 ± 3 %" in text
    assert "age (0 % alone, 90 % with interactions)" in text


def test_sentences_of_chaotic_and_uncertain_outputs_claim_no_interactions() -> None:
    # Of a chaotic output every total index holds the noise floor; a first-order index does not.
    entry = made_up(
        {"impact_speed": (0.4, 0.03), "friction_body_car": (0.05, 0.02), "age": (0.0, 0.02),
         "dummy": (0.0, 0.02)},
        {"impact_speed": (0.8, 0.05), "friction_body_car": (0.36, 0.05), "age": (0.3, 0.05),
         "dummy": (0.3, 0.04)},
        unit="m",
    )  # fmt: skip
    text = sobol_report.sentence("throw_distance", entry)
    assert "friction body–car 5 ± 2 %" in text
    assert "friction" not in text.partition("Not distinguishable from zero")[2].partition(".")[0]
    assert "age" not in text.partition("Most through interactions: ")[2].partition(".")[0]
    entry = made_up(
        {"impact_speed": (0.4, 0.3), "headform_mass": (0.3, 0.2), "dummy": (0.0, 0.0)},
        {"impact_speed": (0.42, 0.2), "headform_mass": (0.3, 0.1), "dummy": (0.0, 0.0)},
    )
    text = sobol_report.sentence("hic15", entry)
    assert "on their own explain 70 ± 36 %; interactions are not distinguishable" in text
    assert "the rest are interactions." not in text


def test_the_change_by_a_nudge_is_that_of_two_runs(folder: ResultsFolder) -> None:
    runs = folder.runs()
    values = runs["hic15"].to_numpy().reshape(128, 10)
    change = np.sqrt(np.mean((values[:, 4] - values[:, 0]) ** 2))
    analysis = folder.read_json("analysis.json")
    # Two runs with nudges of their own differ by sqrt(2) times the scatter that a nudge gives.
    scatter = analysis["outputs"]["hic15"]["noise_sd"]
    assert change == pytest.approx(np.sqrt(2.0) * scatter, rel=1e-9)


def test_every_table_row_of_an_index_holds_two_intervals(folder: ResultsFolder) -> None:
    html = (folder.path / "report.html").read_text()
    row = re.search(r"<tr><td[^>]*>impact speed</td>(.*?)</tr>", html)
    assert row is not None
    cells = re.findall(r"<td[^>]*>(.*?)</td>", row.group(1))
    assert len(cells) == 2
    number = r"-?\d\.\d\d"
    for cell in cells:
        assert re.fullmatch(rf"{number} \({number} to {number}\)", cell)
