"""Evaluations of a model: rows of inputs in, outputs and statuses back, in parallel.

The one door through which rows are run. The number of workers and the backend come from
``joblib.parallel_config``; a task is one chunk of plain rows for a top-level function, so nothing
of the driver travels with it.

When a worker process dies, what arrived is kept, the rows that were under way in dead processes are
run alone, each in a process of its own, and all the rest goes on in fresh workers. A row that kills
its own process again is recorded as crashed, one that took too long as a timeout.
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
"""Wanted duration of a chunk in s: overhead below 0.1 %, loss after a kill below a few seconds."""
MAX_GROWTH = 8
"""Times that a chunk may be larger than the largest so far: a first run compiles, a slow one
misleads."""
MAX_SILENCE = 900.0
"""s, beside what a run may take, without any chunk coming back after which the workers count as
lost."""
MAX_SOLO_CRASHES = 2
"""Times that a row must kill a process in which it is alone before it is recorded as crashed: once
may be somebody else's kill."""
MAX_FAILED_RESTARTS = 10
"""Fresh workers that may die in a row without a single run arriving."""
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
    """What a cluster gives back in place of a chunk whose worker was lost, and why."""

    reason: str
    NO_WORKERS: ClassVar[str] = "no workers"


@dataclass(frozen=True)
class Evaluator:
    """A model that rows are run through.

    Attributes
    ----------
    function : top-level function of (argument, rows, started); see ``mcstudy.execution.chunk``.
    argument : plain data for it, e.g. the model's name and options.
    output_names : of the m outputs.
    bounds : (m, 2) lowest and highest value that an output can have; none by default.
    run_time : s that one run may take.
    chunk_time : s that a chunk should take.
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
            If no worker can be had, or none comes back.
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
            Numbers of those that are to be run.
        traces : Path
            Empty folder in which workers keep what they are at.

        Raises
        ------
        StudyError
            If no worker can be had, or none comes back.
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
                # A cluster gives back what it can. What it loses twice is run here, alone.
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
        """Yield what one set of workers gives back of the missing rows, in whatever order."""
        workers = effective_n_jobs(None)
        # With one worker joblib runs in this process, as it should: nothing to send, nothing to
        # end.
        parallel = Parallel(
            return_as="generator_unordered",
            batch_size=1,
            pre_dispatch="2*n_jobs",
            timeout=MAX_SILENCE + self.run_time if workers > 1 else None,
        )
        remote = getattr(get_active_backend()[0], "is_remote", False)
        if remote:
            # Another machine has no such folder; a slow run is ended there all the same.
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
            # The pool is gone for good; the next round gets a fresh one.
            get_reusable_executor().shutdown(wait=True, kill_workers=True)
            raise
        except MemoryError:
            raise StudyError(
                "a run found no memory; what arrived is kept, run again with fewer --workers to "
                "resume"
            ) from None
        except KeyboardInterrupt:
            if workers > 1 and not remote:
                # Nobody waits for the chunks that are under way.
                get_reusable_executor().shutdown(wait=False, kill_workers=True)
            raise

    def _chunk_function(self, watchdog: Watchdog | None) -> Callable[..., ChunkResult]:
        bounds = self.bounds
        if bounds is None:
            bounds = np.tile([-np.inf, np.inf], (len(self.output_names), 1))
        names = tuple(self.output_names)
        return partial(evaluate_chunk, self.function, self.argument, bounds, names, watchdog)

    def _run_alone(self, rows: Array, run: int, watchdog: Watchdog, traces: Path) -> ChunkResult:
        """Return the result of one row in a process of its own, or that it crashes.

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
            # A process that dies before it comes to the row says nothing of the row.
            deaths, early = (deaths + 1, early) if left else (deaths, early + 1)
            if early >= MAX_FAILED_RESTARTS:
                raise StudyError(_NOTHING_ARRIVES)
        return self._failed(run, CRASHED)

    def _failed(self, run: int, status: str) -> ChunkResult:
        """Return the record of a row that gave no result."""
        reason = {
            TIMEOUT: f"took longer than {self.run_time:g} s",
            CRASHED: f"its process died {MAX_SOLO_CRASHES} times",
        }[status]
        outputs = np.full((1, len(self.output_names)), np.nan)
        return ChunkResult(np.array([run]), outputs, [status], [reason], 0.0)


@dataclass
class _Pace:
    """How many rows a chunk should have, learnt from those that came back."""

    missing: int
    workers: int
    chunk_time: float
    size: int = 1
    cost: float = np.inf

    def learn(self, result: ChunkResult) -> None:
        """Take the fastest row so far as the cost of one: others waited or compiled."""
        rows = len(result.ids)
        self.cost = min(self.cost, max(result.seconds / rows, 1e-7))
        # A few chunks for every worker, so that none waits long for the last one.
        fair = max(1, self.missing // (8 * self.workers))
        self.size = int(np.clip(self.chunk_time / self.cost, 1, min(fair, MAX_GROWTH * self.size)))


def _chunks(missing: Ids, pace: _Pace) -> Iterator[Ids]:
    """Give chunks as the workers ask for them, as large as the pace says by then."""
    first = 0
    while first < missing.size:
        chunk = missing[first : first + pace.size]
        first += chunk.size
        yield chunk


def _without(missing: Ids, arrived: Iterable[Ids]) -> Ids:
    held = [*arrived]
    return missing[~np.isin(missing, np.concatenate(held))] if held else missing
