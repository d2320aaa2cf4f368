"""Lines of a TOML file at which its keys stand, for messages."""

import contextlib
import re
from collections.abc import Iterator

from mcstudy.errors import UserError
from mcstudy.files import lines_of

_KEY = r"""(?:"(?:[^"\\]|\\.)*"|'[^']*'|[A-Za-z0-9_-]+)"""
_KEYS = rf"{_KEY}(?:\s*\.\s*{_KEY})*"
_HEADER = re.compile(rf"\s*(\[\[?)\s*({_KEYS})\s*\]")
_PAIR = re.compile(rf"\s*({_KEYS})\s*=(.*)")


def with_line(message: str, text: str) -> str:
    """Return a message with the line of the place in a file that it begins with, if it has one.

    Parameters
    ----------
    message : str
        ``<place>: <problem>``, where the place is a dotted key; indices stand as ``.0`` or ``[0]``.
    text : str
        TOML.
    """
    place = re.sub(r"\[(\d+)\]", r".\1", message)
    best, line = "", 0
    for name, number in _lines(text).items():
        if len(name) > len(best) and re.match(rf"{re.escape(name)}(?=[.:])", place):
            best, line = name, number
    return f"{message} (line {line})" if line else message


@contextlib.contextmanager
def naming_lines(source: str, text: str) -> Iterator[None]:
    """Add file and line to the errors of the user within.

    Parameters
    ----------
    source : str
        Name of the file.
    text : str
        TOML.
    """
    try:
        yield
    except UserError as error:
        message = str(error).removeprefix(f"{source}: ")
        named = with_line(message, text)
        if named == message or re.search(r"\(line \d+\)$", message):
            raise
        raise UserError(f"{source}: {named}") from None


def _lines(text: str) -> dict[str, int]:
    """Return the line of every table and key by its dotted name."""
    found: dict[str, int] = {}
    counts: dict[str, int] = {}
    table, closing, depth = "", "", 0
    for number, line in enumerate(lines_of(text), start=1):
        if closing:
            closing = "" if closing in line else closing
            continue
        if depth == 0 and (header := _HEADER.match(line)):
            table = _name(header[2])
            if header[1] == "[[":
                found.setdefault(table, number)
                counts[table] = counts.get(table, -1) + 1
                table = f"{table}.{counts[table]}"
            else:
                table = _inside(table, counts)
            found.setdefault(table, number)
            continue
        value = line
        if depth == 0 and (pair := _PAIR.match(line)):
            name = _name(pair[1])
            found.setdefault(f"{table}.{name}" if table else name, number)
            value = pair[2]
        for quotes in ('"""', "'''"):
            if value.count(quotes) % 2:
                closing = quotes
        if not closing:
            bare = re.sub(r"""\"(?:[^"\\]|\\.)*\"|'[^']*'|#.*""", "", value)
            depth = max(
                0, depth + sum(bare.count(c) for c in "[{") - sum(bare.count(c) for c in "]}")
            )
    return found


def _name(keys: str) -> str:
    """Return a dotted key without quotes."""
    return ".".join(part.strip("\"'") for part in re.findall(_KEY, keys))


def _inside(table: str, counts: dict[str, int]) -> str:
    """Return the name of a table below an array of tables, with the index of the last of these."""
    for name, last in counts.items():
        if table.startswith(f"{name}."):
            return f"{name}.{last}{table[len(name) :]}"
    return table
