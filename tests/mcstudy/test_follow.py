"""The line for work on a list of things: counts on a terminal, silent elsewhere."""

import io

import pytest

from mcstudy.execution.progress import follow


class Terminal(io.StringIO):
    """A text stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_counts_and_names_on_a_terminal() -> None:
    stream = Terminal()
    work = follow(["A", "B"], "tests fitted", stream=stream)
    seen = [(item, stream.getvalue().rsplit("\x1b[K")[-1]) for item in work]
    assert seen == [("A", "0/2 tests fitted (A)"), ("B", "1/2 tests fitted (B)")]
    assert stream.getvalue().endswith("\r\x1b[K2/2 tests fitted\n")
    assert stream.getvalue().count("\n") == 1


@pytest.mark.parametrize(("stream", "quiet"), [(Terminal(), True), (io.StringIO(), False)])
def test_silent_where_nobody_looks(stream: io.StringIO, quiet: bool) -> None:
    assert list(follow([3, 1, 2], "runs", quiet=quiet, stream=stream)) == [3, 1, 2]
    assert stream.getvalue() == ""


def test_an_error_in_the_work_comes_through() -> None:
    work = follow([1, 2], "runs", stream=Terminal())
    next(work)
    with pytest.raises(KeyError):
        work.throw(KeyError("broken"))
