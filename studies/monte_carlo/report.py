"""The report of a Monte Carlo study: text, tables and figures."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from mcstudy import statistics, units
from mcstudy.figures import distributions, relations, style
from mcstudy.report import Section, Table
from mcstudy.statistics import Distribution, TooFew
from mcstudy.text import capital, interval, number, percent, quantity, unit
from models.protocol import Model, complete_status
from studies.failure_report import failure_map, failures_said, status_table
from studies.monte_carlo.analysis import MonteCarloAnalysis, marks_of
from studies.monte_carlo.schema import MonteCarloStudy


def draw(
    study: MonteCarloStudy, model: Model, runs: pd.DataFrame, analysis: MonteCarloAnalysis
) -> dict[str, Any]:
    """Return the study's figures by file name.

    Parameters
    ----------
    study : MonteCarloStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Table of the runs.
    analysis : MonteCarloAnalysis
        Every number of the report.
    """
    complete = runs[runs["status"].isin(complete_status(model))]
    unit_of = {item.name: item.unit for item in model.outputs}
    # An output without a value in any run is not drawn.
    wanted = {name: unit_of[name] for name in analysis.convergence}
    marks = marks_of(study, model)
    figures = failure_map(analysis)
    if not wanted:
        return figures
    figures |= {
        "distributions": distributions.draw_distributions(
            complete, wanted, marks, analysis.outputs
        ),
        "rank_correlation": relations.draw_correlations(
            pd.DataFrame(analysis.rank_correlation), analysis.rank_correlation_noise
        ),
    }
    steps = {name: table for name, table in analysis.convergence.items() if table}
    if steps:
        figures["convergence"] = relations.draw_convergence(steps, wanted)
    speed = complete["impact_speed"].to_numpy() if "impact_speed" in study.inputs else np.zeros(0)
    if statistics.varies(speed):
        shown = complete.assign(impact_speed=3.6 * complete["impact_speed"])
        figures["impact_speed"] = relations.draw_against_input(
            shown, "impact_speed", "impact speed [km/h]", wanted, marks
        )
    if {"throw_distance", "wad"} <= set(wanted):
        point = {
            name: mark.value for name, items in marks.items() for mark in items
            if mark.kind == "observed"
        }  # fmt: skip
        figures["throw_and_wad"] = relations.draw_joint(
            complete, ("throw_distance", "m"), ("wad", "m"), point
        )
    return figures


def sections_of(
    study: MonteCarloStudy,
    model: Model,
    runs: pd.DataFrame,
    analysis: MonteCarloAnalysis,
    figures: Mapping[str, Any],
) -> list[Section]:
    """Return the sections of the report.

    Parameters
    ----------
    study : MonteCarloStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Table of the runs.
    analysis : MonteCarloAnalysis
        Every number of the report.
    figures : mapping
        Figures by file name.
    """
    captions = {
        "distributions": "Above: runs by output; shaded the central 90 %, the median with its 95 % "
        "interval. Below: cumulative share with a 95 % band for the whole curve. The widest "
        "0.2 % of the runs at either end lie outside the figure above.",
        "throw_and_wad": "Throw and wrap-around distance of every run and of the accident.",
        "impact_speed": "Outputs against impact speed: median and 90 % band of the runs around it.",
        "rank_correlation": "Spearman rank correlation of inputs and outputs; grey: not "
        "distinguishable from zero; hatched: none, as an input or output does not vary.",
        "convergence": "Median over growing parts of the study.",
        "failures": "Share of failed runs in each tenth of each input.",
    }

    def pick(*names: str) -> dict[str, Any]:
        return {captions[name]: figures[name] for name in names if name in figures}

    return [
        Section("Result", _summary(study, model, analysis), [_output_table(study, model, analysis)],
                pick("distributions")),
        Section("The accident", _accident(analysis, model), (), pick("throw_and_wad")),
        Section("Rank correlations", (
            "Rank correlations measure the monotonic association of an output with one input at "
            "a time; they are not shares of variance.",),
            (), pick("impact_speed", "rank_correlation")),
        Section("Inputs", (), [_input_table(study, model, runs)]),
        Section("Sampling uncertainty", [_honesty(study), *failures_said(analysis)],
                [status_table(analysis)], pick("convergence", "failures")),
        Section("The model", _model_notes(model)),
    ]  # fmt: skip


def summarise(analysis: MonteCarloAnalysis) -> list[Table]:
    """Return the distributions of the reported outputs as a short table."""
    rows = []
    for name in analysis.rank_correlation:
        entry = analysis.outputs[name]
        known = (
            [interval(entry.mean),
             *(number(entry.quantiles[p].value) for p in ("0.05", "0.5", "0.95"))]
            if isinstance(entry, Distribution)
            else ["–"] * 4
        )  # fmt: skip
        rows.append([name, entry.unit, *known])
    head = ["output", "unit", "mean (95 % interval)", "5 %", "median", "95 %"]
    return [Table("", head, rows)]


def _title(name: str) -> str:
    return capital(style.words(name))


def _summary(study: MonteCarloStudy, model: Model, analysis: MonteCarloAnalysis) -> list[str]:
    unit_of = {item.name: item.unit for item in model.outputs}
    lines = [_distribution(name, analysis.outputs[name]) for name in analysis.rank_correlation]
    for name, entries in analysis.exceedance.items():
        lines += [
            f"{_title(name)} exceeds {quantity(e.value, unit_of[name])} ({e.label}) in "
            f"{percent(e.probability_above)} of the runs."
            for e in entries
        ]
    return lines


def _distribution(name: str, entry: Distribution | TooFew) -> str:
    """Return a sentence on the distribution of an output."""
    title, count = _title(name), entry.n
    if not isinstance(entry, Distribution):
        return f"{title}: {'only one run' if count else 'no run'} has a value."
    q, u = entry.quantiles, unit(entry.unit)
    if entry.sd.value == 0.0:
        held = " that have a value" if entry.undefined else ""
        value = f"{number(q['0.5'].value, 4)} {u}".strip()
        return f"{title} does not vary: it is {value} in all {count:,} runs{held}."
    return (
        f"{title}: median {' '.join((interval(q['0.5']), u)).strip()}; nine runs in ten "
        f"lie between {number(q['0.05'].value)} and "
        f"{' '.join((number(q['0.95'].value), u)).strip()}."
    )


def _accident(analysis: MonteCarloAnalysis, model: Model) -> list[str]:
    unit_of = {item.name: item.unit for item in model.outputs}
    lines = []
    for name, entries in analysis.observed.items():
        for e in entries:
            where = "inside" if e.inside_central_90 else "OUTSIDE"
            lines.append(
                f"{_title(name)}: the observed {quantity(e.value, unit_of[name])} "
                f"({e.label}) lies {where} the central 90 % of the prediction, at its "
                f"{100.0 * e.percentile:.0f} % point."
            )
    return lines or ["The study file names no observed values."]


def _output_table(study: MonteCarloStudy, model: Model, analysis: MonteCarloAnalysis) -> Table:
    rows = []
    for item in model.outputs:
        entry = analysis.outputs[item.name]
        if not isinstance(entry, Distribution):
            continue
        q = entry.quantiles
        rows.append(
            [
                item.name,
                unit(item.unit) or "–",
                interval(entry.mean),
                number(entry.sd.value),
                *(number(q[p].value) for p in ("0.05", "0.5", "0.95")),
                str(entry.undefined),
            ]
        )
    head = ["output", "unit", "mean (95 % interval)", "sd", "5 %", "median", "95 %", "undefined"]
    return Table(
        "All outputs. 'undefined' counts runs in which an output has no value.", head, rows
    )


def _input_table(study: MonteCarloStudy, model: Model, runs: pd.DataFrame) -> Table:
    rows = []
    for item in model.inputs:
        if item.name in study.inputs:
            spec = study.inputs[item.name]
            scale = 1.0 / units.factor(spec.unit, item.unit)
            low, middle, high = np.quantile(runs[item.name] * scale, [0.05, 0.5, 0.95])
            shown = [spec.distribution, number(low), number(middle), number(high), unit(spec.unit)]
        else:
            value = float(runs[item.name].iloc[0])
            shown = ["fixed", "", number(value), "", unit(item.unit)]
        meaning = f"{item.meaning}; ignored: {item.ignored}" if item.ignored else item.meaning
        rows.append([item.name, *shown, meaning])
    head = ["input", "distribution", "5 %", "median or value", "95 %", "unit", "meaning"]
    return Table("Inputs as sampled, in the study file's units.", head, rows)


def _honesty(study: MonteCarloStudy) -> str:
    if study.design.method == "monte-carlo":
        return (
            "Samples are independent: quantiles have order-statistic intervals, probabilities "
            "Wilson intervals, means t intervals, all at 95 %. They cover the sampling "
            "uncertainty only, not model error."
        )
    return (
        f"The design is {study.design.n // study.design.size} independent replicates of "
        f"{study.design.size} samples; every interval is a 95 % t interval from the spread between "
        "the replicates. It covers the sampling uncertainty only, not model error."
    )


def _model_notes(model: Model) -> list[str]:
    calibrated = [item for item in model.inputs if item.source.startswith("calibrated")]
    lines = [f"Model {model.name}, version {model.version}."]
    if calibrated:
        lines.append(
            "Calibrated to the multibody rows of the case's tables (throw, WAD, HIC15, head dent): "
            + ", ".join(f"{i.name} (nominal {quantity(i.nominal, i.unit)})" for i in calibrated)
            + ". Every other output of the nominal run is a prediction."
        )
    return lines
