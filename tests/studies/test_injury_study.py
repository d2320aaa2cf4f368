"""The injury study from file to folder: cells, outcomes, intervals, limits, speeds, report."""

import contextlib
import itertools
import json
import math
import re
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from headform_studies import contents, global_state, mcstudy, recorded_parts, run_text
from numpy.typing import NDArray
from scipy import stats
from scipy.special import expit, ndtr

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.injury import association
from mcstudy.injury.functions import RiskFunction
from models.headform.model import HeadformModel
from models.registry import load_model
from studies import api
from studies import worker as evaluation
from studies.injury import analysis as injury_analysis
from studies.injury import report as injury_report
from studies.injury import speed as injury_speed
from studies.injury import study as injury
from studies.injury.analysis import analyse, outcomes_of
from studies.injury.cells import cells_of
from studies.injury.schema import InjuryStudy
from studies.kinds import parse_study
from studies.monte_carlo.design import sample_inputs
from studies.runs import load_study_model

Array = NDArray[np.float64]

AGE_FACTOR = 0.98 + 0.02 * 1.5 / 4.0
"""Tolerance of HIC at 7.5 years over the adult's: 0.98 at 6, 1 at 10 years."""
LEVELS = range(1, 7)
SOFTEST = 0.05
"""Hood scale below which a run of the formula fails."""
GRAZING = 0.5
"""rad: beyond this angle the formula's head has no blow."""

SLOWER = """
[scenarios.slower]
title = "slower"
[scenarios.slower.inputs.impact_speed]
distribution = "lognormal"
unit = "km/h"
median = 24.0
sigma = 0.12
"""
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
SPEED = """
[inputs.impact_speed]
distribution = "lognormal"
unit = "km/h"
median = 30.0
sigma = 0.12
"""
UNIFORM_SPEED = """
[inputs.impact_speed]
distribution = "uniform"
unit = "km/h"
low = 10.0
high = 60.0
"""
SCALE = """
[inputs.hood_force_scale]
distribution = "lognormal"
median = 1.0
sigma = 0.3
"""
MASS = """
[inputs.headform_mass]
distribution = "lognormal"
unit = "kg"
median = 2.5
sigma = 0.2
"""
TABLES = SPEED + MASS + SCALE


def study_text(
    *tables: str,
    design: str = "n = 40\nreplicate_size = 10",
    inputs: str = TABLES,
    functions: str = "nhtsa_lognormal = 1.0, prasad_mertz = 3.0",
    top: str = "age = 7.5",
    title: str = "Headform",
    seed: int = 11,
) -> str:
    """Return a study of a headform on a straight hood."""
    return (
        f'format = "mcstudy-study/1"\nkind = "injury"\nname = "headform_injury"\n'
        f'title = "{title}"\nseed = {seed}\n{top}\n\n'
        '[model]\nname = "headform"\n'
        'options = { headform = "eevc_child", hood_curve = [[0.0, 0.0], [0.1, 10000.0]] }\n\n'
        f"[design]\n{design}\n\n[mechanisms.impact]\nfunctions = {{ {functions} }}\n"
        f"{inputs}{''.join(tables)}"
    )


def formula(argument: Mapping[str, Any], rows: Array) -> tuple[Array, list[str]]:
    """Return about what the headform model returns, at once, where only rows matter."""
    model = load_model(argument["name"], argument["options"])
    at = {item.name: k for k, item in enumerate(model.inputs)}
    stiffness = float(argument["options"]["hood_curve"][1][1]) / 10000.0
    v, m, k, angle = (
        rows[:, at[name]]
        for name in ("impact_speed", "headform_mass", "hood_force_scale", "impact_angle")
    )
    outputs = np.zeros((len(rows), len(model.outputs)))
    hic = 6.0 * v**2.5 * m**-0.75 * (k * stiffness) ** 0.75
    names = [item.name for item in model.outputs]
    outputs[:, names.index("hic15")] = np.where(angle > GRAZING, np.nan, hic)
    failed = k < SOFTEST
    outputs[failed] = np.nan
    status = np.where(angle > GRAZING, "no_head_contact", "ok")
    return outputs, np.where(failed, "time_limit", status).tolist()


@pytest.fixture(scope="module", autouse=True)
def few_resamples() -> Iterator[None]:
    """Resample little: it takes most of a small study's time. A miss is no failure."""
    with (
        mock.patch.object(HeadformModel, "partial_status", frozenset({"no_head_contact"})),
        mock.patch.object(association, "RESAMPLES", 4),
        mock.patch.object(injury_speed, "RESAMPLES", 50),
    ):
        yield


@contextlib.contextmanager
def unreported() -> Iterator[None]:
    """Leave figures and the words of the report out."""
    with (
        mock.patch.object(injury, "draw", lambda *_: {}),
        mock.patch.object(injury, "sections_of", lambda *_: []),
    ):
        yield


@contextlib.contextmanager
def by_formula() -> Iterator[None]:
    """Replace the model by the formula and draw nothing; one worker only."""
    with (
        mock.patch.object(evaluation, "evaluate", formula),
        mock.patch.object(injury, "draw", lambda *_: {}),
    ):
        yield


@pytest.fixture
def reported() -> Iterator[None]:
    """Run by formula and write the report without its figures."""
    with by_formula():
        yield


@pytest.fixture
def fast() -> Iterator[None]:
    """Run by formula and write the numbers alone."""
    with by_formula(), unreported():
        yield


