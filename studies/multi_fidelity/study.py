"""The multi-fidelity study: pilot runs of all models, an allotment of the budget, nested runs.

Every model has a cell of its own; run k of every cell has the same inputs and belongs to replicate
``k % replicates``. Cheap models have more runs of the same design.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.progress import say
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.multifidelity.allocation import allocate
from mcstudy.report import Section, Table
from mcstudy.studyfile.schema import Design
from mcstudy.studyfile.study_outputs import check_outputs, report_outputs
from models.protocol import Model
from studies.kind import Finished, StudyKind
from studies.model_cells import (
    known_values,
    prepare_model,
    run_model,
    study_of_model,
    take_over,
)
from studies.multi_fidelity.analysis import Allotment, FidelityAnalysis, analyse
from studies.multi_fidelity.report import draw, sections_of, summarise
from studies.multi_fidelity.schema import FidelityStudy
from studies.paired_runs import PreparedCell, cell_runs, finish_manifest, start_manifest
from studies.runs import load_study_model

ALLOTMENT = "allotment.json"
"""File of the measured costs and of the runs of each model."""
METHOD: Literal["monte-carlo"] = "monte-carlo"
"""Design of the runs: those of fewer runs come first."""
TIMED = 1.0
"""s of runs by which the cost of a run is measured, at least one run."""


@dataclass(frozen=True)
class FidelityResults:
    """Input of the analysis: models, tables of runs and the allotment, by label."""

    models: dict[str, Model]
    runs: dict[str, pd.DataFrame]
    allotment: Allotment


Done = Finished[FidelityStudy, FidelityResults, FidelityAnalysis]


class MultiFidelity(
    StudyKind[FidelityStudy, list[PreparedCell], FidelityResults, FidelityAnalysis]
):
    """The distribution of the dearest of several models, with the help of the others."""

    schema = FidelityStudy
    analysis = FidelityAnalysis

    def plan(self, study: FidelityStudy, folder: ResultsFolder) -> list[PreparedCell]:
        """Return the cells with the inputs of the pilot runs."""
        design = cell_design(study.budget.pilot)
        cells = [prepare_model(study, label, design, folder) for label in study.models]
        for cell in cells:
            check_outputs(reported(study, cell.model), cell.model, f"models.{cell.name}")
        return cells

    def execute(
        self,
        study: FidelityStudy,
        plan: list[PreparedCell],
        folder: ResultsFolder,
        *,
        workers: Workers,
        quiet: bool,
    ) -> None:
        """Run the pilot runs, allot the budget, and run the rest.

        Parameters
        ----------
        study : FidelityStudy
            Checked study file.
        plan : list of PreparedCell
            From ``plan``.
        folder : ResultsFolder
            Open for writing.
        workers : int or str
            Processes, -1 for one per core, or the address of a dask scheduler.
        quiet : bool
            No progress line.
        """
        pilots = len(plan) * study.budget.pilot
        start_manifest(study, folder, METHOD, pilots, plan)
        for cell in plan:
            take_over(cell, study.models[cell.name].reuse, folder)
        piloted = {
            cell.name: run_model(
                cell, folder, _replicates(study, cell), workers=workers, quiet=quiet
            )
            for cell in plan
        }
        allotment = _allot(study, plan, piloted, folder)
        folder.write_json(ALLOTMENT, allotment)
        n_all = sum(allotment.runs.values())
        manifest = start_manifest(study, folder, METHOD, n_all, plan)
        tables = {}
        for cell in plan:
            n = allotment.runs[cell.name]
            whole = prepare_model(study, cell.name, cell_design(n), folder)
            say(f"{cell.name}: {n:,} runs of {allotment.costs[cell.name]:.3g} s", quiet=quiet)
            tables[cell.name] = run_model(
                whole, folder, _replicates(study, whole), workers=workers, quiet=quiet
            )
        finish_manifest(manifest, folder, tables)

    def results(self, study: FidelityStudy, folder: ResultsFolder) -> FidelityResults:
        """Return models, runs and allotment."""
        if not (folder.path / ALLOTMENT).exists():
            raise UserError(f"{folder.path}: the pilot runs are not done; run the study again")
        allotment = Allotment(**folder.read_json(ALLOTMENT))
        models = {
            label: load_study_model(study_of_model(study, label, cell_design(1)))
            for label in study.models
        }
        runs = {
            label: cell_runs(folder, label, allotment.runs[label], model)
            for label, model in models.items()
        }
        return FidelityResults(models, runs, allotment)

    def analyse(self, study: FidelityStudy, results: FidelityResults) -> FidelityAnalysis:
        """Return every number that the report prints."""
        first = results.models[results.allotment.order[0]]
        outputs = reported(study, first)
        return analyse(study, results.models, results.runs, results.allotment, outputs)

    def subtitle(self, done: Done) -> str:
        """Return the line below the report's title."""
        allotment = done.analysis.allotment
        runs = ", ".join(f"{allotment.runs[label]:,} of {label}" for label in allotment.order)
        return (
            f"Distribution of {allotment.order[0]} by {allotment.method}: runs {runs}, "
            f"seed {done.study.seed}"
        )

    def draw(self, done: Done) -> dict[str, Any]:
        """Return the figures by file name."""
        return draw(done.analysis)

    def sections(self, done: Done, figures: Mapping[str, Any]) -> Sequence[Section]:
        """Return the sections of the report."""
        return sections_of(done.analysis, figures)

    def summarise(self, analysis: FidelityAnalysis) -> list[Table]:
        """Return models and estimates."""
        return summarise(analysis)


