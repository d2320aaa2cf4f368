"""The report of a multi-fidelity study, in text and figures."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from mcstudy.figures import style
from mcstudy.figures.panels import Band, Curve, Panel, draw_panels
from mcstudy.report import Section, Table
from mcstudy.statistics import Estimate
from mcstudy.text import capital, number, unit
from studies.failure_report import failure_map, failures_said, status_table
from studies.multi_fidelity.analysis import FidelityAnalysis, FidelityOutput


def draw(analysis: FidelityAnalysis) -> dict[str, Any]:
    """Return the figures by file name: the exceedance of every output.

    Parameters
    ----------
    analysis : FidelityAnalysis
    """
    figures = failure_map(analysis)
    for name, output in analysis.outputs.items():
        curve = output.exceedance
        levels = np.array(curve.levels)
        low, value, high = (
            np.array([100.0 * getattr(entry, key) for entry in curve.several])
            for key in ("low", "value", "high")
        )
        dear = analysis.allotment.order[0]
        lines = [Curve(levels, value, f"{dear}, by all models", colour=style.PALETTE[0])]
        for (label, own), colour in zip(curve.own.items(), style.PALETTE[1:], strict=False):
            shares = 100.0 * np.array(own)
            runs = analysis.allotment.runs[label]
            lines.append(
                Curve(levels, shares, f"{label}, its {runs:,} runs", colour=colour, line="--")
            )
        band = Band(levels, low, high, "95 % interval", colour=style.PALETTE[0])
        panel = Panel(
            style.label(name, output.unit), "probability of exceeding it [%]", lines, [band],
            ylim=(0.0, 102.0), legend="upper right",
        )  # fmt: skip
        figures[f"exceedance_{name}"] = draw_panels([panel], width=6.4, height=4.2)
    return figures


def sections_of(analysis: FidelityAnalysis, figures: Mapping[str, Any]) -> list[Section]:
    """Return the sections of the report.

    Parameters
    ----------
    analysis : FidelityAnalysis
    figures : mapping
        Figures by file name.
    """
    dear = analysis.allotment.order[0]
    sections = [Section("Models and budget", _budget_said(analysis), [_models_table(analysis)], {})]
    for name, output in analysis.outputs.items():
        words = capital(style.words(name))
        sections.append(
            Section(
                words,
                [
                    "The last column compares the width of the interval with that of the same "
                    f"budget spent on {dear} alone, measured on its own runs."
                ],
                [_output_table(name, output, dear)],
                {
                    f"Probability of exceeding a level: {dear} by all models with its interval, "
                    "and each model's own runs.": figures[f"exceedance_{name}"]
                },
            )
        )
    sections.append(
        Section(
            "Sampling uncertainty",
            [
                "Run k of every model has the same inputs. Intervals are 95 % Student intervals "
                "from leaving out one replicate of the design at a time, weights included; of a "
                "quantile, the levels whose exceedance they allow. Estimates are those of the "
                "reference model: what it gets wrong stays in them.",
                *failures_said(analysis),
            ],
            [status_table(analysis)],
            {"Share of failed runs in each tenth of each input.": figures["failures"]}
            if "failures" in figures
            else {},
        )
    )
    return sections


def summarise(analysis: FidelityAnalysis) -> list[Table]:
    """Return the models and the estimates.

    Parameters
    ----------
    analysis : FidelityAnalysis
    """
    dear = analysis.allotment.order[0]
    return [
        _models_table(analysis),
        *(_output_table(name, output, dear) for name, output in analysis.outputs.items()),
    ]


def _budget_said(analysis: FidelityAnalysis) -> list[str]:
    allotment = analysis.allotment
    spent = sum(allotment.costs[label] * n for label, n in allotment.runs.items())
    words = [
        f"The budget is {number(allotment.seconds)} s of one core; the runs cost "
        f"{number(spent)} s. {capital(allotment.method)} leaves the mean of {allotment.order[0]} "
        f"{number(100.0 * allotment.predicted_ratio)} % of the variance that the whole budget "
        "would have left it alone, as predicted from the pilot runs."
    ]
    if allotment.left_out:
        words.append(f"Left out, as they do not pay: {', '.join(allotment.left_out)}.")
    return words


def _models_table(analysis: FidelityAnalysis) -> Table:
    allotment = analysis.allotment
    labels = [*allotment.order, *allotment.left_out]
    rows = []
    for label in labels:
        runs, cost = allotment.runs[label], allotment.costs[label]
        correlations = [
            _plain(output.correlation.get(label, math.nan)) for output in analysis.outputs.values()
        ]
        rows.append([label, number(cost), f"{runs:,}", number(cost * runs), *correlations])
    heads = [f"correlation, {style.words(name)}" for name in analysis.outputs]
    return Table(
        f"Models, and their correlation with {allotment.order[0]} for the same inputs.",
        ["model", "s a run", "runs", "s in all", *heads],
        rows,
    )


def _output_table(name: str, output: FidelityOutput, dear: str) -> Table:
    rows = []
    for row in output.statistics:
        percent = row.label.startswith(("probability", "risk"))
        rows.append(
            [row.label, _shown(row.several, percent), _shown(row.alone, percent),
             f"{100.0 * row.ratio:.0f} %" if math.isfinite(row.ratio) else "–"]
        )  # fmt: skip
    title = capital(style.words(name))
    return Table(
        f"{title} [{unit(output.unit) or '–'}] of {dear}, with 95 % intervals.",
        ["statistic", "by all models", f"{dear} alone", "width"],
        rows,
    )


def _shown(entry: Estimate, percent: bool) -> str:
    factor = 100.0 if percent else 1.0
    if not math.isfinite(entry.value):
        return "–"
    value, low, high = (
        number(factor * end) if math.isfinite(end) else "open"
        for end in (entry.value, entry.low, entry.high)
    )
    return f"{value}{' %' if percent else ''} ({low} to {high})"


def _plain(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "–"
