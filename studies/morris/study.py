"""The Morris study: screening of many factors with a few dozen runs each."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.report import Section
from mcstudy.sampling.factors import factors_of
from mcstudy.sampling.morris import draw_trajectories
from studies.factor_kind import FactorKind
from studies.kind import Finished
from studies.morris.analysis import MorrisAnalysis, analyse
from studies.morris.report import draw, sections_of, summarise
from studies.morris.schema import MorrisStudy
from studies.runs import (
    ModelRuns,
    RunPlan,
    run_rows,
)

Done = Finished[MorrisStudy, ModelRuns, MorrisAnalysis]


class Morris(FactorKind[MorrisStudy, MorrisAnalysis]):
    """Trajectories that change one factor of one model after the other."""

    schema = MorrisStudy
    analysis = MorrisAnalysis

    def design(self, study: MorrisStudy) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the design and the independent part of each row."""
        design = study.design
        drawn = draw_trajectories(
            list(study.inputs), study.groups, design.n, design.levels, study.seed
        )
        return drawn.uniforms, drawn.trajectory

    def execute(
        self,
        study: MorrisStudy,
        plan: RunPlan,
        folder: ResultsFolder,
        *,
        workers: Workers,
        quiet: bool,
    ) -> None:
        """Run the missing runs of the trajectories.

        Parameters
        ----------
        study : MorrisStudy
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
        block = len(factors_of(list(study.inputs), study.groups)) + 1
        run_rows(
            study, plan.model, plan.columns, folder,
            design={"method": "morris", "n": len(plan.replicate), "block": block,
                    "trajectories": study.design.n},
            replicate=plan.replicate, workers=workers, quiet=quiet,
        )  # fmt: skip

    def analyse(self, study: MorrisStudy, results: ModelRuns) -> MorrisAnalysis:
        """Return every number that the report prints."""
        return analyse(study, results.model, results.runs)

    def subtitle(self, done: Done) -> str:
        """Return the line below the report's title."""
        return (
            f"Morris screening by {len(done.results.runs):,} runs of the "
            f"{done.results.model.name} model: {done.analysis.trajectories:,} trajectories, "
            f"seed {done.study.seed}"
        )

    def draw(self, done: Done) -> dict[str, Any]:
        """Return the figures by file name."""
        return draw(done.analysis)

    def sections(self, done: Done, figures: Mapping[str, Any]) -> Sequence[Section]:
        """Return the sections of the report."""
        return sections_of(done.study, done.results.model, done.analysis, figures)

    def summarise(self, analysis: MorrisAnalysis) -> list[str]:
        """Return the influential factors of the reported outputs."""
        return summarise(analysis)

    def independent_rows(self, runs: pd.DataFrame, folder: ResultsFolder) -> pd.DataFrame:
        """Refuse: trajectories are no sample of the inputs."""
        raise UserError(
            f"{folder.path}: trajectories of a Morris study are no sample of its inputs; its own "
            "report ranks them"
        )
