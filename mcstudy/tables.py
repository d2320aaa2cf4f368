"""CSV tables with commas, semicolons or tabs, read strictly.

A file whose columns are separated by semicolons or tabs may have decimal commas; with commas
between the columns a decimal comma is ambiguous and is refused. A row with another number of fields
than the header is refused, never shifted.
"""

import csv
import io
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcstudy.errors import UserError
from mcstudy.files import lines_of, read_text

Array = NDArray[np.float64]

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
_DECLARED = re.compile(r"sep=([,;\t]?)[,;\t]*", re.IGNORECASE)
"""Line above a table in which spreadsheets declare the separator of its columns."""
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)


@dataclass(frozen=True)
class TextTable:
    """A table of text fields as read from its file.

    Attributes
    ----------
    path : of the file.
    columns : fields by name of the column, without surrounding blanks.
    lines : line of the file in which each row ends.
    separator : between the columns.
    text : names of columns that hold no numbers.
    """

    path: Path
    columns: dict[str, list[str]]
    lines: list[int]
    separator: str
    text: Collection[str] = ()

    def fields(self, name: str) -> list[str]:
        """Return a column of text.

        Raises
        ------
        UserError
            If there is no such column.
        """
        if name not in self.columns:
            raise UserError(
                f"{self.path}: has no column {name!r}; it has {', '.join(self.columns)}"
            )
        return self.columns[name]

    def numbers(
        self, name: str, *, missing: Sequence[str] = (), infinite: bool = False, advice: str = ""
    ) -> Array:
        """Return a column of numbers, NaN where a field is empty.

        Parameters
        ----------
        name : str
            Name of the column.
        missing : sequence of str
            Lower-case words that count as empty.
        infinite : bool
            Whether ``inf`` is a number.
        advice : str
            Advice for the error message of a field that is no number.

        Raises
        ------
        UserError
            If there is no such column, or a field is no number; the message names its line.
        """
        fields = self.fields(name)
        comma = self.separator != "," and self._decimal_commas()
        column = np.full(len(fields), np.nan)
        for k, field in enumerate(fields):
            if not field or field.lower() in missing:
                continue
            plain = field.replace(",", ".") if comma and field.count(",") == 1 else field
            finite = _NUMBER.fullmatch(plain) and np.isfinite(float(plain))
            if not finite and not (infinite and _INFINITE.fullmatch(plain)):
                raise UserError(
                    f"{self.path}: line {self.lines[k]}: column {name!r} must hold numbers, not "
                    f"{field[:40]!r}{_hint(field)}{advice and f'; {advice}'}"
                )
            column[k] = float(plain)
        return column

    def _decimal_commas(self) -> bool:
        """Return whether the table writes decimal commas.

        Raises
        ------
        UserError
            If it writes decimal points as well: one of them separates thousands.
        """
        found = {}
        for sign in ",.":
            shape = re.compile(rf"[+-]?\d*{re.escape(sign)}\d+([eE][+-]?\d+)?")
            found[sign] = next(
                (
                    (self.lines[k], field)
                    for name, fields in self.columns.items()
                    if name not in self.text
                    for k, field in enumerate(fields)
                    if shape.fullmatch(field)
                ),
                None,
            )
        if found[","] is None:
            return False
        if found["."] is not None:
            (first, comma), (second, point) = found[","], found["."]
            raise UserError(
                f"{self.path}: line {first} has a decimal comma ({comma[:40]}), line {second} a "
                f"decimal point ({point[:40]}): write all numbers alike"
            )
        return True


def read_csv(path: Path, text: Collection[str] = ()) -> TextTable:
    """Read a table; the header line, or a line ``sep=;`` above it, determines the separator.

    Parameters
    ----------
    path : Path
        Of the file.
    text : collection of str
        Names of columns that hold no numbers.

    Raises
    ------
    UserError
        If the file cannot be read, names a column twice, or has a row with more or fewer fields
        than the header; the message names the line.
    """
    content = read_text(path)
    if "\0" in content:
        raise UserError(f"{path}: cannot be read (it holds zero bytes, it is no text)")
    separator = _separator_of(content)
    reader = csv.reader(io.StringIO(content, newline=""), strict=True, delimiter=separator)
    try:
        numbered = [
            (reader.line_num, [field.strip() for field in row])
            for row in reader
            if "".join(row).strip() or len(row) > 1
        ]
    except (ValueError, csv.Error) as error:
        raise UserError(f"{path}: cannot be read (line {reader.line_num}: {error})") from None
    if numbered and _DECLARED.fullmatch(",".join(numbered[0][1])):
        del numbered[0]
    (first, head), *body = numbered or [(1, [])]
    if not head or len(set(head)) < len(head):
        raise UserError(f"{path}: line {first} must name the columns, each once")
    for line, row in body:
        if len(row) != len(head):
            raise UserError(
                f"{path}: line {line} has {len(row)} fields, not {len(head)} as line {first}"
                + _comma_hint(row, separator)
            )
    return TextTable(
        path,
        {name: [row[k] for _, row in body] for k, name in enumerate(head)},
        [line for line, _ in body],
        separator,
        text,
    )


def _separator_of(text: str) -> str:
    """Return the most frequent separator of the first line that is not empty."""
    head = next((line for line in lines_of(text) if line.strip()), "")
    if declared := _DECLARED.fullmatch(head.strip(" ")):
        return declared[1] or ","
    unquoted = re.sub(r'"[^"]*"', "", head)
    return max(SEPARATORS, key=unquoted.count) if unquoted.strip() else ","


def _comma_hint(row: Sequence[str], separator: str) -> str:
    """Return advice if the row's first number seems to have a decimal comma."""
    if not row[-1]:
        return ": it ends with a separator"
    if separator != ",":
        return ""
    for k, (whole, part) in enumerate(pairwise(row), start=1):
        if re.fullmatch(r"[+-]?\d+", whole) and re.fullmatch(r"\d+", part):
            return (
                f": fields {k} and {k + 1} look like {whole[:20]},{part[:20]} with a decimal "
                "comma; write a decimal point, or separate the columns with semicolons"
            )
    return ""


def _hint(field: str) -> str:
    if re.fullmatch(r"[+-]?\d+,\d+", field):
        return " (a decimal comma: write a decimal point, or separate the columns with semicolons)"
    return ""
