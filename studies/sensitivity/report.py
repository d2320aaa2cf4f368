"""The report of given-data sensitivity by three measures."""

import math
from collections.abc import Mapping
from typing import Any

from mcstudy.figures import screening, sensitivity, style
from mcstudy.report import Section, Table
from mcstudy.sensitivity.given_data import DUMMIES
from mcstudy.statistics import by_size
from mcstudy.text import capital, number, share
from studies.sensitivity.analysis import GivenDataAnalysis, MeasuredOutput

TITLES = {
    "first_order": "first-order index, rank based [–]",
    "delta": "Borgonovo's delta [–]",
    "pawn": "PAWN, median over slices [–]",
}
NAMED = 4
"""Inputs that a sentence names, the largest."""


def draw(analysis: GivenDataAnalysis) -> dict[str, Any]:
    """Return the figures by file name."""
    figures = {}
    for name, entry in analysis.outputs.items():
        if not _varies(entry):
            continue
        figures[f"measures_{name}"] = screening.draw_given_data(
            {key: (measure.inputs, measure.noise) for key, measure in entry.measures.items()},
            TITLES,
        )
        figures[f"main_effects_{name}"] = sensitivity.draw_main_effects(
            analysis.main_effects[name],
            style.label(name, entry.unit),
        )
    return figures


def sections_of(analysis: GivenDataAnalysis, figures: Mapping[str, Any]) -> list[Section]:
    """Return the sections of the report."""
    sections = []
    for name, entry in analysis.outputs.items():
        words = style.words(name)
        heading, said = capital(words), [sentence(name, entry)]
        if not _varies(entry):
            sections.append(Section(heading, said))
            continue
        shown = {
            f"Sensitivity of {words}: 95 % intervals for the first-order index, bootstrap scatter "
            "for delta, smallest and largest slice for PAWN. Grey: not above the noise line.":
            figures[f"measures_{name}"],
            f"Conditional mean and band of {words}.": figures[f"main_effects_{name}"],
        }  # fmt: skip
        sections.append(Section(heading, said, [_table(name, entry)], shown))
    return [*sections, Section("Interpretation and limitations", _explained(analysis))]


def summarise(analysis: GivenDataAnalysis) -> list[str]:
    """Return the influential inputs of the outputs, a paragraph each."""
    return [sentence(name, entry) for name, entry in analysis.outputs.items()]


def sentence(name: str, entry: MeasuredOutput) -> str:
    """Return sentences on the influential inputs of an output."""
    words = style.words(name)
    if not _varies(entry):
        return f"{capital(words)} does not vary."
    first = entry.measures["first_order"].inputs
    order = by_size({key: index.value for key, index in first.items()})
    clear = [key for key in order if first[key].clear]
    if clear:
        named = ", ".join(
            f"{style.words(key)} {100.0 * first[key].value:.0f} ± "
            f"{max(1.0, 50.0 * (first[key].high - first[key].low)):.0f} %"
            for key in clear[:NAMED]
        )
        text = f"First-order shares of the variance of {words}: {named}."
    else:
        text = f"No input has a clear first-order effect on {words}."
    others = [
        key
        for key in order
        if key not in clear and any(entry.measures[m].inputs[key].clear for m in ("delta", "pawn"))
    ]
    if others:
        text += (
            f" Its distribution also depends on {', '.join(map(style.words, others))}, though "
            "without a clear share of the variance."
        )
    none = [
        key
        for key in order
        if not any(table.inputs[key].clear for table in entry.measures.values())
    ]
    if none:
        text += f" Not distinguishable from zero: {', '.join(map(style.words, none))}."
    return text


def _varies(entry: MeasuredOutput) -> bool:
    return not math.isnan(entry.measures["first_order"].noise)


def _table(name: str, entry: MeasuredOutput) -> Table:
    measures = entry.measures
    first = measures["first_order"].inputs
    order = by_size({key: index.value for key, index in first.items()})
    rows = [
        [style.words(key), *(share(table.inputs[key]) for table in measures.values())]
        for key in order
    ]
    rows.append(["noise line", *(number(table.noise, 2) for table in measures.values())])
    head = ["input", *(TITLES[measure].removesuffix(" [–]") for measure in measures)]
    return Table(f"{style.words(name)}: {entry.runs:,} runs with a value.", head, rows)


def _explained(analysis: GivenDataAnalysis) -> list[str]:
    lines = [
        "First-order index, rank based: the share of the variance due to the input alone. "
        "Delta: the share of the whole density that moves when the input is known. PAWN: the "
        "distance that the cumulative distribution moves. The last two also measure effects on "
        "spread or shape without an effect on the mean, and are never negative: their noise line "
        "is above zero.",
        f"The noise line is the largest value of {DUMMIES} unrelated dummy inputs: one "
        "unrelated input in twenty passes it by chance.",
        "None of them detects an input that acts through interactions alone; total indices need "
        "a Sobol' study.",
    ]
    if analysis.dependent:
        lines.append(
            f"{', '.join(map(style.words, analysis.dependent))} depend on each other: the "
            "effect of one also appears with the others. The numbers are associations and do not "
            "add up."
        )
    return lines
