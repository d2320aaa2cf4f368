"""A small model as the methods see it, and a small study of it, for tests without physics."""

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class FakeInput:
    name: str
    unit: str
    nominal: float
    low: float
    high: float
    meaning: str = "a test input"


@dataclass(frozen=True)
class FakeOutput:
    name: str
    unit: str
    meaning: str = "a test output"


@dataclass(frozen=True)
class FakeSimulator:
    name: str = "toy"
    version: str = "1"
    inputs: tuple[FakeInput, ...] = (
        FakeInput("impact_speed", "m/s", 11.0, 0.5, 40.0),
        FakeInput("age", "year", 7.5, 3.0, 90.0),
        FakeInput("stature", "m", 1.22, 0.8, 2.1),
        FakeInput("body_mass", "kg", 23.2, 9.0, 150.0),
        FakeInput("facing_angle", "rad", 1.5, -6.3, 6.3),
    )
    outputs: tuple[FakeOutput, ...] = (FakeOutput("hic15", "1"), FakeOutput("wad", "m"))
    partial_status: frozenset[str] = field(default=frozenset())


STUDY = """\
format = "mcstudy-study/1"
kind = "monte-carlo"
name = "small"
title = "A small study"
seed = 7
max_failure_rate = 0.1

[model]
name = "toy"
options = { vehicle = "car" }

[design]
method = "latin-hypercube"
n = 40
replicate_size = 20

[inputs.impact_speed]
distribution = "normal"
unit = "km/h"
mean = 42.0
sd = 2.0
low = 36.0
high = 48.0

[inputs.facing_angle]
distribution = "uniform"
unit = "deg"
low = 60.0
high = 120.0

[inputs.stature]
distribution = "triangular"
unit = "cm"
low = 110.0
mode = 122.0
high = 135.0

[fixed]
body_mass = { value = 24000, unit = "g_mass" }

[dependence]
correlations = [["impact_speed", "stature", 0.4]]

[report]
outputs = ["hic15", "wad"]
histories = 2
"""


def edited(*edits: tuple[str, str], text: str = STUDY) -> str:
    """Return the small study with each old text replaced by a new one, once."""
    for old, new in edits:
        assert old in text, f"{old!r} is not in the study"
        text = text.replace(old, new, 1)
    return text


def edits_of(row: tuple[Any, ...]) -> tuple[list[tuple[str, str]], tuple[str, ...]]:
    """Return the edits and the parts of the message of a row (old, new, *parts).

    Old and new may be tuples, of several edits.
    """
    old, new, *parts = row
    return [(old, new)] if isinstance(old, str) else list(zip(old, new, strict=True)), tuple(parts)