FULL = study_text(
    FRONTS, SLOWER, SOFTER, ANOTHER, OBSERVED, design="n = 480\nreplicate_size = 24"
)  # fmt: skip
REAL = study_text(
    FRONTS,
    SLOWER.replace('"slower"', '"slower <script>alert(1)</script> & [bold]"').replace(
        "24.0", "26.0"
    ),
    ANOTHER,
    "[limit]\nvalue = 1500.0\n",
    OBSERVED.replace('"fracture"', '"<script>fracture</script> [red]"'),
    title="Hood <script>alert(0)</script> & co",
    design="n = 60\nreplicate_size = 10",
    inputs=TABLES.replace("median = 30.0", "median = 28.0"),
)


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Return a study by formula: three scenarios, two fronts, two mechanisms."""
    results = ResultsFolder(tmp_path_factory.mktemp("injury") / "full")
    with by_formula():
        run_text(FULL, results)
    return results


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Return a small study of the headform model itself, with figures and report."""
    results = ResultsFolder(tmp_path_factory.mktemp("injury") / "real")
    run_text(REAL, results)
    return results


def analysis_of(folder: ResultsFolder) -> dict[str, Any]:
    return folder.read_json("analysis.json")


def cases_of(folder: ResultsFolder, scenario: str | None = None) -> pd.DataFrame:
    cases = pd.read_parquet(folder.path / "cases.parquet")
    return cases if scenario is None else cases[cases["scenario"] == scenario]


def cell(folder: ResultsFolder, name: str) -> ResultsFolder:
    return ResultsFolder(folder.path / "cells" / name.replace(".", "/"))


def copied(folder: ResultsFolder, path: Path) -> ResultsFolder:
    shutil.copytree(folder.path, path)
    return ResultsFolder(path)


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def digests(folder: ResultsFolder) -> Any:
    return folder.read_json("manifest.json")["digests"]


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
        outputs, status = formula(
            {"name": "headform", "options": part.study.model.options}, rows
        )  # fmt: skip
        named = {item.name: outputs[:, k] for k, item in enumerate(model.outputs)}
        frame = pd.DataFrame({"run": np.arange(study.design.n)} | columns | named)
        frames.append(frame.assign(status=status, scenario=part.scenario, front=part.front))
    functions = injury.check_functions(study, model)
    return study, outcomes_of(study, pd.concat(frames, ignore_index=True), functions), functions


def analysed(text: str, *without: str) -> dict[str, Any]:
    """Return numbers of a study by formula, without associations, speeds and what else is named."""
    study, cases, functions = frame_of(text)
    with contextlib.ExitStack() as stack:
        for name in ("_associations", "describe_speed", *without):
            stack.enter_context(mock.patch.object(injury_analysis, name, lambda *_: {}))
        return analyse(study, load_study_model(study), cases, functions)


def t_interval(batches: Array) -> tuple[float, float]:
    """Return the mean of independent estimates and half its 95 % interval."""
    reach = stats.t.ppf(0.975, batches.size - 1) * batches.std(ddof=1) / math.sqrt(batches.size)
    return float(batches.mean()), float(reach)


def by_replicate(part: pd.DataFrame, column: str) -> Array:
    """Return the share-weighted mean of each replicate; sedans are three in four."""
    means = part.groupby(["replicate", "front"])[column].mean().unstack("front")
    return (0.75 * means["sedan"] + 0.25 * means["suv"]).to_numpy(dtype=float)


# -- cells and common random numbers ----------------------------------------------------------


