"""Errors of a study file name the line of the place that is wrong."""

import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcstudy.errors import UserError
from mcstudy.files import parse_toml
from mcstudy.studyfile.lines import naming_lines, with_line

TEXT = '''\
format = "x"

[design]   # [not.a.table]
n = 3
text = """
[design.n]
m = 5
"""

[inputs."impact speed"]
low = 1.0
[[tables]]
title = "first"
units = { wad = "m" }
[[tables]]
rows = [
  { label = "a = [", values = 1 },
]
title = "second"
[tables.more]
key = 'it"s'
last.of.all = 2
'''


@pytest.mark.parametrize(
    ("place", "line"),
    [
        ("format: must", 1),
        ("design: must", 3),
        ("design.n: must", 4),
        ("design.missing: missing", 3),
        ("inputs.impact speed.low: must", 11),
        ("tables.0.title: must", 13),
        ("tables[0].units.wad: must", 14),
        ("tables[1].rows[0].values: must", 16),
        ("tables.1.title: must", 19),
        ("tables.1.more.key: must", 21),
        ("tables.1.more.last.of.all: must", 22),
    ],
)
def test_the_line_of_the_nearest_place_is_named(place: str, line: int) -> None:
    assert with_line(place, TEXT) == f"{place} (line {line})"


@pytest.mark.parametrize("place", ["designs: must", "m: must", "label: must", "nothing here"])
def test_a_place_that_the_file_does_not_have_gets_no_line(place: str) -> None:
    assert with_line(place, TEXT) == place


def test_errors_of_later_checks_get_file_and_line() -> None:
    with (
        pytest.raises(UserError, match=r"^a\.toml: design\.n: too many \(line 4\)$"),
        naming_lines("a.toml", TEXT),
    ):
        raise UserError("design.n: too many")
    with (
        pytest.raises(UserError, match=r"^a\.toml: design\.n: odd \(line 4\)$"),
        naming_lines("a.toml", TEXT),
    ):
        raise UserError("a.toml: design.n: odd (line 4)")
    with pytest.raises(UserError, match=r"^results/x: is locked$"), naming_lines("a.toml", TEXT):
        raise UserError("results/x: is locked")


@pytest.mark.parametrize("path", [r"C:\Users\me\hood.toml", r"D:\data\x", r".\new\cars"])
def test_a_windows_path_in_double_quotes_is_told_its_cure(path: str) -> None:
    with pytest.raises(UserError, match=r"line 2.*single quotes, or has / instead"):
        parse_toml(f'a = 1\nb = "{path}"', "study.toml")
    assert parse_toml(f"b = '{path}'", "study.toml") == {"b": path}


def test_other_mistakes_are_not_taken_for_paths() -> None:
    with pytest.raises(UserError, match=r"line 1, column 5\)$"):
        parse_toml("a = = 1", "study.toml")


KEYS = st.text("abc-_1", min_size=1, max_size=4)
VALUES = st.sampled_from(
    ["1", '"a = b"', "'[x]'", "[1,\n 2]", "{ a = 1 }", '"""\nx = 1\n[y]\n"""', "true # = ["]
)


@given(st.dictionaries(KEYS, st.dictionaries(KEYS, VALUES, max_size=4), max_size=4))
def test_every_key_of_any_file_is_found_on_its_line(tables: dict[str, dict[str, str]]) -> None:
    lines: list[str] = []
    places: dict[str, int] = {}
    for name, pairs in tables.items():
        lines.append(f"[{name}]")
        places[name] = len("\n".join(lines).split("\n"))
        for key, value in pairs.items():
            lines.append(f"{key} = {value}")
            places[f"{name}.{key}"] = len("\n".join(lines[:-1]).split("\n")) + 1
    text = "\n".join(lines)
    table: dict[str, Any] = tomllib.loads(text)
    assert set(table) == set(tables)
    for place, line in places.items():
        assert with_line(f"{place}: x", text) == f"{place}: x (line {line})"
