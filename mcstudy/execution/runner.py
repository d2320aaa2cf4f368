"""The runner: evaluates a task into a results folder, and resumes from it."""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.execution.chunk import ChunkResult, read_traces
from mcstudy.execution.evaluator import Evaluator
from mcstudy.execution.progress import Progress
from mcstudy.execution.results import ResultsFolder

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Task:
    """A table of runs to evaluate.

    Attributes
    ----------
    evaluator : of the model.
    inputs : (n, d) rows, in the model's units.
    input_names : of the d columns.
    replicate : (n,) replicate of each row.
    """

    evaluator: Evaluator
    inputs: Array
    input_names: Sequence[str]
    replicate: NDArray[np.int64]


def run(task: Task, folder: ResultsFolder, progress: Progress) -> pd.DataFrame:
    """Run the missing rows and return the table of all runs, sorted by run id.

    Parameters
    ----------
    task : Task
    folder : ResultsFolder
        Open for writing; chunks are kept in it as they arrive.
    progress : Progress

    Raises
    ------
    StudyError
        If no worker is available, or none returns; the chunks received are kept.
    """
    n = task.inputs.shape[0]
    found = folder.done()
    kept = None if found is None else found[found["run"] < n]
    frames = [] if kept is None or kept.empty else [kept]
    done = np.zeros(n, dtype=bool)
    if frames:
        done[frames[0]["run"].to_numpy()] = True
    progress.start(total=n, done=int(done.sum()))
    traces = _trace_folder(folder)
    for result in task.evaluator.stream(task.inputs, np.flatnonzero(~done), traces):
        frame = _frame(task, result)
        folder.add_part(frame)
        frames.append(frame)
        progress.advance(frame)
    progress.finish()
    with contextlib.suppress(OSError):
        traces.rmdir()
    runs: pd.DataFrame = pd.concat(frames, ignore_index=True)
    # Folders of earlier versions have no reasons.
    runs["reason"] = runs["reason"].fillna("") if "reason" in runs.columns else ""
    return runs.sort_values("run", ignore_index=True)


def _trace_folder(folder: ResultsFolder) -> Path:
    """Return the empty folder in which workers record the row under way."""
    traces = (folder.path / "running").resolve()
    traces.mkdir(parents=True, exist_ok=True)
    read_traces(traces)
    return traces


def _frame(task: Task, result: ChunkResult) -> pd.DataFrame:
    ids, outputs = result.ids, task.evaluator.output_names
    columns: dict[str, Any] = {"run": ids, "replicate": task.replicate[ids]}
    columns |= {name: task.inputs[ids, k] for k, name in enumerate(task.input_names)}
    columns |= {name: result.outputs[:, k] for k, name in enumerate(outputs)}
    columns["status"], columns["reason"] = result.status, result.reason
    return pd.DataFrame(columns)
