"""The report of a Sobol' study: what its indices say, in words, tables and pictures."""

from collections.abc import Mapping, Sequence
from typing import Any

from mcstudy.config import SobolStudy
from mcstudy.figures import sensitivity, style
from mcstudy.report import Section, Table
from mcstudy.sensitivity.saltelli import DUMMY, NUDGE
from mcstudy.text import interval, number, unit
from models.protocol import Model

NAMED = 4
"""Factors that a sentence names, the largest."""


def draw(analysis: Mapping[str, Any], wanted: Sequence[str]) -> dict[str, Any]:
    """Return the study's figures by file name."""
    outputs = analysis["outputs"]
    varying = [name for name in wanted if outputs[name]["variance"]]
    if not varying:
        return {}
    figures: dict[str, Any] = {
        "indices": sensitivity.draw_indices({name: outputs[name] for name in varying}, DUMMY),
        "heatmap": sensitivity.draw_heatmap(
            {name: entry for name, entry in outputs.items() if entry["variance"]}
        ),
        "convergence": sensitivity.draw_convergence(
            {name: analysis["convergence"][name] for name in varying}
        ),
    }
    for name in varying:
        figures[f"main_effects_{name}"] = sensitivity.draw_main_effects(
            analysis["main_effects"][name],
            analysis["input_units"],
            style.label(name, outputs[name]["unit"]),
        )
        if "second" in outputs[name]:
            figures[f"second_order_{name}"] = sensitivity.draw_second_order(
                outputs[name], analysis["factors"], style.words(name)
            )
    return figures


def sections_of(
    study: SobolStudy,
    model: Model,
    manifest: Mapping[str, Any],
    analysis: Mapping[str, Any],
    figures: Mapping[str, Any],
) -> list[Section]:
    """Return the sections of the report."""
    wanted = list(analysis["convergence"])
    outputs = analysis["outputs"]

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
            "What drives the outputs",
            [sentence(name, outputs[name]) for name in wanted],
            [_index_table(name, outputs[name]) for name in wanted],
            one("indices", "First-order and total indices with 95 % intervals. Factors whose total "
                "index does not pass the noise line are not distinguishable from none."),
        ),
        Section(
            "All outputs",
            ("Total indices: the share of an output's variance that would be left if all but this "
             "factor were known.",),
            (),
            one("heatmap", "Total index of every output by factor."),
        ),
        Section(
            "Main effects",
            ("What an output does on average as one input goes through its distribution, and the "
             "spread that the others leave.",),
            (),
            picked("main_effects", "Conditional mean and band of"),
        ),
    ]  # fmt: skip
    second = picked("second_order", "Second-order indices of")
    if second:
        sections.append(
            Section("Interactions of two", ("Grey: not distinguishable from zero.",), (), second)
        )
    sections += [
        Section(
            "How sure the numbers are",
            _honesty(study, analysis),
            [_status_table(manifest)],
            one("convergence", "Total indices on growing parts of the design, with 95 % bands; the "
                "largest factors."),
        ),
        Section("The model", (f"Model {model.name}, version {model.version}.", _groups(analysis))),
    ]  # fmt: skip
    return [s for s in sections if s.paragraphs or s.figures or s.tables]


def sentence(name: str, entry: Mapping[str, Any]) -> str:
    """Say in words what drives an output."""
    title = style.words(name)
    title = title[0].upper() + title[1:]
    if not entry["variance"]:
        return f"{title} does not vary."
    first, total = entry["first"], entry["total"]
    noise = total[DUMMY]
    factors = [factor for factor in total if factor != DUMMY]
    order = sorted(factors, key=lambda factor: -first[factor]["value"])
    clear = [factor for factor in order if first[factor]["low"] > 0.0]
    lines = []
    if clear:
        named = [f"{style.words(f)} explains {_share(first[f])}" for f in clear[:NAMED]]
        lines.append(f"{title}: of the variance {', '.join(named)} on its own.")
    else:
        lines.append(f"{title}: no factor explains variance on its own that is clear of zero.")
    mixed = sum(first[factor]["value"] for factor in factors)
    lines.append(
        f"All factors on their own explain {100.0 * mixed:.0f} %; the rest are interactions"
        + (" and chaos." if noise["value"] > 0.01 else ".")
    )
    strongest = sorted(factors, key=lambda f: first[f]["value"] - total[f]["value"])[:2]
    acting = [
        f"{style.words(f)} ({100.0 * first[f]['value']:.0f} % alone, "
        f"{100.0 * total[f]['value']:.0f} % with interactions)"
        for f in strongest
        if total[f]["low"] > first[f]["high"]
    ]
    if acting:
        lines.append(f"Most through interactions: {', '.join(acting)}.")
    weak = [f for f in factors if not total[f]["low"] > noise["high"]]
    if weak:
        lines.append(
            "Not distinguishable from none, even with interactions: "
            f"{', '.join(style.words(f) for f in weak)}."
        )
    lines.append(
        f"A nudge of all inputs by {NUDGE:g} of their range changes it as if {_share(noise)} of "
        "its variance belonged to no input."
    )
    return " ".join(lines)


def _share(entry: Mapping[str, float]) -> str:
    half = 0.5 * (entry["high"] - entry["low"])
    return f"{100.0 * entry['value']:.0f} ± {max(1.0, 100.0 * half):.0f} %"


def _index_table(name: str, entry: Mapping[str, Any]) -> Table:
    order = sorted(entry["total"], key=lambda f: -(entry["total"][f]["value"] or 0.0))
    rows = [
        [style.words(f), interval(entry["first"][f], 2), interval(entry["total"][f], 2)]
        for f in order
    ]
    caption = (
        f"{style.words(name)} [{unit(entry['unit']) or '–'}]: variance "
        f"{number(entry['variance'])}, {entry['base_points']:,} base points. Negative estimates "
        "are noise about zero."
    )
    return Table(caption, ["factor", "first order (95 %)", "total (95 %)"], rows)


def _honesty(study: SobolStudy, analysis: Mapping[str, Any]) -> list[str]:
    failed = analysis["failures"]
    lines = [
        "Intervals are 95 % normal intervals with the standard deviation of "
        f"{study.report.resamples:,} bootstrap resamples of whole base points. They count the "
        "sampling error only, not what the model itself gets wrong.",
        f"{failed['runs']:,} of {analysis['runs']:,} runs failed. A base point with a failed run "
        "is left out whole, for every output that it has no value of.",
    ]
    if failed["where"]:
        where = ", ".join(
            f"{style.words(name)} {'high' if rank > 0.5 else 'low'} (mean rank {rank:.2f})"
            for name, rank in failed["where"].items()
        )
        lines.append(f"Failed runs lie where: {where}.")
    return lines


def _groups(analysis: Mapping[str, Any]) -> str:
    if not analysis["groups"]:
        return "Every input is a factor of its own."
    text = "; ".join(
        f"{group}: {', '.join(style.words(name) for name in names)}"
        for group, names in analysis["groups"].items()
    )
    return f"Factors that are groups of inputs: {text}."


def _status_table(manifest: Mapping[str, Any]) -> Table:
    rows = [[status, f"{count:,}"] for status, count in manifest["counts"].items()]
    return Table("How the runs ended.", ["status", "runs"], rows)
