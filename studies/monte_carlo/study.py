"""The Monte Carlo study: sample the inputs, run the model, describe the outputs."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.report import Section, Table
from mcstudy.studyfile.study_outputs import report_outputs
from models.protocol import Model
from studies.explorer import explorer_pages
from studies.kind import Finished, StudyKind
from studies.monte_carlo.analysis import MonteCarloAnalysis, analyse, marks_of
from studies.monte_carlo.design import plan_design, run_design, runs_of_design
from studies.monte_carlo.report import draw, sections_of, summarise
from studies.monte_carlo.schema import MonteCarloStudy
from studies.runs import ModelRuns, RunPlan, load_study_model, run_again
from studies.stored_scenes import Measured, keep_scenes

Done = Finished[MonteCarloStudy, ModelRuns, MonteCarloAnalysis]


class MonteCarlo(StudyKind[MonteCarloStudy, RunPlan, ModelRuns, MonteCarloAnalysis]):
    """Independent or stratified samples of the inputs of one model."""

    schema = MonteCarloStudy
    analysis = MonteCarloAnalysis

    def plan(self, study: MonteCarloStudy, folder: ResultsFolder) -> RunPlan:
        """Return the model and the sampled values of its inputs."""
        model = load_study_model(study)
        report_outputs(study, model)
        marks_of(study, model)
        return plan_design(study, model, folder)

    def execute(
        self,
        study: MonteCarloStudy,
        plan: RunPlan,
        folder: ResultsFolder,
        *,
        workers: Workers,
        quiet: bool,
    ) -> None:
        """Run the missing runs of the design.

        Parameters
        ----------
        study : MonteCarloStudy
            Checked study file.
        plan : RunPlan
            From ``plan``.
        folder : ResultsFolder
            Open for writing.
        workers : int or str
            Processes, -1 for one per core, or the address of a dask scheduler.
        quiet : bool
            No progress line.
        """
        run_design(study, plan, folder, workers=workers, quiet=quiet)

    def keep(self, study: MonteCarloStudy, results: ModelRuns, folder: ResultsFolder) -> None:
        """Keep the histories of the first runs, and notable runs in three dimensions."""
        model, runs = results.model, results.runs
        _keep_histories(study, model, runs, folder)
        near = [
            Measured(output, mark.value, float(runs[output].std()) or 1.0)
            for output, marks in marks_of(study, model).items()
            for mark in marks
            if mark.kind == "observed"
        ]
        keep_scenes(study, model, runs, folder, near)

    def results(self, study: MonteCarloStudy, folder: ResultsFolder) -> ModelRuns:
        """Return the model and the runs of the design."""
        return runs_of_design(study, folder)

    def analyse(self, study: MonteCarloStudy, results: ModelRuns) -> MonteCarloAnalysis:
        """Return every number that the report prints."""
        return analyse(study, results.model, results.runs)

    def subtitle(self, done: Done) -> str:
        """Return the line below the report's title."""
        return (
            f"Monte Carlo study of {len(done.results.runs):,} runs of the "
            f"{done.results.model.name} model, {done.study.design.method} design, "
            f"seed {done.study.seed}"
        )

    def draw(self, done: Done) -> dict[str, Any]:
        """Return the figures by file name."""
        return draw(done.study, done.results.model, done.results.runs, done.analysis)

    def pages(
        self, study: MonteCarloStudy, results: ModelRuns, folder: ResultsFolder
    ) -> Mapping[str, str]:
        """Return the explorer of the runs."""
        return explorer_pages(study, results.model, results.runs, folder)

    def sections(self, done: Done, figures: Mapping[str, Any]) -> Sequence[Section]:
        """Return the sections of the report."""
        return sections_of(
            done.study, done.results.model, done.results.runs, done.analysis, figures
        )

    def summarise(self, analysis: MonteCarloAnalysis) -> list[Table]:
        """Return the distributions of the reported outputs."""
        return summarise(analysis)

    def independent_rows(self, runs: pd.DataFrame, folder: ResultsFolder) -> pd.DataFrame:
        """Return all runs: each is an independent draw."""
        return runs


def _keep_histories(
    study: MonteCarloStudy, model: Model, runs: pd.DataFrame, folder: ResultsFolder
) -> None:
    """Write the time histories of the study's first runs."""
    for k in range(min(study.report.histories, len(runs))):
        row = runs.iloc[k]
        run = run_again(model, row)
        folder.add_histories(int(row["run"]), run.histories)