def test_every_scenario_meets_every_front(full: ResultsFolder) -> None:
    names = {f"{s}.{f}" for s in ("reference", "slower", "softer") for f in ("sedan", "suv")}
    found = (path.parent for path in (full.path / "cells").glob("*/*/manifest.json"))
    assert {f"{path.parent.name}.{path.name}" for path in found} == names
    for name in names:
        runs = cell(full, name).runs()
        assert runs["run"].tolist() == list(range(480))
        assert runs["replicate"].tolist() == [k // 24 for k in range(480)]
    manifest = full.read_json("manifest.json")
    assert set(manifest["digests"]) == {name.replace(".", "/") for name in names}
    assert manifest["counts"] == {"ok": 6 * 480}
    design = {"method": "latin-hypercube", "n": 6 * 480, "cells": list(manifest["digests"])}
    assert manifest["design"] == design
    assert manifest["finished"]
    analysis = analysis_of(full)
    assert analysis["runs"] == len(cases_of(full)) == 6 * 480
    assert list(analysis["scenarios"]) == ["reference", "slower", "softer"]
    assert analysis["fronts"] == {"sedan": 0.75, "suv": 0.25}
    assert {entry["runs"] for entry in analysis["scenarios"].values()} == {960}


def test_cells_share_every_draw_that_a_scenario_leaves_alone(full: ResultsFolder) -> None:
    model = load_model("headform", {"hood_curve": [[0.0, 0.0], [0.1, 1.0]]})
    names = [item.name for item in model.inputs]
    reference = cell(full, "reference.sedan").runs()
    changed = {"reference": None, "slower": "impact_speed", "softer": "hood_force_scale"}
    for (scenario, own), front in itertools.product(changed.items(), ("sedan", "suv")):
        runs = cell(full, f"{scenario}.{front}").runs()
        for name in names:
            same = runs[name].to_numpy().tobytes() == reference[name].to_numpy().tobytes()
            assert same == (name != own), (scenario, front, name)


def test_a_scenarios_distribution_meets_the_same_quantiles(full: ResultsFolder) -> None:
    reference, slower = (cell(full, f"{name}.suv").runs() for name in ("reference", "slower"))
    ratio = slower["impact_speed"] / reference["impact_speed"]
    assert ratio.to_numpy() == pytest.approx(0.8, rel=1e-12)


def test_a_fixed_value_of_a_scenario_overrides_the_sampled_input(full: ResultsFolder) -> None:
    assert set(cell(full, "softer.sedan").runs()["hood_force_scale"]) == {0.5}
    assert cell(full, "reference.sedan").runs()["hood_force_scale"].nunique() == 480


def test_a_fixed_value_of_a_scenario_is_in_the_units_of_the_file(
    tmp_path: Path, fast: None
) -> None:
    more = (
        '[fixed.impact_angle]\nvalue = 10.0\nunit = "deg"\n'
        '[scenarios.angled]\ntitle = "angled"\n'
        '[scenarios.angled.fixed]\nimpact_angle = { value = 20.0, unit = "deg" }\n'
        'impact_speed = { value = 36.0, unit = "km/h" }\n'
    )
    results = ResultsFolder(tmp_path / "units")
    run_text(study_text(more), results)
    angled = cell(results, "angled.car").runs()
    assert set(angled["impact_speed"]) == {10.0}
    assert angled["impact_angle"].to_numpy() == pytest.approx(math.radians(20.0))
    reference = cell(results, "reference.car").runs()["impact_angle"]
    assert reference.to_numpy() == pytest.approx(math.radians(10.0))


def test_fronts_are_the_model_with_their_options(full: ResultsFolder) -> None:
    sedan, suv = (cell(full, f"reference.{name}").runs() for name in ("sedan", "suv"))
    ratio = (suv["hic15"] / sedan["hic15"]).to_numpy()
    assert ratio == pytest.approx(2.0**0.75, rel=1e-12)
    options = cell(full, "reference.suv").read_json("manifest.json")["model"]["options"]
    assert options == {"headform": "eevc_child", "hood_curve": [[0.0, 0.0], [0.1, 20000.0]]}


def test_inputs_of_the_cells_are_those_of_a_monte_carlo_study(full: ResultsFolder) -> None:
    text = (
        study_text(design="n = 480\nreplicate_size = 24", top="")
        .replace('kind = "injury"', 'kind = "monte-carlo"')
        .replace("[mechanisms.impact]\nfunctions = { nhtsa_lognormal = 1.0, prasad_mertz = 3.0 }\n",
                 "")
    )  # fmt: skip
    study = parse_study(text)
    columns = sample_inputs(study, load_study_model(study))
    runs = cell(full, "reference.sedan").runs()
    for name in ("impact_speed", "headform_mass", "hood_force_scale"):
        assert runs[name].to_numpy().tobytes() == columns[name].tobytes()


def test_numpys_global_random_state_is_left_alone(tmp_path: Path, fast: None) -> None:
    np.random.seed(5)  # noqa: NPY002
    before = global_state()
    run_text(study_text(SLOWER), ResultsFolder(tmp_path / "state"))
    assert global_state() == before


# -- going on, extending, refusing ------------------------------------------------------------


def test_the_same_command_again_runs_nothing(
    full: ResultsFolder, tmp_path: Path, reported: None
) -> None:
    folder = copied(full, tmp_path / "again")
    before = contents(folder.path)
    with recorded_parts() as ids:
        analysis = run_text(FULL, folder)
    assert ids == []
    assert analysis == analysis_of(full)
    after = contents(folder.path)
    kept = [name for name in before if not name.endswith("manifest.json")]
    assert [name for name in kept if before[name] != after[name]] == []


def test_a_larger_design_keeps_what_was_run(tmp_path: Path, fast: None) -> None:
    grown, whole = ResultsFolder(tmp_path / "grown"), ResultsFolder(tmp_path / "whole")
    small = study_text(SLOWER)
    large = study_text(SLOWER, design="n = 60\nreplicate_size = 10")
    first = run_text(small, grown)
    cases = cases_of(grown)
    with recorded_parts() as ids:
        run_text(large, grown)
    assert sorted(ids) == sorted([*range(40, 60)] * 2)
    run_text(large, whole)
    assert digests(grown) == digests(whole)
    assert analysis_of(grown) == analysis_of(whole)
    extended = cases_of(grown)
    kept = extended[extended["run"] < 40].reset_index(drop=True)
    pd.testing.assert_frame_equal(kept, cases, check_exact=True)
    with recorded_parts() as ids:
        assert run_text(small, grown) == first
    assert ids == []
    assert len(cell(grown, "slower.car").runs()) == 60


def test_a_killed_study_goes_on_where_it_stopped(
    full: ResultsFolder, tmp_path: Path, fast: None
) -> None:
    folder = copied(full, tmp_path / "killed")
    shutil.rmtree(cell(folder, "softer.suv").path)
    half = cell(folder, "softer.sedan")
    runs = half.runs()
    (half.path / "runs.parquet").unlink()
    with half.open_for_writing():
        half.add_part(runs.iloc[100:300])
    with recorded_parts() as ids:
        analysis = run_text(FULL, folder)
    assert sorted(ids) == sorted([*range(480), *range(100), *range(300, 480)])
    assert digests(folder) == digests(full)
    assert analysis == analysis_of(full)


@pytest.mark.parametrize(
    ("edit", "where", "differs"),
    [
        (("median = 30.0", "median = 31.0"), "reference, front sedan", "inputs.impact_speed"),
        (("median = 24.0", "median = 25.0"), "slower, front sedan", "inputs.impact_speed"),
        (("value = 0.5", "value = 0.6"), "softer, front sedan", "fixed.hood_force_scale"),
        (("20000.0", "21000.0"), "reference, front suv", "model"),
        (("seed = 11", "seed = 12"), "reference, front sedan", "seed"),
        (("replicate_size = 24", "replicate_size = 48"), "reference", "design.replicate_size"),
    ],
)  # fmt: skip
def test_a_changed_study_is_refused_with_what_differs(
    full: ResultsFolder, tmp_path: Path, edit: tuple[str, str], where: str, differs: str
) -> None:
    text = FULL.replace(*edit, 1)
    assert text != FULL
    before = contents(full.path)
    answer = mcstudy("run", written(tmp_path / "s.toml", text), "--out", full.path)
    assert answer.code == 2
    assert len(answer.err.strip().splitlines()) == 1
    assert f"scenario {where}" in answer.err
    assert f"differs in {differs})" in answer.err
    assert contents(full.path) == before


@pytest.mark.parametrize(
    "edit",
    [
        ("prasad_mertz = 3.0", "prasad_mertz = 1.0"),
        ("share = 3.0", "share = 1.0"),
        ("age = 7.5", 'age = 3.0\ntogether = "independent"'),
        ("[fronts.sedan]", "[limit]\nvalue = 500.0\nlevel = 4\n[fronts.sedan]"),
    ],
)
def test_what_changes_no_run_is_no_other_study(
    full: ResultsFolder, tmp_path: Path, fast: None, edit: tuple[str, str]
) -> None:
    folder, text = copied(full, tmp_path / "same"), FULL.replace(*edit, 1)
    assert text != FULL
    with recorded_parts() as ids:
        analysis = run_text(text, folder)
    assert ids == []
    assert analysis != analysis_of(full)


def test_a_scenario_more_runs_its_own_cells_alone(tmp_path: Path, fast: None) -> None:
    folder = ResultsFolder(tmp_path / "more")
    run_text(study_text(SLOWER), folder)
    with recorded_parts() as ids:
        analysis = run_text(study_text(SLOWER, SOFTER), folder)
    assert sorted(ids) == list(range(40))
    assert list(analysis["scenarios"]) == ["reference", "slower", "softer"]


def test_digests_are_the_same_for_one_and_two_workers(tmp_path: Path) -> None:
    text = study_text(SLOWER, design="n = 24\nreplicate_size = 6")
    found = []
    with unreported():
        for workers in (1, 2):
            folder = ResultsFolder(tmp_path / f"of{workers}")
            found.append((run_text(text, folder, workers=workers), digests(folder)))
    assert found[0] == found[1]


def test_children_and_fronts_of_the_multibody_model(tmp_path: Path) -> None:
    text = Path("configs/population_injury.toml").read_text()
    head, _, rest = text.partition("[scenarios.both]")
    small = (head + "# " + rest[rest.index("Impact speeds in town") :]).replace(
        "n = 1000\nreplicate_size = 50", "n = 4\nreplicate_size = 2"
    )
    folder = ResultsFolder(tmp_path / "children")
    with unreported():
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


# -- population numbers -----------------------------------------------------------------------


@pytest.mark.parametrize("scenario", ["reference", "slower", "softer"])
def test_population_numbers_are_share_weighted_means(full: ResultsFolder, scenario: str) -> None:
    entry, part = analysis_of(full)["scenarios"][scenario], cases_of(full, scenario)
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
    entry = analysis_of(full)["scenarios"][scenario]
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


def test_common_random_numbers_make_differences_sharper(tmp_path: Path, fast: None) -> None:
    folder = ResultsFolder(tmp_path / "sharp")
    text = study_text(SLOWER, design='method = "monte-carlo"\nn = 400')
    found = run_text(text, folder)["scenarios"]["slower"]["difference"]["3"]
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
    "design", ['method = "monte-carlo"\nn = 200', "n = 200\nreplicate_size = 20"]
)
def test_intervals_hold_the_truth_as_often_as_they_say(design: str) -> None:
    reference, slower = (
        0.75 * expected_risk(speed, 1.0) + 0.25 * expected_risk(speed, 2.0)
        for speed in (20.0, 16.0)
    )
    inputs = TABLES.replace("median = 30.0", "median = 20.0")
    hits: list[tuple[bool, bool]] = []
    with mock.patch.object(injury_analysis, "LEVELS", (2,)):
        for seed in range(20):
            text = study_text(
                FRONTS,
                SLOWER.replace("24.0", "16.0"),
                "[limit]\nlevel = 2\n",
                design=design,
                inputs=inputs,
                seed=seed,
                functions="nhtsa_lognormal = 1.0",
            )
            entry = analysed(text, "_limit", "_by_function", "_observed")["scenarios"]["slower"]
            level, change = entry["at_least"]["2"], entry["difference"]["2"]
            hits.append(
                (
                    level["low"] <= slower <= level["high"],
                    change["low"] <= slower - reference <= change["high"],
                )
            )
    # Of 20 intervals of 95 % at least 16 hold the truth, but for three times in a thousand.
    assert np.sum(hits, axis=0).min() >= 16


