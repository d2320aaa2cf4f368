"""Studies of several models: a cell a model, the same inputs in run k of each."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.results import ResultsFolder, check_failures, status_counts
from mcstudy.execution.workers import Workers
from mcstudy.studyfile.identity import numbers_digest
from mcstudy.studyfile.schema import Design, ModelChoice, ModelsStudy, Report
from mcstudy.studyfile.study_outputs import check_outputs, report_outputs
from models.protocol import Model, complete_status
from studies.monte_carlo.design import sample_inputs
from studies.monte_carlo.schema import MonteCarloStudy
from studies.paired_runs import PreparedCell, cell_folder
from studies.runs import RunEnds, columns_of, describe_ends, load_study_model, run_rows

Array = NDArray[np.float64]


def study_of_model(study: ModelsStudy, label: str, design: Design) -> MonteCarloStudy:
    """Return the Monte Carlo study of one of several models.

    Parameters
    ----------
    study : ModelsStudy
        Checked study file.
    label : str
        Of the model.
    design : Design
        Design of its runs.
    """
    chosen = study.models[label]
    return MonteCarloStudy(
        format=study.format, kind="monte-carlo", name=study.name, title=study.title,
        seed=study.seed, model=ModelChoice(name=chosen.name, options=chosen.options),
        fixed=study.fixed, design=design, inputs=study.inputs, dependence=study.dependence,
        max_failure_rate=study.max_failure_rate, run_time=study.run_time,
        report=Report(outputs=study.report.outputs, histories=0),
    )  # fmt: skip


def prepare_model(
    study: ModelsStudy, label: str, design: Design, folder: ResultsFolder
) -> PreparedCell:
    """Return a model's cell with the values of every input.

    Parameters
    ----------
    study : ModelsStudy
        Checked study file.
    label : str
        Of the model.
    design : Design
        Design of its runs.
    folder : ResultsFolder
        Of the study.

    Raises
    ------
    UserError
        Naming the model, if the study does not fit it or its folder.
    """
    inner = study_of_model(study, label, design)
    try:
        model = load_study_model(inner)
        columns = sample_inputs(inner, model)
        cell_folder(folder, label).check_same_study(numbers_digest(inner, model))
    except UserError as error:
        raise UserError(f"models.{label}: {error}") from None
    return PreparedCell(label, inner, model, columns)


def shared_outputs(study: ModelsStudy, models: Mapping[str, Model]) -> list[str]:
    """Return the outputs of the report, which every model must have.

    Parameters
    ----------
    study : ModelsStudy
        Checked study file.
    models : mapping
        Models by label.

    Raises
    ------
    UserError
        If a model lacks one, or has it in another unit.
    """
    first = next(iter(models))
    names = report_outputs(
        study_of_model(study, first, Design(method="monte-carlo", n=1)), models[first]
    )
    units = {item.name: item.unit for item in models[first].outputs}
    for label, model in models.items():
        check_outputs(names, model, f"models.{label}")
        for item in model.outputs:
            if item.name in names and item.unit != units[item.name]:
                raise UserError(
                    f"models.{label}: gives {item.name} in {item.unit}, models.{first} in "
                    f"{units[item.name]}"
                )
    return names


def take_over(cell: PreparedCell, source: str | None, folder: ResultsFolder) -> None:
    """Copy the runs of a finished study of the same design into a cell that has none.

    Parameters
    ----------
    cell : PreparedCell
        Of a model.
    source : str or None
        Results folder of the study, or the cell of one; None to copy nothing.
    folder : ResultsFolder
        Of the study, open for writing.

    Raises
    ------
    UserError
        If the source has other inputs, another seed or another model.
    """
    inner = cell_folder(folder, cell.name)
    if source is None or inner.done() is not None:
        return
    finished = ResultsFolder(Path(source))
    if not (finished.path / "manifest.json").exists():
        raise UserError(f"models.{cell.name}.reuse: {source}: is no results folder")
    try:
        finished.check_same_study(numbers_digest(cell.study, cell.model))
    except UserError as error:
        raise UserError(f"models.{cell.name}.reuse: {error}") from None
    with inner.open_for_writing():
        inner.add_part(finished.runs(columns_of(cell.model)))


def run_model(
    cell: PreparedCell,
    folder: ResultsFolder,
    replicate: NDArray[np.int64],
    *,
    workers: Workers,
    quiet: bool,
) -> pd.DataFrame:
    """Return the runs of a model's cell, after running those that are missing.

    Parameters
    ----------
    cell : PreparedCell
        Of a model.
    folder : ResultsFolder
        Of the study, open for writing.
    replicate : (n,) int array
        Replicate of each run.
    workers : int or str
        Processes, -1 for one per core, or the address of a dask scheduler.
    quiet : bool
        No progress line.

    Raises
    ------
    StudyError
        If too many runs failed, or the workers are lost.
    """
    inner, design = cell_folder(folder, cell.name), cell.study.design
    try:
        with inner.open_for_writing():
            return run_rows(
                cell.study, cell.model, cell.columns, inner,
                design={"method": design.method, "n": design.n, "replicate_size": design.size},
                replicate=replicate, workers=workers, quiet=quiet,
            )  # fmt: skip
    except StudyError as error:
        raise StudyError(f"models.{cell.name}: {error}") from None


def describe_models(
    study: ModelsStudy, models: Mapping[str, Model], runs: Mapping[str, pd.DataFrame]
) -> RunEnds:
    """Return how the runs of several models ended.

    Parameters
    ----------
    study : ModelsStudy
        Checked study file.
    models, runs : mapping
        Models and tables of runs by label.

    Raises
    ------
    StudyError
        If more runs of a model failed than the study allows.
    """
    everything = pd.concat([part.assign(model=label) for label, part in runs.items()])
    everything = everything.reset_index(drop=True)
    complete = np.zeros(len(everything), dtype=bool)
    words = frozenset[str]()
    for label, model in models.items():
        counts = status_counts(runs[label])
        try:
            check_failures(counts, set(counts) - complete_status(model), study.max_failure_rate)
        except StudyError as error:
            raise StudyError(f"models.{label}: {error}") from None
        own = (everything["model"] == label).to_numpy()
        complete |= own & everything["status"].isin(complete_status(model)).to_numpy()
        words |= complete_status(model)
    return describe_ends(study, everything, complete, words)


def known_values(runs: pd.DataFrame, model: Model, output: str) -> Array:
    """Return an output (n,) of a model's runs, NaN where a run failed.

    Parameters
    ----------
    runs : DataFrame
        Table of its runs.
    model : Model
    output : str
        Name of the output.
    """
    complete = runs["status"].isin(complete_status(model))
    return runs[output].where(complete).to_numpy(dtype=float)
