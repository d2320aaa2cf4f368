"""The model comparison: the same draws through every model, and what is the method's own.

Each model runs in a cell of its own; run k of every cell has the same inputs.
"""

from typing import Any

import numpy as np

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.studyfile import config
from mcstudy.studyfile.config import ModelComparison, MonteCarloStudy, load_study
from mcstudy.studyfile.schema import Report
from models.protocol import Model, Run
from studies.model_comparison.analysis import analyse, published_methods
from studies.model_comparison.report import draw, sections_of
from studies.paired_runs import PreparedCell, cell_folder, cell_runs, run_cells
from studies.publishing import publish
from studies.runs import load_study_model

NOMINAL = "nominal.json"
"""Outputs and pictures' poses of the nominal run of a model, in its cell."""


def run_comparison(
    study: ModelComparison,
    text: str,
    folder: ResultsFolder,
    *,
    workers: Workers = -1,
    quiet: bool = False,
) -> dict[str, Any]:
    """Run all models of a comparison, or go on with them, and write its results folder.

    Parameters
    ----------
    study : ModelComparison
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
        If the study does not fit a model or the folder.
    StudyError
        If too many runs failed.
    """
    cells = [_prepare(study, label, folder) for label in study.models]
    models = {cell.name: cell.model for cell in cells}
    compared_outputs(study, models)
    published_methods(study, cells[0].model)
    with folder.open_for_writing():
        run_cells(study, text, folder, cells, workers=workers, quiet=quiet)
        for cell in cells:
            run = cell.model.run({})
            cell_folder(folder, cell.name).write_json(
                NOMINAL, _nominal(run, study.report.strip_times)
            )
        return build_report(folder)


def build_report(folder: ResultsFolder) -> dict[str, Any]:
    """Analyse a results folder and write its figures and report, without running a model.

    Raises
    ------
    UserError
        If the folder is not one of a finished comparison.
    StudyError
        If too many runs of a model failed.
    """
    study = load_study(folder.path / "study.toml")
    if not isinstance(study, ModelComparison):
        raise UserError(f"{folder.path}: is not the folder of a model comparison")
    models = {label: load_study_model(cell_study(study, label)) for label in study.models}
    runs = {
        label: cell_runs(folder, label, study.design.n, model) for label, model in models.items()
    }
    nominal = {label: cell_folder(folder, label).read_json(NOMINAL) for label in study.models}
    analysis = analyse(study, models, runs, nominal, compared_outputs(study, models))
    subtitle = (
        f"{study.design.n:,} sets of inputs through {len(models)} models: "
        f"{', '.join(f'{label} ({model.name})' for label, model in models.items())}, "
        f"seed {study.seed}"
    )
    return publish(
        folder, study.title, subtitle, analysis,
        lambda held: draw(study, models, runs, nominal, held),
        lambda held, figures: sections_of(study, models, held, figures),
    )  # fmt: skip


def cell_study(study: ModelComparison, label: str) -> MonteCarloStudy:
    """Return the comparison's study of one model."""
    return MonteCarloStudy(
        format=study.format, kind="monte-carlo", name=study.name, title=study.title,
        seed=study.seed, model=study.models[label], fixed=study.fixed, design=study.design,
        inputs=study.inputs, dependence=study.dependence,
        max_failure_rate=study.max_failure_rate, run_time=study.run_time,
        report=Report(histories=0),
    )  # fmt: skip


def compared_outputs(study: ModelComparison, models: dict[str, Model]) -> list[str]:
    """Return the outputs that are compared: those of the report, which every model must have.

    Raises
    ------
    UserError
        If a model lacks one, or has it in another unit.
    """
    first = next(iter(models))
    chosen = cell_study(study, first).model_copy(
        update={"report": Report(outputs=study.report.outputs, histories=0)}
    )
    names = config.report_outputs(chosen, models[first])
    units = {item.name: item.unit for item in models[first].outputs}
    for label, model in models.items():
        config.check_outputs(names, model, f"models.{label}")
        for item in model.outputs:
            if item.name in names and item.unit != units[item.name]:
                raise UserError(
                    f"models.{label}: gives {item.name} in {item.unit}, models.{first} in "
                    f"{units[item.name]}"
                )
    return names


def _prepare(study: ModelComparison, label: str, folder: ResultsFolder) -> PreparedCell:
    """Return a model's cell with the values of every input.

    Raises
    ------
    UserError
        Naming the model, if the study does not fit it or its folder.
    """
    inner = cell_study(study, label)
    try:
        model = load_study_model(inner)
        columns = config.sample_inputs(inner, model)
        cell_folder(folder, label).check_same_study(config.numbers_digest(inner, model))
    except UserError as error:
        raise UserError(f"models.{label}: {error}") from None
    return PreparedCell(label, inner, model, columns)


def _nominal(run: Run, times: list[float]) -> dict[str, Any]:
    """Return what a report says and draws of a nominal run."""
    found: dict[str, Any] = {"status": run.status, "outputs": dict(run.outputs)}
    if run.scene is not None:
        scene = run.scene
        frames = sorted({int(np.argmin(np.abs(scene.time - time))) for time in times})
        found["scene"] = {
            "time": scene.time[frames], "names": list(scene.names),
            "semi_axes": scene.semi_axes, "centre": scene.centre[frames],
            "orientation": scene.orientation[frames], "car": scene.car[frames],
            "outline": [np.asarray(line) for line in scene.outline], "plan": scene.plan,
        }  # fmt: skip
    return found