# -- outcomes ---------------------------------------------------------------------------------


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


def test_age_moves_the_risk() -> None:
    risks = [
        frame_of(study_text(top=f"age = {age}"))[1]["risk_head_ais3"].to_numpy()
        for age in (3.0, 7.5, 20.0)
    ]
    assert (risks[0] > risks[1]).all()
    assert (risks[1] > risks[2]).all()


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


def test_a_milder_scenario_gives_no_run_a_worse_ais(full: ResultsFolder) -> None:
    ais = cases_of(full).pivot_table(index=["run", "front"], columns="scenario", values="ais")
    assert (ais["slower"] <= ais["reference"]).all()
    assert (ais["slower"] < ais["reference"]).any()


def test_drawn_ais_agree_with_their_probabilities() -> None:
    _, cases, _ = frame_of(study_text(design='method = "monte-carlo"\nn = 4000'))
    for level in (1, 2, 3):
        share = (cases["ais"] >= level).mean()
        risk = cases[f"risk_head_ais{level}"].mean()
        assert share == pytest.approx(risk, abs=4.0 * math.sqrt(risk * (1.0 - risk) / 4000.0))


def test_another_seed_draws_other_outcomes() -> None:
    one, other = (frame_of(study_text(seed=seed))[1]["ais"] for seed in (1, 2))
    assert (one != other).any()


