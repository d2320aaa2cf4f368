"""Runs samples in parallel, keeps what arrives, and goes on where it stopped.

The number of workers and the backend come from ``joblib.parallel_config``; a task is one chunk of
plain rows for a top-level function, so nothing of the driver travels with it.

When a worker process dies, what arrived is kept, the rows that were under way in dead processes are
run alone, each in a process of its own, and all the rest goes on in fresh workers. A row that kills
its own process again is booked as crashed, one that took too long as a timeout.
"""

import contextlib
import multiprocessing
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from joblib import Parallel, delayed, effective_n_jobs
from joblib.externals.loky import ProcessPoolExecutor, get_reusable_executor
from joblib.parallel import get_active_backend
from numpy.typing import NDArray

from mcstudy.errors import StudyError
from mcstudy.execution.chunk import (
    CRASHED,
    TIMEOUT,
    ChunkResult,
    Evaluate,
    Watch,
    evaluate_chunk,
    read_traces,
)
from mcstudy.execution.progress import Progress
from mcstudy.execution.results import ResultsFolder

Array = NDArray[np.float64]
Ids = NDArray[np.int64]

CHUNK_TIME = 2.5
"""Wanted duration of a chunk in s: overhead below 0.1 %, loss after a kill below a few seconds."""
GROWTH = 8
"""Times that a chunk may be larger than the largest so far: a first run compiles, a slow one
misleads."""
STALL = 900.0
"""s, beside what a run may take, without any chunk coming back after which the workers count as
lost."""
ALONE = 2
"""Times that a row must kill a process in which it is alone before it is booked as crashed: once
may be somebody else's kill."""
FRUITLESS = 10
"""Fresh workers that may die in a row without a single run arriving."""
_FRUITLESS = (
    f"{FRUITLESS} times in a row the worker processes died before a run came back; what arrived is "
    "kept, run again to resume"
)


@dataclass(frozen=True)
class Task:
    """What to run.

    Attributes
    ----------
    evaluate : top-level function of (argument, rows) that returns outputs (k, m) and k statuses.
    argument : plain data for it, e.g. the model's name and options.
    inputs : (n, d) rows. input_names, output_names : column names.
    replicate : (n,) replicate of each row.
    bounds : (m, 2) lowest and highest value that an output can have; none by default.
    run_time : s that one run may take.
    """

    evaluate: Evaluate
    argument: Any
    inputs: Array
    input_names: Sequence[str]
    output_names: Sequence[str]
    replicate: Ids
    bounds: Array | None = None
    run_time: float = 600.0


