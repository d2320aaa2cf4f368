"""The injury study of a headform: cells, outcomes, intervals, limits, speeds, what is refused."""

import contextlib
import itertools
import math
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from headform_studies import (
    INPUTS,
    by_formula,
    closed_form,
    contents,
    mcstudy,
    recorded_parts,
    run_text,
    told,
    without_figures,
)
from numpy.typing import NDArray
from scipy import stats
from scipy.special import expit, ndtr

from mcstudy.execution.failures import Failures
from mcstudy.execution.results import ResultsFolder
from mcstudy.injury.functions import RiskFunction
from mcstudy.typed_json import from_plain, to_plain
from models.headform.model import HeadformModel
from models.registry import load_model
from studies.injury import analysis as injury_analysis
from studies.injury import pictures as injury_pictures
from studies.injury import speed as injury_speed
from studies.injury import study as injury
from studies.injury.analysis import analyse, outcomes_of
from studies.injury.cells import cells_of
from studies.injury.numbers import InjuryAnalysis
from studies.injury.schema import InjuryStudy
from studies.kinds import parse_study
from studies.monte_carlo.design import sample_inputs
from studies.runs import RunEnds, load_study_model

Array = NDArray[np.float64]

AGE_FACTOR = 0.98 + 0.02 * 1.5 / 4.0
"""Tolerance of HIC at 7.5 years over the adult's: 0.98 at 6, 1 at 10 years."""
LEVELS = range(1, 7)
SPEED, MASS, SCALE = (f"\n[inputs.{part}" for part in INPUTS.split("[inputs.")[1:])
SLOWER = SPEED.replace(
    "[inputs.", '[scenarios.slower]\ntitle = "slower"\n[scenarios.slower.inputs.'
).replace("30.0", "24.0")
SOFTER = """
[scenarios.softer]
title = "softer hood"
[scenarios.softer.fixed.hood_force_scale]
value = 0.5
"""
FRONTS = """
[fronts.sedan]
share = 3.0
[fronts.suv]
share = 1.0
options = { hood_curve = [[0.0, 0.0], [0.1, 20000.0]] }
"""
ANOTHER = """
[mechanisms.skull]
functions = { mertz_normal = 1.0, ncap_logistic = 2.0 }
"""
OBSERVED = """
[[observed]]
label = "fracture"
mechanism = "impact"
level = 3
[[observed]]
label = "bleeding"
mechanism = "skull"
level = 4
"""
UNIFORM_SPEED = """
[inputs.impact_speed]
distribution = "uniform"
unit = "km/h"
low = 10.0
high = 60.0
"""
ANGLE = """
[inputs.impact_angle]
distribution = "uniform"
unit = "rad"
low = 0.0
high = 1.0
"""
MANY = "n = 400\nreplicate_size = 20"


def study_text(
    *tables: str,
    design: str = "n = 40\nreplicate_size = 10",
    inputs: str = INPUTS,
    functions: str = "nhtsa_lognormal = 1.0, prasad_mertz = 3.0",
    top: str = "age = 7.5",
    seed: int = 11,
) -> str:
    """Return a study of a headform on a straight hood."""
    return (
        'format = "mcstudy-study/1"\nkind = "injury"\nname = "headform_injury"\n'
        f'title = "Headform"\nseed = {seed}\n{top}\n\n[model]\nname = "headform"\n'
        'options = { headform = "eevc_child", hood_curve = [[0.0, 0.0], [0.1, 10000.0]] }\n\n'
        f"[design]\n{design}\n\n[mechanisms.impact]\nfunctions = {{ {functions} }}\n"
        f"{inputs}{''.join(tables)}"
    )


FULL = study_text(FRONTS, SLOWER, SOFTER, ANOTHER, OBSERVED, design="n = 480\nreplicate_size = 24")


