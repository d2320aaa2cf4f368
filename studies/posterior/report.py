"""The report of a posterior, in text and figures: the number first, then what it rests on."""

import math
from collections.abc import Mapping
from typing import Any

from mcstudy.figures import posterior as figures_of
from mcstudy.figures import style
from mcstudy.posterior.ratio import Ratio
from mcstudy.report import Section, Table
from mcstudy.text import capital, number, quantity
from mcstudy.text import unit as shown_unit
from studies.failure_report import failure_map, failures_said, status_table
from studies.posterior.formulae import KMH
from studies.posterior.numbers import InjuryResult, PosteriorAnalysis, Spread
from studies.posterior.verbal import SCALE


def draw(analysis: PosteriorAnalysis) -> dict[str, Any]:
    """Return the figures by file name.

    Parameters
    ----------
    analysis : PosteriorAnalysis
    """
    label = style.label(analysis.target, analysis.unit)
    rows = {"all the evidence": _ends(analysis.after)}
    rows |= {f"only {style.words(i.name)}": _ends(i.alone) for i in analysis.items if i.alone}
    rows |= {f"all but {style.words(i.name)}": _ends(i.left_out) for i in analysis.items
             if i.left_out}  # fmt: skip
    others = {"as stated": _ends(analysis.after), "no model errors": _ends(analysis.plain)}
    others |= {entry.label: _ends(entry.target) for entry in analysis.assumptions}
    return failure_map(analysis) | {
        "posterior": figures_of.draw_densities(
            analysis.curves,
            label,
            shown_unit(analysis.unit) or "–",
            analysis.after.intervals["0.95"],
        ),
        "evidence": figures_of.draw_forest(rows, label),
        "assumptions": figures_of.draw_forest(others, label),
        "ranks": figures_of.draw_ranks(analysis.ranks),
    }


def _ends(spread: Spread) -> tuple[float, tuple[float, float], tuple[float, float]]:
    return spread.median, spread.intervals["0.5"], spread.intervals["0.9"]


def sections_of(analysis: PosteriorAnalysis, figures: Mapping[str, Any]) -> list[Section]:
    """Return the sections of the report.

    Parameters
    ----------
    analysis : PosteriorAnalysis
    figures : mapping
        Figures by file name.
    """
    name = style.words(analysis.target)
    first = [f"NO LIKELIHOOD RATIO IS GIVEN: {analysis.refused}."] if analysis.refused else []
    sections = [
        Section(
            capital(name),
            [
                *first,
                f"Given the evidence the median of the {name} is "
                f"{_value(analysis, analysis.after.median)}, and with a probability of 95 % it "
                f"lies between {_range(analysis, analysis.after, '0.95')}, if prior, model and "
                "evidence are as stated.",
            ],
            [_target_table(analysis)],
            {f"Density of the {name} before and after the evidence.": figures["posterior"]},
        ),
        _ratios(analysis),
        Section(
            "Evidence",
            [
                "Each item alone and each left out. The first p-value says how far out an item "
                "lies by model and prior, the second how far out given the other items: small "
                "ones contradict. "
                f"All together: p = {number(analysis.check.together, 2)}"
                + (
                    "."
                    if analysis.check.possible > 0.995
                    else f"; bounds and events have a prior probability of "
                    f"{number(analysis.check.possible, 2)}."
                )
            ],
            [_items_table(analysis)],
            {"Median, 50 and 90 % interval by the evidence that is used.": figures["evidence"]},
        ),
        Section(
            "Assumptions",
            ["One assumption is changed at a time."],
            [_assumptions_table(analysis)],
            {"Median, 50 and 90 % interval by assumption.": figures["assumptions"]},
        ),
        *_more(analysis),
        Section(
            "Calibration",
            [
                "Runs of the bank are left out, one at a time, and found from evidence of their "
                "own. Where posteriors are right, the rank of the true value is uniform and a 90 % "
                "interval holds 90 % of the true values, given any evidence. Joint coverage with "
                f"other inputs: Kolmogorov distance {number(analysis.joint[0], 2)}, "
                f"p = {number(analysis.joint[1], 2)}."
            ],
            [_calibration_table(analysis)],
            {"Ranks of the runs left out.": figures["ranks"]},
        ),
        Section(
            "Runs",
            failures_said(analysis),
            [status_table(analysis)],
            {"Share of failed runs in each tenth of each input.": figures["failures"]}
            if "failures" in figures
            else {},
        ),
    ]
    return sections


def summarise(analysis: PosteriorAnalysis) -> list[str | Table]:
    """Return target and ratios in brief.

    Parameters
    ----------
    analysis : PosteriorAnalysis
    """
    found: list[str | Table] = [_target_table(analysis)]
    if analysis.refused:
        return [f"no likelihood ratio is given: {analysis.refused}", *found]
    if analysis.ratios:
        found.append(_ratio_table(analysis))
    return found