@dataclass
class _Pace:
    """How many rows a chunk should have, learnt from those that came back."""

    missing: int
    workers: int
    size: int = 1
    cost: float = np.inf

    def learn(self, result: ChunkResult) -> None:
        """Take the fastest row so far as the cost of one: others waited or compiled."""
        rows = len(result.ids)
        self.cost = min(self.cost, max(result.seconds / rows, 1e-7))
        # A few chunks for every worker, so that none waits long for the last one.
        fair = max(1, self.missing // (8 * self.workers))
        self.size = int(np.clip(CHUNK_TIME / self.cost, 1, min(fair, GROWTH * self.size)))


@dataclass(frozen=True)
class LostChunk:
    """What a cluster gives back in place of a chunk whose worker was lost, and why."""

    reason: str
    NO_WORKERS: ClassVar[str] = "no workers"


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
        If no worker can be had, or none comes back; the chunks that arrived are kept.
    """
    n = task.inputs.shape[0]
    found = folder.done()
    kept = None if found is None else found[found["run"] < n]
    frames = [] if kept is None or kept.empty else [kept]
    done = np.zeros(n, dtype=bool)
    if frames:
        done[frames[0]["run"].to_numpy()] = True
    progress.start(total=n, done=int(done.sum()))
    for result in _run_missing(task, np.flatnonzero(~done), _trace_folder(folder)):
        frame = _frame(task, result)
        folder.add_part(frame)
        frames.append(frame)
        progress.advance(frame)
    progress.finish()
    with contextlib.suppress(OSError):
        _trace_folder(folder).rmdir()
    runs: pd.DataFrame = pd.concat(frames, ignore_index=True)
    # Folders of earlier versions tell no reasons.
    runs["reason"] = runs["reason"].fillna("") if "reason" in runs.columns else ""
    return runs.sort_values("run", ignore_index=True)


def _trace_folder(folder: ResultsFolder) -> Path:
    """Return the empty folder in which workers note what they are at."""
    traces = (folder.path / "running").resolve()
    traces.mkdir(parents=True, exist_ok=True)
    read_traces(traces)
    return traces


def _run_missing(task: Task, missing: Ids, traces: Path) -> Iterator[ChunkResult]:
    """Yield results until every row has one."""
    watch: Watch = {"folder": str(traces), "limit": task.run_time}
    pace, fruitless = _Pace(missing.size, max(1, effective_n_jobs(None))), 0
    lost = np.zeros(len(task.inputs), dtype=np.int64)
    while missing.size:
        arrived: list[Ids] = []
        broken = False
        try:
            for result in _run_parallel(task, missing, pace, watch):
                arrived.append(result.ids)
                yield result
        except BrokenProcessPool:
            broken = True
        suspects = read_traces(traces) if broken else []
        missing = _without(missing, arrived)
        for trace in suspects:
            if trace.run not in missing:
                continue
            if trace.timed_out:
                result = _booked(task, trace.run, TIMEOUT)
            else:
                result = _run_alone(task, trace.run, watch, traces)
            arrived.append(result.ids)
            yield result
        missing = _without(missing, arrived)
        if not broken:
            # A cluster gives back what it can. What it loses twice is run here, alone.
            lost[missing] += 1
            for run in missing[lost[missing] >= ALONE].tolist():
                result = _run_alone(task, run, watch, traces)
                arrived.append(result.ids)
                yield result
            missing = _without(missing, arrived)
        fruitless = 0 if arrived else fruitless + 1
        if fruitless >= FRUITLESS:
            raise StudyError(_FRUITLESS)


def _chunks(missing: Ids, pace: _Pace) -> Iterator[Ids]:
    """Give chunks as the workers ask for them, as large as the pace says by then."""
    first = 0
    while first < missing.size:
        chunk = missing[first : first + pace.size]
        first += chunk.size
        yield chunk


def _run_parallel(task: Task, missing: Ids, pace: _Pace, watch: Watch) -> Iterator[ChunkResult]:
    """Yield what one set of workers gives back of the missing rows, in whatever order."""
    workers = effective_n_jobs(None)
    # With one worker joblib runs in this process, as it should: nothing to send, nothing to end.
    parallel = Parallel(
        return_as="generator_unordered",
        batch_size=1,
        pre_dispatch="2*n_jobs",
        timeout=STALL + task.run_time if workers > 1 else None,
    )
    remote = getattr(get_active_backend()[0], "is_remote", False)
    if remote:
        # Another machine has no such folder; a slow run is ended there all the same.
        watch = {"folder": "", "limit": task.run_time}
    evaluate = _evaluation(task, watch if workers > 1 else None)
    results = parallel(delayed(evaluate)(*_rows(task, ids)) for ids in _chunks(missing, pace))
    try:
        for result in results:
            if isinstance(result, LostChunk):
                if result.reason == LostChunk.NO_WORKERS:
                    raise StudyError(
                        "the cluster has lost all its workers; what arrived is kept, start "
                        "workers and run again to resume"
                    )
                continue
            pace.learn(result)
            yield result
    except (TimeoutError, multiprocessing.TimeoutError):
        raise StudyError(
            f"no chunk came back within {STALL + task.run_time:g} s; run again to resume"
        ) from None
    except BrokenProcessPool:
        # The pool is gone for good; the next round gets a fresh one.
        get_reusable_executor().shutdown(wait=True, kill_workers=True)
        raise
    except MemoryError:
        raise StudyError(
            "a run found no memory; what arrived is kept, run again with fewer --workers to resume"
        ) from None
    except KeyboardInterrupt:
        if workers > 1 and not remote:
            # Nobody waits for the chunks that are under way.
            get_reusable_executor().shutdown(wait=False, kill_workers=True)
        raise


def _evaluation(task: Task, watch: Watch | None) -> Callable[..., ChunkResult]:
    bounds = task.bounds
    if bounds is None:
        bounds = np.tile([-np.inf, np.inf], (len(task.output_names), 1))
    names = tuple(task.output_names)
    return partial(evaluate_chunk, task.evaluate, task.argument, bounds, names, watch)


def _rows(task: Task, ids: Ids) -> tuple[Ids, Array]:
    return ids, task.inputs[ids]


def _run_alone(task: Task, run: int, watch: Watch, traces: Path) -> ChunkResult:
    """Return the result of one row in a process of its own, or that it crashes.

    Raises
    ------
    StudyError
        If the processes die before they come to the row.
    """
    deaths = early = 0
    while deaths < ALONE:
        with ProcessPoolExecutor(max_workers=1) as pool:
            try:
                job = pool.submit(_evaluation(task, watch), *_rows(task, np.array([run])))
                result: ChunkResult = job.result()
                return result
            except BrokenProcessPool:
                left = read_traces(traces)
        if any(trace.timed_out for trace in left):
            return _booked(task, run, TIMEOUT)
        # A process that dies before it comes to the row says nothing of the row.
        deaths, early = (deaths + 1, early) if left else (deaths, early + 1)
        if early >= FRUITLESS:
            raise StudyError(_FRUITLESS)
    return _booked(task, run, CRASHED)


def _booked(task: Task, run: int, status: str) -> ChunkResult:
    """Return the record of a row that gave no result."""
    reason = {
        TIMEOUT: f"took longer than {task.run_time:g} s",
        CRASHED: f"its process died {ALONE} times",
    }[status]
    outputs = np.full((1, len(task.output_names)), np.nan)
    return ChunkResult(np.array([run]), outputs, [status], [reason], 0.0)


def _without(missing: Ids, arrived: Iterable[Ids]) -> Ids:
    held = [*arrived]
    return missing[~np.isin(missing, np.concatenate(held))] if held else missing


def _frame(task: Task, result: ChunkResult) -> pd.DataFrame:
    ids = result.ids
    columns: dict[str, Any] = {"run": ids, "replicate": task.replicate[ids]}
    columns |= {name: task.inputs[ids, k] for k, name in enumerate(task.input_names)}
    columns |= {name: result.outputs[:, k] for k, name in enumerate(task.output_names)}
    columns["status"], columns["reason"] = result.status, result.reason
    return pd.DataFrame(columns)
