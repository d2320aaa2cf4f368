"""The Sobol' study: how much of the variance of each output each factor explains."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from mcstudy.execution.progress import say
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.report import Section
from mcstudy.sampling.factors import factors_of
from mcstudy.sampling.saltelli import block_size, draw_saltelli, is_base_row
from mcstudy.studyfile.identity import numbers_digest
from mcstudy.studyfile.study_inputs import check_independent, map_inputs
from mcstudy.studyfile.study_outputs import report_outputs
from studies.kind import StudyKind
from studies.runs import ModelRuns, RunPlan, complete_blocks, load_study_model, run_rows
from studies.sobol.analysis import analyse, widest_interval
from studies.sobol.report import draw, sections_of, summarise
from studies.sobol.schema import SobolStudy


class Sobol(StudyKind[SobolStudy, RunPlan, ModelRuns]):
    """Saltelli's design of one model, doubled until the indices are accurate enough.

    It doubles from ``design.start`` base points until the widest interval of a total index of the
    reported outputs is below ``design.tolerance``, or ``design.n`` is reached; without a tolerance
    it goes to ``design.n`` at once. Earlier runs are never repeated.
    """

    schema = SobolStudy

    def plan(self, study: SobolStudy, folder: ResultsFolder) -> RunPlan:
        """Return the model and the values of its inputs over the whole design.

        Parameters
        ----------
        study : SobolStudy
            Checked study file.
        folder : ResultsFolder
            Results folder of the study.
        """
        model = load_study_model(study)
        report_outputs(study, model)
        check_independent(study)
        design = study.design
        drawn = draw_saltelli(
            list(study.inputs), study.groups, design.n, study.seed, second_order=design.second_order
        )
        columns = map_inputs(study, model, drawn.uniforms)
        folder.check_same_study(numbers_digest(study, model))
        return RunPlan(model, columns, drawn.scramble)

    def execute(
        self,
        study: SobolStudy,
        plan: RunPlan,
        folder: ResultsFolder,
        *,
        workers: Workers,
        quiet: bool,
    ) -> None:
        """Run the design, doubling it as far as needed.

        Parameters
        ----------
        study : SobolStudy
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
        design = study.design
        factors = factors_of(list(study.inputs), study.groups)
        block = block_size(factors, second_order=design.second_order)
        n = design.n if design.tolerance is None else min(design.start, design.n)
        while True:
            rows = n * block
            columns = {name: values[:rows] for name, values in plan.columns.items()}
            runs = run_rows(
                study, plan.model, columns, folder,
                design={"method": "saltelli", "n": rows, "block": block, "base_points": n},
                replicate=plan.replicate[:rows], workers=workers, quiet=quiet,
            )  # fmt: skip
            if design.tolerance is None or n >= design.n:
                return
            width = widest_interval(study, plan.model, runs)
            known = "cannot be estimated yet" if math.isinf(width) else f"{width:.3f}"
            say(f"{n} base points: widest interval of a total index {known}", quiet=quiet)
            if width <= design.tolerance:
                return
            n *= 2

    def results(self, study: SobolStudy, folder: ResultsFolder) -> ModelRuns:
        """Return the model and the runs of the base points that are whole.

        Parameters
        ----------
        study : SobolStudy
            Checked study file.
        folder : ResultsFolder
            Results folder of the study.
        """
        model = load_study_model(study)
        return ModelRuns(model, complete_blocks(folder, model))

    def analyse(self, study: SobolStudy, results: ModelRuns) -> dict[str, Any]:
        """Return every number that the report prints.

        Parameters
        ----------
        study : SobolStudy
            Checked study file.
        results : ModelRuns
            From ``results``.
        """
        return analyse(study, results.model, results.runs)

    def subtitle(self, study: SobolStudy, results: ModelRuns, analysis: Mapping[str, Any]) -> str:
        """Return the line below the report's title.

        Parameters
        ----------
        study : SobolStudy
            Checked study file.
        results : ModelRuns
            From ``results``.
        analysis : mapping
            From ``analyse``, as read from ``analysis.json``.
        """
        return (
            f"Sobol' study of {len(results.runs):,} runs of the {results.model.name} model: "
            f"{analysis['base_points']:,} base points, seed {study.seed}"
        )

    def draw(
        self, study: SobolStudy, results: ModelRuns, analysis: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Return the figures by file name.

        Parameters
        ----------
        study : SobolStudy
            Checked study file.
        results : ModelRuns
            From ``results``.
        analysis : mapping
            From ``analyse``, as read from ``analysis.json``.
        """
        return draw(analysis)

    def sections(
        self,
        study: SobolStudy,
        results: ModelRuns,
        analysis: Mapping[str, Any],
        figures: Mapping[str, Any],
    ) -> Sequence[Section]:
        """Return the sections of the report.

        Parameters
        ----------
        study : SobolStudy
            Checked study file.
        results : ModelRuns
            From ``results``.
        analysis : mapping
            From ``analyse``, as read from ``analysis.json``.
        figures : mapping
            From ``draw``: figures by file name.
        """
        return sections_of(study, results.model, analysis, figures)

    def summarise(self, analysis: Mapping[str, Any]) -> list[str]:
        """Return the influential factors of the reported outputs."""
        return summarise(analysis)

    def independent_rows(self, runs: pd.DataFrame, folder: ResultsFolder) -> pd.DataFrame:
        """Return the rows of Saltelli's matrices A and B.

        Parameters
        ----------
        runs : DataFrame
            One row a run.
        folder : ResultsFolder
            Results folder of the study.
        """
        return runs[is_base_row(runs["run"].to_numpy(), folder.design()["block"])]
