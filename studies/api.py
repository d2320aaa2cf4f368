"""Studies from Python: what the command line does, as functions.

Examples
--------
>>> from studies.api import rerun, run_study
>>> results = run_study("configs/paper_study.toml", workers=2)      # doctest: +SKIP
>>> runs = results.runs()                                           # doctest: +SKIP
>>> head = rerun(results, run=17).histories["head"]                 # doctest: +SKIP
"""

from pathlib import Path
from typing import Any

from mcstudy.config import MonteCarloStudy, Reconstruction, SobolStudy, Study, load_study
from mcstudy.errors import UserError
from mcstudy.results import ResultsFolder
from models.protocol import Run
from studies import monte_carlo, sobol
from studies.execution import load_study_model
from studies.monte_carlo import run_monte_carlo
from studies.reconstruction import Comparison, reconstruct, write_reconstruction
from studies.sobol import run_sobol


def results_folder(study: Study, out: Path | str | None = None) -> ResultsFolder:
    """Return the results folder of a study: ``out`` or ``results/<name>``."""
    return ResultsFolder(Path("results") / study.name if out is None else Path(out))


def run_study(
    path: Path | str,
    *,
    out: Path | str | None = None,
    workers: int = -1,
    quiet: bool = True,
) -> ResultsFolder:
    """Run a Monte Carlo or Sobol' study file, or go on with it where it stopped.

    Parameters
    ----------
    path : study file.
    out : results folder, by default ``results/<name>``.
    workers : processes, -1 for one a core.
    quiet : print no progress line.

    Returns
    -------
    ResultsFolder
        ``runs()`` gives the table, ``read_json("analysis.json")`` the numbers of the report.

    Raises
    ------
    UserError
        If the file is wrong or of another kind.
    StudyError
        If too many runs failed.
    """
    study = load_study(path)
    folder = results_folder(study, out)
    text = Path(path).read_text(encoding="utf-8")
    if isinstance(study, MonteCarloStudy):
        run_monte_carlo(study, text, folder, workers=workers, quiet=quiet)
    elif isinstance(study, SobolStudy):
        run_sobol(study, text, folder, workers=workers, quiet=quiet)
    else:
        raise UserError(f"{path}: kind {study.kind!r} is run by 'mcstudy reconstruct'")
    return folder


def build_report(folder: ResultsFolder) -> dict[str, Any]:
    """Rebuild analysis, figures and report of a results folder, without running the model.

    Raises
    ------
    UserError
        If the folder holds no study that has a report of its own.
    """
    study = load_study(folder.path / "study.toml")
    if isinstance(study, SobolStudy):
        return sobol.build_report(folder)
    return monte_carlo.build_report(folder)


def run_case(
    path: Path | str, *, out: Path | str | None = None
) -> tuple[Run, list[Comparison], ResultsFolder]:
    """Run a reconstruction file and write its folder.

    Returns
    -------
    run, tables, folder
        The run with histories and scene, its comparison tables, and where the report is.

    Raises
    ------
    UserError
        If the file is wrong or of another kind.
    StudyError
        If the run failed.
    """
    study = load_study(path)
    if not isinstance(study, Reconstruction):
        raise UserError(f"{path}: kind {study.kind!r} is run by 'mcstudy run'")
    folder = results_folder(study, out)
    run, tables = reconstruct(study)
    write_reconstruction(study, Path(path).read_text(encoding="utf-8"), run, tables, folder)
    return run, tables, folder


def rerun(results: ResultsFolder, run: int) -> Run:
    """Run one row of a study again, with its time histories; the numbers are the same bits.

    Raises
    ------
    UserError
        If the folder has no such run.
    """
    study = load_study(results.path / "study.toml")
    model = load_study_model(study)
    runs = results.runs()
    row = runs[runs["run"] == run]
    if row.empty:
        raise UserError(f"{results.path}: has no run {run}, only 0 to {runs['run'].max()}")
    return model.run({item.name: float(row[item.name].iloc[0]) for item in model.inputs})
