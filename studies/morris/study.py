"""The Morris study: which of many factors matter at all, for a few dozen runs each."""

from typing import Any

import pandas as pd

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.sampling.morris import draw_trajectories
from mcstudy.sensitivity.blocks import is_enough, whole_blocks
from mcstudy.sensitivity.morris import ElementaryEffects, estimate_effects
from mcstudy.statistics import Estimate
from mcstudy.studyfile import config
from mcstudy.studyfile.config import MorrisStudy, load_study
from models.protocol import Model
from studies.morris.report import draw, sections_of
from studies.publishing import publish
from studies.runs import check_failure_rate, complete_blocks, load_study_model, run_rows


def run_morris(
    study: MorrisStudy,
    text: str,
    folder: ResultsFolder,
    *,
    workers: Workers = -1,
    quiet: bool = False,
) -> dict[str, Any]:
    """Run a Morris study, or go on with it, and write its results folder.

    Parameters
    ----------
    study : MorrisStudy
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
        If the study does not fit the model or the folder, or its inputs are dependent.
    StudyError
        If too many runs failed.
    """
    model = load_study_model(study)
    config.report_outputs(study, model)
    config.check_independent(study)
    design = study.design
    drawn = draw_trajectories(list(study.inputs), study.groups, design.n, design.levels, study.seed)
    columns = config.map_inputs(study, model, drawn.uniforms)
    folder.check_same_study(config.numbers_digest(study, model))
    with folder.open_for_writing():
        folder.write_text("study.toml", text)
        run_rows(
            study, model, columns, folder,
            design={"method": "morris", "n": len(drawn.levels), "block": drawn.block,
                    "trajectories": design.n},
            replicate=drawn.trajectory, workers=workers, quiet=quiet,
        )  # fmt: skip
        return build_report(folder)


def build_report(folder: ResultsFolder) -> dict[str, Any]:
    """Analyse a results folder and write its figures and report, without running the model.

    Raises
    ------
    UserError
        If the folder is not one of a Morris study, or holds too few runs yet.
    StudyError
        If failed runs leave too few trajectories.
    """
    study = load_study(folder.path / "study.toml")
    if not isinstance(study, MorrisStudy):
        raise UserError(f"{folder.path}: is not the folder of a Morris study")
    model = load_study_model(study)
    runs = complete_blocks(folder, model)
    analysis = analyse(study, model, runs)
    subtitle = (
        f"Morris screening by {len(runs):,} runs of the {model.name} model: "
        f"{analysis['trajectories']:,} trajectories, seed {study.seed}"
    )
    return publish(
        folder, study.title, subtitle, analysis, draw,
        lambda held, figures: sections_of(study, model, held, figures),
    )  # fmt: skip


def analyse(study: MorrisStudy, model: Model, runs: pd.DataFrame) -> dict[str, Any]:
    """Return every number that the report prints.

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
    wanted = config.report_outputs(study, model)
    analysis["ranked"] = [name for name in wanted if "factors" in analysis["outputs"][name]]
    if not analysis["ranked"]:
        raise StudyError(
            f"{', '.join(wanted)}: too few of the {len(cube)} trajectories have no failed run and "
            "a value in every row; nothing is ranked"
        )
    return analysis


def _by_factor(found: ElementaryEffects, factors: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    table = zip(factors, found.mean, found.mean_size.T, found.spread, strict=True)
    return {
        name: {
            "mean": float(mean),
            **Estimate(*size.tolist()).as_dict(),
            "spread": float(spread),
            # The last factor is the dummy.
            "clear": bool(size[1] > found.mean_size[2, -1]),
        }
        for name, mean, size, spread in table
    }