def _value(analysis: PosteriorAnalysis, value: float) -> str:
    return quantity(value, analysis.unit)


def _range(analysis: PosteriorAnalysis, spread: Spread, level: str) -> str:
    low, high = spread.intervals[level]
    return f"{number(low)} and {quantity(high, analysis.unit)}"


def _cells(spread: Spread | None) -> list[str]:
    """Return median and the 50, 90 and 95 % intervals as text."""
    if spread is None:
        return ["–"] * 4
    return [number(spread.median)] + [
        f"{number(low)} to {number(high)}" for low, high in spread.intervals.values()
    ]


def _target_table(analysis: PosteriorAnalysis) -> Table:
    label = style.label(analysis.target, analysis.unit)
    rows = [
        ["before the evidence", *_cells(analysis.before), ""],
        ["given the evidence", *_cells(analysis.after), number(analysis.after.effective)],
        ["the same without model errors", *_cells(analysis.plain),
         number(analysis.plain.effective)],
    ]  # fmt: skip
    head = [label, "median", "50 %", "90 %", "95 %", "effective runs"]
    return Table(f"{capital(style.words(analysis.target))}.", head, rows)


def _ratios(analysis: PosteriorAnalysis) -> Section:
    said = [
        "The ratio is the probability of the evidence if the proposition is true over that if it "
        "is not. It is no probability of the proposition: that needs what is known beside this "
        "evidence, which is not the expert's to weigh. What the quantity is like if a proposition "
        "is true, or is not, is the prior cut to it."
    ]
    if analysis.refused:
        return Section("Propositions", [f"No ratio is given: {analysis.refused}."])
    if not analysis.ratios:
        return Section("Propositions", ["The study states none."])
    said.append(
        f"Words: {SCALE}. The range is that over the assumptions below; a ratio beyond the "
        "resolution of this bank is bounded."
    )
    return Section("Propositions", said, [_ratio_table(analysis)])


def _ratio_table(analysis: PosteriorAnalysis) -> Table:
    rows = [
        [
            entry.label,
            _ratio_said(entry.given),
            entry.verbal,
            _ratio_said(entry.plain),
            f"{_odds(entry.lowest)} to {_odds(entry.highest)}"
            if math.isfinite(entry.lowest)
            else "–",
        ]
        for entry in analysis.ratios
    ]
    head = ["proposition, against its negation", "likelihood ratio (95 %)", "in words",
            "without model errors", "range over assumptions"]  # fmt: skip
    return Table("Likelihood ratios.", head, rows)


def _ratio_said(ratio: Ratio) -> str:
    if ratio.resolved:
        found = ratio.ratio
        return f"{_odds(found.value)} ({_odds(found.low)} to {_odds(found.high)})"
    side = "below" if ratio.bound <= 1.0 else "above"
    return f"beyond the resolution of this bank: {side} {_odds(ratio.bound)}"


def _odds(value: float) -> str:
    """Return a ratio as text, small ones as a share of one."""
    if not math.isfinite(value):
        return "–"
    if 0.0 < value < 0.105:
        return f"1/{number(1.0 / value, 2)}"
    return number(value, 2)


def _items_table(analysis: PosteriorAnalysis) -> Table:
    rows = [
        [style.words(item.name), item.said, number(item.prior_p, 2), _p(item.predictive_p),
         *(_width(spread) for spread in (item.alone, item.left_out))]
        for item in analysis.items
    ]  # fmt: skip
    head = ["item", "value", "p, prior", "p, given the others",
            f"alone: median (90 %) [{shown_unit(analysis.unit) or '–'}]", "left out"]  # fmt: skip
    return Table("Items of evidence.", head, rows)


def _p(value: float) -> str:
    return number(value, 2) if math.isfinite(value) else "–"


def _width(spread: Spread | None) -> str:
    if spread is None:
        return "–"
    low, high = spread.intervals["0.9"]
    return f"{number(spread.median)} ({number(low)} to {number(high)})"


def _assumptions_table(analysis: PosteriorAnalysis) -> Table:
    labels = [entry.label for entry in analysis.ratios]
    rows = [["as stated", _width(analysis.after),
             *(_ratio_said(entry.given) for entry in analysis.ratios)]]  # fmt: skip
    rows.append(
        ["no model errors", _width(analysis.plain),
         *(_ratio_said(entry.plain) for entry in analysis.ratios)]
    )  # fmt: skip
    rows += [
        [entry.label, _width(entry.target),
         *(_ratio_said(entry.ratios[label]) for label in labels)]
        for entry in analysis.assumptions
    ]  # fmt: skip
    unit = shown_unit(analysis.unit) or "–"
    return Table("Other assumptions.", ["", f"median (90 %) [{unit}]", *labels], rows)


