"""The method comparison: one case through several methods, each run once.

Every method's run is compared with the published tables, and the methods with each other.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.progress import say
from mcstudy.execution.results import ANALYSIS, ResultsFolder
from mcstudy.execution.workers import run_jobs
from mcstudy.figures import style
from mcstudy.report import Table, render
from mcstudy.studyfile.schema import ModelChoice, Value
from mcstudy.studyfile.study_inputs import fixed_values
from models.protocol import Model, Run, complete_status
from models.registry import load_model
from studies.method_comparison.report import compare, draw, sections_of, summarise, units_of
from studies.method_comparison.schema import MethodComparison
from studies.published_tables import PublishedTable


def compare_methods(
    study: MethodComparison,
    text: str,
    folder: ResultsFolder,
    *,
    workers: int = -1,
    quiet: bool = False,
) -> None:
    """Run every method once and write the results folder.

    Parameters
    ----------
    study : MethodComparison
        Checked study file.
    text : str
        The study file as written.
    folder : ResultsFolder
        Results folder of the study.
    workers : int
        Processes, -1 for one a core.
    quiet : bool
        Print nothing.

    Raises
    ------
    UserError
        If the study does not fit a model.
    StudyError
        If a run failed.
    """
    models = {label: _load(label, choice) for label, choice in study.models.items()}
    _check(study, models)
    compare(study, models, {})
    # The dearest first: the others fill the remaining time.
    order = sorted(models, key=lambda label: -models[label].cost)
    say(f"one run of each of {', '.join(order)}", quiet=quiet)
    job = partial(_run, study.fixed)
    done = run_jobs(job, [(label, study.models[label]) for label in order], workers)
    by_label = dict(zip(order, done, strict=True))
    runs = {label: by_label[label] for label in models}
    for label, run in runs.items():
        if run.status not in complete_status(models[label]):
            raise StudyError(f"models.{label}: the run ended with status {run.status!r}")
    tables = compare(study, models, {label: run.outputs for label, run in runs.items()})
    _write(study, text, models, runs, tables, folder)


def summarise_methods(study: MethodComparison, folder: ResultsFolder) -> list[Table]:
    """Return the tables of a results folder in brief.

    Parameters
    ----------
    study : MethodComparison
        Checked study file.
    folder : ResultsFolder
        Finished.
    """
    models = {label: _load(label, choice) for label, choice in study.models.items()}
    methods = folder.read_json(ANALYSIS)["methods"]
    return summarise(study, models, {label: row["outputs"] for label, row in methods.items()})


def _load(label: str, choice: ModelChoice) -> Model:
    try:
        return load_model(choice.name, choice.options)
    except (ValueError, TypeError) as error:
        raise UserError(f"models.{label}: {error}") from None


def _check(study: MethodComparison, models: Mapping[str, Model]) -> None:
    """Raise ``UserError`` if a model has no such input, or no model an output of a table."""
    for label, model in models.items():
        try:
            fixed_values(study.fixed, model)
        except UserError as error:
            raise UserError(f"models.{label}: {error}") from None
    known = units_of(models)
    for k, table in enumerate(study.tables):
        for name in table.units:
            if name not in known:
                raise UserError(
                    f"tables[{k}].units: no model has an output {name!r}; they have "
                    f"{', '.join(known)}"
                )


def _run(fixed: Mapping[str, Value], method: tuple[str, ModelChoice]) -> Run:
    """Return a run of one method, with histories and scene."""
    model = _load(*method)
    return model.run(fixed_values(fixed, model))


def _write(
    study: MethodComparison,
    text: str,
    models: Mapping[str, Model],
    runs: Mapping[str, Run],
    tables: Sequence[PublishedTable],
    folder: ResultsFolder,
) -> None:
    analysis: dict[str, Any] = {
        "kind": study.kind,
        "methods": {
            label: {
                "model": models[label].name,
                "version": models[label].version,
                "status": run.status,
                "end_reason": run.end_reason,
                "outputs": dict(run.outputs),
            }
            for label, run in runs.items()
        },
    }
    with folder.open_for_writing():
        folder.write_text("study.toml", text)
        folder.write_json(ANALYSIS, analysis)
        for k, run in enumerate(runs.values()):
            folder.add_histories(k, run.histories)
        figures = draw(study, runs)
        style.save(figures, folder.path / "figures")
        named = ", ".join(f"{label} ({model.name})" for label, model in models.items())
        folder.write_text(
            "report.html",
            render(
                study.title,
                f"One set of inputs through {len(models)} methods: {named}",
                sections_of(study, models, runs, tables, figures),
            ),
        )
