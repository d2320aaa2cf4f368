"""A design of runs: its input values, and its runs in a results folder."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.sampling import designs
from mcstudy.studyfile.identity import numbers_digest
from mcstudy.studyfile.schema import DesignedStudy
from mcstudy.studyfile.study_inputs import map_inputs
from models.protocol import Model
from studies.runs import ModelRuns, RunPlan, columns_of, load_study_model, run_rows

Array = NDArray[np.float64]


def sample_inputs(study: DesignedStudy, model: Model) -> dict[str, Array]:
    """Return the (n,) values of every input of the model, in its units.

    Raises
    ------
    UserError
        If names, units, dependence or ranges do not fit the model.
    """
    design = study.design
    uniforms = designs.draw(design.method, design.n, design.size, len(study.inputs), study.seed)
    return map_inputs(study, model, uniforms)


def plan_design(study: DesignedStudy, model: Model, folder: ResultsFolder) -> RunPlan:
    """Return the plan of a design, which must be that of the folder.

    Parameters
    ----------
    study : DesignedStudy
        Checked study file.
    model : Model
        Of the study.
    folder : ResultsFolder
        Results folder, new or of the same study.

    Raises
    ------
    UserError
        If the study does not fit the model, or the folder is another study's.
    """
    columns = sample_inputs(study, model)
    folder.check_same_study(numbers_digest(study, model))
    return RunPlan(model, columns, np.arange(study.design.n) // study.design.size)


def run_design(
    study: DesignedStudy, plan: RunPlan, folder: ResultsFolder, *, workers: Workers, quiet: bool
) -> pd.DataFrame:
    """Run the missing runs of a design and return all of them.

    Parameters
    ----------
    study : DesignedStudy
        Checked study file.
    plan : RunPlan
        From ``plan_design``.
    folder : ResultsFolder
        Open for writing.
    workers : int or str
        Processes, -1 for one per core, or the address of a dask scheduler.
    quiet : bool
        No progress line.

    Raises
    ------
    StudyError
        If too many runs failed, or the workers are lost.
    """
    design = study.design
    return run_rows(
        study, plan.model, plan.columns, folder,
        design={"method": design.method, "n": design.n, "replicate_size": design.size},
        replicate=plan.replicate, workers=workers, quiet=quiet,
    )  # fmt: skip


def runs_of_design(study: DesignedStudy, folder: ResultsFolder) -> ModelRuns:
    """Return the model and the runs of the design that are done.

    Parameters
    ----------
    study : DesignedStudy
        Checked study file.
    folder : ResultsFolder
        Results folder of the study.
    """
    model = load_study_model(study)
    runs = folder.runs(columns_of(model))
    return ModelRuns(model, runs[runs["run"] < study.design.n])
