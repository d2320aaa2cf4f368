"""A progress line on terminals: done, failed, rate, time left."""

import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import TextIO, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Item = TypeVar("Item")

REACH = 1.96
"""Standard errors of a 95 % interval."""
PACE = 0.5
"""Time (s) between two looks at a run under way."""
MIN_COUNT = 10
"""Smallest number of values for an interval of the mean."""


def say(text: str, *, quiet: bool = False, stream: TextIO = sys.stderr) -> None:
    """Print a line on a terminal only.

    Parameters
    ----------
    text : str
    quiet : bool
        Print nothing at all.
    stream : TextIO
        By default standard error.
    """
    if not quiet and stream.isatty():
        stream.write(f"{text}\n")
        stream.flush()


def follow(
    items: Sequence[Item], what: str, *, quiet: bool = False, stream: TextIO | None = None
) -> Iterator[Item]:
    """Yield the items and show the number of completed ones on a terminal.

    Parameters
    ----------
    items : sequence
    what : str
        Word for the line, e.g. ``tests``.
    quiet : bool
        Print nothing at all.
    stream : TextIO, optional
        By default standard error.
    """
    stream = stream or sys.stderr
    live = not quiet and stream.isatty()
    for done, item in enumerate(items):
        if live:
            name = f" ({item})" if isinstance(item, str) else ""
            stream.write(f"\r\x1b[K{done}/{len(items)} {what}{name}")
            stream.flush()
        yield item
    if live:
        stream.write(f"\r\x1b[K{len(items)}/{len(items)} {what}\n")
        stream.flush()


def watch(
    work: Callable[[], Item],
    reached: Callable[[], float] | None,
    *,
    quiet: bool = False,
    stream: TextIO | None = None,
) -> Item:
    """Return what one long run gives, and show on a terminal how far it is.

    Parameters
    ----------
    work : callable
        The run; it lets other threads go on.
    reached : callable or None
        Returns the time that the run under way has reached, s; None to show nothing.
    quiet : bool
        Print nothing at all.
    stream : TextIO, optional
        By default standard error.
    """
    stream = stream or sys.stderr
    if quiet or reached is None or not stream.isatty():
        return work()
    with ThreadPoolExecutor(max_workers=1) as pool:
        task = pool.submit(work)
        begun = time.monotonic()
        while wait([task], timeout=PACE).not_done:
            passed = time.monotonic() - begun
            now = reached()
            where = f"{1000.0 * now:.0f} ms of the crash" if now > 0.0 else "getting ready"
            stream.write(f"\r\x1b[K{where}, {passed:.0f} s")
            stream.flush()
        stream.write("\r\x1b[K")
        stream.flush()
        return task.result()


class _RunningMean:
    """Mean and variance of values that come in parts (T. Chan and others, 1979)."""

    def __init__(self) -> None:
        self.count, self.mean, self.square = 0, 0.0, 0.0

    def add(self, values: NDArray[np.float64]) -> None:
        """Add the finite values."""
        part = values[np.isfinite(values)]
        if not part.size:
            return
        total = self.count + part.size
        with np.errstate(over="ignore", invalid="ignore"):
            # Overflowing squares leave the width undefined.
            shift = float(part.mean()) - self.mean
            self.square += float(((part - part.mean()) ** 2).sum())
            self.square += shift * shift * self.count * part.size / total
            self.mean += shift * part.size / total
        self.count = total

    @property
    def relative_reach(self) -> float:
        """Half the 95 % interval of the mean over the mean; NaN for fewer than ten values."""
        if self.count < MIN_COUNT or self.mean == 0.0:
            return math.nan
        error = math.sqrt(self.square / (self.count - 1) / self.count)
        return abs(REACH * error / self.mean)


class Progress:
    """Progress of one study on a terminal.

    Parameters
    ----------
    quiet : bool
        Print nothing at all. Without a terminal nothing is printed either way.
    complete : frozenset of str
        Statuses that do not count as failed.
    watched : sequence of str
        Outputs of whose means the widest relative interval is shown.
    stream : TextIO, optional
        By default standard error.
    """

    def __init__(
        self,
        *,
        quiet: bool = False,
        complete: frozenset[str] = frozenset({"ok"}),
        watched: Sequence[str] = (),
        stream: TextIO | None = None,
    ) -> None:
        self._stream = stream or sys.stderr
        self._live = not quiet and self._stream.isatty()
        self._complete = complete
        self._watched = tuple(watched)
        self._means = {name: _RunningMean() for name in self._watched}
        self._counts: Counter[str] = Counter()
        self._total = self._done = self._first = 0
        self._start = time.perf_counter()

    @property
    def failed(self) -> int:
        """Runs of this session that failed."""
        return sum(n for status, n in self._counts.items() if status not in self._complete)

    def start(self, total: int, done: int) -> None:
        """Begin with ``done`` of ``total`` runs already on disk."""
        self._total, self._done, self._first = total, done, done
        self._start = time.perf_counter()
        if self._live and done < total:
            resumed = f", {done} already done" if done else ""
            self._stream.write(f"{total} runs{resumed}; the first compiles the model\n")
            self._stream.flush()

    def advance(self, frame: pd.DataFrame) -> None:
        """Count runs that arrived: a table with ``status`` and the outputs that are watched."""
        self._done += len(frame)
        self._counts.update(frame["status"].tolist())
        for name in self._watched:
            self._means[name].add(frame[name].to_numpy(dtype=float))
        self._show()

    @property
    def widest(self) -> tuple[str, float] | None:
        """The output with the widest relative interval of its mean, and the half-width.

        Of the runs of this session, treated as independent; None if undefined.
        """
        known = {name: mean.relative_reach for name, mean in self._means.items()}
        finite = {name: reach for name, reach in known.items() if math.isfinite(reach)}
        if not finite:
            return None
        name = max(finite, key=lambda key: finite[key])
        return name, finite[name]

    def finish(self) -> None:
        """End the line."""
        if self._live and self._done > self._first:
            self._stream.write("\n")
            self._stream.flush()

    def _show(self) -> None:
        if not self._live:
            return
        elapsed = time.perf_counter() - self._start
        rate = (self._done - self._first) / elapsed if elapsed > 0.0 else 0.0
        left = (self._total - self._done) / rate if rate > 0.0 else 0.0
        widest = self.widest
        known = "" if widest is None else f", {widest[0]} ± {100.0 * widest[1]:.2g} %"
        self._stream.write(
            f"\r\x1b[K{self._done}/{self._total} done, {self.failed} failed, "
            f"{rate:.1f} runs/s, {left:.0f} s left{known}"
        )
        self._stream.flush()
