"""The posterior study: a bank of runs over the priors, and what the evidence says.

The bank does not depend on the evidence: other evidence, narrower priors and other propositions
cost no run (``mcstudy infer``).
"""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.report import Section, Table
from mcstudy.studyfile.study_outputs import report_outputs
from studies.explorer import explorer_pages
from studies.kind import Finished, StudyKind
from studies.monte_carlo.design import plan_design, run_design, runs_of_design
from studies.posterior.analysis import analyse
from studies.posterior.evidence import check_tables, items_of
from studies.posterior.numbers import PosteriorAnalysis
from studies.posterior.report import draw, sections_of, summarise
from studies.posterior.schema import PosteriorStudy
from studies.runs import ModelRuns, RunPlan, load_study_model
from studies.stored_scenes import Measured, keep_scenes

Done = Finished[PosteriorStudy, ModelRuns, PosteriorAnalysis]


class PosteriorOf(StudyKind[PosteriorStudy, RunPlan, ModelRuns, PosteriorAnalysis]):
    """What evidence says of the inputs of one model."""

    schema = PosteriorStudy
    analysis = PosteriorAnalysis

    def plan(self, study: PosteriorStudy, folder: ResultsFolder) -> RunPlan:
        """Return the model and the sampled values of its inputs."""
        model = load_study_model(study)
        report_outputs(study, model)
        check_tables(study, study, model)
        return plan_design(study, model, folder)

    def execute(
        self,
        study: PosteriorStudy,
        plan: RunPlan,
        folder: ResultsFolder,
        *,
        workers: Workers,
        quiet: bool,
    ) -> None:
        """Run the missing runs of the bank.

        Parameters
        ----------
        study : PosteriorStudy
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

    def keep(self, study: PosteriorStudy, results: ModelRuns, folder: ResultsFolder) -> None:
        """Keep notable runs in three dimensions, those nearest to the evidence first."""
        near = [
            Measured(item.name, item.value, item.sd)
            for item in items_of(study, results.model).values()
            if item.value is not None
        ]
        keep_scenes(study, results.model, results.runs, folder, near)

    def results(self, study: PosteriorStudy, folder: ResultsFolder) -> ModelRuns:
        """Return the model and the runs of the design."""
        return runs_of_design(study, folder)

    def analyse(self, study: PosteriorStudy, results: ModelRuns) -> PosteriorAnalysis:
        """Return every number that the report prints."""
        return analyse(study, study, results.model, results.runs)

    def subtitle(self, done: Done) -> str:
        """Return the line below the report's title."""
        return (
            f"Evidence of {len(done.study.evidence)} items on a bank of "
            f"{len(done.results.runs):,} runs of the {done.results.model.name} model, "
            f"seed {done.study.seed}"
        )

    def draw(self, done: Done) -> dict[str, Any]:
        """Return the figures by file name."""
        return draw(done.analysis)

    def pages(
        self, study: PosteriorStudy, results: ModelRuns, folder: ResultsFolder
    ) -> Mapping[str, str]:
        """Return the explorer of the runs."""
        return explorer_pages(study, results.model, results.runs, folder)

    def sections(self, done: Done, figures: Mapping[str, Any]) -> Sequence[Section]:
        """Return the sections of the report."""
        return sections_of(done.analysis, figures)

    def summarise(self, analysis: PosteriorAnalysis) -> list[str | Table]:
        """Return target and likelihood ratios."""
        return summarise(analysis)

    def independent_rows(self, runs: pd.DataFrame, folder: ResultsFolder) -> pd.DataFrame:
        """Return all runs: the bank is a sample of the priors."""
        return runs
