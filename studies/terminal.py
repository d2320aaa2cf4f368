"""Printing of any text on any terminal."""

import sys
from collections.abc import Iterable, Sequence
from typing import TextIO

from rich import box
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

WIDEST = 10_000
"""Columns where the output is not a terminal, so that no line is cut."""


def accept_any_text(streams: Iterable[TextIO]) -> None:
    """Let streams print a replacement for what their encoding has no character for."""
    for stream in streams:
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def printable(text: str) -> str:
    """Return a text without terminal control characters."""
    return "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)


def print_lines(lines: Iterable[str]) -> None:
    """Print paragraphs as plain text, without markup."""
    console = _console()
    for line in lines:
        console.print(Text(printable(line)), soft_wrap=not console.is_terminal)


def print_path(what: str, path: object) -> None:
    """Print a path without line breaks."""
    _console().print(Text(printable(f"{what}: {path}")), soft_wrap=True)


def print_table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table of plain text, without markup.

    On a terminal long cells are folded; elsewhere lines are not broken.

    Parameters
    ----------
    caption : str
        Title of the table.
    head : sequence of str
        Column titles.
    rows : iterable of sequence of str
        Cells by row.
    """
    shown = RichTable(
        title=Text(printable(caption)) if caption else None,
        box=box.HEAVY_HEAD if _draws_lines() else box.ASCII,
    )
    for name in head:
        shown.add_column(Text(printable(name)), overflow="fold")
    for row in rows:
        shown.add_row(*(Text(printable(cell)) for cell in row))
    _console().print(shown)


def _draws_lines() -> bool:
    """Return whether the output's encoding has the characters of a table's lines."""
    try:
        "━┃│".encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


def _console() -> Console:
    terminal = sys.stdout.isatty()
    return Console(
        markup=False, emoji=False, highlight=False, width=None if terminal else WIDEST
    )  # fmt: skip
