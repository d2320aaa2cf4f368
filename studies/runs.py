"""The runs of a study: its model, parallel evaluations, manifest and table."""

import os
import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.errors import UserError
from mcstudy.execution import runner
from mcstudy.execution.evaluator import Evaluator
from mcstudy.execution.failures import Ending, Failures, endings, locate_failures
from mcstudy.execution.progress import Progress
from mcstudy.execution.results import ResultsFolder, check_failures, digest, status_counts
from mcstudy.execution.workers import Workers, parallel_backend
from mcstudy.sensitivity.blocks import MIN_BLOCKS
from mcstudy.studyfile.identity import hash_of, numbers_digest
from mcstudy.studyfile.schema import RUN_TIME, CommonStudy, SampledStudy
from mcstudy.studyfile.study_outputs import report_outputs
from models.protocol import Model, Run, complete_status
from models.registry import load_model
from studies import worker

PACKAGES = ("numpy", "scipy", "numba", "pandas", "joblib", "pyarrow", "salib")


class DescribedStudy(Protocol):
    """A study of runs: its kind, the inputs that it samples, the failures that it allows."""

    @property
    def kind(self) -> str:
        """Name of the kind."""

    @property
    def inputs(self) -> Mapping[str, Any]:
        """Sampled inputs by name."""

    @property
    def max_failure_rate(self) -> float:
        """Share of the runs that may fail."""


@dataclass(frozen=True)
class RunEnds:
    """How the runs of a study ended: the first part of every analysis.

    Attributes
    ----------
    kind : kind of the study.
    runs : number of runs.
    status : number of runs by status.
    endings : outcomes, the most frequent first.
    failures : number and location of the failed runs.
    """

    kind: str
    runs: int
    status: Mapping[str, int]
    endings: Sequence[Ending]
    failures: Failures


@dataclass(frozen=True)
class RunPlan:
    """Planned runs of a study of one model.

    Attributes
    ----------
    model : Model
        Model of the runs.
    columns : dict
        (n,) values of every input of the model, by name.
    replicate : (n,) int array
        Replicate of each row.
    """

    model: Model
    columns: Mapping[str, NDArray[np.float64]]
    replicate: NDArray[np.int64]


@dataclass(frozen=True)
class ModelRuns:
    """The runs of a study of one model: the model and the table."""

    model: Model
    runs: pd.DataFrame


def run_again(model: Model, row: "pd.Series[Any]") -> Run:
    """Return the run of a row of a table of runs, with histories and scene."""
    return model.run({item.name: float(row[item.name]) for item in model.inputs})


def load_study_model(study: CommonStudy) -> Model:
    """Return the model of a study.

    Raises
    ------
    UserError
        If the model, an option or an effect is unknown.
    """
    try:
        return load_model(study.model.name, study.model.options, study.effects)
    except (ValueError, TypeError) as error:
        raise UserError(f"model: {error}") from None


def evaluator_of(
    model: Model,
    options: Mapping[str, Any],
    effects: Mapping[str, Mapping[str, float]] | None = None,
    *,
    run_time: float = RUN_TIME,
) -> Evaluator:
    """Return the evaluator of a model of the registry.

    Parameters
    ----------
    model : Model
        As loaded with the same options and effects.
    options : mapping
        Options of the model.
    effects : mapping, optional
        Effects switched on, with their parameters.
    run_time : float
        Time limit of a run in s.
    """
    argument: worker.ModelArgument = {
        "name": model.name,
        "options": dict(options),
        "effects": {name: dict(values) for name, values in (effects or {}).items()},
        "version": model.version,
    }
    return Evaluator(
        function=worker.evaluate,
        argument=argument,
        output_names=[item.name for item in model.outputs],
        bounds=np.array([[item.low, item.high] for item in model.outputs]),
        run_time=run_time,
    )


def run_rows(
    study: SampledStudy,
    model: Model,
    columns: Mapping[str, NDArray[np.float64]],
    folder: ResultsFolder,
    *,
    design: Mapping[str, Any],
    replicate: NDArray[np.int64],
    workers: Workers,
    quiet: bool,
) -> pd.DataFrame:
    """Run and store the missing runs of a design, write the manifest and return all runs.

    Parameters
    ----------
    study : SampledStudy
        Checked study file.
    model : Model
        Model of the folder.
    columns : mapping
        (n,) values of every input of the model, by name.
    folder : ResultsFolder
        Open for writing.
    design : mapping
        Description of the design for the manifest.
    replicate : (n,) int array
        Replicate of each row.
    workers : int or str
        Processes, -1 for one per core, or the address of a dask scheduler.
    quiet : bool
        No progress line.

    Raises
    ------
    StudyError
        If too many runs failed, or the workers are lost.
    """
    rows = np.stack([columns[item.name] for item in model.inputs], axis=1)
    task = runner.Task(
        evaluator=evaluator_of(model, study.model.options, study.effects, run_time=study.run_time),
        inputs=rows,
        input_names=[item.name for item in model.inputs],
        replicate=replicate,
    )
    complete = complete_status(model)
    manifest = _manifest(study, model, numbers_digest(study, model), design, workers)
    earlier = folder.read_json("manifest.json") if (folder.path / "manifest.json").exists() else {}
    manifest["wall_time_s"] = earlier.get("wall_time_s", 0.0)
    folder.write_json("manifest.json", manifest)
    start = time.perf_counter()
    with parallel_backend(workers):
        watched = report_outputs(study, model)
        progress = Progress(quiet=quiet, complete=complete, watched=watched)
        runs = runner.run(task, folder, progress)
    # A study that was larger before keeps its extra runs.
    folder.compact(held if (held := folder.done()) is not None else runs)
    counts = status_counts(runs)
    manifest |= {
        "wall_time_s": round(manifest["wall_time_s"] + time.perf_counter() - start, 3),
        "counts": counts,
        "digest": digest(runs),
        "finished": True,
    }
    folder.write_json("manifest.json", manifest)
    check_failures(counts, set(counts) - complete, study.max_failure_rate)
    return runs


