"""The report of a model comparison: model-form uncertainty, in text and figures."""

import math
from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from mcstudy import units
from mcstudy.figures import agreement, crash, style
from mcstudy.report import Section, Table
from mcstudy.statistics import Estimate, by_size
from mcstudy.text import capital, interval, number, quantity, unit
from models.protocol import Model, Scene
from studies.failure_report import failure_map, failures_said, status_table
from studies.model_comparison.numbers import ComparedOutput, ComparisonAnalysis, Pair
from studies.model_comparison.schema import ModelComparison
from studies.published_tables import as_table, compare_with_table

NAMED = 3
"""Inputs that a sentence names, the largest."""


def draw(
    study: ModelComparison,
    models: Mapping[str, Model],
    runs: Mapping[str, pd.DataFrame],
    nominal: Mapping[str, Mapping[str, Any]],
    analysis: ComparisonAnalysis,
) -> dict[str, Any]:
    """Return the figures by file name.

    Parameters
    ----------
    study : ModelComparison
        Checked study file.
    models : mapping
        Models by label.
    runs : mapping
        Table of runs by label.
    nominal : mapping
        Outputs and poses of the nominal run by label.
    analysis : ComparisonAnalysis
        Every number of the report.
    """
    reported = analysis.reported
    unit_of = {name: entry.unit for name, entry in reported.items()}
    figures = failure_map(analysis)
    figures["variance"] = agreement.draw_variance(
        {name: entry.variance for name, entry in reported.items()}
    )
    for one, two in combinations(study.models, 2):
        found = analysis.pairs(one, two)
        values = {
            name: np.stack(
                [runs[label][name].to_numpy(dtype=float) for label in (one, two)], axis=1
            )
            for name in reported
        }
        figures[f"pairs_{one}_{two}"] = agreement.draw_pairs(values, unit_of, (one, two), found)
        figures[f"breaking_{one}_{two}"] = agreement.draw_breaking(
            {name: pair.breaking for name, pair in found.items()}
        )
        si = {item.name: item.unit for item in models[one].inputs}
        along = {}
        for name, pair in found.items():
            key = by_size(pair.breaking.gains)[0]
            spec = study.inputs[key]
            shown = runs[one][key].to_numpy(dtype=float) * units.factor(si[key], spec.unit)
            along[name] = (shown, style.label(key, spec.unit))
        figures[f"along_{one}_{two}"] = agreement.draw_along(along, values, unit_of, (one, two))
    for label, entry in nominal.items():
        if "scene" in entry:
            figures[f"kinematics_{label}"] = crash.draw_strip(
                _scene(entry["scene"]), study.report.strip_times
            )
    return figures


def sections_of(
    study: ModelComparison,
    models: Mapping[str, Model],
    analysis: ComparisonAnalysis,
    figures: Mapping[str, Any],
) -> list[Section]:
    """Return the sections of the report.

    Parameters
    ----------
    study : ModelComparison
        Checked study file.
    models : mapping
        Models by label.
    analysis : ComparisonAnalysis
        Every number of the report.
    figures : mapping
        Figures by file name.
    """
    sections = [
        Section(
            "Model-form uncertainty",
            [_variance_said(name, entry) for name, entry in analysis.reported.items()],
            [_variance_table(analysis)],
            {"Variance split of each output over equally likely methods: effect of the inputs "
             "common to all methods, shift between methods, and interaction of inputs and "
             "methods.": figures["variance"]},
        )
    ]  # fmt: skip
    for one, two in combinations(study.models, 2):
        found = analysis.pairs(one, two)
        sections.append(
            Section(
                f"{capital(two)} against {one}",
                [_pair_said(name, pair, one, two) for name, pair in found.items()],
                [_pair_table(found, one, two)],
                {"Above: every set of inputs by both models. Below: their difference against their "
                 "mean, with the mean difference and the limits between which 95 % of normal "
                 "differences lie; shaded, 95 % intervals of the lines. The widest 0.2 % at either "
                 "end lie outside the figures.": figures[f"pairs_{one}_{two}"]},
            )
        )  # fmt: skip
        sections.append(
            Section(
                f"Sources of disagreement of {one} and {two}",
                [_breaking_said(name, pair) for name, pair in found.items()],
                [_disagreement_table(found), _apart_table(study, found, (one, two), models[one])],
                {"Gain in rank correlation if the mean disagreement along an input is removed. "
                 "Grey: not above the gain of an unrelated input.":
                 figures[f"breaking_{one}_{two}"],
                 "Both models along the input over which each output disagrees most: median and "
                 "middle half of the runs.": figures[f"along_{one}_{two}"]},
            )
        )  # fmt: skip
    pictures = {
        f"Nominal run of {label} ({models[label].name}), in the car's frame.":
        figures[f"kinematics_{label}"]
        for label in study.models
        if f"kinematics_{label}" in figures
    }  # fmt: skip
    sections.append(_published(study, models, analysis, pictures))
    sections.append(
        Section(
            "Sampling uncertainty",
            [
                "Run k of every model has the same inputs. Intervals are 95 % t intervals between "
                "independent parts of the design, of correlations on Fisher's scale. They cover "
                "the sampling uncertainty only: models that agree may share an error.",
                *failures_said(analysis),
            ],
            [status_table(analysis)],
            {"Share of failed runs in each tenth of each input.": figures["failures"]}
            if "failures" in figures
            else {},
        )
    )
    sections.append(Section("The models", _models_said(analysis)))
    return sections


