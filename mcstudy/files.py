"""Text files of other programs: byte order marks, code pages, line ends."""

import codecs
import re
import tomllib
from pathlib import Path
from typing import Any

from mcstudy.errors import UserError

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


def read_text(path: Path) -> str:
    """Return the text of a file: UTF-8, UTF-16 with a byte order mark, else Windows-1252.

    Raises
    ------
    UserError
        If the file cannot be read.
    """
    try:
        raw = path.read_bytes()
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read ({error})") from None
    try:
        return _marked(raw)
    except UnicodeDecodeError:
        pass
    try:
        # Older programs write the Western code page.
        return raw.decode("cp1252")
    except UnicodeDecodeError:
        # Windows-1252 leaves five bytes undefined.
        return raw.decode("latin-1")


def _marked(raw: bytes) -> str:
    """Return UTF-16 with a byte order mark or UTF-8 with or without one as text."""
    for mark, encoding in _MARKS:
        if raw.startswith(mark):
            return raw[len(mark) :].decode(encoding)
    return raw.decode("utf-8")


def lines_of(text: str) -> list[str]:
    """Return the lines of a text, ended by carriage return, line feed or both.

    ``str.splitlines`` also breaks at characters that stand within a line, such as the three dots
    of Windows-1252 read as Latin-1.
    """
    return re.split(r"\r\n|\r|\n", text)


def read_study_text(path: Path | str) -> str:
    """Return the text of a TOML file, which is UTF-8, without its byte order mark.

    Raises
    ------
    UserError
        If the file cannot be read or is no UTF-8.
    """
    try:
        return _marked(Path(path).read_bytes())
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read ({error})") from None


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Return the table of a TOML text.

    Raises
    ------
    UserError
        If it is no TOML; the message names ``source`` and the line.
    """
    try:
        return tomllib.loads(text.removeprefix("\ufeff"))
    except (ValueError, RecursionError) as error:
        raise UserError(f"{source}: not valid TOML: {_told(str(error), text)}") from None


def _told(message: str, text: str) -> str:
    """Return the message of TOML's reader, with the cure where a Windows path is at fault."""
    place = re.search(r"\(at line (\d+),", message)
    line = lines_of(text)[int(place[1]) - 1] if place else ""
    cure = "; a path with \\ stands in single quotes, or has / instead"
    return message[:200] + (cure if re.search(r'"[^"]*\\', line) else "")
