"""The injury study: from runs to AIS outcomes, for scenarios and car fronts.

Every scenario meets every car front in a *cell*: the same draws of all inputs that the scenario
does not change, so that differences between scenarios have a small variance. Each cell has its own
folder.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.injury.functions import RiskFunction, risk_function
from mcstudy.report import Section
from mcstudy.studyfile.identity import numbers_digest
from mcstudy.studyfile.study_inputs import fixed_values
from mcstudy.studyfile.study_outputs import check_outputs
from models.protocol import Model
from studies.explorer import explorer_pages
from studies.injury.analysis import CASES, analyse, outcomes_of
from studies.injury.cells import Cell, cells_of
from studies.injury.numbers import InjuryAnalysis
from studies.injury.pictures import draw
from studies.injury.report import sections_of, summarise
from studies.injury.schema import InjuryStudy
from studies.kind import Finished, StudyKind
from studies.monte_carlo.design import sample_inputs
from studies.paired_runs import PreparedCell, cell_folder, cell_runs, run_cells
from studies.runs import RunEnds, check_failure_rate, load_study_model
from studies.stored_scenes import keep_scenes


@dataclass(frozen=True)
class InjuryResults:
    """Input of the analysis of an injury study.

    Attributes
    ----------
    model : Model
        Model of the runs.
    functions : dict
        Risk functions by name.
    cases : DataFrame
        Complete runs of all cells, with risks and a drawn AIS.
    ended : RunEnds
        How the runs ended.
    """

    model: Model
    functions: dict[str, RiskFunction]
    cases: pd.DataFrame
    ended: RunEnds


Done = Finished[InjuryStudy, InjuryResults, InjuryAnalysis]


class Injury(StudyKind[InjuryStudy, list[PreparedCell], InjuryResults, InjuryAnalysis]):
    """Scenarios and car fronts through one model, with AIS outcomes of the runs."""

    schema = InjuryStudy
    analysis = InjuryAnalysis

    def plan(self, study: InjuryStudy, folder: ResultsFolder) -> list[PreparedCell]:
        """Return the cells, each with its model and the values of every input."""
        return [_prepare(study, cell, folder) for cell in cells_of(study)]

    def execute(
        self,
        study: InjuryStudy,
        plan: list[PreparedCell],
        folder: ResultsFolder,
        *,
        workers: Workers,
        quiet: bool,
    ) -> None:
        """Run the missing runs of all cells.

        Parameters
        ----------
        study : InjuryStudy
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
        run_cells(study, folder, plan, workers=workers, quiet=quiet)

    def keep(self, study: InjuryStudy, results: InjuryResults, folder: ResultsFolder) -> None:
        """Keep notable runs of the reference in three dimensions."""
        cell = next(iter(cells_of(study)))
        runs = cell_runs(folder, cell.name, study.design.n, results.model)
        keep_scenes(cell.study, results.model, runs, cell_folder(folder, cell.name))

    def pages(
        self, study: InjuryStudy, results: InjuryResults, folder: ResultsFolder
    ) -> Mapping[str, str]:
        """Return the explorer of the runs of the reference."""
        cell = next(iter(cells_of(study)))
        runs = cell_runs(folder, cell.name, study.design.n, results.model)
        return explorer_pages(cell.study, results.model, runs, cell_folder(folder, cell.name))

    def results(self, study: InjuryStudy, folder: ResultsFolder) -> InjuryResults:
        """Return the cases of all cells and write them to the folder."""
        model = load_study_model(study)
        functions = check_functions(study, model)
        frames = []
        for cell in cells_of(study):
            runs = cell_runs(folder, cell.name, study.design.n, model)
            frames.append(runs.assign(scenario=cell.scenario, front=cell.front))
        runs = pd.concat(frames, ignore_index=True)
        ended, complete = check_failure_rate(study, model, runs)
        cases = outcomes_of(study, runs[complete], functions)
        folder.write_frame(CASES, cases)
        return InjuryResults(model, functions, cases, ended)

    def analyse(self, study: InjuryStudy, results: InjuryResults) -> InjuryAnalysis:
        """Return every number that the report prints."""
        return analyse(study, results.model, results.ended, results.cases, results.functions)

    def subtitle(self, done: Done) -> str:
        """Return the line below the report's title."""
        scenarios, fronts = len(done.analysis.scenarios), len(done.analysis.fronts)
        return (
            f"Injury study of {done.analysis.runs:,} runs of the {done.study.model.name} model, "
            f"{scenarios} scenario(s), {fronts} car front(s), seed {done.study.seed}"
        )

    def draw(self, done: Done) -> dict[str, Any]:
        """Return the figures by file name."""
        return draw(done.study, done.results.cases, done.analysis, done.results.functions)

    def sections(self, done: Done, figures: Mapping[str, Any]) -> Sequence[Section]:
        """Return the sections of the report."""
        return sections_of(done.study, done.analysis, figures, done.results.functions)

    def summarise(self, analysis: InjuryAnalysis) -> list[str]:
        """Return the risks of the scenarios."""
        return summarise(analysis)


def check_functions(study: InjuryStudy, model: Model) -> dict[str, RiskFunction]:
    """Return the study's risk functions by name.

    Raises
    ------
    UserError
        If one is unknown, or the model lacks its stimulus or gives it in another unit.
    """
    known = {item.name: item.unit for item in model.outputs}
    found = {}
    for mechanism, entry in study.mechanisms.items():
        place = f"mechanisms.{mechanism}.functions"
        for name in entry.functions:
            try:
                function = risk_function(name)
            except ValueError as error:
                raise UserError(f"{place}: {error}") from None
            if known.get(function.stimulus) != function.unit:
                raise UserError(
                    f"{place}.{name}: takes {function.stimulus} in {function.unit}, which model "
                    f"{model.name!r} does not give"
                )
            found[name] = function
    check_outputs([study.limit.output], model, "limit.output")
    has_age = "age" in {item.name for item in model.inputs}
    if study.age is None and not has_age:
        raise UserError(f"age: model {model.name!r} has no input 'age'; give it in years")
    if study.age is not None and has_age:
        raise UserError(f"age: model {model.name!r} has an input 'age'; sample or fix that")
    return found


def _prepare(study: InjuryStudy, cell: Cell, folder: ResultsFolder) -> PreparedCell:
    """Return a cell with its model and the values of every input.

    Raises
    ------
    UserError
        Naming the cell, if it does not fit the model or its folder.
    """
    try:
        model = load_study_model(cell.study)
        check_functions(study, model)
        columns = sample_inputs(cell.study, model)
        for name, value in fixed_values(cell.changes.fixed, model).items():
            columns[name] = np.full(study.design.n, value)
        merged = cell.study.model_copy(update={"fixed": cell.study.fixed | cell.changes.fixed})
        cell_folder(folder, cell.name).check_same_study(numbers_digest(merged, model))
    except UserError as error:
        raise UserError(f"scenario {cell.scenario}, front {cell.front}: {error}") from None
    return PreparedCell(cell.name, merged, model, columns)