def summarise(analysis: ComparisonAnalysis) -> list[Any]:
    """Return the command line's summary: the variance split and each pair's agreement."""
    return [
        *(_variance_said(name, entry) for name, entry in analysis.reported.items()),
        *(
            _pair_table(analysis.pairs(one, two), one, two)
            for one, two in combinations(analysis.models, 2)
        ),
    ]


def _scene(entry: Mapping[str, Any]) -> Scene:
    """Return the scene that a cell keeps."""
    time, semi_axes, centre, orientation, car, plan = (
        np.asarray(entry[key], dtype=float)
        for key in ("time", "semi_axes", "centre", "orientation", "car", "plan")
    )
    outline = [np.asarray(line, dtype=float) for line in entry["outline"]]
    names = list(entry["names"])
    return Scene(time, names, semi_axes, centre, orientation, car, outline, plan)


def _title(name: str) -> str:
    return capital(style.words(name))


def _percent(entry: Estimate) -> str:
    if not math.isfinite(entry.value):
        return "–"
    value, low, high = (
        f"{100.0 * v:.0f}".replace("-0", "0") for v in (entry.value, entry.low, entry.high)
    )
    return f"{value} % ({low} to {high})" if entry.has_interval else f"{value} %"


def _gain(value: float) -> str:
    """Return a gain with two decimals, zero without a sign."""
    return f"{value:.2f}".replace("-0.00", "0.00") if math.isfinite(value) else "–"


def _variance_said(name: str, entry: ComparedOutput) -> str:
    split = entry.variance
    if not math.isfinite(split.inputs.value):
        return f"{_title(name)} does not vary in any model."
    return (
        f"{_title(name)}: of its variance {_percent(split.inputs)} is due to the inputs alike "
        f"in all models, {_percent(split.method)} to the shift between methods, and "
        f"{_percent(split.together)} to the interaction of inputs and methods. For one set of "
        "inputs the standard deviation of the methods is "
        f"{quantity(entry.method_sd, entry.unit)}."
    )


def _variance_table(analysis: ComparisonAnalysis) -> Table:
    rows = []
    for name, entry in analysis.reported.items():
        split = entry.variance
        rows.append(
            [style.words(name), unit(entry.unit) or "–",
             *map(_percent, (split.inputs, split.method, split.together)),
             number(entry.method_sd), f"{entry.rows:,}"]
        )  # fmt: skip
    head = ["output", "unit", "inputs", "method", "interaction", "sd of the methods", "runs"]
    return Table(
        "Shares of the variance (95 %), and standard deviation of the methods.", head, rows
    )


def _pair_said(name: str, found: Pair, one: str, two: str) -> str:
    u = unit(found.unit)
    if found.spread.value == found.bias.value == 0.0:
        return f"{_title(name)}: {one} and {two} give the same value in every run."
    bias, low, high = found.bias, found.lower.value, found.upper.value
    differs = not bias.low <= 0.0 <= bias.high
    side = "above" if bias.value > 0.0 else "below"
    shift = (
        f"{two} lies {number(abs(bias.value))} {u} {side} {one} on average".replace("  ", " ")
        if differs
        else f"{two} and {one} have no clear mean difference"
    )
    return (
        f"{_title(name)}: {shift}; 95 % of the differences lie between {number(low)} and "
        f"{quantity(high, found.unit)}. "
        + (
            f"Rank correlation {interval(found.rank_correlation, 2)}."
            if math.isfinite(found.rank_correlation.value)
            else "There is no rank correlation where one of them does not vary."
        )
    )