ANGLE = """
[inputs.impact_angle]
distribution = "uniform"
unit = "rad"
low = 0.0
high = 1.0
"""


def test_no_blow_is_no_risk(tmp_path: Path, fast: None) -> None:
    folder = ResultsFolder(tmp_path / "missed")
    text = study_text(
        SLOWER, inputs=TABLES + ANGLE, design="n = 400\nreplicate_size = 20", top="age = 7.5"
    )
    entry = run_text(text, folder)["scenarios"]["reference"]
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


# -- the limit as a classifier ----------------------------------------------------------------


@pytest.mark.parametrize(("value", "level"), [(700.0, 3), (500.0, 2)])
def test_the_limit_is_judged_by_the_risks_of_the_runs(value: float, level: int) -> None:
    text = study_text(
        f"[limit]\nvalue = {value}\nlevel = {level}\n",
        ANOTHER,
        design="n = 400\nreplicate_size = 20",
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
    found = analysis_of(full)["scenarios"]["reference"]["limit"]["head"]
    wanted = (weight * p)[above].sum() / (weight * p).sum()
    assert found["sensitivity"]["value"] == pytest.approx(wanted, rel=1e-6)


def test_a_limit_that_no_run_exceeds_is_reported(tmp_path: Path, reported: None) -> None:
    text = study_text("[limit]\nvalue = 5000.0\n")
    answer = mcstudy(
        "run", written(tmp_path / "s.toml", text), "--out", tmp_path / "out", "--workers", "1"
    )
    assert answer.code == 0, answer.err
    found = analysis_of(ResultsFolder(tmp_path / "out"))["scenarios"]["reference"]
    assert found["above_limit"]["value"] == 0.0
    assert found["limit"]["head"]["sensitivity"]["value"] == 0.0
    assert found["limit"]["head"]["positive"]["value"] is None


# -- risk against impact speed ----------------------------------------------------------------

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
    with by_formula(), mock.patch.object(injury_speed, "RESAMPLES", 400):
        run_text(text, results)
    return results


def test_speed_curves_and_halving_speeds_hold_the_truth(speeds: ResultsFolder) -> None:
    speed = analysis_of(speeds)["speed"]
    assert speed["runs"] == 4000
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


def test_scenarios_that_change_more_than_the_speed_are_left_out(speeds: ResultsFolder) -> None:
    speed = analysis_of(speeds)["speed"]
    assert speed["runs"] == len(cases_of(speeds)) - len(cases_of(speeds, "softer"))


def test_the_curve_of_two_fronts_is_weighted_by_their_shares(full: ResultsFolder) -> None:
    speed = analysis_of(full)["speed"]
    assert set(speed["curves"]) == set(speed["halved"])
    for word in ("AIS2+ head", "AIS3+ head", "AIS5+ head", "fracture", "bleeding", "above 700"):
        assert sum(word in name for name in speed["curves"]) == 1
    assert speed["runs"] == 4 * 480
    entry = analysis_of(full)["scenarios"]["reference"]
    for level in (2, 3, 5):
        now = speed["halved"][f"AIS{level}+ head"]["now"]
        assert now == pytest.approx(entry["at_least"][str(level)]["value"], rel=1e-9)


@pytest.mark.parametrize(
    ("inputs", "design"),
    [(MASS + SCALE, "n = 300\nreplicate_size = 20"), (TABLES, "n = 200\nreplicate_size = 20")],
    ids=["speed fixed", "few runs"],
)
def test_no_curve_without_a_varied_speed_or_enough_runs(
    tmp_path: Path, reported: None, inputs: str, design: str
) -> None:
    folder = ResultsFolder(tmp_path / "none")
    assert run_text(study_text(inputs=inputs, design=design), folder)["speed"] is None
    assert "No curve" in (folder.path / "report.html").read_text()


def test_halving_beyond_the_speeds_of_the_study_is_unknown(tmp_path: Path, fast: None) -> None:
    narrow = SPEED.replace("sigma = 0.12", "sigma = 0.01")
    folder = ResultsFolder(tmp_path / "narrow")
    text = study_text(inputs=narrow + MASS, design="n = 400\nreplicate_size = 20")
    half = run_text(text, folder)["speed"]["halved"]["AIS3+ head"]
    assert half["now"] > 0.0
    assert (half["value"], half["low"], half["high"]) == (None, None, None)


def test_a_scenario_of_one_fixed_speed_leaves_the_curve_whole(tmp_path: Path, fast: None) -> None:
    one = '[scenarios.at24]\ntitle = "24 km/h"\n[scenarios.at24.fixed.impact_speed]\n'
    text = study_text(
        one + 'value = 24.0\nunit = "km/h"\n', inputs=TABLES, design="n = 400\nreplicate_size = 20"
    )
    speed = run_text(text, ResultsFolder(tmp_path / "one"))["speed"]
    assert None not in speed["speed"]
    assert speed["halved"]["AIS3+ head"]["value"] is not None


# -- what is refused --------------------------------------------------------------------------

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
    "study name": (study_text().replace('"headform_injury"', '"../up"'), "'../up'"),
}  # fmt: skip


