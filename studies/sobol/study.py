"""The Sobol' study: how much of the variance of each output each factor explains."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.execution.progress import say
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.report import Section
from mcstudy.sampling.factors import factors_of
from mcstudy.sampling.saltelli import block_size, draw_saltelli, is_base_row
from studies.factor_kind import FactorKind
from studies.kind import Finished
from studies.runs import ModelRuns, RunPlan, run_rows
from studies.sobol.analysis import SobolAnalysis, analyse, widest_interval
from studies.sobol.report import draw, sections_of, summarise
from studies.sobol.schema import SobolStudy

Done = Finished[SobolStudy, ModelRuns, SobolAnalysis]


class Sobol(FactorKind[SobolStudy, SobolAnalysis]):
    """Saltelli's design of one model, doubled until the indices are accurate enough.

    It doubles from ``design.start`` base points until the widest interval of a total index of the
    reported outputs is below ``design.tolerance``, or ``design.n`` is reached; without a tolerance
    it goes to ``design.n`` at once. Earlier runs are never repeated.
    """

    schema = SobolStudy
    analysis = SobolAnalysis

    def design(self, study: SobolStudy) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the design and the independent part of each row."""
        design = study.design
        drawn = draw_saltelli(
            list(study.inputs), study.groups, design.n, study.seed, second_order=design.second_order
        )
        return drawn.uniforms, drawn.scramble

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

    def analyse(self, study: SobolStudy, results: ModelRuns) -> SobolAnalysis:
        """Return every number that the report prints."""
        return analyse(study, results.model, results.runs)

    def subtitle(self, done: Done) -> str:
        """Return the line below the report's title."""
        return (
            f"Sobol' study of {len(done.results.runs):,} runs of the "
            f"{done.results.model.name} model: {done.analysis.base_points:,} base points, "
            f"seed {done.study.seed}"
        )

    def draw(self, done: Done) -> dict[str, Any]:
        """Return the figures by file name."""
        return draw(done.analysis)

    def sections(self, done: Done, figures: Mapping[str, Any]) -> Sequence[Section]:
        """Return the sections of the report."""
        return sections_of(done.study, done.results.model, done.analysis, figures)

    def summarise(self, analysis: SobolAnalysis) -> list[str]:
        """Return the influential factors of the reported outputs."""
        return summarise(analysis)

    def independent_rows(self, runs: pd.DataFrame, folder: ResultsFolder) -> pd.DataFrame:
        """Return the rows of Saltelli's matrices A and B."""
        return runs[is_base_row(runs["run"].to_numpy(), folder.design()["block"])]
