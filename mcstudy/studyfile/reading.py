"""Study files: TOML, checked before anything runs."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from mcstudy.errors import UserError, on_one_line
from mcstudy.files import parse_toml
from mcstudy.studyfile.lines import with_line

Study = TypeVar("Study")

LONGEST = 200
"""Largest number of characters of a message."""
_MIXED = {"options": "a text, a number or a list of pairs of numbers",
          "fixed": "a number or a list of pairs of numbers"}  # fmt: skip
"""Contents of the tables whose values may be of several types."""


def check_study(text: str, source: str, kinds: TypeAdapter[Study]) -> Study:
    """Check the text of a study file.

    Parameters
    ----------
    text : str
        TOML.
    source : str
        Where it comes from, for messages.
    kinds : TypeAdapter
        Of the kinds of study that it may be.

    Raises
    ------
    UserError
        If something in it is wrong; the message names the source and the place in it.
    """
    table = parse_toml(text, source)
    try:
        return kinds.validate_python(table)
    except ValidationError as error:
        problem = with_line(first_problem(error, table), text)
        raise UserError(f"{source}: {problem}") from None


def first_problem(error: ValidationError, table: Mapping[str, Any]) -> str:
    """Return the first problem of a table, on one line, with its place in the file.

    Parameters
    ----------
    error : ValidationError
        Of the check.
    table : mapping
        The table as read from the file.
    """
    problem = error.errors(include_url=False)[0]
    kind = problem["type"]
    parts, typed = _place_in(table, problem["loc"], missing=kind == "missing")
    place = on_one_line(".".join(parts) or "study", LONGEST)
    mixed = next((part for part in parts if part in _MIXED), None)
    if mixed is not None and typed >= parts.index(mixed) + 2:
        place = on_one_line(".".join(parts[: parts.index(mixed) + 2]), LONGEST)
        return f"{place}: must be {_MIXED[mixed]}"
    if kind == "extra_forbidden":
        return f"{place}: unknown key"
    if kind == "missing":
        return f"{place}: missing"
    if kind == "union_tag_invalid":
        told = problem["ctx"]
        name, known = (
            str(told[key]).replace("'", "") for key in ("discriminator", "expected_tags")
        )
        given = on_one_line(repr(told["tag"]), 60)
        return f"{place}: {name} {given} is none of {known}"
    message = on_one_line(problem["msg"].removeprefix("Value error, "), LONGEST)
    given = problem.get("input")
    shown = (
        f" (given {on_one_line(repr(given), 60)})" if isinstance(given, str | int | float) else ""
    )
    return f"{place}: {message}{shown}"


def _place_in(
    table: Any, location: tuple[int | str, ...], *, missing: bool
) -> tuple[list[str], int]:
    """Return the parts of a location that the file has, and where the last other part was.

    Pydantic adds the chosen kind of study and of distribution to a location, and the type that it
    tried; the file does not have them. A missing key is the last part.
    """
    parts: list[str] = []
    other = 0
    for k, part in enumerate(location):
        inside = (
            part in table
            if isinstance(table, Mapping)
            else isinstance(table, Sequence) and isinstance(part, int) and part < len(table)
        )
        if inside:
            table = table[part]
            parts.append(str(part))
        elif missing and k == len(location) - 1:
            parts.append(str(part))
        else:
            other = len(parts)
    return parts, other
