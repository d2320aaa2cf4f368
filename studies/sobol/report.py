"""The report of a Sobol' study: indices in text, tables and figures."""

import math
from collections.abc import Mapping
from typing import Any

from mcstudy.figures import sensitivity, style
from mcstudy.report import Section, Table
from mcstudy.sampling.factors import DUMMY, PERTURBATION
from mcstudy.sampling.saltelli import SCRAMBLES
from mcstudy.statistics import Estimate, by_size
from mcstudy.text import capital, quantity, share
from models.protocol import Model
from studies.factor_report import groups_said
from studies.failure_report import failure_map, failures_said, status_table
from studies.sobol.analysis import IndexedOutput, SobolAnalysis
from studies.sobol.schema import SobolStudy

NAMED = 4
"""Factors that a sentence names, the largest."""


def draw(analysis: SobolAnalysis) -> dict[str, Any]:
    """Return the study's figures by file name."""
    varying = {name: entry for name, entry in analysis.reported.items() if entry.varies}
    figures: dict[str, Any] = failure_map(analysis)
    if not varying:
        return figures
    figures |= {
        "indices": sensitivity.draw_indices(
            {name: (entry.first, entry.total) for name, entry in varying.items()}, DUMMY
        ),
        "heatmap": sensitivity.draw_heatmap(
            {name: entry.total for name, entry in analysis.indexed.items()}
        ),
        "convergence": sensitivity.draw_convergence(
            {name: {step.n: step.total for step in analysis.convergence[name]} for name in varying}
        ),
    }
    for name, entry in varying.items():
        figures[f"main_effects_{name}"] = sensitivity.draw_main_effects(
            analysis.main_effects[name],
            style.label(name, entry.unit),
        )
        if entry.second is not None:
            figures[f"second_order_{name}"] = sensitivity.draw_second_order(
                entry.second, analysis.factors, style.words(name)
            )
    return figures


def sections_of(
    study: SobolStudy, model: Model, analysis: SobolAnalysis, figures: Mapping[str, Any]
) -> list[Section]:
    """Return the sections of the report.

    Parameters
    ----------
    study : SobolStudy
        Checked study file.
    model : Model
        Model of the runs.
    analysis : SobolAnalysis
        Every number of the report.
    figures : mapping
        Figures by file name.
    """
    wanted = analysis.reported

    def picked(prefix: str, caption: str) -> dict[str, Any]:
        return {
            f"{caption} {style.words(name)}.": figures[f"{prefix}_{name}"]
            for name in wanted
            if f"{prefix}_{name}" in figures
        }

    def one(name: str, caption: str) -> dict[str, Any]:
        return {caption: figures[name]} if name in figures else {}

    sections = [
        Section(
            "Sensitivity indices",
            summarise(analysis),
            [_index_table(name, entry) for name, entry in wanted.items() if entry.varies],
            one("indices", "First-order and total indices with 95 % intervals. Factors whose total "
                "index is below the noise line are not distinguishable from zero."),
        ),
        Section(
            "All outputs",
            ["Total indices: the share of an output's variance that would remain if all but this "
             "factor were known.", *_constant(analysis), *_not_given(analysis)],
            (),
            one("heatmap", "Total index of every output by factor. Hatched: none, as the output "
                "does not vary, or hardly ever."),
        ),
    ]  # fmt: skip
    if any(entry.varies for entry in wanted.values()):
        sections.append(
            Section(
                "Main effects",
                ("Conditional mean of an output along one input, and the remaining spread due to "
                 "the others.",),
                (),
                picked("main_effects", "Conditional mean and band of"),
            )
        )  # fmt: skip
    second = picked("second_order", "Second-order indices of")
    if second:
        sections.append(
            Section(
                "Second-order interactions", ("Grey: not distinguishable from zero.",), (), second
            )
        )
    return [
        *sections,
        Section(
            "The model's noise floor",
(
                f"The dummy perturbs every input by {PERTURBATION:g} of its range. A smooth output "
                "does not change; the scatter of a chaotic one cannot be attributed to any input.",
            ),
            [_noise_table(analysis)],
        ),
        Section(
            "Sampling uncertainty",
            [
                _convergence_said(analysis),
                _intervals_said(study),
                *failures_said(analysis, "base points"),
            ],
            [status_table(analysis)],
            one("convergence", "Total indices on growing parts of the design, with 95 % bands; the "
                "largest factors.")
            | one("failures", "Share of failed runs in each tenth of each input."),
        ),
        Section("The model", (f"Model {model.name}, version {model.version}.",
                              groups_said(analysis))),
    ]  # fmt: skip


def summarise(analysis: SobolAnalysis) -> list[str]:
    """Return the influential factors of the reported outputs, a paragraph each."""
    return [sentence(name, entry) for name, entry in analysis.reported.items()]


