"""What people give the readers, right and wrong: grammars of files for hypothesis.

Every grammar starts from a valid file and spoils some of it, so that most of what it gives comes
past the first check. Numbers, words and dates of the hostile kind are shared between them.
"""

import copy
import datetime
import decimal
import io
import json
import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from hypothesis import strategies as st
from pyarrow import parquet

Draw = Any
"""The function that draws within ``st.composite``."""

WORDS = (
    "", " ", "a", "[red]x[/red]", "a:b", "*?[a]", "/etc/passwd", "../up", "nul\0byte",
    "\x1b[31mred", "$x^{2$", "%s %d {0} {x}", "back\\slash", "é" * 300, "<script>alert(1)</script>",
    "\u202eright", "\ufeffmark", "\N{PILE OF POO}", "w" * 5000, "NaN", "NOVALUE", "line\nbreak",
    "tab\tstop", "'single'", '"double"', "٣", "½", "１２", "\x85", "\u2028", "#", "=", "|", "con",
)  # fmt: skip
"""Texts that are nobody's names."""
NUMBERS = (
    "0", "-0.0", "-1", "1", "0.5", "1.5", "3", "7", "1e308", "-1e308", "1.7e308", "1e-308",
    "5e-324", "1e400", "nan", "-nan", "inf", "-inf", "9" * 250, "-" + "9" * 250, "9" * 5000,
    "9223372036854775807", "9223372036854775808", "18446744073709551616", "1e100", "1e-100",
    "1e30", "1e-30", "0x" + "f" * 300, "1_000", "1e15", "1e-9",
)  # fmt: skip
"""Numbers as TOML writes them, from plain to absurd."""
ODD_VALUES = (
    "true", "false", "[]", "{}", "[[]]", "[[0.0, 0.0]]", "[1, 'a', true]", "1979-05-27",
    "07:32:00", "1979-05-27T07:32:00Z", "1979-05-27 07:32:00.999999", "[1979-05-27, 07:32:00]",
    "[" * 60 + "]" * 60, "[" * 4000 + "]" * 4000, "{a = " * 40 + "1" + "}" * 40, '"\\ud800"',
    "{ distribution = 'uniform' }", "[{ a = 1 }, { a = 'b' }]", "''", "'''\nlong\n'''", "0b1",
    "[[0.0, 0.0], [0.1, 1e308]]", "[[0.0, 0.0], [1e-308, 1e308]]", "[[nan, 1.0], [0.1, inf]]",
    "[0.0, 0.0]", "[[1, 2, 3]]", "[-1.0, 1e308]", "not toml", "", "1 2", "\0", "'open",
)  # fmt: skip


@dataclass(frozen=True)
class Raw:
    """A value as it stands in a TOML file."""

    text: str


def hostile_values() -> st.SearchStrategy[Any]:
    """Return values that a key of a TOML file is given in place of its own."""
    return st.one_of(
        st.sampled_from(NUMBERS).map(Raw),
        st.sampled_from(ODD_VALUES).map(Raw),
        st.sampled_from(WORDS),
        st.floats(),
        st.integers(-(2**70), 2**70),
        st.text(max_size=12),
    )


def toml_text(tree: Mapping[str, Any]) -> str:
    """Return a TOML text of a tree whose leaves may be ``Raw``."""
    plain = [f"{_key(k)} = {_inline(v)}" for k, v in tree.items() if not isinstance(v, dict)]
    tables = []
    for key, value in tree.items():
        if isinstance(value, dict):
            tables.append(f"\n[{_key(key)}]")
            tables += [f"{_key(k)} = {_inline(v)}" for k, v in value.items()]
    return "\n".join([*plain, *tables, ""])


def _key(name: str) -> str:
    plain = name and all(c.isascii() and (c.isalnum() or c in "_-") for c in name)
    return name if plain else _quoted(name)


def _quoted(text: str) -> str:
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(whole, ensure_ascii=False).replace("\x7f", "\\u007F")


