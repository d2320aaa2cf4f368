"""The report of a model chain, in text and figures."""

from collections.abc import Mapping
from typing import Any

from mcstudy.figures import style
from mcstudy.figures.waterfall import draw_waterfall
from mcstudy.report import Section, Table
from mcstudy.statistics import by_size
from mcstudy.text import capital, interval, number, unit
from studies.failure_report import failure_map, failures_said, status_table
from studies.model_chain.analysis import ChainAnalysis, SplitOutput
from studies.model_chain.schema import ModelChain

CLEAR = 2
"""Changes that a sentence names, the largest."""


def draw(analysis: ChainAnalysis) -> dict[str, Any]:
    """Return the figures by file name: the split of every output.

    Parameters
    ----------
    analysis : ChainAnalysis
    """
    figures = failure_map(analysis)
    for name, split in analysis.outputs.items():
        figures[f"split_{name}"] = draw_waterfall(
            split.base, split.shares, split.whole,
            label=f"mean {style.label(name, split.unit)}", ends=(analysis.first, analysis.last),
        )  # fmt: skip
    return figures


def sections_of(
    study: ModelChain, analysis: ChainAnalysis, figures: Mapping[str, Any]
) -> list[Section]:
    """Return the sections of the report.

    Parameters
    ----------
    study : ModelChain
        Checked study file.
    analysis : ChainAnalysis
    figures : mapping
        Figures by file name.
    """
    rows = [
        [label, model.name, ", ".join(model.changes) or "–", f"{analysis.counts[label]:,}"]
        for label, model in study.models.items()
    ]
    sections = [
        Section(
            "Models",
            [
                "Run k of every model has the same inputs. A step leads from a model to one that "
                "has one more thing changed. The share of a change is the mean of its steps over "
                "all orders in which the models allow the changes (the Shapley value), so the "
                "shares sum to the whole difference. Intervals are 95 % intervals from resampled "
                "draws. Where the steps of one change differ, it interacts with the others."
            ],
            [Table("Models of the chain.", ["model", "method", "changes", "runs"], rows)],
        )
    ]
    for name, split in analysis.outputs.items():
        sections.append(
            Section(
                capital(style.words(name)),
                [_said(name, split, analysis)],
                [_split_table(name, split, analysis), _steps_table(split)],
                {
                    f"Mean of {analysis.first}, what each change adds to it, and mean of "
                    f"{analysis.last}.": figures[f"split_{name}"]
                },
            )
        )
    sections.append(
        Section(
            "Runs",
            failures_said(analysis),
            [status_table(analysis)],
            {"Share of failed runs in each tenth of each input.": figures["failures"]}
            if "failures" in figures
            else {},
        )
    )
    return sections


def summarise(analysis: ChainAnalysis) -> list[Table]:
    """Return the split of every output.

    Parameters
    ----------
    analysis : ChainAnalysis
    """
    return [_split_table(name, split, analysis) for name, split in analysis.outputs.items()]


def _said(name: str, split: SplitOutput, analysis: ChainAnalysis) -> str:
    """Return a sentence on the changes whose intervals leave zero out."""
    whole = f"{analysis.last} minus {analysis.first} is {interval(split.whole)} on average"
    clear = [
        change
        for change in by_size({change: abs(e.value) for change, e in split.shares.items()})
        if split.shares[change].low > 0.0 or split.shares[change].high < 0.0
    ]
    words = capital(style.words(name))
    if not clear:
        return f"{words}: {whole}; no change has a share that is clear of chance."
    named = ", ".join(
        f"{change} ({'+' if split.shares[change].value > 0.0 else ''}"
        f"{number(split.shares[change].value)})"
        for change in clear[:CLEAR]
    )
    return f"{words}: {whole}; most of it by {named}."


def _split_table(name: str, split: SplitOutput, analysis: ChainAnalysis) -> Table:
    rows = [[f"mean of {analysis.first}", interval(split.base), ""]]
    for change, share in split.shares.items():
        rows.append([change, interval(share), _relative(share.value, split.base.value)])
    whole = _relative(split.whole.value, split.base.value)
    rows.append([f"{analysis.last} minus {analysis.first}", interval(split.whole), whole])
    title = capital(style.words(name))
    return Table(
        f"{title} [{unit(split.unit) or '–'}]: split of the difference, with 95 % intervals.",
        ["", "mean", f"of {analysis.first}"],
        rows,
    )


def _relative(value: float, base: float) -> str:
    return f"{100.0 * value / abs(base):.1f} %" if base else "–"


def _steps_table(split: SplitOutput) -> Table:
    rows = [
        [step.change, step.start, step.end, f"{100.0 * step.weight:.0f} %", f"{step.pairs:,}",
         interval(step.mean), number(step.spread)]
        for step in split.steps
    ]  # fmt: skip
    heads = ["change", "from", "to", "share of the orders", "pairs", "mean difference",
             "standard deviation"]  # fmt: skip
    return Table("Steps, run by run.", heads, rows)
