"""The Sobol' study: how much of the variance of each output each factor explains."""

import math
from typing import Any

from mcstudy.errors import UserError
from mcstudy.execution.progress import say
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.sampling.saltelli import draw_saltelli
from mcstudy.studyfile import config
from mcstudy.studyfile.config import SobolStudy, load_study
from studies.publishing import publish
from studies.runs import complete_blocks, load_study_model, run_rows
from studies.sobol.analysis import analyse, widest_interval
from studies.sobol.report import draw, sections_of


def run_sobol(
    study: SobolStudy,
    text: str,
    folder: ResultsFolder,
    *,
    workers: Workers = -1,
    quiet: bool = False,
) -> dict[str, Any]:
    """Run a Sobol' study, or go on with it, and write its results folder.

    The design doubles from ``design.start`` base points until the widest interval of a total index
    of the reported outputs is below ``design.tolerance``, or ``design.n`` is reached; without a
    tolerance it goes to ``design.n`` at once. Earlier runs are never repeated.

    Parameters
    ----------
    study : SobolStudy
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
    drawn = draw_saltelli(
        list(study.inputs), study.groups, design.n, study.seed, second_order=design.second_order
    )
    columns = config.map_inputs(study, model, drawn.uniforms)
    folder.check_same_study(config.numbers_digest(study, model))
    n = design.n if design.tolerance is None else min(design.start, design.n)
    with folder.open_for_writing():
        folder.write_text("study.toml", text)
        while True:
            rows = n * drawn.block
            runs = run_rows(
                study, model, {name: values[:rows] for name, values in columns.items()}, folder,
                design={"method": "saltelli", "n": rows, "block": drawn.block, "base_points": n},
                replicate=drawn.scramble[:rows], workers=workers, quiet=quiet,
            )  # fmt: skip
            if design.tolerance is None or n >= design.n:
                break
            width = widest_interval(study, model, runs)
            known = "cannot be estimated yet" if math.isinf(width) else f"{width:.3f}"
            say(f"{n} base points: widest interval of a total index {known}", quiet=quiet)
            if width <= design.tolerance:
                break
            n *= 2
        return build_report(folder)


def build_report(folder: ResultsFolder) -> dict[str, Any]:
    """Analyse a results folder and write its figures and report, without running the model.

    Raises
    ------
    UserError
        If the folder is not one of a Sobol' study, or holds too few runs yet.
    StudyError
        If failed runs leave too few base points.
    """
    study = load_study(folder.path / "study.toml")
    if not isinstance(study, SobolStudy):
        raise UserError(f"{folder.path}: is not the folder of a Sobol' study")
    model = load_study_model(study)
    runs = complete_blocks(folder, model)
    analysis = analyse(study, model, runs)
    subtitle = (
        f"Sobol' study of {len(runs):,} runs of the {model.name} model: "
        f"{analysis['base_points']:,} base points, seed {study.seed}"
    )
    return publish(
        folder, study.title, subtitle, analysis, draw,
        lambda held, figures: sections_of(study, model, held, figures),
    )  # fmt: skip
