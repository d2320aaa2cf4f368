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
from collections.abc import Mapping, Sequence
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


def places(tree: Any) -> list[tuple[Any, Any]]:
    """Return every container of a tree with each of its keys."""
    found = []
    keys = list(tree) if isinstance(tree, dict) else range(len(tree))
    for key in keys:
        found.append((tree, key))
        if isinstance(tree[key], dict | list):
            found += places(tree[key])
    return found


def _spoil_tree(draw: Draw, tree: dict[str, Any]) -> None:
    """Change one place of a tree."""
    spots = places(tree)
    if not spots:
        return
    container, key = draw(st.sampled_from(spots))
    what = draw(st.sampled_from(
        ["value", "value", "value", "scale", "drop", "rename", "add", "swap", "wrap", "twin"]
    ))  # fmt: skip
    old = container[key]
    if what == "value":
        container[key] = draw(hostile_values())
    elif what == "scale" and isinstance(old, int | float) and not isinstance(old, bool):
        power = draw(st.sampled_from(["e5", "e-5", "e300", "e-300"]))
        container[key] = Raw(f"{float(old):f}{power}" if isinstance(old, float) else str(-old))
    elif what == "drop":
        del container[key]
    elif what == "rename" and isinstance(container, dict):
        container[draw(st.sampled_from(WORDS) | st.text(max_size=8))] = container.pop(key)
    elif what == "add" and isinstance(container, dict):
        container[draw(st.sampled_from(WORDS) | st.text(max_size=8))] = draw(hostile_values())
    elif what == "add":
        container.append(draw(hostile_values()))
    elif what == "swap":
        other, place = draw(st.sampled_from(spots))
        container[key] = copy.deepcopy(other[place]) if place in _keys(other) else old
    elif what == "wrap":
        container[key] = [old] if draw(st.booleans()) else {"a": old}
    elif what == "twin" and isinstance(container, list):
        container.append(copy.deepcopy(old))


def _keys(container: Any) -> Sequence[Any]:
    return list(container) if isinstance(container, dict) else range(len(container))


SAVED = ("as it is", "as it is", "as it is", "mark", "crlf")
"""How programs save a text that is all right."""
DAMAGED = ("cr", "utf-16", "utf-16-be", "latin", "cut", "insert", "remove", "twice", "null",
           "late mark")  # fmt: skip


def seldom(draw: Draw, times: int) -> bool:
    """Return true once in so many times."""
    return bool(draw(st.integers(0, times - 1)) == times - 1)


@st.composite
def spoilt_bytes(draw: Draw, text: str, often: int = 4) -> bytes:
    """Return a text as other programs save it, or once in so many times with damage."""
    how = draw(st.sampled_from(DAMAGED if seldom(draw, often) else SAVED))
    raw = text.encode("utf-8", "surrogatepass")
    at = draw(st.integers(0, len(raw)))
    if how == "mark":
        return b"\xef\xbb\xbf" + raw
    if how == "crlf":
        return raw.replace(b"\n", b"\r\n")
    if how == "cr":
        return raw.replace(b"\n", b"\r")
    if how == "utf-16":
        return b"\xff\xfe" + text.encode("utf-16-le", "surrogatepass")
    if how == "utf-16-be":
        return b"\xfe\xff" + text.encode("utf-16-be", "surrogatepass")
    if how == "latin":
        return text.replace("a", "ä", 1).encode("cp1252", "replace")
    if how == "cut":
        return raw[:at]
    if how == "insert":
        return raw[:at] + draw(st.binary(max_size=6)) + raw[at:]
    if how == "remove":
        return raw[:at] + raw[at + draw(st.integers(1, 40)) :]
    if how == "twice":
        lines = raw.split(b"\n")
        k = draw(st.integers(0, len(lines) - 1))
        return b"\n".join([*lines[: k + 1], *lines[k:]])
    if how == "null":
        return raw[:at] + b"\0" + raw[at:]
    if how == "late mark":
        return raw[:at] + b"\xef\xbb\xbf" + raw[at:]
    return raw


# -- study files -----------------------------------------------------------------------------

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