def sentence(name: str, entry: IndexedOutput) -> str:
    """Return sentences on the influential factors of an output."""
    title = style.words(name)
    if not entry.varies:
        return f"{capital(title)} does not vary."
    first, total = entry.first, entry.total
    if any(not row.has_interval for table in (first, total) for row in table.values()):
        return (
            f"{capital(title)} hardly ever changes: in some resamples of the design it does not "
            "vary, so its indices have no intervals and are not interpreted."
        )
    noise = total[DUMMY]
    factors = [factor for factor in total if factor != DUMMY]
    order = sorted(factors, key=lambda factor: -first[factor].value)
    clear = [factor for factor in order if first[factor].low > 0.0]
    lines = []
    if clear:
        named = ", ".join(f"{style.words(f)} {_share(first[f])}" for f in clear[1:NAMED])
        lines.append(
            f"{style.words(clear[0])} explains {_share(first[clear[0]])} of the variance of {title}"
            + (f", {named}." if named else ".")
        )
    else:
        lines.append(f"no first-order index of {title} is distinguishable "
                     "from zero.")  # fmt: skip
    alone = entry.alone
    lines.append(
        f"All factors on their own explain {_share(alone)}; "
        + (
            "the rest are interactions" + (" and chaos." if noise.value > 0.01 else ".")
            if alone.high < 1.0 - noise.high
            else "interactions are not distinguishable from none."
        )
    )
    # Chaotic scatter raises every total index.
    felt = [f for f in factors if total[f].low > noise.high]
    mixed = [f for f in felt if total[f].low > first[f].high + noise.high]
    mixed.sort(key=lambda f: first[f].value - total[f].value)
    if mixed:
        named = ", ".join(
            f"{style.words(f)} ({_percent(first[f])} alone, {_percent(total[f])} with interactions)"
            for f in mixed[:NAMED]
        )
        lines.append(f"Most through interactions: {named}.")
    quiet = [f for f in felt if f not in clear and f not in mixed[:NAMED]]
    if quiet:
        lines.append(
            "Distinguishable from zero only through interactions: "
            f"{', '.join(style.words(f) for f in quiet)}."
        )
    weak = [f for f in factors if f not in felt and f not in clear]
    if weak:
        lines.append(
            "Not distinguishable from zero, even with interactions: "
            f"{', '.join(style.words(f) for f in weak)}."
        )
    lines.append(
        f"{_share(noise)} of the variance is not attributable to any input: a perturbation of all "
        f"inputs by {PERTURBATION:g} of their range makes {title} scatter by "
        f"{quantity(entry.noise_sd, entry.unit, 2)} (standard deviation)."
    )
    return " ".join(capital(line) for line in lines)


def _share(entry: Estimate) -> str:
    value, half = 100.0 * entry.value, 50.0 * (entry.high - entry.low)
    if abs(value) < 0.5 and half < 0.5:
        return "less than 1 %"
    return f"{_percent(entry, ' ')}± {max(half, 1.0):.0f} %"


def _percent(entry: Estimate, unit: str = " %") -> str:
    # Negative estimates are noise about zero.
    return f"{max(0, round(100.0 * entry.value))}{unit}"


def _index_table(name: str, entry: IndexedOutput) -> Table:
    order = by_size({factor: total.value for factor, total in entry.total.items()})
    rows = [[style.words(f), share(entry.first[f]), share(entry.total[f])] for f in order]
    caption = (
        f"{style.words(name)}: standard deviation {_sd(entry)}, "
        f"{entry.base_points:,} base points. Negative estimates are noise about zero."
    )
    return Table(caption, ["factor", "first order (95 %)", "total (95 %)"], rows)


def _sd(entry: IndexedOutput) -> str:
    return quantity(entry.variance**0.5, entry.unit, 2)


def _constant(analysis: SobolAnalysis) -> list[str]:
    held = [name for name, entry in analysis.indexed.items() if not entry.varies]
    if not held:
        return []
    return [
        f"No index is given where an output does not vary: {', '.join(map(style.words, held))}."
    ]


def _not_given(analysis: SobolAnalysis) -> list[str]:
    missing = [
        f"{style.words(name)} ({entry.base_points:,} of {analysis.base_points:,})"
        for name, entry in analysis.outputs.items()
        if name not in analysis.indexed
    ]
    if not missing:
        return []
    return [
        "No index is given where too few base points have a value in every row (no failed run, "
        f"and a contact that the output describes): {', '.join(missing)}."
    ]


def _noise_table(analysis: SobolAnalysis) -> Table:
    rows = []
    for name, entry in analysis.indexed.items():
        if entry.varies:
            noise = entry.total[DUMMY].value
            rows.append(
                [
                    style.words(name),
                    _sd(entry),
                    quantity(entry.noise_sd, entry.unit, 2),
                    f"{100.0 * noise:.2g} %" if math.isfinite(noise) else "–",
                ]
            )
    head = ["output", "standard deviation", "noise floor", "share of the variance"]
    return Table("Noise floor by output.", head, rows)


def _convergence_said(analysis: SobolAnalysis) -> str:
    if not math.isfinite(analysis.widest):
        return "Some intervals could not be estimated: an output hardly ever changes."
    if not any(entry.varies for entry in analysis.reported.values()):
        return "No reported output varies, so there is no index whose interval could be wide."
    said = (
        f"The widest 95 % interval of a total index of the reported outputs is "
        f"{analysis.widest:.3f} wide, with a design of {analysis.base_points:,} base points."
    )
    tolerance = analysis.tolerance
    if tolerance is None:
        return said
    if analysis.widest <= tolerance:
        return f"{said} The study asked for {tolerance:g}: met."
    return f"{said} The study asked for {tolerance:g}: NOT met, the budget is spent."


def _intervals_said(study: SobolStudy) -> str:
    return (
        f"The design is {SCRAMBLES} independent scrambles of a Sobol' sequence. Intervals are 95 % "
        f"t intervals with the standard deviation of {study.report.resamples:,} bootstrap "
        "resamples of whole scrambles. They cover the sampling uncertainty only, not "
        "model error."
    )