def _calibration_table(analysis: PosteriorAnalysis) -> Table:
    unit = shown_unit(analysis.unit) or "–"
    rows = [
        [
            "all" if entry.label == "all" else f"{entry.label} third of the medians",
            f"{entry.runs:,}",
            f"{number(entry.chi_square[0])} (p {number(entry.chi_square[1], 2)})",
            f"{number(entry.kolmogorov[0], 2)} (p {number(entry.kolmogorov[1], 2)})",
            *(f"{100.0 * entry.coverage[level]:.0f} %" for level in ("0.5", "0.9")),
            number(entry.bias, 2), number(entry.width), number(entry.score),
        ]
        for entry in analysis.calibration
    ]  # fmt: skip
    head = ["runs left out", "number", "chi-square of 20 bins", "Kolmogorov", "in 50 %", "in 90 %",
            f"bias [{unit}]", f"width of 90 % [{unit}]", f"CRPS [{unit}]"]  # fmt: skip
    return Table("Runs left out of the bank and found again.", head, rows)


def _more(analysis: PosteriorAnalysis) -> list[Section]:
    """Return the sections that a study may leave out."""
    found = []
    if analysis.formulae:
        rows = [
            [entry.name, *(number(KMH * v) for v in (entry.low, entry.middle, entry.high)),
             entry.source]
            for entry in analysis.formulae
        ]  # fmt: skip
        found.append(
            Section(
                "Hand formulae",
                ["From the throw distance alone, without its uncertainty."],
                [Table("Speed [km/h].", ["formula", "low", "middle", "high", "source"], rows)],
            )
        )
    if analysis.avoidability:
        found.append(_avoidability(analysis))
    if analysis.injury is not None:
        found.append(_injury(analysis))
    if analysis.others:
        rows = [
            [style.label(entry.name, entry.unit), *_cells(entry.before)[:3:2],
             *_cells(entry.after)[:3:2]]
            for entry in analysis.others
        ]  # fmt: skip
        head = ["quantity", "median before", "90 %", "median given the evidence", "90 %"]
        found.append(
            Section("Other quantities", [], [Table("Before and after the evidence.", head, rows)])
        )
    if analysis.further:
        now = number(analysis.after.width)
        rows = [[style.words(e.name), e.said, number(e.width)] for e in analysis.further]
        unit = shown_unit(analysis.unit) or "–"
        found.append(
            Section(
                "Further measurements",
                [f"The 90 % interval is {now} {unit} wide. Expected width if one more quantity "
                 "were measured, the most useful one first."],
                [Table("Further measurements.", ["measured", "how well", f"width [{unit}]"], rows)],
            )
        )  # fmt: skip
    return found


def _avoidability(analysis: PosteriorAnalysis) -> Section:
    unit = shown_unit(analysis.unit) or "–"
    rows = [
        [number(entry.speed), f"{100.0 * entry.stopped:.0f} %", _width(entry.impact),
         _width(entry.head_speed), _width(entry.hic15)]
        for entry in analysis.avoidability
    ]  # fmt: skip
    head = [f"speed [{unit}]", "would have stopped before", f"else impact at (90 %) [{unit}]",
            "head impact speed [m/s]", "HIC15 [–]"]  # fmt: skip
    said = (
        "The driver reacts at the same place and as fast, and brakes as hard; posture and place of "
        "the impact are those of the bank at the other speed, the child's way is not changed."
    )
    return Section("Avoidability", [said], [Table("At other speeds.", head, rows)])


def _injury(analysis: PosteriorAnalysis) -> Section:
    injury = analysis.injury
    assert injury is not None
    levels = sorted({level for row in injury.exceeding.values() for level in row})
    rows = [
        [style.words(name), *(_percent(row.get(level)) for level in levels)]
        for name, row in injury.exceeding.items()
    ]
    said = [f"HIC15 given the evidence: {_width(injury.hic15)}."]
    if injury.recorded is not None:
        said.append(f"Recorded: AIS {injury.recorded}." + _recorded(injury))
    head = ["risk function", *(f"AIS{level}+" for level in levels)]
    return Section("Injury", said, [Table("Probability of an injury as bad or worse.", head, rows)])


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100.0 * share:.0f} %"


def _recorded(injury: InjuryResult) -> str:
    """Return the probability of the recorded injury or a worse one, by functions that have it."""
    shares = [
        f"{_percent(row[str(injury.recorded)])} ({style.words(name)})"
        for name, row in injury.exceeding.items()
        if str(injury.recorded) in row
    ]
    if not shares:
        return " No risk function has this level."
    return f" As bad or worse with a probability of {' and '.join(shares)}."
