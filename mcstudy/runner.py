"""Runs samples in parallel, keeps what arrives, and goes on where it stopped.

The number of workers and the backend come from ``joblib.parallel_config``; a task is one chunk of
plain rows for a top-level function, so nothing of the driver travels with it.
"""

import multiprocessing
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed, effective_n_jobs
from numpy.typing import NDArray

from mcstudy.chunk import evaluate_chunk
from mcstudy.errors import StudyError
from mcstudy.progress import Progress
from mcstudy.results import ResultsFolder

Array = NDArray[np.float64]

CHUNK_TIME = 2.5
"""Wanted duration of a chunk in s: overhead below 0.1 %, loss after a kill below a few seconds."""
STALL_TIME = 900.0
"""s without any chunk coming back after which the workers count as lost."""


@dataclass(frozen=True)
class Task:
    """What to run.

    Attributes
    ----------
    evaluate : top-level function of (argument, rows) that returns outputs (k, m) and k statuses.
    argument : plain data for it, e.g. the model's name and options.
    inputs : (n, d) rows. input_names, output_names : column names.
    replicate : (n,) replicate of each row.
    """

    evaluate: Callable[[Any, Array], tuple[Array, list[str]]]
    argument: Any
    inputs: Array
    input_names: Sequence[str]
    output_names: Sequence[str]
    replicate: NDArray[np.int64]


def run(task: Task, folder: ResultsFolder, progress: Progress) -> pd.DataFrame:
    """Run what is missing and return the table of all runs, sorted by run id.

    Parameters
    ----------
    task : Task
    folder : ResultsFolder
        Open for writing; chunks are kept in it as they arrive.
    progress : Progress

    Raises
    ------
    StudyError
        If the workers die or stall; the chunks that arrived are kept.
    """
    n = task.inputs.shape[0]
    found = folder.done()
    kept = None if found is None else found[found["run"] < n]
    done = set() if kept is None else set(kept["run"].tolist())
    missing = np.array([i for i in range(n) if i not in done], dtype=np.int64)
    frames = [] if kept is None or kept.empty else [kept]
    progress.start(total=n, done=len(done))
    if missing.size:
        for frame in _run_chunks(task, missing):
            folder.add_part(frame)
            frames.append(frame)
            progress.advance(len(frame), Counter(frame["status"].tolist()))
    progress.finish()
    runs: pd.DataFrame = pd.concat(frames, ignore_index=True)
    return runs.sort_values("run", ignore_index=True)


def _run_chunks(task: Task, missing: NDArray[np.int64]) -> Iterable[pd.DataFrame]:
    size = _chunk_size(task, missing)
    chunks = [missing[k : k + size] for k in range(0, missing.size, size)]
    # With one worker joblib runs in this process, as it should: nothing to send.
    workers = Parallel(
        return_as="generator_unordered",
        batch_size=1,
        timeout=STALL_TIME if effective_n_jobs(None) > 1 else None,
    )
    try:
        for ids, outputs, status in workers(
            delayed(evaluate_chunk)(task.evaluate, task.argument, ids, task.inputs[ids])
            for ids in chunks
        ):
            yield _frame(task, ids, outputs, status)
    except (TimeoutError, multiprocessing.TimeoutError):
        raise StudyError(
            f"no chunk came back within {STALL_TIME:g} s; run again to resume"
        ) from None
    except BrokenProcessPool:
        raise StudyError(
            "a worker process died; what arrived is kept, run again to resume"
        ) from None


def _frame(task: Task, ids: NDArray[np.int64], outputs: Array, status: list[str]) -> pd.DataFrame:
    columns: dict[str, Any] = {"run": ids, "replicate": task.replicate[ids]}
    columns |= {name: task.inputs[ids, k] for k, name in enumerate(task.input_names)}
    columns |= {name: outputs[:, k] for k, name in enumerate(task.output_names)}
    columns["status"] = status
    return pd.DataFrame(columns)


def _chunk_size(task: Task, missing: NDArray[np.int64]) -> int:
    """Return the rows of a chunk, by a timed probe after a first run that compiles."""
    task.evaluate(task.argument, task.inputs[missing[:1]])
    probe = task.inputs[missing[: min(3, missing.size)]]
    start = time.perf_counter()
    task.evaluate(task.argument, probe)
    cost = max((time.perf_counter() - start) / probe.shape[0], 1e-7)
    # A few chunks for every worker, so that none waits long for the last one.
    fair = max(1, missing.size // (8 * max(1, effective_n_jobs(None))))
    return int(np.clip(CHUNK_TIME / cost, 1, fair))
