"""What the command line prints: on any terminal, of any text, whole."""

import contextlib
import os
import pty
import re
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from mcstudy.errors import UserError
from studies import terminal

HOSTILE = "[bold]a[/bold] :smile: * ** [link=x]y[/] \\[z]"


@pytest.mark.parametrize("text", [HOSTILE, "1:2:3", "[", "]", "[/]", "a" * 500])
def test_nothing_in_a_text_is_markup(capsys: pytest.CaptureFixture[str], text: str) -> None:
    terminal.print_lines([text])
    terminal.print_path("report", Path("/tmp") / text.replace("/", "-"))
    terminal.print_table(text, [text], [[text]])
    assert capsys.readouterr().out.count(text) == 5 - ("/" in text)


def test_nothing_is_cut_where_the_output_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    row = [f"a_name_that_is_as_long_as_names_of_inputs_are_{k}" for k in range(8)]
    terminal.print_table("", [f"head {k}" for k in range(8)], [row])
    out = capsys.readouterr().out
    assert all(name in out for name in row)
    assert "\N{HORIZONTAL ELLIPSIS}" not in out


def test_characters_that_steer_a_terminal_are_replaced(capsys: pytest.CaptureFixture[str]) -> None:
    terminal.print_lines(["a\x1b[31mb\x07\x9bc"])
    assert capsys.readouterr().out == "a\ufffd[31mb\ufffd\ufffdc\n"
    assert str(UserError("x\x1b[2J\ny")) == "x\ufffd[2J y"


# -- processes of their own, which take seconds to start -------------------------------------

C_LOCALE = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}


def run(*arguments: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """Run the command line with another encoding of its output."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("LC_", "LANG"))}
    return subprocess.run(
        [sys.executable, "-c", "from studies.cli import main; main()", *arguments],
        env=kept | environment, capture_output=True, timeout=120, check=False,
    )  # fmt: skip


@pytest.mark.parametrize("encoding", ["cp437", pytest.param("cp932", marks=pytest.mark.slow)])
def test_any_encoding_of_the_terminal(encoding: str) -> None:
    done = run("models", "headform", PYTHONIOENCODING=encoding)
    assert done.returncode == 0, done.stderr
    assert done.stderr == b""
    assert "impact_speed" in done.stdout.decode(encoding)


def test_errors_in_the_c_locale() -> None:
    done = run("run", "gibt-es-nicht-\u00e4\u20ac.toml", **C_LOCALE)
    assert done.returncode == 2
    assert done.stderr.startswith(b"mcstudy: ")
    assert b"Traceback" not in done.stderr


@pytest.mark.slow
def test_the_c_locale() -> None:
    assert run("effects", **C_LOCALE).returncode == 0


def on_terminal(columns: int, *arguments: str, **environment: str) -> str:
    """Return what the command writes to a terminal of a width."""
    leader, follower = pty.openpty()
    termios.tcsetwinsize(follower, (40, columns))
    kept = {key: value for key, value in os.environ.items() if key not in ("COLUMNS", "NO_COLOR")}
    with subprocess.Popen(
        [sys.executable, "-c", "from studies.cli import main; main()", *arguments],
        env=kept | {"TERM": "xterm-256color", **environment}, stdout=follower, stderr=follower,
    ) as process:  # fmt: skip
        os.close(follower)
        written = b""
        with contextlib.suppress(OSError):
            while piece := os.read(leader, 65536):
                written += piece
    os.close(leader)
    assert process.returncode == 0, written
    return written.decode("utf-8")


def test_a_terminal_of_80_columns_and_no_colour() -> None:
    text = on_terminal(80, "models", "planar", NO_COLOR="1")
    assert "impact_speed" in text
    # Neither foreground nor background colours.
    assert not re.search(r"\x1b\[[0-9;]*(?:3|4|9|10)[0-9][;m]", text)
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)
    assert max(len(line) for line in plain.splitlines()) <= 80