def _pair_table(found: Mapping[str, Pair], one: str, two: str) -> Table:
    rows = [
        [style.label(name, pair.unit), f"{pair.pairs:,}",
         *(interval(e, 2) for e in (pair.rank_correlation, pair.correlation, pair.concordance)),
         interval(pair.bias), f"{number(pair.lower.value)} to {number(pair.upper.value)}"]
        for name, pair in found.items()
    ]  # fmt: skip
    head = ["output", "pairs", "rank correlation", "Pearson", "concordance", "mean difference",
            "limits"]  # fmt: skip
    return Table(
        f"{capital(two)} minus {one}, with 95 % intervals; limits of agreement hold 95 % of the "
        "differences.",
        head,
        rows,
    )


def _breaking_said(name: str, found: Pair) -> str:
    gains, noise = found.breaking.gains, found.breaking.noise
    rank = found.rank_correlation.value
    if not math.isfinite(rank):
        return f"{_title(name)}: there is no rank correlation to analyse."
    if found.spread.value == 0.0:
        return f"{_title(name)}: no input reduces the rank correlation of {rank:.2f}."
    order = [key for key in by_size(gains) if gains[key] > noise]
    if not order:
        return (
            f"{_title(name)}: no single input reduces the rank correlation of {rank:.2f}; the "
            "disagreement is spread over all inputs or due to their interactions."
        )
    named = ", ".join(f"{style.words(k)} (+{gains[k]:.2f})" for k in order[:NAMED])
    return (
        f"{_title(name)}: the rank correlation of {rank:.2f} is reduced most by {named}: the gain "
        "if both models responded to that input alike."
    )


def _disagreement_table(found: Mapping[str, Pair]) -> Table:
    rows = []
    for key in next(iter(found.values())).breaking.gains:
        row = [style.words(key)]
        for pair in found.values():
            row.append(_gain(pair.breaking.gains[key]))
            row.append(_percent(pair.disagreement.shares[key]) if pair.disagreement else "–")
        rows.append(row)
    last = ["noise line"]
    for pair in found.values():
        noise = pair.disagreement.noise if pair.disagreement else math.nan
        last.append(_gain(pair.breaking.noise))
        last.append(f"{100.0 * noise:.0f} %" if math.isfinite(noise) else "–")
    head = ["input"]
    for name in found:
        head += [f"{style.words(name)}: gain", f"{style.words(name)}: share of the difference"]
    return Table(
        "Gain in rank correlation by input, and first-order share of the variance of the "
        "difference (95 %).",
        head,
        [*rows, last],
    )


def _apart_table(
    study: ModelComparison, found: Mapping[str, Pair], labels: tuple[str, str], model: Model
) -> Table:
    shown = []
    for pair in found.values():
        shown += by_size(pair.breaking.gains)[:NAMED]
    columns = list(dict.fromkeys(shown))
    si = {item.name: item.unit for item in model.inputs}
    rows = []
    for name, pair in found.items():
        for entry in pair.most_apart:
            values = [number(value) for value in entry.values]
            point = [
                number(entry.inputs[k] * units.factor(si[k], study.inputs[k].unit)) for k in columns
            ]
            rows.append([style.words(name), str(entry.run), *values, *point])
    head = ["output", "run", *labels,
            *(style.label(k, study.inputs[k].unit) for k in columns)]  # fmt: skip
    return Table("Runs with the largest differences beyond the mean difference.", head, rows)


def _published(
    study: ModelComparison,
    models: Mapping[str, Model],
    analysis: ComparisonAnalysis,
    pictures: Mapping[str, Any],
) -> Section:
    si = {item.name: item.unit for model in models.values() for item in model.outputs}
    ours = {f"{label}, nominal": analysis.nominal[label] for label in study.models}
    tables = [as_table(compare_with_table(table, ours, si)) for table in study.tables]
    lines = ["Our rows are the models' nominal runs; none of them was set up for this study."]
    for name, entry in analysis.published.items():
        mine = analysis.reported.get(name)
        said = (
            f"{_title(name)}: the {entry.methods} published methods have a standard deviation "
            f"of {quantity(entry.sd, entry.unit)}"
        )
        if entry.mean:
            said += f" ({number(100.0 * entry.sd / abs(entry.mean), 2)} % of their mean)"
        said += " for one set of inputs"
        if mine is not None:
            said += f"; ours, over all sets of inputs, have {quantity(mine.method_sd, entry.unit)}"
        lines.append(f"{said}.")
    return Section("Comparison with the published methods", lines, tables, dict(pictures))


def _models_said(analysis: ComparisonAnalysis) -> list[str]:
    lines = []
    for label, entry in analysis.models.items():
        line = f"{capital(label)}: model {entry.name}, version {entry.version}."
        for key, reason in entry.ignored.items():
            line += f" It ignores {style.words(key)}: {reason}."
        lines.append(line)
    return lines