def columns_of(model: Model) -> list[str]:
    """Return the columns of numbers that the runs of a model have."""
    names = [item.name for item in model.inputs] + [item.name for item in model.outputs]
    return ["replicate", *names]


def complete_blocks(folder: ResultsFolder, model: Model) -> pd.DataFrame:
    """Return the first runs of a design in blocks, up to the first block with a missing run.

    Parameters
    ----------
    folder : ResultsFolder
        Its manifest states ``n`` runs in blocks of ``block``.
    model : Model
        Model of the runs.

    Raises
    ------
    UserError
        If not even the first blocks are there.
    """
    design = folder.design()
    runs = folder.runs(columns_of(model))
    runs = runs[runs["run"] < design["n"]]
    block: int = design["block"]
    ids = runs["run"].to_numpy()
    gaps = np.flatnonzero(ids != np.arange(ids.size))
    blocks = (int(gaps[0]) if gaps.size else ids.size) // block
    if blocks < MIN_BLOCKS:
        raise UserError(f"{folder.path}: too few runs are done for a report; run the study again")
    held: pd.DataFrame = runs.iloc[: blocks * block]
    return held


def describe_runs(
    study: DescribedStudy,
    model: Model,
    runs: pd.DataFrame,
    block: int = 1,
) -> tuple[RunEnds, NDArray[np.bool_]]:
    """Return the status of the runs of a study, and (n,) which are complete.

    Parameters
    ----------
    study : DescribedStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Table of the runs.
    block : int
        Rows of a block, which is complete or left out as a whole.
    """
    words = complete_status(model)
    complete: NDArray[np.bool_] = runs["status"].isin(words).to_numpy(dtype=bool)
    return describe_ends(study, runs, complete, words, block), complete


def describe_ends(
    study: DescribedStudy,
    runs: pd.DataFrame,
    complete: NDArray[np.bool_],
    words: frozenset[str],
    block: int = 1,
) -> RunEnds:
    """Return the status of the runs of a study, as every analysis holds it.

    Parameters
    ----------
    study : DescribedStudy
        Checked study file.
    runs : DataFrame
        Table of the runs.
    complete : (n,) bool array
        Whether each run is complete.
    words : frozenset of str
        Statuses that are not failures.
    block : int
        Rows of a block.
    """
    return RunEnds(
        kind=study.kind,
        runs=len(runs),
        status=status_counts(runs),
        endings=endings(runs, words),
        failures=locate_failures(runs[list(study.inputs)], ~complete, block),
    )


def check_failure_rate(
    study: DescribedStudy, model: Model, runs: pd.DataFrame, block: int = 1
) -> tuple[RunEnds, NDArray[np.bool_]]:
    """Return the result of ``describe_runs``, if the failure rate is allowed.

    Parameters
    ----------
    study : DescribedStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Table of the runs.
    block : int
        Rows of a block, which is complete or left out as a whole.

    Raises
    ------
    StudyError
        If more runs failed than the study allows.
    """
    counts = status_counts(runs)
    check_failures(counts, set(counts) - complete_status(model), study.max_failure_rate)
    return describe_runs(study, model, runs, block)


def _manifest(
    study: SampledStudy,
    model: Model,
    topics: Mapping[str, str],
    design: Mapping[str, Any],
    workers: Workers,
) -> dict[str, Any]:
    return {
        "format": "mcstudy-results/1",
        "study": study.name,
        "kind": study.kind,
        "seed": study.seed,
        "model": {"name": model.name, "version": model.version, "options": study.model.options},
        "design": dict(design),
        "numbers": dict(topics),
        "hash": hash_of(dict(topics)),
        "versions": {"mcstudy": version("mcstudy"), "python": platform.python_version()}
        | {name: version(name) for name in PACKAGES},
        "machine": {"system": platform.system(), "processor": platform.machine(),
                    "cores": os.cpu_count()},
        "workers": workers,
        "finished": False,
    }  # fmt: skip