@st.composite
def numbers(draw: Draw) -> float:
    """Return numbers, most of them of the size that studies have."""
    kind = draw(st.sampled_from(["plain"] * 5 + ["wide", "huge"]))
    if kind == "plain":
        return round(draw(st.floats(0.0, 40.0)), 3)
    if kind == "wide":
        return draw(st.sampled_from([0.0, -1.0, -5.0, 1e-9, 1e9, 1e-3, 1e3, 1e6, 0.1, 1.0]))
    return draw(st.sampled_from(
        [1e308, -1e308, 1.7e308, 5e-324, -5e-324, 1e-308, 1e300, 1e-300, 1e150, 1e16]
    ))  # fmt: skip


@st.composite
def distributions(draw: Draw) -> dict[str, Any]:
    """Return tables of distributions whose numbers need not fit each other."""
    kind = draw(st.sampled_from(["uniform", "triangular", "normal", "lognormal", "growth-chart"]))
    three = [draw(numbers()) for _ in range(3)]
    if draw(st.integers(0, 3)):
        three = sorted(three)
    low, middle, high = three
    table: dict[str, Any] = {"distribution": kind}
    if kind == "uniform":
        table |= {"low": low, "high": high}
    elif kind == "triangular":
        table |= {"low": low, "mode": middle, "high": high}
    elif kind == "normal":
        table |= {"mean": middle, "sd": draw(numbers())}
    elif kind == "lognormal":
        table |= {"median": middle, "sigma": draw(numbers())}
    else:
        count = draw(st.integers(1, 4))
        table |= {"age": draw(st.sampled_from(NAMES))}
        table |= {"at": sorted(draw(numbers()) for _ in range(count))}
        table |= {key: [draw(numbers()) for _ in range(count)] for key in "LMS"}
    if kind in ("normal", "lognormal", "growth-chart"):
        if draw(st.booleans()):
            table["low"] = low
        if draw(st.booleans()):
            table["high"] = high
    if draw(st.booleans()):
        table["unit"] = draw(st.sampled_from(UNITS))
    return table


def _vary_study(draw: Draw, tree: dict[str, Any]) -> None:
    """Change something of a study that its grammar allows."""
    what = draw(st.sampled_from(
        ["input", "input", "fixed", "correlation", "design", "report", "title", "limit", "effect",
         "option", "groups", "table"]
    ))  # fmt: skip
    name = draw(st.sampled_from(NAMES))
    if what == "input" and isinstance(tree.get("inputs"), dict):
        tree["inputs"][name] = draw(distributions())
    elif what == "fixed":
        tree.setdefault("fixed", {})[name] = {
            "value": draw(numbers()), "unit": draw(st.sampled_from(UNITS))
        }  # fmt: skip
    elif what == "correlation":
        pairs = st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES), st.floats(-1.1, 1.1))
        tree["dependence"] = {"correlations": [list(draw(pairs)) for _ in range(draw(
            st.integers(0, 4)))]}  # fmt: skip
    elif what == "design":
        method = draw(st.sampled_from(["monte-carlo", "latin-hypercube", "sobol"]))
        size = draw(st.sampled_from([1, 2, 4, 10, 16, 20, 64, 1000]))
        tree["design"] = {"method": method, "n": size * draw(st.integers(1, 5))}
        if draw(st.booleans()):
            tree["design"]["replicate_size"] = size
    elif what == "report":
        outputs = ["hic15", "peak_force", "clip_3ms", "permanent_dent", "wad", "nothing"]
        tree["report"] = {"outputs": draw(st.lists(st.sampled_from(outputs), max_size=4))}
        if draw(st.booleans()):
            tree["report"]["references"] = [
                {"output": draw(st.sampled_from(outputs)), "value": draw(numbers()),
                 "label": draw(st.sampled_from(WORDS)), "unit": draw(st.sampled_from(UNITS)),
                 "kind": draw(st.sampled_from(["observed", "limit", "simulated"]))}
                for _ in range(draw(st.integers(0, 3)))
            ]  # fmt: skip
    elif what == "title":
        tree["title"] = draw(st.sampled_from(WORDS) | st.text(max_size=20))
    elif what == "limit" and tree.get("kind") == "injury":
        tree["limit"] = {"output": draw(st.sampled_from(["hic15", "peak_force", "wad"])),
                         "value": draw(numbers()), "level": draw(st.integers(0, 7))}  # fmt: skip
    elif what == "effect":
        effects = ["sensor_gain", "mass_error", "hood_bottoming", "rate_dependent_hood", "nothing"]
        tree["effects"] = {draw(st.sampled_from(effects)): {
            draw(st.sampled_from(["factor", "error", "depth", "stiffness", "exponent", "a"])):
            draw(numbers())}}  # fmt: skip
    elif what == "option" and isinstance(tree.get("model"), dict):
        pairs = [[draw(numbers()), draw(numbers())] for _ in range(draw(st.integers(0, 4)))]
        tree["model"]["options"] = {
            "hood_curve": [[0.0, 0.0], *sorted(pairs)],
            "channel_class": draw(st.sampled_from([0.0, 60.0, 180.0, 600.0, 1000.0, -1.0, 1e308])),
        }
    elif what == "groups":
        tree["groups"] = {draw(st.sampled_from([*NAMES, *WORDS])): draw(
            st.lists(st.sampled_from(NAMES), max_size=3))}  # fmt: skip
    elif what == "table" and isinstance(tree.get("tables"), list):
        tree["tables"] = [{
            "title": draw(st.sampled_from(WORDS)),
            "units": {draw(st.sampled_from(["hic15", "peak_force", "wad"])):
                      draw(st.sampled_from(UNITS))},
            "rows": [{"label": draw(st.sampled_from(WORDS)),
                      "values": {"hic15": draw(numbers())}}],
        }]  # fmt: skip


