"""Code that runs in worker processes; it imports NumPy alone.

A chunk of rows is evaluated as a whole; only if that fails, row by row. A *watchdog* records the
row under way in a small file that outlives the process, and terminates a process in which a row
takes too long. The driver reads from the file of a dead process which row it was and whether it
timed out.
"""

import contextlib
import faulthandler
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ids = NDArray[np.int64]
Started = Callable[[int], None]
"""Called with the number of a row, counted from 0, before it is run."""
Evaluate = Callable[[Any, Array, Started], tuple[Array, list[str]]]
"""Outputs (k, m) and k statuses of ``(argument, rows, started)``."""

OK = "ok"
ERROR, NOT_FINITE, UNPHYSICAL = "error", "not_finite", "unphysical"
TIMEOUT, CRASHED = "timeout", "crashed"
"""Statuses set by the runner, never by a model."""

UNKNOWN = -1
"""Number of the row under way where the evaluation does not report it."""
_SPARE = 0.25
"""Share of the time limit after which the alarm is reset, and by which a row may exceed it."""


class Watchdog(TypedDict):
    """Folder of the record of the row under way (empty: a temporary one), and time limit (s)."""

    folder: str
    limit: float


@dataclass(frozen=True)
class ChunkResult:
    """Results of a chunk.

    Attributes
    ----------
    ids : (k,) run ids.
    outputs : (k, m), NaN where a run failed.
    status : k statuses, the model's or the runner's.
    reason : k reasons for the runner's statuses, else empty.
    seconds : wall time of the chunk, s.
    """

    ids: Ids
    outputs: Array
    status: list[str]
    reason: list[str]
    seconds: float


@dataclass(frozen=True)
class Trace:
    """Record of a chunk whose process died.

    Attributes
    ----------
    run : run id of the row under way, ``UNKNOWN`` if the evaluation did not report it.
    ids : (k,) run ids of the chunk.
    timed_out : whether it exceeded the time limit.
    """

    run: int
    ids: Ids
    timed_out: bool


def evaluate_chunk(
    evaluate: Evaluate,
    argument: Any,
    bounds: Array,
    names: tuple[str, ...],
    watchdog: Watchdog | None,
    ids: Ids,
    rows: Array,
    singly: bool = False,
) -> ChunkResult:
    """Run the rows of a chunk.

    Parameters
    ----------
    evaluate : Evaluate
        Outputs (k, m) and k statuses of rows.
    argument : Any
        Its first argument.
    bounds : (m, 2) array
        Lowest and highest value that an output can have.
    names : tuple of str
        Of the outputs.
    watchdog : Watchdog or None
        None in the driver's own process.
    ids : (k,) array
        Run ids.
    rows : (k, d) array
        Inputs.
    singly : bool
        Evaluate row by row from the start.
    """
    start = time.perf_counter()
    with _watched(watchdog, ids) as started:
        found = (
            None if singly and len(ids) > 1 else _evaluate_whole(evaluate, argument, rows, started)
        )
        if found is None:
            found = _evaluate_singly(evaluate, argument, rows, started, len(names))
    outputs, status, reason = found
    _check_values(outputs, status, reason, bounds, names)
    return ChunkResult(ids, outputs, status, reason, time.perf_counter() - start)


Found = tuple[Array, list[str], list[str]]


def _evaluate_whole(
    evaluate: Evaluate, argument: Any, rows: Array, started: Started
) -> Found | None:
    """Return outputs, statuses and reasons of a chunk, or None if the evaluation raises."""
    try:
        outputs, status = evaluate(argument, rows, started)
    except (KeyboardInterrupt, SystemExit, MemoryError):
        raise
    except Exception:
        # Any exception is due to a row, which is found row by row.
        return None
    return np.array(outputs, dtype=np.float64), list(status), [""] * len(rows)