@pytest.fixture(scope="module", autouse=True)
def a_miss_is_no_failure() -> Iterator[None]:
    with mock.patch.object(HeadformModel, "partial_status", frozenset({"no_head_contact"})):
        yield


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Return a study by formula: three scenarios, two fronts, two mechanisms."""
    return ran(tmp_path_factory.mktemp("injury") / "full", FULL)


def ran(path: Path, text: str) -> ResultsFolder:
    """Run a study by formula, without figures, and return its folder."""
    with by_formula(), without_figures():
        run_text(text, ResultsFolder(path))
    return ResultsFolder(path)


def analysis_of(folder: ResultsFolder) -> dict[str, Any]:
    return folder.read_json("analysis.json")


def scenario_of(folder: ResultsFolder, name: str = "reference") -> dict[str, Any]:
    entry: dict[str, Any] = analysis_of(folder)["scenarios"][name]
    return entry


def cases_of(folder: ResultsFolder, scenario: str | None = None) -> pd.DataFrame:
    cases = pd.read_parquet(folder.path / "cases.parquet")
    return cases if scenario is None else cases[cases["scenario"] == scenario]


def cell(folder: ResultsFolder, name: str) -> ResultsFolder:
    return ResultsFolder(folder.path / "cells" / name.replace(".", "/"))


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def nhtsa(hic: Array) -> dict[int, Array]:
    """Return the risks of the NHTSA curves at 7.5 years, by AIS level."""
    known = {2: (6.96352, 0.84664), 3: (7.45231, 0.73998), 4: (7.65605, 0.60580)}
    x = np.log(hic / AGE_FACTOR)
    return {level: ndtr((x - mean) / sd) for level, (mean, sd) in known.items()}


def prasad_mertz(hic: Array) -> dict[int, Array]:
    """Return the risks of the expanded Prasad-Mertz curves at 7.5 years, by AIS level."""
    known = {1: (1.54, 0.00650), 2: (2.49, 0.00483), 3: (3.39, 0.00372), 4: (4.90, 0.00351),
             5: (7.82, 0.00429), 6: (12.24, 0.00565)}  # fmt: skip
    x = hic / AGE_FACTOR
    return {level: expit(c2 * x - c1 - 200.0 / x) for level, (c1, c2) in known.items()}


def frame_of(text: str) -> tuple[InjuryStudy, pd.DataFrame, dict[str, RiskFunction]]:
    """Return a study, its cases and functions, by formula and without a folder."""
    study = parse_study(text)
    assert isinstance(study, InjuryStudy)
    model = load_study_model(study)
    frames = []
    for part in cells_of(study):
        columns = sample_inputs(part.study, model)
        for name, value in part.changes.fixed.items():
            columns[name] = np.full(study.design.n, value.value)
        rows = np.stack([columns[item.name] for item in model.inputs], axis=1)
        argument = {"name": "headform", "options": part.study.model.options}
        outputs, status = closed_form(argument, rows)
        named = {item.name: outputs[:, k] for k, item in enumerate(model.outputs)}
        frame = pd.DataFrame({"run": np.arange(study.design.n)} | columns | named)
        frames.append(frame.assign(status=status, scenario=part.scenario, front=part.front))
    functions = injury.check_functions(study, model)
    return study, outcomes_of(study, pd.concat(frames, ignore_index=True), functions), functions


ENDED = RunEnds("injury", 0, {}, [], Failures(0, 0.0, 0, {}, {}))


def analysed(text: str, *without: str) -> dict[str, Any]:
    """Return numbers of a study by formula, without associations, speeds and what else is named."""
    study, cases, functions = frame_of(text)
    with contextlib.ExitStack() as stack:
        for name in ("_associations", "describe_speed", *without):
            stack.enter_context(mock.patch.object(injury_analysis, name, lambda *_: {}))
        found = analyse(study, load_study_model(study), ENDED, cases, functions)
    plain: dict[str, Any] = to_plain(found)
    return plain


def t_interval(batches: Array) -> tuple[float, float]:
    """Return the mean of independent estimates and half its 95 % interval."""
    reach = stats.t.ppf(0.975, batches.size - 1) * batches.std(ddof=1) / math.sqrt(batches.size)
    return float(batches.mean()), float(reach)


def by_replicate(part: pd.DataFrame, column: str) -> Array:
    """Return the share-weighted mean of each replicate; sedans are three in four."""
    means = part.groupby(["replicate", "front"])[column].mean().unstack("front")
    return (0.75 * means["sedan"] + 0.25 * means["suv"]).to_numpy(dtype=float)


def test_every_scenario_meets_every_front(full: ResultsFolder) -> None:
    scenarios = ["reference", "slower", "softer"]
    names = [f"{s}/{f}" for s in scenarios for f in ("sedan", "suv")]
    manifest, analysis = full.read_json("manifest.json"), analysis_of(full)
    assert list(manifest["digests"]) == manifest["design"]["cells"] == names
    assert manifest["design"]["n"] == analysis["runs"] == len(cases_of(full)) == 6 * 480
    assert list(analysis["scenarios"]) == scenarios
    assert analysis["fronts"] == {"sedan": 0.75, "suv": 0.25}
    assert {entry["runs"] for entry in analysis["scenarios"].values()} == {960}
    for name in names:
        runs = cell(full, name).runs()
        assert runs["replicate"].tolist() == [k // 24 for k in range(480)]
    held = cases_of(full, "softer").query("front == 'suv'")["hic15"].to_numpy()
    assert held.tobytes() == cell(full, "softer.suv").runs()["hic15"].to_numpy().tobytes()


def test_cells_differ_in_what_their_scenario_or_front_changes_alone(full: ResultsFolder) -> None:
    model = load_model("headform", {"hood_curve": [[0.0, 0.0], [0.1, 1.0]]})
    reference = cell(full, "reference.sedan").runs()
    changed = {"reference": None, "slower": "impact_speed", "softer": "hood_force_scale"}
    for (scenario, own), front in itertools.product(changed.items(), ("sedan", "suv")):
        runs = cell(full, f"{scenario}.{front}").runs()
        for name in (item.name for item in model.inputs):
            same = runs[name].to_numpy().tobytes() == reference[name].to_numpy().tobytes()
            assert same == (name != own), (scenario, front, name)
    # A distribution of a scenario meets the same quantiles, a fixed value overrides the sampled.
    ratio = cell(full, "slower.suv").runs()["impact_speed"] / reference["impact_speed"]
    assert ratio.to_numpy() == pytest.approx(0.8, rel=1e-12)
    assert set(cell(full, "softer.sedan").runs()["hood_force_scale"]) == {0.5}
    assert reference["hood_force_scale"].nunique() == 480
    # A front is the model with its options.
    ratio = cell(full, "reference.suv").runs()["hic15"] / reference["hic15"]
    assert ratio.to_numpy() == pytest.approx(2.0**0.75, rel=1e-12)
    options = cell(full, "reference.suv").read_json("manifest.json")["model"]["options"]
    assert options == {"headform": "eevc_child", "hood_curve": [[0.0, 0.0], [0.1, 20000.0]]}


def test_a_fixed_value_of_a_scenario_is_in_the_units_of_the_file(tmp_path: Path) -> None:
    more = (
        '[fixed.impact_angle]\nvalue = 10.0\nunit = "deg"\n'
        '[scenarios.angled]\ntitle = "angled"\n'
        '[scenarios.angled.fixed]\nimpact_angle = { value = 20.0, unit = "deg" }\n'
        'headform_mass = { value = 3000.0, unit = "g_mass" }\n'
    )
    results = ran(tmp_path / "units", study_text(more))
    angled = cell(results, "angled.car").runs()
    assert set(angled["headform_mass"]) == {3.0}
    assert angled["impact_angle"].to_numpy() == pytest.approx(math.radians(20.0))
    reference = cell(results, "reference.car").runs()["impact_angle"]
    assert reference.to_numpy() == pytest.approx(math.radians(10.0))


def test_inputs_of_the_cells_are_those_of_a_monte_carlo_study(full: ResultsFolder) -> None:
    text = study_text(design="n = 480\nreplicate_size = 24", top="")
    start, end = text.index("[mechanisms"), text.index("[inputs.")
    study = parse_study((text[:start] + text[end:]).replace('"injury"', '"monte-carlo"'))
    columns = sample_inputs(study, load_study_model(study))
    runs = cell(full, "reference.sedan").runs()
    for name in ("impact_speed", "headform_mass", "hood_force_scale"):
        assert runs[name].to_numpy().tobytes() == columns[name].tobytes()


@pytest.mark.parametrize(
    ("edit", "where", "differs"),
    [
        (("median = 24.0", "median = 25.0"), "slower, front sedan", "inputs.impact_speed"),
        (("value = 0.5", "value = 0.6"), "softer, front sedan", "fixed.hood_force_scale"),
        (("20000.0", "21000.0"), "reference, front suv", "model"),
        (("replicate_size = 24", "replicate_size = 48"), "reference", "design.replicate_size"),
    ],
)  # fmt: skip
def test_a_changed_cell_is_refused_with_what_differs(
    full: ResultsFolder, tmp_path: Path, edit: tuple[str, str], where: str, differs: str
) -> None:
    text, before = FULL.replace(*edit, 1), contents(full.path)
    assert text != FULL
    said = told(mcstudy("run", written(tmp_path / "s.toml", text), "--out", full.path))
    assert f"scenario {where}" in said
    assert f"differs in {differs})" in said
    assert contents(full.path) == before


def test_what_changes_no_run_is_no_other_study(full: ResultsFolder, tmp_path: Path) -> None:
    folder, text = ResultsFolder(shutil.copytree(full.path, tmp_path / "same")), FULL
    for edit in (
        ("prasad_mertz = 3.0", "prasad_mertz = 1.0"),
        ("share = 3.0", "share = 1.0"),
        ("age = 7.5", 'age = 3.0\ntogether = "independent"'),
        ("[fronts.sedan]", "[limit]\nvalue = 500.0\nlevel = 4\n[fronts.sedan]"),
    ):
        assert edit[0] in text
        text = text.replace(*edit, 1)
    with recorded_parts() as ids:
        ran(folder.path, text)
    assert ids == []
    assert analysis_of(folder)["fronts"] == {"sedan": 0.5, "suv": 0.5}
    new, old = scenario_of(folder), scenario_of(full)
    assert new["at_least"]["3"]["value"] > old["at_least"]["3"]["value"]
    assert new["above_limit"]["value"] > old["above_limit"]["value"]


def test_a_scenario_more_runs_its_own_cells_and_one_less_is_not_counted(tmp_path: Path) -> None:
    ran(tmp_path, study_text(SLOWER))
    with recorded_parts() as ids:
        folder = ran(tmp_path, study_text(SLOWER, SOFTER))
    assert sorted(ids) == list(range(40))
    assert list(analysis_of(folder)["scenarios"]) == ["reference", "slower", "softer"]
    ran(tmp_path, study_text(SLOWER))
    assert folder.progress() == (80, {"ok": 80})


def test_children_and_fronts_of_the_multibody_model(tmp_path: Path) -> None:
    text = Path("configs/population_injury.toml").read_text()
    head, _, rest = text.partition("[scenarios.both]")
    small = (head + "# " + rest[rest.index("Impact speeds in town") :]).replace(
        "n = 1000\nreplicate_size = 50", "n = 4\nreplicate_size = 2"
    )
    folder = ResultsFolder(tmp_path / "children")
    with without_figures():
        analysis = run_text(small, folder)
    assert analysis["runs"] == 24
    cases = cases_of(folder)
    factor = np.interp(cases["age"], [3.0, 6.0, 10.0], [0.71, 0.98, 1.0])
    x = np.log(cases["hic15"].to_numpy(dtype=float) / factor)
    alone = np.where(np.isnan(x), 0.0, ndtr((x - 7.45231) / 0.73998))
    second = np.exp(x)
    other = np.where(np.isnan(x), 0.0, expit(0.00372 * second - 3.39 - 200.0 / second))
    wanted = np.minimum(0.5 * (alone + other), cases["risk_impact_ais2"].to_numpy())
    assert cases["risk_impact_ais3"].to_numpy() == pytest.approx(wanted, abs=1e-12)
    speeds = cases.pivot_table(index="run", columns=["scenario", "front"], values="impact_speed")
    ratio = speeds["slower"]["high_front"] / speeds["reference"]["family_car"]
    assert ratio.to_numpy() == pytest.approx(0.6, rel=1e-9)


@pytest.mark.parametrize("scenario", ["reference", "slower", "softer"])
def test_population_numbers_are_share_weighted_means(full: ResultsFolder, scenario: str) -> None:
    entry, part = scenario_of(full, scenario), cases_of(full, scenario)
    of_front = {name: part[part["front"] == name] for name in ("sedan", "suv")}

    def mean(column: str) -> float:
        sedan, suv = (of_front[name][column].mean() for name in of_front)
        return float(0.75 * sedan + 0.25 * suv)

    for level in LEVELS:
        column = f"risk_head_ais{level}"
        found = entry["at_least"][str(level)]
        assert found["value"] == pytest.approx(mean(column), rel=1e-12)
        batches = by_replicate(part, column)
        centre, reach = t_interval(batches)
        assert found["value"] == pytest.approx(centre, rel=1e-9)
        assert found["low"] == pytest.approx(max(centre - reach, 0.0), rel=1e-9, abs=1e-15)
        assert found["high"] == pytest.approx(centre + reach, rel=1e-9)
    above = 0.75 * (of_front["sedan"]["hic15"] > 700.0).mean() + 0.25 * (
        of_front["suv"]["hic15"] > 700.0
    ).mean()  # fmt: skip
    assert entry["above_limit"]["value"] == pytest.approx(above, rel=1e-12)
    for name, mine in of_front.items():
        batches = mine.groupby("replicate")["risk_head_ais3"].mean().to_numpy(dtype=float)
        centre, reach = t_interval(batches)
        found = entry["by_front"][name]
        assert found["value"] == pytest.approx(centre, rel=1e-9)
        assert found["high"] - found["low"] == pytest.approx(2.0 * reach, rel=1e-9)


@pytest.mark.parametrize("scenario", ["reference", "slower"])
def test_distributions_of_the_ais_are_differences_of_exceedances(
    full: ResultsFolder, scenario: str
) -> None:
    entry = scenario_of(full, scenario)
    exceeding = [1.0, *(entry["at_least"][str(level)]["value"] for level in LEVELS), 0.0]
    assert entry["ais"] == pytest.approx(-np.diff(exceeding), abs=1e-12)
    part = cases_of(full, scenario)
    for name, shares in {"head": entry["ais"], **entry["mechanisms"]}.items():
        assert sum(shares) == pytest.approx(1.0, abs=1e-12)
        assert min(shares) >= -1e-15
        risk = by_replicate(part, f"risk_{name}_ais4").mean()
        assert sum(shares[4:]) == pytest.approx(risk, rel=1e-9)


@pytest.mark.parametrize("scenario", ["slower", "softer"])
def test_differences_are_those_of_the_two_means_with_paired_intervals(
    full: ResultsFolder, scenario: str
) -> None:
    entries = analysis_of(full)["scenarios"]
    assert "difference" not in entries["reference"]
    parts = [cases_of(full, name) for name in (scenario, "reference")]
    for level in LEVELS:
        found = entries[scenario]["difference"][str(level)]
        new, old = (
            entries[name]["at_least"][str(level)]["value"] for name in (scenario, "reference")
        )
        assert found["value"] == pytest.approx(new - old, rel=1e-9, abs=1e-15)
        assert found["relative"] == pytest.approx(new / old - 1.0, rel=1e-9)
        changed, plain = (by_replicate(part, f"risk_head_ais{level}") for part in parts)
        centre, reach = t_interval(changed - plain)
        assert found["value"] == pytest.approx(centre, rel=1e-7, abs=1e-14)
        assert found["high"] - found["low"] == pytest.approx(2.0 * reach, rel=1e-7)


def test_common_random_numbers_make_differences_sharper(tmp_path: Path) -> None:
    folder = ran(tmp_path, study_text(SLOWER, design='method = "monte-carlo"\nn = 400'))
    found = scenario_of(folder, "slower")["difference"]["3"]
    batches = [
        cases_of(folder, name).groupby(lambda k: (k % 400) // 20)["risk_head_ais3"].mean()
        for name in ("slower", "reference")
    ]
    old, new = (batch.to_numpy(dtype=float) for batch in batches)
    assert old.size == 20
    centre, reach = t_interval(old - new)
    assert found["value"] == pytest.approx(centre, rel=1e-9)
    assert found["high"] - found["low"] == pytest.approx(2.0 * reach, rel=1e-9)
    error = math.sqrt((old.var(ddof=1) + new.var(ddof=1)) / 20.0)
    unpaired = 2.0 * float(stats.t.ppf(0.975, 38)) * error
    assert found["high"] - found["low"] < 0.7 * unpaired
    assert found["high"] < 0.0


def expected_risk(speed: float, stiffness: float) -> float:
    """Return the mean NHTSA risk of AIS 2 of the formula in closed form: HIC is lognormal."""
    centre = math.log(6.0 * (speed / 3.6) ** 2.5 * 2.5**-0.75 * stiffness**0.75 / AGE_FACTOR)
    spread = (2.5 * 0.12) ** 2 + (0.75 * 0.2) ** 2 + (0.75 * 0.3) ** 2
    return float(ndtr((centre - 6.96352) / math.sqrt(0.84664**2 + spread)))


@pytest.mark.parametrize(
    "design",
    [
        pytest.param('method = "monte-carlo"\nn = 200', marks=pytest.mark.slow),
        "n = 200\nreplicate_size = 20",
    ],
)
def test_intervals_hold_the_truth_as_often_as_they_say(design: str) -> None:
    reference, slower = (
        0.75 * expected_risk(speed, 1.0) + 0.25 * expected_risk(speed, 2.0)
        for speed in (20.0, 16.0)
    )
    inputs = INPUTS.replace("median = 30.0", "median = 20.0")
    hits: list[tuple[bool, bool]] = []
    with mock.patch.object(injury_analysis, "LEVELS", (2,)):
        for seed in range(20):
            text = study_text(
                FRONTS, SLOWER.replace("24.0", "16.0"), "[limit]\nlevel = 2\n", design=design,
                inputs=inputs, seed=seed, functions="nhtsa_lognormal = 1.0",
            )  # fmt: skip
            entry = analysed(text, "_limit", "_by_function", "_observed")["scenarios"]["slower"]
            level, change = entry["at_least"]["2"], entry["difference"]["2"]
            held = change["low"] <= slower - reference <= change["high"]
            hits.append((level["low"] <= slower <= level["high"], held))
    # Of 20 intervals of 95 % at least 16 hold the truth, but for three times in a thousand.
    assert np.sum(hits, axis=0).min() >= 16


def test_risks_are_weighted_means_of_the_published_functions(full: ResultsFolder) -> None:
    cases = cases_of(full)
    hic = cases["hic15"].to_numpy(dtype=float)
    first, second = nhtsa(hic), prasad_mertz(hic)
    below = np.ones(hic.size)
    for level in LEVELS:
        mean = second[level]
        if level in first:
            mean = 0.25 * first[level] + 0.75 * mean
        # No level is more probable than the one below it.
        below = np.minimum(mean, below)
        assert cases[f"risk_impact_ais{level}"].to_numpy() == pytest.approx(below, rel=1e-9)
    normal = ndtr((hic / AGE_FACTOR - 1434.0) / 430.0)
    logistic = expit(0.00351 * hic / AGE_FACTOR - 5.02)
    skull = (normal + 2.0 * logistic) / 3.0
    for level in (1, 2, 3, 4):
        assert cases[f"risk_skull_ais{level}"].to_numpy() == pytest.approx(skull, rel=1e-9)
    for level in (5, 6):
        assert not cases[f"risk_skull_ais{level}"].any()


@pytest.mark.parametrize("together", ["dependent", "independent"])
def test_the_head_takes_the_worse_of_its_mechanisms(together: str) -> None:
    _, cases, _ = frame_of(study_text(ANOTHER, top=f'age = 7.5\ntogether = "{together}"'))
    for level in LEVELS:
        a, b = (cases[f"risk_{name}_ais{level}"].to_numpy() for name in ("impact", "skull"))
        wanted = np.maximum(a, b) if together == "dependent" else a + b - a * b
        assert cases[f"risk_head_ais{level}"].to_numpy() == pytest.approx(wanted, rel=1e-12)


def test_outcomes_go_with_age_and_scenario_and_are_drawn_by_the_seed(full: ResultsFolder) -> None:
    young, middle, old = (
        frame_of(study_text(top=f"age = {age}"))[1]["risk_head_ais3"] for age in (3.0, 7.5, 20.0)
    )
    assert (young > middle).all() and (middle > old).all()
    ais = cases_of(full).pivot_table(index=["run", "front"], columns="scenario", values="ais")
    assert (ais["slower"] <= ais["reference"]).all()
    assert (ais["slower"] < ais["reference"]).any()
    one, other = (frame_of(study_text(seed=seed))[1]["ais"] for seed in (1, 2))
    assert (one != other).any()


def test_drawn_ais_depends_on_the_run_id_alone(full: ResultsFolder) -> None:
    cases = cases_of(full)
    risks = cases[[f"risk_head_ais{level}" for level in LEVELS]].to_numpy()
    ais = cases["ais"].to_numpy()
    beyond = np.concatenate([np.ones((len(cases), 1)), risks, np.zeros((len(cases), 1))], axis=1)
    rows = np.arange(len(cases))
    # The hidden uniform of a run lies between the risks of its level and of the next.
    table = pd.DataFrame(
        {"run": cases["run"], "low": beyond[rows, ais + 1], "high": beyond[rows, ais]}
    )
    bounds = table.groupby("run").agg({"low": "max", "high": "min"})
    assert len(bounds) == 480
    assert (bounds["low"] < bounds["high"]).all()
    middle = 0.5 * (bounds["low"] + bounds["high"])
    assert middle.mean() == pytest.approx(0.5, abs=0.08)
    assert abs(middle.autocorr(1)) < 0.15


def test_drawn_ais_agree_with_their_probabilities() -> None:
    _, cases, _ = frame_of(study_text(design='method = "monte-carlo"\nn = 4000'))
    for level in (1, 2, 3):
        share = (cases["ais"] >= level).mean()
        risk = cases[f"risk_head_ais{level}"].mean()
        assert share == pytest.approx(risk, abs=4.0 * math.sqrt(risk * (1.0 - risk) / 4000.0))


def test_no_blow_is_no_risk(tmp_path: Path) -> None:
    folder = ran(tmp_path, study_text(SLOWER, inputs=INPUTS + ANGLE, design=MANY))
    entry = scenario_of(folder)
    cases = cases_of(folder, "reference")
    missed = cases["hic15"].isna().to_numpy()
    assert missed.mean() == pytest.approx(0.5, abs=0.01)
    risks = cases[[name for name in cases if str(name).startswith("risk_")]].to_numpy()
    assert not risks[missed].any()
    assert (risks[~missed] > 0.0).all()
    assert not cases["ais"][missed].any()
    hic = cases["hic15"].dropna().to_numpy(dtype=float)
    mean = 0.5 * (0.25 * nhtsa(hic)[3] + 0.75 * prasad_mertz(hic)[3]).mean()
    assert entry["at_least"]["3"]["value"] == pytest.approx(mean, rel=1e-9)
    assert entry["above_limit"]["value"] == pytest.approx((hic > 700.0).sum() / 400.0)
    assert entry["association"]["runs"] == hic.size
    risk = cases["risk_head_ais3"].to_numpy()
    below = missed | (cases["hic15"] <= 700.0).to_numpy()
    assert entry["limit"]["head"]["specificity"]["value"] == pytest.approx(
        (1.0 - risk)[below].sum() / (1.0 - risk).sum(), rel=1e-9
    )


def test_observed_injuries_are_judged_by_each_function(full: ResultsFolder) -> None:
    analysis, part = analysis_of(full), cases_of(full, "reference")
    fracture, bleeding = analysis["observed"]["injuries"]
    assert (fracture["label"], fracture["mechanism"], fracture["level"]) == (
        "fracture",
        "impact",
        3,
    )
    hic = part["hic15"].to_numpy(dtype=float)
    weight = np.where(part["front"] == "sedan", 0.75, 0.25) / 480.0
    assert fracture["probability"]["value"] == pytest.approx(
        (weight * part["risk_impact_ais3"]).sum(), rel=1e-9
    )
    wanted = {"nhtsa_lognormal": nhtsa(hic)[3], "prasad_mertz": prasad_mertz(hic)[3]}
    assert fracture["by_function"] == {
        name: pytest.approx((weight * risk).sum(), rel=1e-9) for name, risk in wanted.items()
    }
    assert set(bleeding["by_function"]) == {"mertz_normal", "ncap_logistic"}
    one = analysis["functions"]["nhtsa_lognormal"]
    assert list(one["at_least"]) == ["2", "3", "4"]
    assert one["at_least"]["3"]["value"] == pytest.approx(
        fracture["by_function"]["nhtsa_lognormal"], rel=1e-12
    )
    assert one["label"] == "found"
    assert analysis["functions"]["ncap_logistic"]["label"] == "recalled"


def test_all_observed_injuries_together_lie_within_their_bounds(full: ResultsFolder) -> None:
    observed = analysis_of(full)["observed"]
    part = cases_of(full, "reference")
    a, b = part["risk_impact_ais3"].to_numpy(), part["risk_skull_ais4"].to_numpy()
    weight = np.where(part["front"] == "sedan", 0.75, 0.25) / 480.0
    joint = {name: entry["value"] for name, entry in observed["all"].items()}
    assert joint["dependent"] == pytest.approx((weight * np.minimum(a, b)).sum(), rel=1e-9)
    assert joint["independent"] == pytest.approx((weight * a * b).sum(), rel=1e-9)
    single = [entry["probability"]["value"] for entry in observed["injuries"]]
    # Both risks rise with HIC, so even independent ones go together over the runs.
    assert min(single) >= joint["dependent"] > joint["independent"] > math.prod(single)


@pytest.mark.parametrize(("value", "level"), [(700.0, 3), (500.0, 2)])
def test_the_limit_is_judged_by_the_risks_of_the_runs(value: float, level: int) -> None:
    text = study_text(
        f"[limit]\nvalue = {value}\nlevel = {level}\n",
        ANOTHER,
        design=MANY,
    )
    entry = analysed(text)["scenarios"]["reference"]["limit"]
    _, cases, _ = frame_of(text)
    assert set(entry) == {"head", "impact", "skull"}
    hic = cases["hic15"].to_numpy(dtype=float)
    above = hic > value
    for mechanism, found in entry.items():
        p = cases[f"risk_{mechanism}_ais{level}"].to_numpy()
        wanted = {
            "sensitivity": p[above].sum() / p.sum(),
            "specificity": (1.0 - p)[~above].sum() / (1.0 - p).sum(),
            "positive": p[above].mean(),
            "negative": (1.0 - p)[~above].mean(),
            "area": (p[:, None] * (1.0 - p) * (hic[:, None] > hic)).sum()
            / (p.sum() * (1.0 - p).sum()),
        }
        # A run's own pair of outcomes is a tie: half of it counts.
        wanted["area"] += 0.5 * (p * (1.0 - p)).sum() / (p.sum() * (1.0 - p).sum())
        for name, truth in wanted.items():
            assert found[name]["value"] == pytest.approx(truth, rel=1e-9), (mechanism, name)
            assert 0.0 <= found[name]["low"] <= found[name]["high"] <= 1.0
            assert found[name]["low"] < truth < found[name]["high"]
        gain = [
            p[hic > x].sum() / p.sum() - (1.0 - p)[hic > x].sum() / (1.0 - p).sum()
            for x in [*hic, found["best"]]
        ]
        assert gain[-1] == pytest.approx(max(gain), rel=1e-9)
        alarm, hits = (np.array(found["roc"][key]) for key in ("false_alarm", "sensitivity"))
        assert (alarm[0], hits[0], alarm[-1], hits[-1]) == pytest.approx((0.0, 0.0, 1.0, 1.0))
        assert (np.diff(alarm) >= 0.0).all()
        assert (np.diff(hits) >= 0.0).all()


def test_the_limit_is_judged_over_the_population_of_fronts(full: ResultsFolder) -> None:
    part = cases_of(full, "reference")
    weight = np.where(part["front"] == "sedan", 0.75, 0.25)
    p, above = part["risk_head_ais3"].to_numpy(), (part["hic15"] > 700.0).to_numpy()
    found = scenario_of(full)["limit"]["head"]
    wanted = (weight * p)[above].sum() / (weight * p).sum()
    assert found["sensitivity"]["value"] == pytest.approx(wanted, rel=1e-6)


def test_a_limit_that_no_run_exceeds_is_reported(tmp_path: Path) -> None:
    found = scenario_of(ran(tmp_path, study_text("[limit]\nvalue = 5000.0\n")))
    assert found["above_limit"]["value"] == found["limit"]["head"]["sensitivity"]["value"] == 0.0
    assert found["limit"]["head"]["positive"]["value"] is None


ANY_SPEED = UNIFORM_SPEED.replace(
    "[inputs.", '[scenarios.any]\ntitle = "any"\n[scenarios.any.inputs.'
)


def speed_only(km_per_h: Array) -> Array:
    """Return the Prasad-Mertz risk of AIS 3 of the formula at a speed, all else nominal."""
    return prasad_mertz(6.0 * (km_per_h / 3.6) ** 2.5 * 2.5**-0.75)[3]


@pytest.fixture(scope="module")
def speeds(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    results = ResultsFolder(tmp_path_factory.mktemp("injury") / "speeds")
    text = study_text(
        ANY_SPEED, SOFTER,
        inputs=SPEED, functions="prasad_mertz = 1.0", design="n = 2000\nreplicate_size = 100",
    )  # fmt: skip
    with by_formula(), without_figures(), mock.patch.object(injury_speed, "RESAMPLES", 100):
        run_text(text, results)
    return results


def test_speed_curves_and_halving_speeds_hold_the_truth(speeds: ResultsFolder) -> None:
    speed = analysis_of(speeds)["speed"]
    # A scenario that changes more than the speed is left out.
    assert speed["runs"] == len(cases_of(speeds)) - len(cases_of(speeds, "softer")) == 4000
    assert speed["reference_speed"] == pytest.approx(30.0, abs=0.1)
    x = np.array(speed["speed"])
    assert (np.diff(x) > 0.0).all()
    curve = {key: np.array(side) for key, side in speed["curves"]["AIS3+ head"].items()}
    assert (np.diff(curve["risk"]) >= 0.0).all()
    assert (curve["low"] <= curve["risk"]).all()
    assert (curve["risk"] <= curve["high"]).all()
    # Within a narrow bin the mean is the curve at the mean speed; the outermost hold tails too.
    middle = slice(1, -1)
    assert curve["risk"][middle] == pytest.approx(speed_only(x)[middle], rel=0.05, abs=0.003)
    half = speed["halved"]["AIS3+ head"]
    cases = cases_of(speeds, "reference")
    assert half["now"] == pytest.approx(cases["risk_head_ais3"].mean(), rel=1e-9)
    grid = np.linspace(10.0, 60.0, 50001)
    truth = float(np.interp(0.5 * half["now"], speed_only(grid), grid))
    assert half["low"] < half["value"] < half["high"]
    assert half["value"] == pytest.approx(truth, rel=0.01)
    assert half["value"] < 30.0


def test_the_limit_along_the_speed_is_a_step(speeds: ResultsFolder) -> None:
    speed = analysis_of(speeds)["speed"]
    name = next(name for name in speed["curves"] if name.endswith("above 700"))
    x, risk = np.array(speed["speed"]), np.array(speed["curves"][name]["risk"])
    exceeds = 3.6 * (700.0 / 6.0 * 2.5**0.75) ** 0.4
    assert (risk[x < exceeds - 3.0] == 0.0).all()
    assert (risk[x > exceeds + 3.0] == 1.0).all()


def test_the_curve_of_two_fronts_is_weighted_by_their_shares(full: ResultsFolder) -> None:
    speed = analysis_of(full)["speed"]
    assert set(speed["curves"]) == set(speed["halved"])
    for word in ("AIS2+ head", "AIS3+ head", "AIS5+ head", "fracture", "bleeding", "above 700"):
        assert sum(word in name for name in speed["curves"]) == 1
    assert speed["runs"] == 4 * 480
    entry = scenario_of(full)
    for level in (2, 3, 5):
        now = speed["halved"][f"AIS{level}+ head"]["now"]
        assert now == pytest.approx(entry["at_least"][str(level)]["value"], rel=1e-9)


@pytest.mark.parametrize(
    ("inputs", "design"),
    [(MASS + SCALE, "n = 300\nreplicate_size = 20"), (INPUTS, "n = 200\nreplicate_size = 20")],
    ids=["speed fixed", "few runs"],
)
def test_no_curve_without_a_varied_speed_or_enough_runs(
    tmp_path: Path, inputs: str, design: str
) -> None:
    folder = ran(tmp_path, study_text(inputs=inputs, design=design))
    assert analysis_of(folder)["speed"] is None
    assert "No curve" in (folder.path / "report.html").read_text()


def test_halving_beyond_the_speeds_of_the_study_is_unknown(tmp_path: Path) -> None:
    narrow = SPEED.replace("sigma = 0.12", "sigma = 0.01")
    folder = ran(tmp_path, study_text(inputs=narrow + MASS, design=MANY))
    half = analysis_of(folder)["speed"]["halved"]["AIS3+ head"]
    assert half["now"] > 0.0
    assert (half["value"], half["low"], half["high"]) == (None, None, None)


def test_a_scenario_of_one_fixed_speed_leaves_the_curve_whole(tmp_path: Path) -> None:
    one = '[scenarios.at24]\ntitle = "24 km/h"\n[scenarios.at24.fixed.impact_speed]\n'
    text = study_text(one + 'value = 24.0\nunit = "km/h"\n', design=MANY)
    speed = analysis_of(ran(tmp_path, text))["speed"]
    assert None not in speed["speed"]
    assert speed["halved"]["AIS3+ head"]["value"] is not None


_HEAD, _, _REST = Path("configs/population_injury.toml").read_text().partition("[scenarios.slower]")
_OLDER = """[scenarios.older]
title = "all of 12 years"
fixed = { age = { value = 144.0, unit = "month" } }
"""
BAD: dict[str, tuple[str, str]] = {
    "function": (study_text(functions="nhtsa = 1.0"), "mechanisms.impact.functions"),
    "no function": (study_text(functions=""), "mechanisms.impact.functions"),
    "weight": (study_text(functions="prasad_mertz = 0.0"), "mechanisms.impact.functions"),
    "stimulus": (
        study_text(functions="bric_takhounts = 1.0"),
        "mechanisms.impact.functions.bric_takhounts: takes bric in 1",
    ),
    "no mechanism": (
        study_text().replace(
            "[mechanisms.impact]\nfunctions = { nhtsa_lognormal = 1.0, prasad_mertz = 3.0 }", ""
        ),
        "mechanisms: missing",
    ),
    "no age": (study_text(top=""), "age: model 'headform' has no input 'age'"),
    "negative age": (study_text(top="age = -1.0"), "age"),
    "level": (study_text("[limit]\nlevel = 7\n"), "limit.level"),
    "output": (study_text('[limit]\noutput = "bric"\n'), "limit.output"),
    "observed level": (study_text(OBSERVED.replace("level = 4", "level = 0")), "observed.1.level"),
    "observed mechanism": (study_text(OBSERVED), "observed[1]: there is no mechanism 'skull'"),
    "together": (study_text(top='age = 7.5\ntogether = "both"'), "together"),
    "share": (study_text(FRONTS.replace("3.0", "0.0")), "fronts.sedan.share"),
    "front option": (
        study_text("[fronts.a.options]\nhood_curve = true\n"),
        "fronts.a.options.hood_curve: must be",
    ),
    "unknown front option": (study_text('[fronts.a.options]\nwheels = "4"\n'), "front a: model: "),
    "front key": (study_text("[fronts.a]\nweight = 1.0\n"), "fronts.a.weight: unknown key"),
    "front path": (study_text('[fronts."../x"]\nshare = 1.0\n'), "'../x'"),
    "front absolute": (study_text('[fronts."/tmp/x"]\nshare = 1.0\n'), "'/tmp/x'"),
    "scenario path": (study_text('[scenarios."../x"]\ntitle = "x"\n'), "'../x'"),
    "scenario dots": (study_text('[scenarios."a..b"]\ntitle = "x"\n'), "'a..b'"),
    "scenario empty": (study_text('[scenarios.""]\ntitle = "x"\n'), "''"),
    "scenario line": (study_text('[scenarios."a\\nb"]\ntitle = "x"\n'), "a\\nb"),
    "scenario reference": (
        study_text('[scenarios.reference]\ntitle = "x"\n'),
        "scenarios.reference",
    ),
    "scenario title": (study_text("[scenarios.a]\n"), "scenarios.a.title: missing"),
    "scenario input": (
        study_text(SLOWER.replace("inputs.impact_speed", "inputs.impact_angle")),
        "scenarios.slower.inputs.impact_angle: only inputs that the study samples",
    ),
    "scenario distribution": (
        study_text(SLOWER.replace("sigma = 0.12", "sigma = -1.0")),
        "scenarios.slower.inputs.impact_speed.sigma",
    ),
    "scenario unit": (
        study_text(SLOWER.replace('"km/h"', '"kg"')),
        "scenario slower, front car: inputs.impact_speed.unit: unit 'kg' measures mass",
    ),
    "scenario fixed": (
        study_text(SOFTER.replace("hood_force_scale", "hood_colour")),
        "scenario softer, front car: fixed.hood_colour",
    ),
    "scenario range": (study_text(SOFTER.replace("0.5", "-0.5")), "fixed.hood_force_scale: -0.5"),
    "no title": (study_text(SLOWER.replace('"slower"', '""')), "scenarios.slower.title"),
    "label empty": (study_text(OBSERVED.replace('"fracture"', '""'), ANOTHER), "observed.0.label"),
    "same title": (
        study_text(SLOWER, SLOWER.replace("scenarios.slower", "scenarios.slowest")),
        "scenarios: two have the title 'slower'",
    ),
    "mechanism head": (
        study_text(ANOTHER).replace("[mechanisms.impact]", "[mechanisms.head]"),
        "mechanisms.head: this name is that of all mechanisms together",
    ),
    "sampled and fixed": (
        study_text(SLOWER, "[scenarios.slower.fixed]\nimpact_speed = { value = 20.0 }\n"),
        "scenarios.slower: impact_speed is both sampled and fixed",
    ),
    "fixed age": (
        (_HEAD + _OLDER + _REST[_REST.index("[inputs.") :]),
        "scenarios.older.fixed.age: stature depends on it",
    ),
    "study name": (study_text().replace('"headform_injury"', '"../up"'), "'../up'"),
}  # fmt: skip


@pytest.mark.parametrize("case", list(BAD))
def test_wrong_studies_get_one_line_and_write_nothing(tmp_path: Path, case: str) -> None:
    text, message = BAD[case]
    study = written(tmp_path / "bad.toml", text)
    assert message in told(mcstudy("run", study, "--out", tmp_path / "deep" / "out"))
    assert [path.name for path in tmp_path.iterdir()] == ["bad.toml"]


def test_a_study_of_one_replicate_has_no_intervals(tmp_path: Path) -> None:
    folder = ran(tmp_path, study_text(SLOWER, design="n = 200"))
    found = scenario_of(folder, "slower")
    assert found["at_least"]["3"]["value"] > 0.0
    assert found["at_least"]["3"]["low"] is None
    assert found["difference"]["3"]["low"] is None
    with by_formula(), without_figures():
        assert "None" not in mcstudy("report", folder.path).out


def test_levels_that_no_function_has_are_no_risk(tmp_path: Path) -> None:
    observed = OBSERVED.partition('[[observed]]\nlabel = "bleeding"')[0].replace("= 3", "= 6")
    text = study_text(SLOWER, observed, functions="nhtsa_lognormal = 1.0", design=MANY)
    folder = ran(tmp_path, text)
    entry = scenario_of(folder, "slower")
    assert entry["at_least"]["5"]["value"] == entry["difference"]["5"]["value"] == 0.0
    assert entry["difference"]["5"]["relative"] is None
    (injured,) = analysis_of(folder)["observed"]["injuries"]
    assert injured["probability"]["value"] == 0.0
    assert injured["by_function"] == {}
    assert "By risk function: ." not in (folder.path / "report.html").read_text()


def test_a_head_that_is_never_struck_is_drawn(tmp_path: Path) -> None:
    never = ANGLE.replace("low = 0.0", "low = 0.6")
    text = study_text(SLOWER, inputs=INPUTS + never, design=MANY)
    folder, study = ran(tmp_path, text), parse_study(text)
    assert isinstance(study, InjuryStudy)
    functions = injury.check_functions(study, load_study_model(study))
    figures = injury_pictures.draw(
        study, cases_of(folder), folder.read_analysis(InjuryAnalysis), functions
    )
    for figure in figures.values():
        figure.draw_without_rendering()
    entry = scenario_of(folder)
    assert entry["at_least"]["1"]["value"] == 0.0
    assert entry["ais"] == [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]


def test_any_title_can_be_drawn(full: ResultsFolder) -> None:
    study = parse_study(FULL)
    assert isinstance(study, InjuryStudy)
    analysis = analysis_of(full)
    titles = ("price $5 and $6", "$\\bad{$", "a_b^c 100 %")
    for name, title in zip(analysis["scenarios"], titles, strict=True):
        analysis["scenarios"][name]["title"] = title
    functions = injury.check_functions(study, load_study_model(study))
    figures = injury_pictures.draw(
        study, cases_of(full), from_plain(InjuryAnalysis, analysis), functions
    )
    for name in ("exceedance", "ais"):
        figures[name].draw_without_rendering()


def test_failed_runs_are_left_out_in_pairs_of_no_cell(tmp_path: Path) -> None:
    # With a hood so uncertain one run in fifteen fails.
    fragile = SPEED + MASS + SCALE.replace("0.3", "3.0\nlow = 0.001\nhigh = 999.0")
    top = "age = 7.5\nmax_failure_rate = 0.3"
    folder = ran(tmp_path, study_text(SLOWER, inputs=fragile, top=top, design=MANY))
    runs, cases = cell(folder, "reference.car").runs(), cases_of(folder)
    lost = set(runs["run"][runs["status"] != "ok"])
    assert 10 < len(lost) < 60
    assert set(cases_of(folder, "reference")["run"]) == set(range(400)) - lost
    assert set(cases["status"]) == {"ok"}
    mean = cases_of(folder, "reference")["risk_head_ais3"].mean()
    assert scenario_of(folder)["at_least"]["3"]["value"] == pytest.approx(mean, rel=1e-12)
    counts = folder.read_json("manifest.json")["counts"]
    assert counts == {"ok": 800 - 2 * len(lost), "time_limit": 2 * len(lost)}
