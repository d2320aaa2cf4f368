"""A live line for long work: done, failed, rate, time left. Silent where nobody looks."""

import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import TextIO, TypeVar

Item = TypeVar("Item")


def say(text: str, *, quiet: bool = False, stream: TextIO = sys.stderr) -> None:
    """Print a line on a terminal; nothing where nobody looks."""
    if not quiet and stream.isatty():
        stream.write(f"{text}\n")
        stream.flush()


def follow(
    items: Sequence[Item], what: str, *, quiet: bool = False, stream: TextIO | None = None
) -> Iterator[Item]:
    """Yield the items and show on a terminal how many are done.

    Parameters
    ----------
    items : sequence. what : word for the line, e.g. ``tests``.
    quiet : print nothing at all. stream : where to, by default standard error.
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


class Progress:
    """Progress of one study on a terminal.

    Parameters
    ----------
    quiet : bool
        Print nothing at all. Without a terminal nothing is printed either way.
    complete : frozenset of str
        Statuses that do not count as failed.
    stream : TextIO, by default standard error
    """

    def __init__(
        self,
        *,
        quiet: bool = False,
        complete: frozenset[str] = frozenset({"ok"}),
        stream: TextIO | None = None,
    ) -> None:
        self._stream = stream or sys.stderr
        self._live = not quiet and self._stream.isatty()
        self._complete = complete
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

    def advance(self, runs: int, counts: Mapping[str, int]) -> None:
        """Count runs that arrived, by status."""
        self._done += runs
        self._counts.update(counts)
        self._show()

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
        self._stream.write(
            f"\r{self._done}/{self._total} done, {self.failed} failed, "
            f"{rate:.1f} runs/s, {left:.0f} s left   "
        )
        self._stream.flush()
