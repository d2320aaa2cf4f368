"""The injury study: from runs to AIS outcomes, for scenarios and car fronts.

Every scenario meets every car front in a *cell*: the same draws of everything that the scenario
does not change, so that differences between scenarios are sharp. Cells lie in folders of their own.
"""

from typing import Any

import numpy as np
import pandas as pd

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.injury.functions import RiskFunction, risk_function
from mcstudy.studyfile import config
from mcstudy.studyfile.config import InjuryStudy, load_study
from models.protocol import Model
from studies.injury.analysis import CASES, analyse, outcomes_of
from studies.injury.cells import Cell, cells_of
from studies.injury.report import draw, sections_of
from studies.paired_runs import PreparedCell, cell_folder, cell_runs, run_cells
from studies.publishing import publish
from studies.runs import check_failure_rate, load_study_model


def run_injury(
    study: InjuryStudy,
    text: str,
    folder: ResultsFolder,
    *,
    workers: Workers = -1,
    quiet: bool = False,
) -> dict[str, Any]:
    """Run all cells of a study, or go on with them, and write its results folder.

    Parameters
    ----------
    study : InjuryStudy
    text : the study file as written. folder : ResultsFolder
    workers : processes, -1 for one a core, or the address of a dask scheduler.
    quiet : no progress line.

    Returns
    -------
    dict
        The analysis, as in ``analysis.json``.

    Raises
    ------
    UserError
        If the study does not fit the model or the folder.
    StudyError
        If too many runs failed.
    """
    prepared = [_prepare(study, cell, folder) for cell in cells_of(study)]
    with folder.open_for_writing():
        run_cells(study, text, folder, prepared, workers=workers, quiet=quiet)
        return build_report(folder)


def build_report(folder: ResultsFolder) -> dict[str, Any]:
    """Analyse a results folder and write its figures and report, without running the model.

    Raises
    ------
    UserError
        If the folder is not one of a finished injury study.
    StudyError
        If too many runs failed.
    """
    study = load_study(folder.path / "study.toml")
    if not isinstance(study, InjuryStudy):
        raise UserError(f"{folder.path}: is not the folder of an injury study")
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
    analysis = ended | analyse(study, model, cases, functions)
    subtitle = (
        f"Injury study of {len(runs):,} runs of the {study.model.name} model, "
        f"{len(analysis['scenarios'])} scenario(s), {len(analysis['fronts'])} car front(s), "
        f"seed {study.seed}"
    )
    return publish(
        folder, study.title, subtitle, analysis,
        lambda held: draw(study, cases, held, functions),
        lambda held, figures: sections_of(study, held, figures, functions),
    )  # fmt: skip


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
    config.check_outputs([study.limit.output], model, "limit.output")
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
        columns = config.sample_inputs(cell.study, model)
        fixed = cell.study.model_copy(update={"fixed": cell.changes.fixed})
        for name, value in config.fixed_values(fixed, model).items():
            columns[name] = np.full(study.design.n, value)
        merged = cell.study.model_copy(update={"fixed": cell.study.fixed | cell.changes.fixed})
        cell_folder(folder, cell.name).check_same_study(config.numbers_digest(merged, model))
    except UserError as error:
        raise UserError(f"scenario {cell.scenario}, front {cell.front}: {error}") from None
    return PreparedCell(cell.name, merged, model, columns)
