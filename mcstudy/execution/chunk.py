"""What a worker process runs of this package; it imports NumPy alone.

Rows of a chunk are run one after the other under a *watch*: which row is under way stands in a
small file that outlives the process, and a row that takes too long ends the process. Whoever finds
the process dead reads from the file which row it was and whether it was too slow.
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
Evaluate = Callable[[Any, Array], tuple[Array, list[str]]]

OK = "ok"
ERROR, NOT_FINITE, UNPHYSICAL = "error", "not_finite", "unphysical"
TIMEOUT, CRASHED = "timeout", "crashed"
"""Statuses that no model gives: they are the runner's own."""

_SPARE = 0.25
"""Share of the time limit after which the alarm is set anew; a row may take so much longer."""


class Watch(TypedDict):
    """Where the row under way is noted (empty: in a folder of its own), and s that it may take."""

    folder: str
    limit: float


@dataclass(frozen=True)
class ChunkResult:
    """What comes back of a chunk: run ids, outputs (k, m), statuses, reasons, s that it took."""

    ids: NDArray[np.int64]
    outputs: Array
    status: list[str]
    reason: list[str]
    seconds: float


@dataclass(frozen=True)
class Trace:
    """What a dead process left: the row that was under way, and whether it was too slow."""

    run: int
    timed_out: bool


def evaluate_chunk(
    evaluate: Evaluate,
    argument: Any,
    bounds: Array,
    names: tuple[str, ...],
    watch: Watch | None,
    ids: NDArray[np.int64],
    rows: Array,
) -> ChunkResult:
    """Run the rows of a chunk.

    Parameters
    ----------
    evaluate, argument : outputs (1, m) and one status of ``(argument, row)``.
    bounds : (m, 2) lowest and highest value that an output can have. names : of the outputs.
    watch : none in the driver's own process.
    ids : (k,) run ids. rows : (k, d).
    """
    start = time.perf_counter()
    outputs = np.full((len(ids), len(names)), np.nan)
    status, reason = [], []
    with _watched(watch, int(ids[0])) as note:
        for k, run in enumerate(ids.tolist()):
            note(run)
            try:
                found, words = evaluate(argument, rows[k : k + 1])
                word, why = _judge(found[0], words[0], bounds, names)
                if not why:
                    outputs[k] = found[0]
            except (KeyboardInterrupt, SystemExit, MemoryError):
                raise
            except Exception as error:
                word, why = ERROR, " ".join(f"{type(error).__name__}: {error}".split())[:200]
            status.append(word)
            reason.append(why)
    return ChunkResult(ids, outputs, status, reason, time.perf_counter() - start)


def _judge(outputs: Array, status: str, bounds: Array, names: tuple[str, ...]) -> tuple[str, str]:
    """Return the status of a row and why it is not the model's own."""
    if status == OK and not np.isfinite(outputs).all():
        name = names[int(np.argmin(np.isfinite(outputs)))]
        return NOT_FINITE, f"{name} has no finite value"
    if np.isinf(outputs).any():
        return NOT_FINITE, f"{names[int(np.argmax(np.isinf(outputs)))]} is infinite"
    beyond = (outputs < bounds[:, 0]) | (outputs > bounds[:, 1])
    if beyond.any():
        k = int(np.argmax(beyond))
        return UNPHYSICAL, (
            f"{names[k]} = {outputs[k]:.4g} is outside {bounds[k, 0]:g} to {bounds[k, 1]:g}"
        )
    return status, ""


@contextlib.contextmanager
def _watched(watch: Watch | None, first: int) -> Iterator[Callable[[int], None]]:
    """Give a function that notes which row begins, and keep the alarm set meanwhile."""
    if watch is None:
        yield lambda _run: None
        return
    folder = watch["folder"] or tempfile.mkdtemp(prefix="mcstudy-")
    place = Path(folder) / f"{first:09d}-{os.getpid()}"
    slow = place.with_suffix(".slow")
    limit = watch["limit"]
    handle = os.open(place, os.O_CREAT | os.O_WRONLY | os.O_TRUNC)
    armed = -np.inf
    with slow.open("w") as report:

        def note(run: int) -> None:
            nonlocal armed
            os.pwrite(handle, run.to_bytes(8, "little", signed=True), 0)
            now = time.perf_counter()
            if now - armed > _SPARE * limit:
                faulthandler.dump_traceback_later((1.0 + _SPARE) * limit, exit=True, file=report)
                armed = now

        try:
            yield note
        finally:
            faulthandler.cancel_dump_traceback_later()
            os.close(handle)
    place.unlink(missing_ok=True)
    slow.unlink(missing_ok=True)
    if not watch["folder"]:
        Path(folder).rmdir()


def read_traces(folder: Path) -> list[Trace]:
    """Return what dead processes left in a folder, and clear it."""
    traces = []
    for place in sorted(folder.glob("[0-9]*")):
        slow = place.with_suffix(".slow")
        if place.suffix == ".slow":
            continue
        content = place.read_bytes()
        if len(content) == 8:
            run = int.from_bytes(content, "little", signed=True)
            traces.append(Trace(run, slow.exists() and slow.stat().st_size > 0))
    for place in folder.glob("[0-9]*"):
        place.unlink(missing_ok=True)
    return traces
