"""Parallel evaluation of a model: rows of inputs in, outputs and statuses out.

All rows are run through this module. The number of workers and the backend come from
``joblib.parallel_config``; a task is one chunk of plain rows for a top-level function, so nothing
of the driver is sent with it.

When a worker process dies, the results received so far are kept, the rows under way in dead
processes are run alone, each in its own process, and the rest continues in fresh workers. A row
that kills its own process again is recorded as crashed, one that took too long as a timeout.
"""

import multiprocessing
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from joblib.externals.loky import ProcessPoolExecutor, get_reusable_executor
from joblib.parallel import get_active_backend
from numpy.typing import NDArray

from mcstudy.errors import StudyError
from mcstudy.execution.chunk import (
    CRASHED,
    TIMEOUT,
    UNKNOWN,
    ChunkResult,
    Evaluate,
    Watchdog,
    evaluate_chunk,
    read_traces,
)

Array = NDArray[np.float64]
Ids = NDArray[np.int64]
Flags = NDArray[np.bool_]

CHUNK_TIME = 2.5
"""Target duration of a chunk in s: overhead below 0.1 %, loss after a kill a few seconds."""
MAX_GROWTH = 8
"""Largest growth factor of a chunk: a first run compiles, and a slow one biases the estimate."""
MAX_SILENCE = 900.0
"""s without any result, beyond the time limit of a run, after which the workers count as lost."""
MAX_SOLO_CRASHES = 2
"""Deaths of a process with this row alone before the row is recorded as crashed: a single death may
have another cause."""
MAX_FAILED_RESTARTS = 10
"""Largest number of consecutive restarts of the workers without a result."""
_NOTHING_ARRIVES = (
    f"{MAX_FAILED_RESTARTS} times in a row the worker processes died before a run came back; what "
    "arrived is kept, run again to resume"
)


@dataclass(frozen=True)
class Batch:
    """Results of rows, in their order.

    Attributes
    ----------
    outputs : (n, m), NaN where an output has no value.
    status : n statuses, ``ok``, the model's own or those of ``mcstudy.execution.chunk``.
    reason : n reasons for the latter, else empty.
    """

    outputs: Array
    status: list[str]
    reason: list[str]


@dataclass(frozen=True)
class LostChunk:
    """Placeholder that a cluster returns for a chunk whose worker was lost, with the reason."""

    reason: str
    NO_WORKERS: ClassVar[str] = "no workers"