@pytest.mark.parametrize("case", list(BAD))
def test_wrong_studies_get_one_line_and_write_nothing(tmp_path: Path, case: str) -> None:
    text, message = BAD[case]
    study = written(tmp_path / "bad.toml", text)
    answer = mcstudy("run", study, "--out", tmp_path / "deep" / "out")
    assert answer.code == 2, answer
    assert len(answer.err.strip().splitlines()) == 1
    assert message in answer.err
    assert [path.name for path in tmp_path.iterdir()] == ["bad.toml"]


def test_cells_of_dotted_names_are_kept_apart(tmp_path: Path, fast: None) -> None:
    scenarios = '[scenarios.a]\ntitle = "a"\n[scenarios.a.fixed.hood_force_scale]\nvalue = 0.5\n'
    more = '[scenarios."a.b"]\ntitle = "ab"\n[fronts.c]\nshare = 1.0\n[fronts."b.c"]\nshare = 1.0\n'
    folder = ResultsFolder(tmp_path / "dots")
    try:
        run_text(study_text(scenarios + more), folder)
    except UserError:
        return
    cases = cases_of(folder)
    held = cases[(cases["scenario"] == "a.b") & (cases["front"] == "c")]
    assert held["hood_force_scale"].nunique() == 40


def test_a_mechanism_called_head_keeps_its_risk_or_is_refused() -> None:
    text = study_text(ANOTHER, top='age = 7.5\ntogether = "independent"').replace(
        "[mechanisms.impact]", "[mechanisms.head]"
    )
    try:
        cases = frame_of(text)[1]
    except UserError:
        return
    hic = cases["hic15"].to_numpy(dtype=float)
    wanted = 0.25 * nhtsa(hic)[3] + 0.75 * prasad_mertz(hic)[3]
    assert cases["risk_head_ais3"].to_numpy() == pytest.approx(wanted, rel=1e-9)


def test_an_input_both_sampled_and_fixed_by_a_scenario_is_refused(tmp_path: Path) -> None:
    twice = SLOWER + '[scenarios.slower.fixed.impact_speed]\nvalue = 20.0\nunit = "km/h"\n'
    study, out = written(tmp_path / "s.toml", study_text(twice)), tmp_path / "out"
    with by_formula(), unreported():
        answer = mcstudy("run", study, "--out", out, "--workers", "1")
    assert answer.code == 2


def test_a_fixed_age_that_others_depend_on_is_refused() -> None:
    text = Path("configs/population_injury.toml").read_text()
    head, _, rest = text.partition("[scenarios.slower]")
    older = '[scenarios.older]\ntitle = "all of 12 years"\n[scenarios.older.fixed.age]\n'
    text = f'{head}{older}value = 144.0\nunit = "month"\n{rest[rest.index("[inputs.") :]}'
    with pytest.raises(UserError, match=r"scenarios\.older\.fixed\.age: stature depends on it"):
        parse_study(text)


# -- small and degenerate studies -------------------------------------------------------------


def ran(tmp_path: Path, text: str) -> ResultsFolder:
    """Run a study on the command line, which must go well, and return its folder."""
    study, folder = written(tmp_path / "s.toml", text), ResultsFolder(tmp_path / "out")
    answer = mcstudy("run", study, "--out", folder.path, "--workers", "1")
    assert answer.code == 0, answer.err
    assert (folder.path / "report.html").exists()
    assert "None" not in answer.out
    return folder


def test_a_study_of_one_replicate_has_no_intervals(tmp_path: Path, reported: None) -> None:
    found = analysis_of(ran(tmp_path, study_text(SLOWER, design="n = 200")))["scenarios"]["slower"]
    assert found["at_least"]["3"]["value"] > 0.0
    assert found["at_least"]["3"]["low"] is None
    assert found["difference"]["3"]["low"] is None


def test_levels_that_no_function_has_are_no_risk(tmp_path: Path, reported: None) -> None:
    design = "n = 400\nreplicate_size = 20"
    folder = ran(tmp_path, study_text(SLOWER, functions="nhtsa_lognormal = 1.0", design=design))
    entry = analysis_of(folder)["scenarios"]["slower"]
    assert entry["at_least"]["5"]["value"] == 0.0
    assert entry["difference"]["5"]["value"] == 0.0
    assert entry["difference"]["5"]["relative"] is None


def test_an_observed_level_that_no_function_has(tmp_path: Path, reported: None) -> None:
    observed = OBSERVED.partition('[[observed]]\nlabel = "bleeding"')[0].replace("= 3", "= 6")
    text = study_text(observed, functions="nhtsa_lognormal = 1.0",
                      design="n = 400\nreplicate_size = 20")  # fmt: skip
    folder = ran(tmp_path, text)
    (entry,) = analysis_of(folder)["observed"]["injuries"]
    assert entry["probability"]["value"] == 0.0
    assert entry["by_function"] == {}
    assert "By risk function: ." not in (folder.path / "report.html").read_text()


@pytest.mark.parametrize(
    "tables",
    [
        SLOWER.replace('title = "slower"', 'title = ""'),
        OBSERVED.replace('"fracture"', '""') + ANOTHER,
    ],
    ids=["title", "label"],
)
def test_empty_titles_and_labels_are_shown_or_refused(
    tmp_path: Path, reported: None, tables: str
) -> None:
    text = study_text(tables, design="n = 400\nreplicate_size = 20")
    study = written(tmp_path / "s.toml", text)
    answer = mcstudy("run", study, "--out", tmp_path / "out", "--workers", "1")
    assert answer.code in (0, 2)