@st.composite
def study_trees(draw: Draw, studies: Mapping[str, Any], *, spoilt: bool = True) -> dict[str, Any]:
    """Return trees of study files: some of their values varied, some of them spoilt."""
    tree: dict[str, Any] = copy.deepcopy(dict(studies[draw(st.sampled_from(sorted(studies)))]))
    for _ in range(draw(st.integers(0, 3))):
        _vary_study(draw, tree)
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


# -- tables of cases -------------------------------------------------------------------------

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


@st.composite
def parquet_tables(draw: Draw) -> pa.Table:
    """Return tables of cases with columns of any type that Parquet has."""
    head, rows = draw(case_columns())
    names, arrays = [], []
    for k, name in enumerate(head):
        fields = [row[k] for row in rows]
        names.append(draw(st.sampled_from(head)) if seldom(draw, 40) else name)
        arrays.append(draw(_arrow_columns(fields)))
    if seldom(draw, 40):
        names, arrays = [], []
    return pa.table(arrays, names=names)


def _plain(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


@st.composite
def _arrow_columns(draw: Draw, fields: Sequence[str]) -> pa.Array:
    """Return a column of Parquet in which fields stand as one of its types."""
    values = [_plain(text) for text in fields]
    kind = draw(st.sampled_from(
        ["float64"] * 20 + ["whole"] * 12
        + ["float32", "float16", "int8", "uint64", "bool", "string", "category", "nullable",
           "datetime", "date", "time", "duration", "decimal", "list", "dict", "bytes", "null",
           "mixed", "large"]
    ))  # fmt: skip
    whole = [int(v) if math.isfinite(v) and abs(v) < 2**62 else None for v in values]
    if kind == "whole":
        return pa.array([0 if v is None else v for v in whole], pa.int64())
    if kind == "nullable":
        return pa.array(whole, pa.int64())
    if kind in ("float32", "float16"):
        with np.errstate(over="ignore"):
            return pa.array(np.array(values, dtype=kind))
    if kind == "int8":
        return pa.array([None if v is None else v % 100 for v in whole], pa.int8())
    if kind == "uint64":
        return pa.array([None if v is None else abs(v) * 4 for v in whole], pa.uint64())
    if kind == "bool":
        return pa.array([None if math.isnan(v) else v > 0.5 for v in values], pa.bool_())
    if kind == "string":
        return pa.array(list(fields), pa.string())
    if kind == "category":
        return pa.array(list(fields), pa.string()).dictionary_encode()
    if kind == "datetime":
        start = datetime.datetime(2020, 1, 1)
        return pa.array([start + datetime.timedelta(days=k) for k in range(len(fields))])
    if kind == "date":
        return pa.array([datetime.date(2020, 1, 1) for _ in fields], pa.date32())
    if kind == "time":
        return pa.array([datetime.time(7, 32) for _ in fields], pa.time64("us"))
    if kind == "duration":
        return pa.array([datetime.timedelta(seconds=k) for k in range(len(fields))],
                        pa.duration("us"))  # fmt: skip
    if kind == "decimal":
        return pa.array([decimal.Decimal(v or 0) for v in whole], pa.decimal128(38, 3))
    if kind == "list":
        return pa.array([[v] for v in values], pa.list_(pa.float64()))
    if kind == "dict":
        return pa.array([{"a": v} for v in values], pa.struct([("a", pa.float64())]))
    if kind == "bytes":
        return pa.array([text.encode("utf-8", "replace") for text in fields], pa.binary())
    if kind == "null":
        return pa.nulls(len(fields))
    if kind == "mixed":
        return pa.array([None if k % 3 else v for k, v in enumerate(values)], pa.float64())
    if kind == "large":
        return pa.array(list(fields), pa.large_string())
    return pa.array(values, pa.float64())


# -- headform tests --------------------------------------------------------------------------

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
    what = draw(st.sampled_from(
        ["value", "value", "drop", "twice", "case", "no colon", "sample", "sample", "cut", "more",
         "all"] if file.samples else ["value", "value", "drop", "twice", "case", "no colon"]
    ))  # fmt: skip
    if what in ("sample", "cut", "more", "all"):
        at = draw(st.integers(0, len(file.samples) - 1))
        if what == "sample":
            file.samples[at] = draw(st.sampled_from(SAMPLES))
        elif what == "cut":
            del file.samples[at:]
        elif what == "more":
            file.samples += draw(st.lists(st.sampled_from(SAMPLES), min_size=1, max_size=3))
        else:
            file.samples[:] = [draw(st.sampled_from(SAMPLES))] * len(file.samples)
        return
    if not file.header:
        return
    at = draw(st.integers(0, len(file.header) - 1))
    key, value = file.header[at]
    if what == "value":
        pool = st.sampled_from(CODES if key == "Channel code" else HEADER_VALUES)
        file.header[at] = (key, draw(pool | st.sampled_from(HEADER_VALUES)))
    elif what == "drop":
        del file.header[at]
    elif what == "twice":
        file.header.append((key, draw(st.sampled_from(HEADER_VALUES))))
    elif what == "case":
        file.header[at] = (draw(st.sampled_from([key.upper(), key.lower(), f" {key} "])), value)
    else:
        file.header[at] = (key.replace(" ", ":", 1), value)


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
        _vary_measured(draw, tree)
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


def _vary_measured(draw: Draw, tree: dict[str, Any]) -> None:
    table = draw(st.sampled_from(["uncertain", "inputs", "scalars", "signals", "fixed", "model"]))
    name = draw(st.sampled_from([*NAMES, "hic15", "head_acceleration", "hood_force", "ais"]))
    if table == "model":
        tree["model"] = draw(st.sampled_from(["headform", "multibody", "planar", *WORDS[:6]]))
    elif table == "uncertain":
        tree[table][name] = draw(distributions())
    elif table == "fixed":
        tree[table][name] = draw(st.one_of(
            numbers(), st.lists(st.lists(numbers(), min_size=2, max_size=2), max_size=3)
        ))  # fmt: skip
    else:
        entry: dict[str, Any] = {"unit": draw(st.sampled_from(UNITS)), "sd": draw(numbers())}
        if table == "signals" and draw(st.booleans()):
            entry["filter"] = draw(st.sampled_from(["none", "CFC60", "CFC1000", "CFC7"]))
        own = list(tree[table])
        tree[table][draw(st.sampled_from([*own, name]))] = entry


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
def parquet_files(draw: Draw) -> bytes:
    """Return Parquet tables of cases, some of them torn."""
    sink = io.BytesIO()
    try:
        parquet.write_table(draw(parquet_tables()), sink)
    except (pa.ArrowException, ValueError):
        # What Parquet itself has no place for.
        return b"PAR1"
    raw = sink.getvalue()
    if not seldom(draw, 6):
        return raw
    at = draw(st.integers(0, len(raw) - 1))
    return draw(st.sampled_from([raw[:at], raw[:at] + b"\xff" + raw[at + 1 :], raw[at:], b""]))


@st.composite
def whole_studies(draw: Draw) -> bytes:
    """Return studies of a headform, most of which can be run."""
    tree = draw(study_trees(STUDIES, spoilt=seldom(draw, 4)))
    return toml_text(tree).encode("utf-8", "replace")