def _replicates(study: FidelityStudy, cell: PreparedCell) -> NDArray[np.int64]:
    """Return the replicate of each run of a cell."""
    return np.arange(cell.study.design.n) % study.budget.replicates


def cell_design(n: int) -> Design:
    """Return the design of a model's n runs: those of fewer runs come first."""
    return Design(method=METHOD, n=n)


def reported(study: FidelityStudy, model: Model) -> list[str]:
    """Return the outputs of the report: those named, that of the budget, those with limits."""
    base = report_outputs(study_of_model(study, next(iter(study.models)), cell_design(1)), model)
    return list(dict.fromkeys([*base, study.budget.output, *study.report.limits]))


def _allot(
    study: FidelityStudy,
    cells: Sequence[PreparedCell],
    pilots: Mapping[str, pd.DataFrame],
    folder: ResultsFolder,
) -> Allotment:
    """Return the runs of each model; costs that were measured before are kept.

    Raises
    ------
    StudyError
        If the budget is too small, or too few pilot runs have a value by every model.
    """
    kept = folder.read_json(ALLOTMENT)["costs"] if (folder.path / ALLOTMENT).exists() else {}
    costs = {
        cell.name: study.models[cell.name].cost or kept.get(cell.name) or measured_cost(cell)
        for cell in cells
    }
    budget = study.budget
    order = sorted(costs, key=lambda label: -costs[label])
    if budget.reference is not None:
        order = [budget.reference, *(label for label in order if label != budget.reference)]
    by_name = {cell.name: cell for cell in cells}
    table = np.stack(
        [known_values(pilots[label], by_name[label].model, budget.output) for label in order]
    )[:, : budget.pilot]
    table = table[:, np.isfinite(table).all(axis=0)]
    if table.shape[1] < budget.pilot / 2:
        raise StudyError(
            f"budget.output: only {table.shape[1]} of {budget.pilot} pilot runs have a value of "
            f"{budget.output} by every model"
        )
    price = np.array([costs[label] for label in order])
    try:
        found = allocate(np.cov(table), price, budget.seconds, multiple=budget.replicates)
    except ValueError as error:
        raise StudyError(f"budget: {error}") from None
    runs = dict.fromkeys(order, budget.pilot)
    for k, n in zip(found.models, found.runs, strict=True):
        runs[order[k]] = max(n, budget.pilot)
    correlations = np.atleast_2d(np.corrcoef(table))[0]
    return Allotment(
        method=found.method,
        order=[order[k] for k in found.models],
        left_out=[label for k, label in enumerate(order) if k not in found.models],
        costs=costs,
        runs=runs,
        pilot_correlation=dict(zip(order, correlations.tolist(), strict=True)),
        predicted_ratio=found.variance / found.variance_alone,
        seconds=budget.seconds,
        replicates=budget.replicates,
    )


def measured_cost(cell: PreparedCell) -> float:
    """Return the time of one run of a cell (s), of its first inputs, on this machine.

    A cheap model is run once before, so that its code is compiled; to a dear one that is little.

    Parameters
    ----------
    cell : PreparedCell
    """
    rows = np.stack([cell.columns[item.name] for item in cell.model.inputs], axis=1)
    if cell.model.cost < TIMED:
        cell.model.run_batch(rows[:1])
    spent = []
    for row in rows:
        start = time.perf_counter()
        cell.model.run_batch(row[None])
        spent.append(time.perf_counter() - start)
        if sum(spent) > TIMED:
            break
    return float(np.mean(spent))