def _inline(value: Any) -> str:
    if isinstance(value, Raw):
        return value.text
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {_inline(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_inline(v) for v in value) + "]"
    return repr(value)


def _keys(container: Any) -> Sequence[Any]:
    return list(container) if isinstance(container, dict) else range(len(container))


def places(tree: Any) -> list[tuple[Any, Any]]:
    """Return every container of a tree with each of its keys."""
    inner = (tree[key] for key in _keys(tree) if isinstance(tree[key], dict | list))
    return [(tree, key) for key in _keys(tree)] + [spot for part in inner for spot in places(part)]


NAMED = st.sampled_from(WORDS) | st.text(max_size=8)
SPOILS = ("value", "value", "value", "scale", "drop", "rename", "add", "swap", "wrap", "twin")


def _spoil_tree(draw: Draw, tree: dict[str, Any]) -> None:
    """Change one place of a tree."""
    if not (spots := places(tree)):
        return
    container, key = draw(st.sampled_from(spots))
    what, old, named = draw(st.sampled_from(SPOILS)), container[key], isinstance(container, dict)
    if what == "value":
        container[key] = draw(hostile_values())
    elif what == "scale" and isinstance(old, int | float) and not isinstance(old, bool):
        power = draw(st.sampled_from(["e5", "e-5", "e300", "e-300"]))
        container[key] = Raw(f"{old:f}{power}" if isinstance(old, float) else str(-old))
    elif what == "drop":
        del container[key]
    elif what in ("rename", "add") and named:
        container[draw(NAMED)] = container.pop(key) if what == "rename" else draw(hostile_values())
    elif what in ("add", "twin") and not named:
        container.append(copy.deepcopy(old) if what == "twin" else draw(hostile_values()))
    elif what == "swap":
        other, place = draw(st.sampled_from(spots))
        container[key] = copy.deepcopy(other[place]) if place in _keys(other) else old
    elif what == "wrap":
        container[key] = [old] if draw(st.booleans()) else {"a": old}


def seldom(draw: Draw, times: int) -> bool:
    """Return true once in so many times."""
    return bool(draw(st.integers(0, times - 1)) == times - 1)


def _doubled(raw: bytes, at: int) -> bytes:
    lines = raw.split(b"\n")
    k = at % len(lines)
    return b"\n".join([*lines[: k + 1], *lines[k:]])


MARK = b"\xef\xbb\xbf"
SAVED: tuple[Callable[[bytes], bytes], ...] = (
    bytes, bytes, bytes, lambda raw: MARK + raw, lambda raw: raw.replace(b"\n", b"\r\n")
)  # fmt: skip
"""How programs save a text that is all right."""
DAMAGED: tuple[Callable[[bytes, int, bytes], bytes], ...] = (
    lambda raw, at, junk: raw.replace(b"\n", b"\r"),
    lambda raw, at, junk: raw.decode("utf-8", "replace").encode("utf-16"),
    lambda raw, at, junk: b"\xfe\xff" + raw.decode("utf-8", "replace").encode("utf-16-be"),
    lambda raw, at, junk: raw.replace(b"a", b"\xe4", 1),
    lambda raw, at, junk: raw[:at],
    lambda raw, at, junk: raw[:at] + junk + raw[at:],
    lambda raw, at, junk: raw[:at] + raw[at + 1 + 6 * len(junk) :],
    lambda raw, at, junk: _doubled(raw, at),
    lambda raw, at, junk: raw[:at] + b"\0" + raw[at:],
    lambda raw, at, junk: raw[:at] + MARK + raw[at:],
)
"""How files are damaged, at a place and with some junk."""


@st.composite
def spoilt_bytes(draw: Draw, text: str, often: int = 4) -> bytes:
    """Return a text as other programs save it, or once in so many times with damage."""
    raw = text.encode("utf-8", "surrogatepass")
    if not seldom(draw, often):
        return bytes(draw(st.sampled_from(SAVED))(raw))
    at, junk = draw(st.integers(0, len(raw))), draw(st.binary(max_size=6))
    return bytes(draw(st.sampled_from(DAMAGED))(raw, at, junk))


INPUTS: dict[str, Any] = {
    "impact_speed": {"distribution": "normal", "unit": "km/h", "mean": 30.0, "sd": 3.0,
                     "low": 20.0, "high": 40.0},
    "headform_mass": {"distribution": "uniform", "unit": "kg", "low": 2.0, "high": 3.0},
    "hood_force_scale": {"distribution": "lognormal", "median": 1.0, "sigma": 0.1},
    "impact_angle": {"distribution": "triangular", "unit": "deg", "low": 0.0, "mode": 1.0,
                     "high": 5.0},
}  # fmt: skip
HEADFORM: dict[str, Any] = {
    "name": "headform",
    "options": {"hood_curve": [[0.0, 0.0], [0.1, 10000.0]], "channel_class": 0.0},
}
_TOP: dict[str, Any] = {"format": "mcstudy-study/1", "name": "fuzz", "title": "A [b] *title*: $x$"}
_SAMPLED = _TOP | {"seed": 3, "max_failure_rate": 1.0, "model": HEADFORM, "inputs": INPUTS,
                   "fixed": {"hood_damping": {"value": 10.0, "unit": "N s/m"}}}  # fmt: skip
_TABLES: list[dict[str, Any]] = [
    {"title": "Published: [1]", "units": {"hic15": "1", "peak_force": "kN"},
     "rows": [{"label": "method *A*", "values": {"hic15": 900, "peak_force": 4.0}},
              {"label": "test", "kind": "observed", "values": {"hic15": 5000}}]}
]  # fmt: skip
STUDIES: dict[str, dict[str, Any]] = {
    "monte-carlo": _SAMPLED | {
        "kind": "monte-carlo", "design": {"method": "latin-hypercube", "n": 40,
                                          "replicate_size": 10},
        "dependence": {"correlations": [["impact_speed", "headform_mass", 0.3]]},
        "report": {"outputs": ["hic15", "peak_force"], "histories": 1,
                   "references": [{"output": "hic15", "value": 700.0, "label": "limit [1]",
                                   "kind": "limit"},
                                  {"output": "peak_force", "value": 3.0, "unit": "kN",
                                   "label": "seen: *"}]},
    },
    "effects": _SAMPLED | {
        "kind": "monte-carlo", "design": {"method": "monte-carlo", "n": 30},
        "effects": {"sensor_gain": {"factor": 1.08}}, "report": {"histories": 0},
    },
    "morris": _SAMPLED | {
        "kind": "morris", "design": {"n": 20, "levels": 4},
        "groups": {"test": ["impact_speed", "headform_mass"]},
        "report": {"outputs": ["hic15"], "resamples": 100},
    },
    "sobol": _SAMPLED | {
        "kind": "sobol", "design": {"n": 64, "start": 64, "second_order": False},
        "groups": {"test": ["impact_speed", "headform_mass"]},
        "report": {"outputs": ["hic15"], "resamples": 100},
    },
    "injury": _SAMPLED | {
        "kind": "injury", "age": 7.5, "design": {"n": 40, "replicate_size": 10},
        "mechanisms": {"impact": {"functions": {"nhtsa_lognormal": 1.0, "prasad_mertz": 3.0}}},
        "fronts": {"sedan": {"share": 3.0}, "suv": {"share": 1.0, "options": {
            "hood_curve": [[0.0, 0.0], [0.1, 20000.0]]}}},
        "scenarios": {"softer": {"title": "softer [hood]", "fixed": {
            "hood_force_scale": {"value": 0.5}}},
            "slower": {"title": "slower", "inputs": {"impact_speed": {
                "distribution": "uniform", "unit": "km/h", "low": 10.0, "high": 20.0}}}},
        "observed": [{"label": "fracture: *", "mechanism": "impact", "level": 3}],
        "limit": {"output": "hic15", "value": 700.0, "level": 3},
    },
    "model-comparison": _TOP | {
        "kind": "model-comparison", "seed": 3, "max_failure_rate": 1.0,
        "models": {"soft": HEADFORM, "stiff": {"name": "headform", "options": {
            "hood_curve": [[0.0, 0.0], [0.1, 20000.0]]}}},
        "inputs": INPUTS, "design": {"n": 40, "replicate_size": 10},
        "report": {"outputs": ["hic15", "peak_force"]}, "tables": _TABLES,
    },
    "reconstruction": _TOP | {
        "kind": "reconstruction", "model": HEADFORM, "tables": _TABLES,
        "strip_times": [0.0, 0.02],
        "fixed": {"impact_speed": {"value": 30.0, "unit": "km/h"},
                  "headform_mass": {"value": 2.5, "unit": "kg"}},
    },
}  # fmt: skip
"""A small study of every kind, which can be run."""


def paper_studies(configs: Path) -> dict[str, dict[str, Any]]:
    """Return the project's own studies, their designs made small."""
    found = {}
    for name in ("paper_study", "paper_sobol", "paper_morris", "population_injury",
                 "model_comparison", "paper_sobol_groups"):  # fmt: skip
        tree = tomllib.loads((configs / f"{name}.toml").read_text(encoding="utf-8"))
        tree["design"]["n"] = 64 if "sobol" in name else 20
        for key, small in (("start", 64), ("replicate_size", 10)):
            if key in tree["design"]:
                tree["design"][key] = small
        found[name] = tree
    return found


NAMES = (*INPUTS, "hood_damping", "hood_unloading_ratio", "friction_body_car", "hood_stiffness",
         "age", "nothing")  # fmt: skip
UNITS = ("1", "%", "m", "mm", "kg", "g_mass", "km/h", "m/s", "mph", "deg", "rad", "N s/m", "KM/H",
         "furlong", "g", "kN", "°", "")  # fmt: skip


_PLAIN = st.floats(0.0, 40.0).map(lambda value: round(value, 3))
_WIDE = st.sampled_from([0.0, -1.0, -5.0, 1e-9, 1e9, 1e-3, 1e3, 1e6, 0.1, 1.0])
_HUGE = st.sampled_from(
    [1e308, -1e308, 1.7e308, 5e-324, -5e-324, 1e-308, 1e300, 1e-300, 1e150, 1e16]
)
SIZES = st.sampled_from([_PLAIN] * 5 + [_WIDE, _HUGE]).flatmap(lambda held: held)
"""Numbers, most of them of the size that studies have."""
_NAME, _UNIT, _WORD = (st.sampled_from(names) for names in (NAMES, UNITS, WORDS))
_OUTPUT = st.sampled_from(["hic15", "peak_force", "clip_3ms", "permanent_dent", "wad", "nothing"])


def _table(optional: Sequence[str] = (), /, **keys: Any) -> st.SearchStrategy[dict[str, Any]]:
    """Return tables with these keys, of a strategy or of one value, and perhaps some others."""
    ends = {"low": SIZES, "high": SIZES, "unit": _UNIT}
    held = {k: v if isinstance(v, st.SearchStrategy) else st.just(v) for k, v in keys.items()}
    return st.fixed_dictionaries(held, optional={key: ends[key] for key in optional})


def _in_order(table: dict[str, Any]) -> dict[str, Any]:
    names = [key for key in ("low", "mode", "mean", "median", "high") if key in table]
    return table | dict(zip(names, sorted(table[key] for key in names), strict=True))


_ENDS, _FEW = ("low", "high", "unit"), st.lists(SIZES, min_size=1, max_size=4)
_ANY_ORDER = st.one_of(
    _table(("unit",), distribution="uniform", low=SIZES, high=SIZES),
    _table(("unit",), distribution="triangular", low=SIZES, mode=SIZES, high=SIZES),
    _table(_ENDS, distribution="normal", mean=SIZES, sd=SIZES),
    _table(_ENDS, distribution="lognormal", median=SIZES, sigma=SIZES),
    _table(_ENDS, distribution="growth-chart", age=_NAME, at=_FEW.map(sorted), L=_FEW, M=_FEW,
           S=_FEW),
)  # fmt: skip
DISTRIBUTIONS = st.one_of(_ANY_ORDER, *[_ANY_ORDER.map(_in_order)] * 3)
"""Tables of distributions whose numbers need not fit each other."""
_SIZE = st.sampled_from([1, 2, 4, 10, 16, 20, 64, 1000])
_METHOD = st.sampled_from(["monte-carlo", "latin-hypercube", "sobol"])
_KINDS = st.sampled_from(["observed", "limit", "simulated"])
_CLASS = st.sampled_from([0.0, 60.0, 180.0, 600.0, 1000.0, -1.0, 1e308])
_EFFECT = st.sampled_from(
    ["sensor_gain", "mass_error", "hood_bottoming", "rate_dependent_hood", "nothing"]
)
_PARAMETER = st.sampled_from(["factor", "error", "depth", "stiffness", "exponent", "a"])
_KNOTS = st.lists(st.lists(SIZES, min_size=2, max_size=2), max_size=4)
VARIATIONS: dict[tuple[str, ...], st.SearchStrategy[Any]] = {
    ("title",): _WORD | st.text(max_size=20),
    ("inputs", "*"): DISTRIBUTIONS,
    ("inputs", "impact_speed"): DISTRIBUTIONS,
    ("fixed", "*"): _table(value=SIZES, unit=_UNIT),
    ("dependence",): _table(correlations=st.lists(
        st.tuples(_NAME, _NAME, st.floats(-1.1, 1.1)).map(list), max_size=4)),
    ("design",): st.tuples(_METHOD, _SIZE, st.integers(1, 5), st.booleans()).map(
        lambda held: {"method": held[0], "n": held[1] * held[2]}
        | ({"replicate_size": held[1]} if held[3] else {})),
    ("report",): st.fixed_dictionaries(
        {"outputs": st.lists(_OUTPUT, max_size=4)},
        optional={"references": st.lists(
            _table(output=_OUTPUT, value=SIZES, label=_WORD, unit=_UNIT, kind=_KINDS), max_size=3)},
    ),
    ("limit",): _table(output=_OUTPUT, value=SIZES, level=st.integers(0, 7)),
    ("effects",): st.dictionaries(
        _EFFECT, st.dictionaries(_PARAMETER, SIZES, min_size=1, max_size=1), min_size=1, max_size=1
    ),
    ("model", "options"): _table(
        hood_curve=_KNOTS.map(lambda knots: [[0.0, 0.0], *sorted(knots)]), channel_class=_CLASS),
    ("groups",): st.dictionaries(_NAME | _WORD, st.lists(_NAME, max_size=3), max_size=1),
    ("tables",): st.tuples(_WORD, _OUTPUT, _UNIT, _WORD, SIZES).map(
        lambda held: [{"title": held[0], "units": {held[1]: held[2]},
                       "rows": [{"label": held[3], "values": {"hic15": held[4]}}]}]),
}  # fmt: skip
"""What of a study is varied within its grammar; ``*`` is any name."""


def _vary(draw: Draw, tree: dict[str, Any], variations: Mapping[tuple[str, ...], Any]) -> None:
    own = {"limit": tree.get("kind") == "injury", "inputs": "inputs" in tree,
           "model": "model" in tree, "tables": "tables" in tree}  # fmt: skip
    table, *inner = draw(st.sampled_from([p for p in variations if own.get(p[0], True)]))
    place = tree.setdefault(table, {}) if inner else tree
    key = inner[0] if inner else table
    place[draw(_NAME) if key == "*" else key] = draw(variations[table, *inner])


@st.composite
def study_trees(draw: Draw, studies: Mapping[str, Any], *, spoilt: bool = True) -> dict[str, Any]:
    """Return trees of study files: some of their values varied, some of them spoilt."""
    tree: dict[str, Any] = copy.deepcopy(dict(studies[draw(st.sampled_from(sorted(studies)))]))
    for _ in range(draw(st.integers(0, 3))):
        _vary(draw, tree, VARIATIONS)
    if spoilt:
        for _ in range(draw(st.sampled_from([0, 1, 1, 1, 2, 3]))):
            _spoil_tree(draw, tree)
    return tree


@st.composite
def study_files(draw: Draw, studies: Mapping[str, Any]) -> bytes:
    """Return study files, right and wrong."""
    text = toml_text(draw(study_trees(studies)))
    raw: bytes = draw(spoilt_bytes(text))
    return raw


CELLS = (
    "", " ", "0", "1", "-1", "yes", "no", "TRUE", "False", "1.0", "NA", "n/a", "nan", "null", "inf",
    "-inf", "Infinity", "1e308", "1e400", "1e-400", "5e-324", "1e100", "1e101", "9" * 250, "1,5",
    "1.5", "1_0", "٣", "１２", "½", "0x10", "+5", "- 5", "1e", "--", "é", "1;2", '"', "'", "2,000",
    "\N{MINUS SIGN}5", "1\xa0000", "100 ", "=1+1", "1e-100", "1e99", "6", "7", "3.5", "hic",
)  # fmt: skip


@st.composite
def case_columns(draw: Draw) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of a table of cases, as text with decimal points."""
    count = draw(st.sampled_from([20, 30, 12, 8, 5, 3, 2, 1, 0]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    scale = draw(st.sampled_from(
        [800.0] * 5 + [1e-3, 1e-99, 1e99, 1e-8, 1e12, 1e102, 1e300]
    ))  # fmt: skip
    spread = draw(st.sampled_from([0.0, 1e-12, 1e-6, 0.1, 0.5, 0.5, 0.5, 3.0, 60.0]))
    with np.errstate(over="ignore", under="ignore"):
        blow = scale * np.exp(spread * rng.standard_normal(count))
        stands = scale * np.exp(0.4 * rng.standard_normal(count))
    injured = blow > stands if draw(st.booleans()) else rng.random(count) < 0.5
    digits = draw(st.sampled_from([1, 3, 6, 17]))
    shown = [f"{value:.{digits}g}" for value in blow]
    shape = draw(st.sampled_from(["injured", "ais", "bounds", "exact", "both"]))
    columns = {"hic": shown}
    if shape in ("injured", "exact", "both"):
        columns["injured"] = [str(int(flag)) for flag in injured]
    if shape == "exact":
        columns["exact"] = [str(int(flag and rng.random() < 0.6)) for flag in injured]
    if shape in ("ais", "both"):
        columns["ais"] = [str(int(rng.integers(3, 7) if flag else rng.integers(0, 3)))
                          for flag in injured]  # fmt: skip
    if shape == "bounds":
        kinds = rng.integers(0, 4, count)
        low = np.where(kinds == 0, np.nan, 0.7 * blow)
        with np.errstate(over="ignore"):
            high = np.where(kinds == 1, np.nan, np.where(kinds == 2, 0.7 * blow, 1.3 * blow))
        empty = draw(st.sampled_from(["", "NA", "inf"]))
        columns = {
            "hic_low": ["" if math.isnan(v) else f"{v:.{digits}g}" for v in low],
            "hic_high": [empty if math.isnan(v) else f"{v:.{digits}g}" for v in high],
        }
    if draw(st.integers(0, 3)) == 0:
        weights = draw(st.sampled_from(["whole", "parts", "huge", "tiny", "mixed"]))
        drawn = {"whole": rng.integers(1, 9, count).astype(float), "parts": rng.random(count) + 0.1,
                 "huge": np.full(count, 1e99), "tiny": np.full(count, 1e-99),
                 "mixed": 10.0 ** rng.uniform(-99, 99, count)}[weights]  # fmt: skip
        columns["weight"] = [f"{v:.6g}" for v in drawn]
    if draw(st.integers(0, 3)) == 0:
        columns[draw(st.sampled_from(["", "note", "Weight", "hic ", "who\n"]))] = [
            draw(st.sampled_from(CELLS)) for _ in range(count)
        ]
    head, rows = list(columns), [list(row) for row in zip(*columns.values(), strict=True)]
    for _ in range(draw(st.sampled_from([0, 0, 0, 0, 0, 1, 3])) if rows else 0):
        row = draw(st.sampled_from(rows))
        row[draw(st.integers(0, len(row) - 1))] = draw(st.sampled_from(CELLS))
    if seldom(draw, 15):
        k = draw(st.integers(0, len(head) - 1))
        head[k] = draw(st.sampled_from([*WORDS, *head]))
    return head, rows


@st.composite
def csv_files(draw: Draw) -> bytes:
    """Return tables of cases as CSV files of any program."""
    head, rows = draw(case_columns())
    separator = draw(st.sampled_from([",", ",", ",", ";", ";", "\t", "|"]))
    comma = separator != "," and draw(st.booleans())
    lines = [list(row) for row in ([] if seldom(draw, 20) else [head])]
    lines += [[field.replace(".", ",") if comma else field for field in row] for row in rows]
    for _ in range(draw(st.integers(1, 2)) if lines and seldom(draw, 8) else 0):
        row = draw(st.sampled_from(lines))
        if draw(st.booleans()):
            row.append(draw(st.sampled_from(CELLS)))
        elif row:
            row.pop()
    quote = draw(st.sampled_from(["never", "needed", "needed", "all", "wrong"]))

    def field(text: str) -> str:
        inside = text.replace('"', '""')
        if quote == "all" or (quote == "needed" and any(c in text for c in separator + '"\n')):
            return f'"{inside}"'
        return f'"{text}' if quote == "wrong" and text == "1.0" else text

    text = "\n".join(separator.join(map(field, row)) for row in lines) + "\n"
    above = draw(st.sampled_from([""] * 8 + [f"sep={separator}\n", "sep=\n", "\n\n", "# x\n"]))
    raw: bytes = draw(spoilt_bytes(above + text))
    return raw


def _plain(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _integers(values: Sequence[float], top: int) -> list[int | None]:
    return [int(v) % top if math.isfinite(v) and abs(v) < 2**62 else None for v in values]


DAY = datetime.datetime(2020, 1, 1)
Column = Callable[[list[str], list[float]], Any]
COLUMNS: dict[str, tuple[int, Column]] = {
    "float64": (20, lambda _, v: pa.array(v, pa.float64())),
    "whole": (12, lambda _, v: pa.array([k or 0 for k in _integers(v, 2**62)], pa.int64())),
    "nullable": (1, lambda _, v: pa.array(_integers(v, 2**62), pa.int64())),
    "float32": (1, lambda _, v: pa.array(np.array(v).astype("float32"))),
    "float16": (1, lambda _, v: pa.array(np.array(v).astype("float16"))),
    "int8": (1, lambda _, v: pa.array(_integers(v, 100), pa.int8())),
    "uint64": (1, lambda _, v: pa.array(_integers(v, 2**62), pa.uint64())),
    "bool": (1, lambda _, v: pa.array([None if math.isnan(k) else k > 0.5 for k in v], pa.bool_())),
    "string": (1, lambda f, _: pa.array(f, pa.string())),
    "large": (1, lambda f, _: pa.array(f, pa.large_string())),
    "category": (1, lambda f, _: pa.array(f, pa.string()).dictionary_encode()),
    "bytes": (1, lambda f, _: pa.array([k.encode("utf-8", "replace") for k in f], pa.binary())),
    "datetime": (1, lambda f, _: pa.array([DAY] * len(f), pa.timestamp("us"))),
    "date": (1, lambda f, _: pa.array([DAY.date()] * len(f), pa.date32())),
    "time": (1, lambda f, _: pa.array([DAY.time()] * len(f), pa.time64("us"))),
    "duration": (1, lambda f, _: pa.array([DAY - DAY] * len(f), pa.duration("us"))),
    "decimal": (1, lambda _, v: pa.array(
        [decimal.Decimal(k or 0) for k in _integers(v, 2**62)], pa.decimal128(38, 3))),
    "list": (1, lambda _, v: pa.array([[k] for k in v], pa.list_(pa.float64()))),
    "dict": (1, lambda _, v: pa.array([{"a": k} for k in v], pa.struct([("a", pa.float64())]))),
    "null": (1, lambda f, _: pa.nulls(len(f))),
    "mixed": (1, lambda _, v: pa.array([None if j % 3 else k for j, k in enumerate(v)],
                                       pa.float64())),
}  # fmt: skip
"""Types of a column of Parquet: how often, and what becomes of its fields and their numbers."""


@st.composite
def parquet_files(draw: Draw) -> bytes:
    """Return tables of cases with columns of any type that Parquet has, some of them torn."""
    head, rows = draw(case_columns())
    kinds = st.sampled_from([make for often, make in COLUMNS.values() for _ in range(often)])
    names, arrays = [], []
    for k, name in enumerate(head):
        fields = [row[k] for row in rows]
        names.append(draw(st.sampled_from(head)) if seldom(draw, 40) else name)
        with np.errstate(over="ignore"):
            arrays.append(draw(kinds)(fields, [_plain(text) for text in fields]))
    if seldom(draw, 40):
        names, arrays = [], []
    sink = io.BytesIO()
    try:
        parquet.write_table(pa.table(arrays, names=names), sink)
    except (pa.ArrowException, ValueError):
        # What Parquet itself has no place for.
        return b"PAR1"
    raw = sink.getvalue()
    if not seldom(draw, 6):
        return raw
    at = draw(st.integers(0, len(raw) - 1))
    return draw(st.sampled_from([raw[:at], raw[:at] + b"\xff" + raw[at + 1 :], raw[at:], b""]))


RATE = 1e-4


def pulse(
    count: int = 260, quiet: int = 60, peak: float = 100.0, width: int = 120, rate: float = RATE
) -> tuple[np.ndarray, np.ndarray]:
    """Return times (s) and accelerations (g) of a headform test that can be fitted."""
    time = rate * (np.arange(count) - quiet)
    phase = np.clip(time / (rate * width), 0.0, 1.0)
    return time, peak * np.sin(np.pi * phase**0.9) ** 1.2


@dataclass
class MmeFile:
    """A file of an ISO-MME test: header lines and what stands below."""

    header: list[tuple[str, str]]
    samples: list[str] = field(default_factory=list)

    def text(self, gap: str = " :") -> str:
        """Return the text of the file."""
        lines = [f"{key}{gap}{value}" for key, value in self.header]
        return "\n".join([*lines, *self.samples, ""])


HEADER_VALUES = ("", "NOVALUE", "novalue", "0", "-1", "1", "2", "nan", "inf", "1e308", "1e-308",
                 "9" * 250, "8,33", "8.33 m/s", "30 km/h", "30 KM/H", "1e-4 s", "0.1 ms", "m/(s*s)",
                 "G", "g", "MM", "explicit", "IMPLICIT", "failed", "channel failed", "ok",
                 "no data", "questionable", "TIME", "a:b", "*", "[1]", "é",
                 "5e-324", "1e400", "260", "1000",
                 "CFC 60", "180.0", "x" * 3000, "11TIRS000000TI00", "001", "\x1b[0m")  # fmt: skip
CODES = ("D0HEAD0000H3ACXA", "D0HEAD0000H3ACYA", "D0HEAD0000H3ACZA", "D0HEADCG00PCACRA",
         "11HEAD0000H3ACRC", "D0HEADCG00PCACR0", "D0HEAD003CPCACRA", "D0CHST0000PCACRA",
         "00TIRS000000TI00", "NOVALUE", "", "head", "2DHEADCG00PCACRA", "é" * 16)  # fmt: skip
SAMPLES = ("NOVALUE", "nan", "inf", "-inf", "1e308", "-1e308", "1e400", "5e-324", "1,5", "1 2", "",
           "text", "9" * 250, "1_0", "a:b", "٣", "0x1", "-", "1e", "\t1.0", "1.0E+00", "+.5",
           "1d3", "\x0c", "1e300")  # fmt: skip


@st.composite
def mme_tests(draw: Draw) -> dict[str, bytes]:
    """Return the files of a folder of ISO-MME tests by relative path."""
    files: dict[str, bytes] = {}
    for k in range(draw(st.sampled_from([1, 1, 1, 2, 3]))):
        name = draw(st.sampled_from([f"T{k}", f"T{k}", "a.b", "Ä", f"T [{k}]", "x*", "T:1"]))
        files |= draw(_mme_test(name, f"{k}/" if draw(st.integers(0, 9)) else ""))
    return files


@st.composite
def _mme_test(draw: Draw, name: str, place: str) -> dict[str, bytes]:
    speed = draw(st.sampled_from(["8.33", "8.33", "8.33", "30 km/h", "0.001", "1e6"]))
    head = MmeFile([("Title", draw(st.sampled_from(["Hood: [A]", *WORDS[:18]]))),
                    ("Velocity test object 1", speed), ("Mass test object 1", "2.5"),
                    ("Number of test objects", "1")])  # fmt: skip
    time, values = draw(signals())
    shape = draw(
        st.sampled_from(
            ["resultant", "axes", "reference", "resultant", "axes", "reference", "two", "other"]
        )
    )
    codes = {"resultant": CODES[3:4], "axes": CODES[:3], "two": CODES[3:5],
             "other": CODES[7:8], "reference": (CODES[3], CODES[8])}[shape]  # fmt: skip
    channels = []
    step = time[1] - time[0] if time.size > 1 else RATE
    for code in codes:
        is_time = code[12:14] == "TI"
        shown = time if is_time else values / (math.sqrt(3.0) if shape == "axes" else 1.0)
        channels.append(MmeFile(
            [("Test object number", "1"), ("Channel code", code),
             ("Unit", "s" if is_time else "g"), ("Data status", "ok"),
             ("Reference channel", "explicit" if shape == "reference" and not is_time
              else "implicit"),
             ("Sampling interval", f"{step:.9g}"),
             ("Time of first sample", f"{time[0] if time.size else 0.0:.9g}"),
             ("Number of samples", str(len(shown)))],
            [f"{v:.6E}" for v in shown],
        ))  # fmt: skip
    if seldom(draw, 6):
        channels.append(MmeFile([("Channel code", draw(st.sampled_from(CODES)))], ["1.0"]))
    index = MmeFile([("Number of channels", str(len(channels)))])
    index.header += [(f"Name of channel {k + 1:03d}", f"{code} / words")
                     for k, code in enumerate(codes)]  # fmt: skip
    for _ in range(draw(st.sampled_from([0, 0, 0, 1, 1, 2, 3]))):
        _spoil_mme(draw, draw(st.sampled_from([head, *channels, *channels])))
    gap = draw(st.sampled_from([":", " :", "  : ", "\t:"]))
    ending = draw(st.sampled_from([".mme", ".mme", ".MME"]))
    found = {f"{place}{name}{ending}": draw(spoilt_bytes(head.text(gap), 20))}
    folder = "Channels" if seldom(draw, 30) else draw(st.sampled_from(["Channel", "CHANNEL"]))
    for k, channel in enumerate(channels):
        found[f"{place}{folder}/{name}.{k + 1:03d}"] = draw(spoilt_bytes(channel.text(gap), 20))
    if draw(st.booleans()):
        found[f"{place}{folder}/{name}.chn"] = draw(spoilt_bytes(index.text(gap), 20))
    return found


def _spoil_mme(draw: Draw, file: MmeFile) -> None:
    ways = ["value", "value", "drop", "twice", "case", "no colon"]
    what = draw(st.sampled_from(
        [*ways, "sample", "sample", "cut", "more", "all"] if file.samples else ways
    ))  # fmt: skip
    samples, head = file.samples, file.header
    at = draw(st.integers(0, max(0, len(samples if what in ("sample", "cut") else head) - 1)))
    if what == "cut":
        del samples[at:]
    elif what in ("sample", "all"):
        where = slice(at, at + 1) if what == "sample" else slice(None)
        samples[where] = [draw(st.sampled_from(SAMPLES))] * len(samples[where])
    elif what == "more":
        samples += draw(st.lists(st.sampled_from(SAMPLES), min_size=1, max_size=3))
    elif head:
        key, value = head.pop(at)
        pool = (*CODES, *HEADER_VALUES) if key == "Channel code" else HEADER_VALUES
        other = draw(st.sampled_from(pool))
        spelt = draw(st.sampled_from([key.upper(), key.lower(), f" {key} "]))
        head[at:at] = {
            "value": [(key, other)], "drop": [], "twice": [(key, value), (key, other)],
            "case": [(spelt, value)], "no colon": [(key.replace(" ", ":", 1), value)],
        }[what]  # fmt: skip


@st.composite
def signals(draw: Draw) -> tuple[np.ndarray, np.ndarray]:
    """Return times (s) and accelerations (g) of tests, most of which can be fitted."""
    time, values = pulse(
        peak=draw(st.sampled_from([170.0] * 20 + [1e-3, 1.0, 1e4, -100.0, 1e300, 0.0, 1e-300])),
        quiet=draw(st.sampled_from([60] * 8 + [0, 200])),
        width=draw(st.sampled_from([120] * 8 + [10, 3, 400])),
        rate=draw(st.sampled_from([RATE] * 20 + [1e-2, 1e-7, 1e-12, 10.0, 1e-300, 1e300])),
    )
    noise = draw(st.sampled_from([0.0, 0.0, 0.3, 30.0]))
    if noise:
        rng = np.random.default_rng(draw(st.integers(0, 99)))
        values = values + noise * rng.standard_normal(values.size)
    count = draw(st.sampled_from([260] * 20 + [130, 9, 7, 1, 0]))
    return time[:count], values[:count]


MEASURED: dict[str, Any] = {
    "format": "mcstudy-measured/1",
    "title": "Hood: [B] *",
    "model": "headform",
    "fixed": {"headform_mass": 2.5},
    "uncertain": {"hood_force_scale": {"distribution": "lognormal", "median": 1.0, "sigma": 0.06}},
    "inputs": {"impact_speed": {"unit": "m/s", "sd": 0.05}},
    "scalars": {"hic15": {"sd": 20.0}},
    "signals": {"head_acceleration": {"unit": "g", "sd": 1.0, "filter": "CFC1000"}},
}


@st.composite
def measured_folders(draw: Draw) -> dict[str, bytes]:
    """Return the files of a folder of measured data by relative path."""
    tree = copy.deepcopy(MEASURED)
    count = draw(st.sampled_from([3, 3, 4, 1, 0]))
    for _ in range(draw(st.sampled_from([0, 0, 0, 1, 1, 2]))):
        _vary(draw, tree, VARIED)
    for _ in range(draw(st.sampled_from([0, 0, 0, 0, 1, 2]))):
        _spoil_tree(draw, tree)
    odd = st.sampled_from(["H0", "a b", "é", "..", "", "1", "[x]*:"])
    names = [draw(odd) if seldom(draw, 20) else draw(st.sampled_from([f"H{k}", f"t.{k}-x"]))
             for k in range(count)]  # fmt: skip
    rows = [["test", "impact_speed", "hic15"], *([name, "8.33", "600"] for name in names)]
    files = {"measured.toml": draw(spoilt_bytes(toml_text(tree), 12))}
    files["tests.csv"] = draw(_table_bytes(rows))
    for name in names:
        if "/" in name or not name or name == ".." or draw(st.integers(0, 29)) == 0:
            continue
        time, values = draw(signals())
        table = [["time", "head_acceleration"]]
        digits = draw(st.sampled_from([7, 7, 7, 12, 9, 4, 3]))
        table += [[f"{t:.{digits}f}" if abs(t) < 1e20 else f"{t:.{digits}e}", f"{v:.6g}"]
                  for t, v in zip(time, values, strict=True)]  # fmt: skip
        files[f"signals/{name}.csv"] = draw(_table_bytes(table))
    return files


_SIGNAL = st.sampled_from(["hic15", "head_acceleration", "hood_force", "ais", *NAMES])
_MEASURED_AS = _table(unit=_UNIT, sd=SIZES)
VARIED: dict[tuple[str, ...], st.SearchStrategy[Any]] = {
    ("model",): st.sampled_from(["headform", "multibody", "planar", *WORDS[:6]]),
    ("uncertain", "*"): DISTRIBUTIONS,
    ("fixed", "*"): SIZES | _KNOTS,
    ("inputs", "*"): _MEASURED_AS,
    ("inputs", "impact_speed"): _MEASURED_AS,
    ("scalars", "hic15"): _MEASURED_AS,
    ("scalars",): st.dictionaries(_SIGNAL, _MEASURED_AS, max_size=1),
    ("signals",): st.dictionaries(_SIGNAL, _MEASURED_AS, max_size=1),
    ("signals", "head_acceleration"): st.tuples(
        _MEASURED_AS, st.sampled_from(["none", "CFC60", "CFC1000", "CFC7"])
    ).map(lambda held: held[0] | {"filter": held[1]}),
}
"""What of the header of measured data is varied within its grammar."""


@st.composite
def _table_bytes(draw: Draw, rows: list[list[str]]) -> bytes:
    """Return a table as CSV with some of its fields spoilt."""
    for _ in range(draw(st.integers(1, 2)) if seldom(draw, 8) else 0):
        row = draw(st.sampled_from(rows))
        what = draw(st.sampled_from(["field", "field", "short", "long"]))
        if what == "field" and row:
            row[draw(st.integers(0, len(row) - 1))] = draw(st.sampled_from(CELLS))
        elif what == "short" and row:
            row.pop()
        else:
            row.append(draw(st.sampled_from(CELLS)))
    separator = draw(st.sampled_from([",", ",", ",", ";", "\t"]))
    comma = separator != "," and draw(st.booleans())
    text = "\n".join(
        separator.join(f.replace(".", ",") if comma else f for f in row) for row in rows
    )
    raw: bytes = draw(spoilt_bytes(text + "\n", 20))
    return raw


@st.composite
def whole_studies(draw: Draw) -> bytes:
    """Return studies of a headform, most of which can be run."""
    tree = draw(study_trees(STUDIES, spoilt=seldom(draw, 4)))
    return toml_text(tree).encode("utf-8", "replace")