def _evaluate_singly(
    evaluate: Evaluate, argument: Any, rows: Array, started: Started, width: int
) -> Found:
    """Return outputs, statuses and reasons of rows that are evaluated one after the other."""
    outputs = np.full((len(rows), width), np.nan)
    status, reason = [], []
    for k in range(len(rows)):
        started(k)
        try:
            found, words = evaluate(argument, rows[k : k + 1], lambda _row: None)
            outputs[k], word, why = found[0], words[0], ""
        except (KeyboardInterrupt, SystemExit, MemoryError):
            raise
        except Exception as error:
            word, why = ERROR, " ".join(f"{type(error).__name__}: {error}".split())[:200]
        status.append(word)
        reason.append(why)
    return outputs, status, reason


def _check_values(
    outputs: Array, status: list[str], reason: list[str], bounds: Array, names: tuple[str, ...]
) -> None:
    """Set status and reason of rows with invalid values, and remove the values."""
    finite = np.isfinite(outputs)
    infinite = np.isinf(outputs)
    beyond = (outputs < bounds[:, 0]) | (outputs > bounds[:, 1])
    suspects = infinite.any(axis=1) | beyond.any(axis=1) | ~finite.all(axis=1)
    for row in np.flatnonzero(suspects).tolist():
        if reason[row]:
            continue
        if status[row] == OK and not finite[row].all():
            name = names[int(np.argmin(finite[row]))]
            status[row], reason[row] = NOT_FINITE, f"{name} has no finite value"
        elif infinite[row].any():
            name = names[int(np.argmax(infinite[row]))]
            status[row], reason[row] = NOT_FINITE, f"{name} is infinite"
        elif beyond[row].any():
            k = int(np.argmax(beyond[row]))
            low, high = bounds[k]
            status[row] = UNPHYSICAL
            reason[row] = f"{names[k]} = {outputs[row, k]:.4g} is outside {low:g} to {high:g}"
        if reason[row]:
            outputs[row] = np.nan


@contextlib.contextmanager
def _watched(watchdog: Watchdog | None, ids: Ids) -> Iterator[Started]:
    """Yield a function that records which row begins, with the alarm set meanwhile."""
    if watchdog is None:
        yield lambda _row: None
        return
    folder = watchdog["folder"] or tempfile.mkdtemp(prefix="mcstudy-")
    place = Path(folder) / f"{int(ids[0]):09d}-{os.getpid()}"
    slow = place.with_suffix(".slow")
    limit = watchdog["limit"]
    handle = os.open(place, os.O_CREAT | os.O_WRONLY | os.O_TRUNC)
    armed = -np.inf
    with slow.open("w") as report:

        def keep(run: int) -> None:
            nonlocal armed
            os.pwrite(handle, run.to_bytes(8, "little", signed=True), 0)
            now = time.perf_counter()
            if now - armed > _SPARE * limit:
                faulthandler.dump_traceback_later((1.0 + _SPARE) * limit, exit=True, file=report)
                armed = now

        os.pwrite(handle, ids.astype("<i8").tobytes(), 8)
        keep(UNKNOWN if len(ids) > 1 else int(ids[0]))
        try:
            yield lambda row: keep(int(ids[row]))
        finally:
            faulthandler.cancel_dump_traceback_later()
            os.close(handle)
    place.unlink(missing_ok=True)
    slow.unlink(missing_ok=True)
    if not watchdog["folder"]:
        Path(folder).rmdir()


def read_traces(folder: Path) -> list[Trace]:
    """Return the traces of dead processes in a folder, and clear it."""
    traces = []
    for place in sorted(folder.glob("[0-9]*")):
        slow = place.with_suffix(".slow")
        if place.suffix == ".slow":
            continue
        content = place.read_bytes()
        if len(content) >= 16:
            run, *ids = np.frombuffer(content, dtype="<i8").tolist()
            timed_out = slow.exists() and slow.stat().st_size > 0
            traces.append(Trace(run, np.array(ids, dtype=np.int64), timed_out))
    for place in folder.glob("[0-9]*"):
        place.unlink(missing_ok=True)
    return traces