def test_scenarios_of_one_title_are_both_told_or_refused(tmp_path: Path, reported: None) -> None:
    again = SLOWER.replace("scenarios.slower", "scenarios.slowest").replace("24.0", "18.0")
    text = study_text(
        SLOWER, again, "[limit]\nvalue = 250.0\n", design="n = 400\nreplicate_size = 20"
    )
    study = written(tmp_path / "s.toml", text)
    answer = mcstudy("run", study, "--out", tmp_path / "out", "--workers", "1")
    if answer.code == 2:
        return
    html = (tmp_path / "out" / "report.html").read_text()
    table = re.search(r"<table>(?:(?!</table>).)*Head injuries in.*?</table>", html, re.DOTALL)
    assert table is not None
    assert len(re.findall("<th[ >]", table.group())) == 4


def test_a_head_that_is_never_struck_is_reported(tmp_path: Path) -> None:
    never = ANGLE.replace("low = 0.0", "low = 0.6")
    text = study_text(SLOWER, inputs=TABLES + never, design="n = 400\nreplicate_size = 20")
    with mock.patch.object(evaluation, "evaluate", formula):
        folder = ran(tmp_path, text)
    entry = analysis_of(folder)["scenarios"]["reference"]
    assert entry["at_least"]["1"]["value"] == 0.0
    assert entry["ais"] == [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "title",
    [
        "price $5 and $6",
        "$\\\\bad{$",
        "a_b^c",
        "100 %",
    ],
)
def test_any_title_can_be_drawn(real: ResultsFolder, title: str) -> None:
    text = REAL.replace("slower <script>alert(1)</script> & [bold]", title)
    study = parse_study(text)
    assert isinstance(study, InjuryStudy)
    analysis = analysis_of(real)
    analysis["scenarios"]["slower"]["title"] = study.scenarios["slower"].title
    functions = injury.check_functions(study, load_study_model(study))
    figures = injury_report.draw(study, cases_of(real), analysis, functions)
    for name in ("exceedance", "ais"):
        figures[name].canvas.draw()


# -- failed runs ------------------------------------------------------------------------------

FRAGILE = SCALE.replace("sigma = 0.3", "sigma = 2.0")
"""With a hood so uncertain one run in fifteen fails."""


def test_too_many_failed_runs_stop_the_study_and_its_report(tmp_path: Path, fast: None) -> None:
    text = study_text(SLOWER, inputs=SPEED + MASS + FRAGILE)
    study, out = written(tmp_path / "s.toml", text), tmp_path / "out"
    answer = mcstudy("run", study, "--out", out, "--workers", "1")
    assert answer.code == 1
    assert len(answer.err.strip().splitlines()) == 1
    assert "time_limit" in answer.err
    assert "max_failure_rate = 2.0%" in answer.err
    assert not (out / "analysis.json").exists()
    assert mcstudy("report", out).code in (1, 2)
    assert not ResultsFolder(out).read_json("manifest.json")["finished"]


def test_failed_runs_are_left_out_in_pairs_of_no_cell(tmp_path: Path, fast: None) -> None:
    text = study_text(
        SLOWER, inputs=SPEED + MASS + FRAGILE, top="age = 7.5\nmax_failure_rate = 0.3",
        design="n = 400\nreplicate_size = 20",
    )  # fmt: skip
    folder = ResultsFolder(tmp_path / "some")
    analysis = run_text(text, folder)
    cases = cases_of(folder)
    runs = cell(folder, "reference.car").runs()
    lost = set(runs["run"][runs["status"] != "ok"])
    assert 10 < len(lost) < 60
    assert set(cases_of(folder, "reference")["run"]) == set(range(400)) - lost
    assert set(cases["status"]) == {"ok"}
    entry = analysis["scenarios"]["reference"]
    mean = cases_of(folder, "reference")["risk_head_ais3"].mean()
    assert entry["at_least"]["3"]["value"] == pytest.approx(mean, rel=1e-12)
    assert folder.read_json("manifest.json")["counts"] == {
        "ok": 800 - 2 * len(lost),
        "time_limit": 2 * len(lost),
    }


def test_failed_runs_are_told(tmp_path: Path, reported: None) -> None:
    text = study_text(
        inputs=SPEED + MASS + FRAGILE, top="age = 7.5\nmax_failure_rate = 0.3",
        design="n = 400\nreplicate_size = 20",
    )  # fmt: skip
    folder = ResultsFolder(tmp_path / "some")
    run_text(text, folder)
    told = mcstudy("report", folder.path)
    assert "time_limit" in told.line
    assert "time_limit" in analysis_of(folder)["status"]
    html = (folder.path / "report.html").read_text()
    assert re.search(r"\d+ (of the )?runs failed|time.limit", html)


# -- the folder and its report ----------------------------------------------------------------


def test_the_folder_holds_what_it_should(real: ResultsFolder) -> None:
    names = {path.name for path in real.path.iterdir()}
    assert {"study.toml", "manifest.json", "analysis.json", "cases.parquet", "cells", "figures",
            "report.html"} <= names  # fmt: skip
    assert (real.path / "study.toml").read_text() == REAL
    for name in ("ais", "risk_hic15", "exceedance", "roc"):
        for ending in ("png", "svg"):
            assert (real.path / "figures" / f"{name}.{ending}").stat().st_size > 1000
    cases = cases_of(real)
    wanted = {"run", "scenario", "front", "status", "hic15", "ais", "risk_head_ais3",
              "risk_impact_ais1", "risk_skull_ais6"}  # fmt: skip
    assert wanted <= set(cases)
    assert cases["ais"].between(0, 6).all()
    kept = cell(real, "slower.suv").runs()
    held = cases[(cases["scenario"] == "slower") & (cases["front"] == "suv")]
    assert held["hic15"].to_numpy().tobytes() == kept["hic15"].to_numpy().tobytes()


