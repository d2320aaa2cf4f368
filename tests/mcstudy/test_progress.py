"""The progress line: what it says on a terminal, and that it says nothing elsewhere."""

import io
import re

import pytest

from mcstudy.progress import Progress


class Terminal(io.StringIO):
    """A text stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def session(progress: Progress, done: int = 0) -> None:
    """Run 100 runs, of which some are on disk already, in two chunks."""
    progress.start(total=100, done=done)
    progress.advance(20, {"ok": 17, "unstable": 2, "no_head_contact": 1})
    progress.advance(80 - done, {"ok": 80 - done})
    progress.finish()


def test_the_line_counts_on_a_terminal() -> None:
    stream = Terminal()
    progress = Progress(complete=frozenset({"ok", "no_head_contact"}), stream=stream)
    session(progress)
    head, rest = stream.getvalue().split("\n", 1)
    assert head.startswith("100 runs;")
    first, second = rest.lstrip("\r").split("\r")
    assert first.startswith("20/100 done, 2 failed, ")
    assert second.startswith("100/100 done, 2 failed, ")
    assert re.search(r"\d+\.\d runs/s, 0 s left *\n$", second)
    assert progress.failed == 2


def test_a_resumed_session_says_what_is_there_already() -> None:
    stream = Terminal()
    session(Progress(stream=stream), done=30)
    assert "100 runs, 30 already done" in stream.getvalue()
    assert "\r50/100 done, 3 failed" in stream.getvalue()
    assert "\r100/100 done, 3 failed" in stream.getvalue()


def test_nothing_is_said_of_a_study_that_is_done() -> None:
    stream = Terminal()
    progress = Progress(stream=stream)
    progress.start(total=100, done=100)
    progress.finish()
    assert stream.getvalue() == ""


@pytest.mark.parametrize(("stream", "quiet"), [(io.StringIO(), False), (Terminal(), True)])
def test_silent_without_a_terminal_or_when_quiet(stream: io.StringIO, quiet: bool) -> None:
    progress = Progress(quiet=quiet, stream=stream)
    session(progress)
    assert stream.getvalue() == ""
    assert progress.failed == 3


def test_standard_output_stays_clean(capsys: pytest.CaptureFixture[str]) -> None:
    session(Progress())
    assert capsys.readouterr().out == ""