@dataclass(frozen=True)
class Evaluator:
    """A model and the settings of its parallel evaluation.

    Attributes
    ----------
    function : top-level function of (argument, rows, started); see ``mcstudy.execution.chunk``.
    argument : plain data for it, e.g. the model's name and options.
    output_names : of the m outputs.
    bounds : (m, 2) physical bounds of the outputs; none by default.
    run_time : s, time limit of one run.
    chunk_time : s, target duration of a chunk.
    """

    function: Evaluate
    argument: Any
    output_names: Sequence[str]
    bounds: Array | None = None
    run_time: float = 600.0
    chunk_time: float = CHUNK_TIME

    def evaluate(self, rows: Array) -> Batch:
        """Run rows and return their results.

        Parameters
        ----------
        rows : (n, d) array
            Inputs, in the model's units.

        Raises
        ------
        StudyError
            If no worker is available, or none returns.
        """
        n, m = len(rows), len(self.output_names)
        outputs = np.full((n, m), np.nan)
        status, reason = [""] * n, [""] * n
        with tempfile.TemporaryDirectory(prefix="mcstudy-") as traces:
            for result in self.stream(rows, np.arange(n), Path(traces)):
                outputs[result.ids] = result.outputs
                for k, run in enumerate(result.ids.tolist()):
                    status[run], reason[run] = result.status[k], result.reason[k]
        return Batch(outputs, status, reason)

    def stream(self, rows: Array, missing: Ids, traces: Path) -> Iterator[ChunkResult]:
        """Yield the results of rows in chunks, as they arrive, until every row has one.

        Parameters
        ----------
        rows : (n, d) array
            Inputs of all rows.
        missing : (k,) array
            Numbers of the rows to run.
        traces : Path
            Empty folder in which workers record the row under way.

        Raises
        ------
        StudyError
            If no worker is available, or none returns.
        """
        watchdog: Watchdog = {"folder": str(traces), "limit": self.run_time}
        pace, restarts = _Pace(missing.size, max(1, effective_n_jobs(None)), self.chunk_time), 0
        lost = np.zeros(len(rows), dtype=np.int64)
        singly = np.zeros(len(rows), dtype=np.bool_)
        while missing.size:
            arrived: list[Ids] = []
            broken = False
            try:
                for result in self._run_parallel(rows, missing, singly, pace, watchdog):
                    arrived.append(result.ids)
                    yield result
            except BrokenProcessPool:
                broken = True
            suspects = read_traces(traces) if broken else []
            missing = _without(missing, arrived)
            for trace in suspects:
                if trace.run == UNKNOWN:
                    singly[trace.ids] = True
                if trace.run not in missing:
                    continue
                if trace.timed_out:
                    result = self._failed(trace.run, TIMEOUT)
                else:
                    result = self._run_alone(rows, trace.run, watchdog, traces)
                arrived.append(result.ids)
                yield result
            missing = _without(missing, arrived)
            if not broken:
                # A row that a cluster loses twice is run here, alone.
                lost[missing] += 1
                for run in missing[lost[missing] >= MAX_SOLO_CRASHES].tolist():
                    result = self._run_alone(rows, run, watchdog, traces)
                    arrived.append(result.ids)
                    yield result
                missing = _without(missing, arrived)
            restarts = 0 if arrived else restarts + 1
            if restarts >= MAX_FAILED_RESTARTS:
                raise StudyError(_NOTHING_ARRIVES)

    def _run_parallel(
        self, rows: Array, missing: Ids, singly: Flags, pace: "_Pace", watchdog: Watchdog
    ) -> Iterator[ChunkResult]:
        """Yield the results of one set of workers for the missing rows, in any order."""
        workers = effective_n_jobs(None)
        # With one worker joblib runs in this process: nothing to send, nothing to terminate.
        parallel = Parallel(
            return_as="generator_unordered",
            batch_size=1,
            pre_dispatch="2*n_jobs",
            timeout=MAX_SILENCE + self.run_time if workers > 1 else None,
        )
        remote = getattr(get_active_backend()[0], "is_remote", False)
        if remote:
            # Another machine has no such folder; its slow runs are terminated nevertheless.
            watchdog = {"folder": "", "limit": self.run_time}
        evaluate = self._chunk_function(watchdog if workers > 1 else None)
        results = parallel(
            delayed(evaluate)(ids, rows[ids], bool(singly[ids].any()))
            for ids in _chunks(missing, pace)
        )
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
                f"no chunk came back within {MAX_SILENCE + self.run_time:g} s; run again to resume"
            ) from None
        except BrokenProcessPool:
            # A broken pool cannot be reused; the next round gets a fresh one.
            get_reusable_executor().shutdown(wait=True, kill_workers=True)
            raise
        except MemoryError:
            raise StudyError(
                "a run found no memory; what arrived is kept, run again with fewer --workers to "
                "resume"
            ) from None
        except KeyboardInterrupt:
            if workers > 1 and not remote:
                # The chunks under way are not awaited.
                get_reusable_executor().shutdown(wait=False, kill_workers=True)
            raise

    def _chunk_function(self, watchdog: Watchdog | None) -> Callable[..., ChunkResult]:
        bounds = self.bounds
        if bounds is None:
            bounds = np.tile([-np.inf, np.inf], (len(self.output_names), 1))
        names = tuple(self.output_names)
        return partial(evaluate_chunk, self.function, self.argument, bounds, names, watchdog)

    def _run_alone(self, rows: Array, run: int, watchdog: Watchdog, traces: Path) -> ChunkResult:
        """Return the result of one row in its own process, or the record of its crash.

        Raises
        ------
        StudyError
            If the processes die before they come to the row.
        """
        deaths = early = 0
        ids = np.array([run])
        while deaths < MAX_SOLO_CRASHES:
            with ProcessPoolExecutor(max_workers=1) as pool:
                try:
                    job = pool.submit(self._chunk_function(watchdog), ids, rows[ids])
                    result: ChunkResult = job.result()
                    return result
                except BrokenProcessPool:
                    left = read_traces(traces)
            if any(trace.timed_out for trace in left):
                return self._failed(run, TIMEOUT)
            # A process that dies before the row starts is no evidence against the row.
            deaths, early = (deaths + 1, early) if left else (deaths, early + 1)
            if early >= MAX_FAILED_RESTARTS:
                raise StudyError(_NOTHING_ARRIVES)
        return self._failed(run, CRASHED)

    def _failed(self, run: int, status: str) -> ChunkResult:
        """Return the record of a row without a result."""
        reason = {
            TIMEOUT: f"took longer than {self.run_time:g} s",
            CRASHED: f"its process died {MAX_SOLO_CRASHES} times",
        }[status]
        outputs = np.full((1, len(self.output_names)), np.nan)
        return ChunkResult(np.array([run]), outputs, [status], [reason], 0.0)


@dataclass
class _Pace:
    """Chunk size, adapted to the cost of completed rows."""

    missing: int
    workers: int
    chunk_time: float
    size: int = 1
    cost: float = np.inf

    def learn(self, result: ChunkResult) -> None:
        """Update the cost of a row, that of the fastest chunk: others waited or compiled."""
        rows = len(result.ids)
        self.cost = min(self.cost, max(result.seconds / rows, 1e-7))
        # Several chunks a worker, so that none waits long for the last one.
        fair = max(1, self.missing // (8 * self.workers))
        self.size = int(np.clip(self.chunk_time / self.cost, 1, min(fair, MAX_GROWTH * self.size)))


def _chunks(missing: Ids, pace: _Pace) -> Iterator[Ids]:
    """Yield chunks on demand, at the current chunk size."""
    first = 0
    while first < missing.size:
        chunk = missing[first : first + pace.size]
        first += chunk.size
        yield chunk


def _without(missing: Ids, arrived: Iterable[Ids]) -> Ids:
    held = [*arrived]
    return missing[~np.isin(missing, np.concatenate(held))] if held else missing
