"""The Sobol' study: how much of the variance of each output each input explains."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy import config, seeds
from mcstudy.config import SobolStudy, load_study
from mcstudy.errors import StudyError, UserError
from mcstudy.figures import style
from mcstudy.progress import say
from mcstudy.report import render
from mcstudy.results import ResultsFolder
from mcstudy.sensitivity.main_effects import main_effect
from mcstudy.sensitivity.saltelli import DUMMY, Saltelli, block_size, draw_saltelli, factors_of
from mcstudy.sensitivity.sobol import Indices, estimate_indices, split_blocks
from models.protocol import Model, complete_status
from studies.execution import load_study_model, run_rows
from studies.sobol_report import draw, sections_of

Array = NDArray[np.float64]

MOST_DROPPED = 0.2
"""Share of base points that may be lost to failed runs before no index is given (assumed)."""
FEWEST_POINTS = 8
"""Base points below which no index is given."""


def run_sobol(
    study: SobolStudy,
    text: str,
    folder: ResultsFolder,
    *,
    workers: int = -1,
    quiet: bool = False,
) -> dict[str, Any]:
    """Run a Sobol' study, or go on with it, and write its results folder.

    The design doubles from ``design.start`` base points until the widest interval of a total index
    of the reported outputs is below ``design.tolerance``, or ``design.n`` is reached; without a
    tolerance it goes to ``design.n`` at once. Earlier runs are never repeated.

    Parameters
    ----------
    study : SobolStudy
    text : the study file as written. folder : ResultsFolder
    workers : processes, -1 for one a core. quiet : no progress line.

    Returns
    -------
    dict
        The analysis, as in ``analysis.json``.

    Raises
    ------
    UserError
        If the study does not fit the model or the folder, or its inputs are dependent.
    StudyError
        If too many runs failed.
    """
    model = load_study_model(study)
    wanted = config.report_outputs(study, model)
    check_independent(study)
    design = study.design
    largest = _design(study, design.n)
    columns = config.map_inputs(study, model, largest.uniforms)
    folder.check_same_study(config.numbers_digest(study, model))
    n = design.n if design.tolerance is None else min(design.start, design.n)
    with folder.open_for_writing():
        folder.write_text("study.toml", text)
        while True:
            rows = n * largest.block
            runs = run_rows(
                study, model, {name: values[:rows] for name, values in columns.items()}, folder,
                design={"method": "saltelli", "n": rows, "base_points": n,
                        "factors": list(largest.factors), "second_order": design.second_order},
                replicate=np.arange(rows) // largest.block, workers=workers, quiet=quiet,
            )  # fmt: skip
            if design.tolerance is None or n >= design.n:
                break
            width = _widest(study, model, runs, wanted)
            say(f"{n} base points: widest total-index interval {width:.3f}", quiet=quiet)
            if width <= design.tolerance:
                break
            n *= 2
        return build_report(folder)


def check_independent(study: SobolStudy) -> None:
    """Raise ``UserError`` if inputs depend on each other across groups."""
    member = {name: group for group, names in study.groups.items() for name in names}
    pairs = [(a, b) for a, b, _ in study.dependence.correlations]
    pairs += [(name, parent) for name, d in study.inputs.items() for parent in d.parents]
    for first, second in pairs:
        if member.get(first, first) != member.get(second, second):
            raise UserError(
                f"Sobol' indices split variance among independent inputs, but {first!r} and "
                f"{second!r} depend on each other: put both into one group, or use "
                "'mcstudy sensitivity' on a Monte Carlo study of them"
            )


def build_report(folder: ResultsFolder) -> dict[str, Any]:
    """Analyse a results folder and write its figures and report, without running the model.

    Raises
    ------
    UserError
        If the folder is not one of a Sobol' study.
    StudyError
        If failed runs leave too few base points.
    """
    study = load_study(folder.path / "study.toml")
    if not isinstance(study, SobolStudy):
        raise UserError(f"{folder.path}: is not the folder of a Sobol' study")
    model = load_study_model(study)
    manifest = folder.read_json("manifest.json")
    runs = folder.runs()
    runs = runs[runs["run"] < int(manifest["design"]["n"])]
    analysis = analyse(study, model, runs)
    folder.write_json("analysis.json", analysis)
    analysis = folder.read_json("analysis.json")
    figures = draw(analysis, config.report_outputs(study, model))
    style.save(figures, folder.path / "figures")
    subtitle = (
        f"Sobol' study of {len(runs):,} runs of the {model.name} model: "
        f"{manifest['design']['base_points']:,} base points, seed {study.seed}"
    )
    sections = sections_of(study, model, manifest, analysis, figures)
    folder.write_text("report.html", render(study.title, subtitle, sections))
    return analysis


def analyse(study: SobolStudy, model: Model, runs: pd.DataFrame) -> dict[str, Any]:
    """Return every number that the report prints."""
    factors = factors_of(list(study.inputs), study.groups)
    block = block_size(factors, second_order=study.design.second_order)
    complete = runs["status"].isin(complete_status(model)).to_numpy()
    wanted = config.report_outputs(study, model)
    analysis: dict[str, Any] = {
        "runs": len(runs),
        "base_points": len(runs) // block,
        "status": {str(k): int(v) for k, v in runs["status"].value_counts().items()},
        "factors": list(factors),
        "input_units": {item.name: item.unit for item in model.inputs},
        "groups": {name: list(names) for name, names in study.groups.items()},
        "failures": _failures(study, runs, complete),
        "outputs": {},
        "convergence": {},
        "main_effects": {},
    }
    names = [item.name for item in model.outputs]
    cube = runs[names].to_numpy(dtype=float).reshape(-1, block, len(names))
    whole = complete.reshape(-1, block).all(axis=1)
    finite: NDArray[np.bool_] = np.isfinite(cube)
    kept = np.logical_and(finite.all(axis=1), whole.reshape(-1, 1))
    for pattern in np.unique(kept, axis=1).T:
        # Outputs that lost the same base points are estimated together.
        same = np.flatnonzero((kept == pattern[:, None]).all(axis=0))
        if pattern.sum() < max(FEWEST_POINTS, (1.0 - MOST_DROPPED) * len(cube)):
            raise StudyError(
                f"{names[int(same[0])]}: only {pattern.sum()} of {len(cube)} base points have no "
                "failed run and a value in every row; no index is given"
            )
        found = _indices(study, cube[pattern][:, :, same], len(factors))
        for k, column in enumerate(same.tolist()):
            item = model.outputs[column]
            analysis["outputs"][item.name] = {"unit": item.unit} | _plain(found, k, factors)
    points = cube[:, [0, -1]]
    inputs = runs[list(study.inputs)].to_numpy(dtype=float).reshape(-1, block, len(study.inputs))
    for name in wanted:
        column = names.index(name)
        analysis["convergence"][name] = _convergence(
            study, cube[kept[:, column]][:, :, column : column + 1], factors
        )
        values = points[:, :, column].ravel()
        analysis["main_effects"][name] = {
            key: main_effect(inputs[:, [0, -1], k].ravel(), values)
            for k, key in enumerate(study.inputs)
        }
    return analysis


def _design(study: SobolStudy, n: int) -> Saltelli:
    return draw_saltelli(
        list(study.inputs), study.groups, n, study.seed, second_order=study.design.second_order
    )


def _indices(study: SobolStudy, cube: Array, d: int, resamples: int | None = None) -> Indices:
    """Return the indices of the outputs of whole base points (n, block, m)."""
    outputs = cube.reshape(-1, cube.shape[2])
    return estimate_indices(
        split_blocks(outputs, d, second_order=study.design.second_order),
        resamples=study.report.resamples if resamples is None else resamples,
        seed=np.random.SeedSequence(study.seed, spawn_key=(seeds.BOOTSTRAP,)),
    )


def _plain(found: Indices, k: int, factors: Sequence[str]) -> dict[str, Any]:
    """Return the indices of output ``k`` by factor."""

    def named(table: Array) -> dict[str, dict[str, float]]:
        return {
            name: dict(zip(("value", "low", "high"), table[:, j, k].tolist(), strict=True))
            for j, name in enumerate(factors)
        }

    entry: dict[str, Any] = {
        "base_points": found.blocks,
        "variance": float(found.variance[k]),
        "first": named(found.first),
        "total": named(found.total),
    }
    if found.second is not None:
        entry["second"] = {
            f"{a} x {b}": dict(
                zip(("value", "low", "high"), found.second[:, i, j, k].tolist(), strict=True)
            )
            for i, a in enumerate(factors)
            for j, b in enumerate(factors)
            if i < j
        }
    return entry


def _widest(study: SobolStudy, model: Model, runs: pd.DataFrame, wanted: Sequence[str]) -> float:
    """Return the widest interval of a total index of the wanted outputs."""
    outputs = analyse(study, model, runs)["outputs"]
    widths = [
        entry["high"] - entry["low"]
        for name in wanted
        for factor, entry in outputs[name]["total"].items()
        if factor != DUMMY
    ]
    return float(np.nanmax(widths))


def _convergence(study: SobolStudy, cube: Array, factors: Sequence[str]) -> list[dict[str, Any]]:
    """Return first and total indices on growing parts of the base points."""
    steps = []
    n = cube.shape[0]
    sizes = sorted({n >> k for k in range(6) if n >> k >= FEWEST_POINTS})
    for size in sizes:
        found = _indices(study, cube[:size], len(factors), resamples=200)
        entry = _plain(found, 0, factors)
        steps.append({"n": size, "first": entry["first"], "total": entry["total"]})
    return steps


def _failures(study: SobolStudy, runs: pd.DataFrame, complete: NDArray[np.bool_]) -> dict[str, Any]:
    """Return how many runs failed and where in the space of inputs: mean rank of each input."""
    lost = ~complete
    entry: dict[str, Any] = {"runs": int(lost.sum()), "where": {}}
    if lost.any():
        ranks = runs[list(study.inputs)].rank(pct=True)[lost].mean()
        # Of unrelated inputs the mean rank scatters by this about one half.
        noise = float(np.sqrt(1.0 / 12.0 / lost.sum()))
        entry["where"] = {
            str(name): float(value)
            for name, value in ranks.items()
            if abs(value - 0.5) > 2.0 * noise
        }
    return entry