def test_the_report_stands_alone_and_escapes_what_users_write(real: ResultsFolder) -> None:
    html = (real.path / "report.html").read_text()
    assert "<script" not in html.lower()
    assert "Hood &lt;script&gt;alert(0)&lt;/script&gt; &amp; co" in html
    assert "lower &lt;script&gt;alert(1)" in html
    assert "&lt;script&gt;fracture&lt;/script&gt; [red]" in html
    for source in re.findall(r'(?:src|href)="([^"]*)"', html):
        assert source.startswith(("data:", "#")), source[:60]
    assert not re.search(r"@import|url\(", html)
    for word in ("nan", "None", "inf"):
        assert not re.search(rf"[>\s(]{word}[<\s,.)%]", html), word


def test_svg_figures_hold_no_script(real: ResultsFolder) -> None:
    for path in (real.path / "figures").glob("*.svg"):
        assert "<script" not in path.read_text().lower()


def test_the_report_is_rebuilt_from_the_folder_alone(real: ResultsFolder, tmp_path: Path) -> None:
    folder = copied(real, tmp_path / "again")
    for name in ("analysis.json", "cases.parquet", "report.html"):
        (folder.path / name).unlink()
    with unreported(), recorded_parts() as ids:
        answer = mcstudy("report", folder.path)
    assert answer.code == 0, answer.err
    assert ids == []
    assert (folder.path / "report.html").exists()
    for name in ("analysis.json", "cases.parquet"):
        assert (folder.path / name).read_bytes() == (real.path / name).read_bytes()


def test_the_command_line_prints_outcomes_as_written(real: ResultsFolder, tmp_path: Path) -> None:
    folder = copied(real, tmp_path / "copy")
    with unreported():
        answer = mcstudy("report", folder.path)
        told = mcstudy("report", folder.path, "--json")
    assert answer.code == 0
    assert "[bold]" in answer.out
    assert "240 runs: 240 ok" in answer.line
    assert "report.html" in answer.line
    assert json.loads(told.out)["analysis"] == analysis_of(real)


def test_every_number_of_the_analysis_is_json(real: ResultsFolder) -> None:
    text = (real.path / "analysis.json").read_text()
    assert not re.search(r"\b(NaN|Infinity)\b", text)
    cells = real.read_json("manifest.json")["digests"]
    assert set(cells) == {f"{s}/{f}" for s in ("reference", "slower") for f in ("sedan", "suv")}


def test_status_counts_all_cells(real: ResultsFolder, tmp_path: Path) -> None:
    status = json.loads(mcstudy("status", real.path, "--json").out)
    assert status == {"done": 240, "total": 240, "counts": {"ok": 240}}
    part = copied(real, tmp_path / "part")
    shutil.rmtree(cell(part, "slower.suv").path)
    answer = mcstudy("status", part.path)
    assert answer.code == 0
    assert answer.out.strip() == "headform_injury: 180 of 240 runs done (180 ok)"


def test_status_counts_the_cells_of_the_study_alone(tmp_path: Path, fast: None) -> None:
    folder = ResultsFolder(tmp_path / "fewer")
    run_text(study_text(SLOWER, SOFTER), folder)
    run_text(study_text(SLOWER), folder)
    status = json.loads(mcstudy("status", folder.path, "--json").out)
    assert status == {"done": 80, "total": 80, "counts": {"ok": 80}}


def test_a_cell_that_is_missing_tells_to_run_again(real: ResultsFolder, tmp_path: Path) -> None:
    part = copied(real, tmp_path / "part")
    shutil.rmtree(cell(part, "slower.suv").path)
    answer = mcstudy("report", part.path)
    assert answer.code == 2
    assert len(answer.err.strip().splitlines()) == 1
    assert re.search(r"run the study( again)?", answer.err)


def test_a_cell_that_is_half_done_tells_to_run_again(real: ResultsFolder, tmp_path: Path) -> None:
    part = copied(real, tmp_path / "part")
    half = cell(part, "slower.suv")
    runs = half.runs()
    with half.open_for_writing():
        half.compact(runs.iloc[:37])
    with unreported():
        answer = mcstudy("report", part.path)
    assert answer.code == 2
    assert len(answer.err.strip().splitlines()) == 1
    assert re.search(r"run the study( again)?", answer.err)


def test_what_an_injury_folder_cannot_be_asked(real: ResultsFolder, tmp_path: Path) -> None:
    answer = mcstudy("sensitivity", real.path, "--out", tmp_path / "none")
    assert answer.code == 2
    assert len(answer.err.strip().splitlines()) == 1
    with pytest.raises(UserError):
        api.rerun(real, 3)
    assert not (tmp_path / "none").exists()


def test_a_study_runs_from_python(tmp_path: Path, fast: None) -> None:
    path = written(tmp_path / "s.toml", study_text(SLOWER))
    folder = api.run_study(path, out=tmp_path / "out", workers=1)
    assert api.build_report(folder) == analysis_of(folder)
    bad = written(tmp_path / "bad.toml", study_text(inputs=SPEED + FRAGILE))
    with pytest.raises(StudyError, match="max_failure_rate"):
        api.run_study(bad, out=tmp_path / "bad", workers=1)
