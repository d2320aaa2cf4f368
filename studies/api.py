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

from mcstudy.errors import UserError
from mcstudy.execution.results import ANALYSIS, ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.files import read_study_text
from mcstudy.report import Table
from mcstudy.studyfile.lines import naming_lines
from mcstudy.studyfile.schema import AnyStudy, CommonStudy
from models.protocol import Run
from studies.kinds import KINDS, load_study, parse_study
from studies.method_comparison.schema import MethodComparison
from studies.method_comparison.study import compare_methods, summarise_methods
from studies.published_tables import PublishedTable
from studies.reconstruction.schema import Reconstruction
from studies.reconstruction.study import reconstruct, write_reconstruction
from studies.reconstruction.variants import run_variants
from studies.runs import columns_of, load_study_model, run_again


def results_folder(study: AnyStudy, out: Path | str | None = None) -> ResultsFolder:
    """Return the results folder of a study: ``out`` or ``results/<name>``."""
    return ResultsFolder(Path("results") / study.name if out is None else Path(out))


def run_study(
    path: Path | str,
    *,
    out: Path | str | None = None,
    workers: Workers = -1,
    quiet: bool = True,
) -> ResultsFolder:
    """Run a study file of any sampled kind, or resume it where it stopped; or compare methods.

    Parameters
    ----------
    path : path or str
        Study file (TOML).
    out : path or str, optional
        Results folder, by default ``results/<name>``.
    workers : int or str
        Processes, -1 for one per core, or the address of a dask scheduler.
    quiet : bool
        No progress line.

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
    text = read_study_text(path)
    study = parse_study(text, str(path))
    folder = results_folder(study, out)
    if isinstance(study, MethodComparison):
        if isinstance(workers, str):
            raise UserError(f"{path}: a {study.kind} has one run a method; leave --cluster out")
        with naming_lines(str(path), text):
            compare_methods(study, text, folder, workers=workers, quiet=quiet)
        return folder
    if study.kind not in KINDS:
        raise UserError(f"{path}: kind {study.kind!r} is run by 'mcstudy reconstruct'")
    with naming_lines(str(path), text):
        KINDS[study.kind].run(study, text, folder, workers=workers, quiet=quiet)
    return folder


def build_report(folder: ResultsFolder) -> dict[str, Any]:
    """Rebuild analysis, figures and report of a results folder, without running the model.

    Raises
    ------
    UserError
        If the folder holds no study that has runs.
    """
    study = load_study(folder.path / "study.toml")
    if study.kind not in KINDS:
        verb = "run" if isinstance(study, MethodComparison) else "reconstruct"
        raise UserError(f"{folder.path}: a {study.kind} is drawn again by 'mcstudy {verb}'")
    KINDS[study.kind].build_report(study, folder)
    return folder.read_json(ANALYSIS)


def summarise(folder: ResultsFolder) -> list[str | Table]:
    """Return the analysis of a study's folder in a few paragraphs and tables."""
    study = load_study(folder.path / "study.toml")
    if isinstance(study, MethodComparison):
        return list(summarise_methods(study, folder))
    kind = KINDS[study.kind]
    analysis = folder.read_analysis(kind.analysis)
    counts = ", ".join(f"{n} {status}" for status, n in analysis.status.items())
    return [*kind.summarise(analysis), f"{analysis.runs} runs: {counts}"]


def run_case(
    path: Path | str, *, out: Path | str | None = None, quiet: bool = True
) -> tuple[Run, list[PublishedTable], ResultsFolder]:
    """Run a reconstruction file and write its folder.

    Parameters
    ----------
    path : path or str
        Study file of a reconstruction (TOML).
    out : path or str, optional
        Results folder, by default ``results/<name>``.
    quiet : bool
        Show no progress of a long run.

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
    text = read_study_text(path)
    study = parse_study(text, str(path))
    if not isinstance(study, Reconstruction):
        raise UserError(f"{path}: kind {study.kind!r} is run by 'mcstudy run'")
    folder = results_folder(study, out)
    with naming_lines(str(path), text):
        run, tables = reconstruct(study, quiet=quiet)
    variants = run_variants(study)
    write_reconstruction(study, text, run, tables, folder, variants)
    return run, tables, folder


def rerun(results: ResultsFolder, run: int) -> Run:
    """Run one row of a study again, with its time histories; the numbers are the same bits.

    Raises
    ------
    UserError
        If the folder has no such run.
    """
    study = load_study(results.path / "study.toml")
    if not isinstance(study, CommonStudy):
        raise UserError(f"{results.path}: give the folder of one of its models, under cells")
    model = load_study_model(study)
    runs = results.runs(columns_of(model))
    row = runs[runs["run"] == run]
    if row.empty:
        raise UserError(f"{results.path}: has no run {run}, only 0 to {runs['run'].max()}")
    return run_again(model, row.iloc[0])
