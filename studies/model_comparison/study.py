"""The model comparison: the same draws through every model give the model-form uncertainty.

Each model runs in its own cell; run k of every cell has the same inputs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.report import Section
from models.protocol import Model, Run
from studies.kind import Finished, StudyKind
from studies.model_cells import prepare_model, shared_outputs, study_of_model
from studies.model_comparison.analysis import analyse, published_methods
from studies.model_comparison.numbers import ComparisonAnalysis
from studies.model_comparison.report import draw, sections_of, summarise
from studies.model_comparison.schema import ModelComparison
from studies.paired_runs import PreparedCell, cell_folder, cell_runs, run_cells
from studies.runs import load_study_model

NOMINAL = "nominal.json"
"""File of outputs and poses of the nominal run of a model, in its cell."""


@dataclass(frozen=True)
class ComparisonResults:
    """Input of the analysis of a comparison, each by label of the model.

    Attributes
    ----------
    models : dict
        Models by label.
    runs : dict
        Table of runs by label; run k of each has the same inputs.
    nominal : dict
        Outputs and poses of the nominal run by label.
    """

    models: dict[str, Model]
    runs: dict[str, pd.DataFrame]
    nominal: dict[str, dict[str, Any]]


Done = Finished[ModelComparison, ComparisonResults, ComparisonAnalysis]


class Comparison(
    StudyKind[ModelComparison, list[PreparedCell], ComparisonResults, ComparisonAnalysis]
):
    """The same inputs through two or more models."""

    schema = ModelComparison
    analysis = ComparisonAnalysis

    def plan(self, study: ModelComparison, folder: ResultsFolder) -> list[PreparedCell]:
        """Return the cells, each with its model and the values of every input."""
        cells = [prepare_model(study, label, study.design, folder) for label in study.models]
        shared_outputs(study, {cell.name: cell.model for cell in cells})
        published_methods(study, cells[0].model)
        return cells

    def execute(
        self,
        study: ModelComparison,
        plan: list[PreparedCell],
        folder: ResultsFolder,
        *,
        workers: Workers,
        quiet: bool,
    ) -> None:
        """Run the missing runs of all cells, and the nominal run of every model.

        Parameters
        ----------
        study : ModelComparison
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
        for cell in plan:
            poses = _nominal(cell.model.run({}), study.report.strip_times)
            cell_folder(folder, cell.name).write_json(NOMINAL, poses)

    def results(self, study: ModelComparison, folder: ResultsFolder) -> ComparisonResults:
        """Return models, runs and nominal runs."""
        models = {
            label: load_study_model(study_of_model(study, label, study.design))
            for label in study.models
        }
        return ComparisonResults(
            models,
            {
                label: cell_runs(folder, label, study.design.n, model)
                for label, model in models.items()
            },
            {label: cell_folder(folder, label).read_json(NOMINAL) for label in study.models},
        )

    def analyse(self, study: ModelComparison, results: ComparisonResults) -> ComparisonAnalysis:
        """Return every number that the report prints."""
        outputs = shared_outputs(study, results.models)
        return analyse(study, results.models, results.runs, results.nominal, outputs)

    def subtitle(self, done: Done) -> str:
        """Return the line below the report's title."""
        named = ", ".join(f"{label} ({model.name})" for label, model in done.results.models.items())
        return (
            f"{done.study.design.n:,} sets of inputs through {len(done.results.models)} models: "
            f"{named}, seed {done.study.seed}"
        )

    def draw(self, done: Done) -> dict[str, Any]:
        """Return the figures by file name."""
        return draw(
            done.study, done.results.models, done.results.runs, done.results.nominal, done.analysis
        )

    def sections(self, done: Done, figures: Mapping[str, Any]) -> Sequence[Section]:
        """Return the sections of the report."""
        return sections_of(done.study, done.results.models, done.analysis, figures)

    def summarise(self, analysis: ComparisonAnalysis) -> list[str]:
        """Return the agreement of the models."""
        return summarise(analysis)


def _nominal(run: Run, times: list[float]) -> dict[str, Any]:
    """Return the outputs and poses of a nominal run for the report."""
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
