"""The lines for long work: what they say on a terminal, and that they say nothing elsewhere."""

import io
import re
import time

import numpy as np
import pandas as pd
import pytest
from mcstudy_tools import Terminal

from mcstudy.execution.progress import Progress, follow, watch

nobody_looks = pytest.mark.parametrize(
    ("stream", "quiet"), [(io.StringIO(), False), (Terminal(), True)]
)


def arrived(**counts: int) -> pd.DataFrame:
    """Return runs by status, whose hic15 alternates between 90 and 110."""
    status = [word for word, count in counts.items() for _ in range(count)]
    hic15 = np.where(np.arange(len(status)) % 2, 90.0, 110.0)
    return pd.DataFrame({"status": status, "hic15": hic15, "wad": np.nan})


def session(progress: Progress, done: int = 0) -> None:
    """Run 100 runs, of which some are on disk already, in two chunks."""
    progress.start(total=100, done=done)
    progress.advance(arrived(ok=17, unstable=2, no_head_contact=1))
    progress.advance(arrived(ok=80 - done))
    progress.finish()


def test_the_line_counts_on_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    stream = Terminal()
    progress = Progress(complete=frozenset({"ok", "no_head_contact"}), stream=stream)
    session(progress)
    head, rest = stream.getvalue().split("\n", 1)
    assert head.startswith("100 runs;")
    first, second = rest.replace("\x1b[K", "").lstrip("\r").split("\r")
    assert first.startswith("20/100 done, 2 failed, ")
    assert second.startswith("100/100 done, 2 failed, ")
    assert re.search(r"\d+\.\d runs/s, 0 s left *\n$", second)
    assert progress.failed == 2
    # Standard output stays clean.
    session(Progress())
    assert capsys.readouterr().out == ""


def test_a_resumed_session_says_what_is_there_already_and_nothing_of_one_that_is_done() -> None:
    stream = Terminal()
    session(Progress(stream=stream), done=30)
    assert "100 runs, 30 already done" in stream.getvalue()
    assert "\r\x1b[K50/100 done, 3 failed" in stream.getvalue()
    assert "\r\x1b[K100/100 done, 3 failed" in stream.getvalue()
    stream = Terminal()
    progress = Progress(stream=stream)
    progress.start(total=100, done=100)
    progress.finish()
    assert stream.getvalue() == ""


@nobody_looks
def test_silent_where_nobody_looks(stream: io.StringIO, quiet: bool) -> None:
    progress = Progress(quiet=quiet, stream=stream)
    session(progress)
    assert progress.failed == 3
    assert list(follow([3, 1, 2], "runs", quiet=quiet, stream=stream)) == [3, 1, 2]
    assert stream.getvalue() == ""


@pytest.mark.filterwarnings("error")
def test_the_widest_interval_is_that_of_the_mean_known_worst() -> None:
    stream, sizes = Terminal(), (3, 60, 37)
    progress = Progress(stream=stream, watched=("hic15", "wad"))
    progress.start(total=200, done=0)
    for size in sizes:
        # Of fewer than ten values nothing is said.
        assert (progress.widest is None) == (size != 37)
        progress.advance(arrived(ok=size))
    values = np.concatenate([arrived(ok=size)["hic15"] for size in sizes])
    reach = 1.96 * values.std(ddof=1) / np.sqrt(values.size) / values.mean()
    # Of wad no run has a value: nothing is said of it.
    assert progress.widest == ("hic15", pytest.approx(reach, rel=1e-12))
    assert f"hic15 ± {100.0 * reach:.2g} %" in stream.getvalue()
    # Numbers too large for their squares leave the width unknown.
    for size in (1e250, -1e250):
        progress.advance(arrived(ok=20).assign(hic15=size))
    assert progress.widest is None


def test_a_list_is_followed_by_counts_and_names() -> None:
    stream = Terminal()
    work = follow(["A", "B"], "tests fitted", stream=stream)
    seen = [(item, stream.getvalue().rsplit("\x1b[K")[-1]) for item in work]
    assert seen == [("A", "0/2 tests fitted (A)"), ("B", "1/2 tests fitted (B)")]
    assert stream.getvalue().endswith("\r\x1b[K2/2 tests fitted\n")
    assert stream.getvalue().count("\n") == 1
    # An error in the work comes through.
    work = follow([1, 2], "runs", stream=Terminal())
    next(work)
    with pytest.raises(KeyError):
        work.throw(KeyError("broken"))


def test_a_long_run_says_how_far_it_is_and_what_it_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mcstudy.execution.progress.PACE", 0.02)
    reached = [0.0]

    def work() -> str:
        reached[0] = 0.035
        time.sleep(0.1)
        return "done"

    stream = Terminal()
    assert watch(work, lambda: reached[0], stream=stream) == "done"
    assert "35 ms of the crash" in stream.getvalue()
    # The line is gone afterwards.
    assert stream.getvalue().endswith("\r\x1b[K")


@nobody_looks
def test_a_long_run_nobody_looks_at_says_nothing(stream: io.StringIO, quiet: bool) -> None:
    assert watch(lambda: 7, lambda: 0.0, quiet=quiet, stream=stream) == 7
    assert watch(lambda: 8, None, stream=Terminal()) == 8
    assert stream.getvalue() == ""


def test_the_error_of_a_long_run_is_its_own() -> None:
    def work() -> None:
        raise ValueError("age must lie within 4 and 90")

    with pytest.raises(ValueError, match="age must lie"):
        watch(work, lambda: 0.0, stream=Terminal())
