"""The Morris study: screening of many factors with a few dozen runs each."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.report import Section
from mcstudy.sampling.factors import factors_of
from mcstudy.sampling.morris import draw_trajectories
from mcstudy.sensitivity.blocks import is_enough, whole_blocks
from mcstudy.sensitivity.morris import ElementaryEffects, estimate_effects
from mcstudy.statistics import Estimate
from mcstudy.studyfile.study_outputs import report_outputs
from models.protocol import Model
from studies.factor_kind import FactorKind
from studies.kind import Finished
from studies.morris.report import draw, sections_of, summarise
from studies.morris.schema import MorrisStudy
from studies.runs import (
    ModelRuns,
    RunPlan,
    check_failure_rate,
    run_rows,
)


class Morris(FactorKind[MorrisStudy]):
    """Trajectories that change one factor of one model after the other."""

    schema = MorrisStudy

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

    def analyse(self, study: MorrisStudy, results: ModelRuns) -> dict[str, Any]:
        """Return every number that the report prints."""
        return analyse(study, results.model, results.runs)

    def subtitle(self, done: Finished[MorrisStudy, ModelRuns]) -> str:
        """Return the line below the report's title."""
        return (
            f"Morris screening by {len(done.results.runs):,} runs of the "
            f"{done.results.model.name} model: {done.analysis['trajectories']:,} trajectories, "
            f"seed {done.study.seed}"
        )

    def draw(self, done: Finished[MorrisStudy, ModelRuns]) -> dict[str, Any]:
        """Return the figures by file name."""
        return draw(done.analysis)

    def sections(
        self, done: Finished[MorrisStudy, ModelRuns], figures: Mapping[str, Any]
    ) -> Sequence[Section]:
        """Return the sections of the report."""
        return sections_of(done.study, done.results.model, done.analysis, figures)

    def summarise(self, analysis: Mapping[str, Any]) -> list[str]:
        """Return the influential factors of the reported outputs."""
        return summarise(analysis)

    def independent_rows(self, runs: pd.DataFrame, folder: ResultsFolder) -> pd.DataFrame:
        """Refuse: trajectories are no sample of the inputs."""
        raise UserError(
            f"{folder.path}: trajectories of a Morris study are no sample of its inputs; its own "
            "report ranks them"
        )


def analyse(study: MorrisStudy, model: Model, runs: pd.DataFrame) -> dict[str, Any]:
    """Return every number that the report prints.

    Parameters
    ----------
    study : MorrisStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Runs of the whole trajectories.

    Raises
    ------
    StudyError
        If more runs failed than the study allows, or no reported output can be ranked.
    """
    inputs = list(study.inputs)
    drawn = draw_trajectories(inputs, study.groups, study.design.n, study.design.levels, study.seed)
    analysis, complete = check_failure_rate(study, model, runs, drawn.block)
    names = [item.name for item in model.outputs]
    cube, kept = whole_blocks(runs[names].to_numpy(dtype=float), complete, drawn.block)
    levels = drawn.levels[: len(runs)].reshape(len(cube), drawn.block, -1)
    analysis |= {
        "groups": {name: list(members) for name, members in study.groups.items()},
        "trajectories": len(cube),
        "factors": list(drawn.factors),
        "outputs": {},
    }
    for column, item in enumerate(model.outputs):
        held = kept[:, column]
        entry: dict[str, Any] = {"unit": item.unit, "trajectories": int(held.sum())}
        if is_enough(held):
            found = estimate_effects(
                inputs, study.groups, levels[held].reshape(-1, len(inputs) + 1),
                cube[held, :, column].ravel(), study.design.levels,
                resamples=study.report.resamples, seed=study.seed,
            )  # fmt: skip
            entry["factors"] = _by_factor(found, drawn.factors)
        analysis["outputs"][item.name] = entry
    wanted = report_outputs(study, model)
    analysis["ranked"] = [name for name in wanted if "factors" in analysis["outputs"][name]]
    if not analysis["ranked"]:
        raise StudyError(
            f"{', '.join(wanted)}: too few of the {len(cube)} trajectories have no failed run and "
            "a value in every row; nothing is ranked"
        )
    return analysis


def _by_factor(found: ElementaryEffects, factors: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    table = zip(factors, found.mean, found.mu_star.T, found.sigma, strict=True)
    return {
        name: {
            "mean": float(mean),
            **Estimate(*size.tolist()).as_dict(),
            "sigma": float(spread),
            # The last factor is the dummy.
            "clear": bool(size[1] > found.mu_star[2, -1]),
        }
        for name, mean, size, spread in table
    }
