"""The report of an injury study: outcomes, limits and curves, in text, tables and figures."""

import math
from collections.abc import Mapping
from typing import Any

from mcstudy.figures import style
from mcstudy.injury.functions import RiskFunction
from mcstudy.report import Section, Table
from mcstudy.statistics import Estimate
from mcstudy.text import capital, interval, number, percent
from studies.failure_report import failures_said, status_table
from studies.injury.numbers import Change, InjuryAnalysis, ScenarioOutcome
from studies.injury.pictures import ratings_of
from studies.injury.schema import REFERENCE, InjuryStudy

FEW = 1000.0
"""Number of impacts to which counts of injured refer."""


def sections_of(
    study: InjuryStudy,
    analysis: InjuryAnalysis,
    figures: Mapping[str, Any],
    functions: Mapping[str, RiskFunction],
) -> list[Section]:
    """Return the sections of the report.

    Parameters
    ----------
    study : InjuryStudy
        Checked study file.
    analysis : InjuryAnalysis
        Every number of the report.
    figures : mapping
        Figures by file name.
    functions : mapping
        Risk functions by name.
    """
    scenarios = analysis.scenarios

    def one(name: str, caption: str) -> dict[str, Any]:
        return {caption: figures[name]} if name in figures else {}

    return [
        Section(
            "Outcomes", summarise(analysis), _outcome_tables(analysis),
            one("ais", "Distribution of the AIS of the head, by scenario and by mechanism."),
        ),
        Section("Observed injuries, and the speed that halves the risk",
                _observed_said(analysis), _halved_tables(analysis)),
        Section(
            "Model-form uncertainty of the risk function",
            ("Which published function is right is unknown. Mean risk by each function alone, over "
             "the same runs:",),
            [_function_table(analysis)],
            {
                f"Published risk of {style.words(name.removeprefix('risk_'))} by AIS level at the "
                "study's median age, over the density of the runs.": figure
                for name, figure in figures.items() if name.startswith("risk_")
            },
        ),
        Section(
            f"The limit: {style.words(study.limit.output)} {study.limit.value:g}",
            _limit_said(analysis),
            [_limit_table(analysis)],
            one("exceedance", "Share of the runs above each value, with a 95 % band for the whole "
                "curve (as if the runs were independent).")
            | one("roc", "Sensitivity over false alarms for all limits."),
        ),
        Section("Rank correlations with the AIS", (
            "Rank correlations with the drawn AIS of the head, and the factor on the odds of a "
            "worse AIS for one standard deviation (proportional-odds regression, all predictors "
            "together). Intervals are 95 %.",),
            [_association_table(entry) for entry in scenarios.values()]),
        Section("Risk against impact speed", _speed_said(analysis), (), one(
            "speed", "Means over bins of the speed (isotonic regression), with 95 % bands. Grey: "
            "published curves, for adults and other injuries, to compare the shape.")),
        Section(
            "Method and sampling uncertainty",
            [*_honesty(study, functions), *failures_said(analysis)],
            [status_table(analysis)],
            one("failures", "Share of failed runs in each tenth of each input."),
        ),
    ]  # fmt: skip


def summarise(analysis: InjuryAnalysis) -> list[str]:
    """Return the outcome in sentences."""
    level = str(analysis.limit.level)
    scenarios = analysis.scenarios
    first = scenarios[REFERENCE].at_least[level]
    lines = [f"Of {FEW:,.0f} impacts {_count(first)} leave a head injury of AIS {level} or worse."]
    for entry in scenarios.values():
        if entry.difference is None:
            continue
        lines.append(
            f"{capital(entry.title)}: {_count(entry.at_least[level])}, "
            f"{_changed(entry.difference[level])}."
        )
    return lines


def _changed(change: Change) -> str:
    """Return the change in numbers of impacts."""
    if not change.value or change.low <= 0.0 <= change.high:
        return "no difference distinguishable from zero"
    verb = "fewer" if change.value < 0.0 else "more"
    known = math.isfinite(change.relative)
    percentage = f" ({100.0 * change.relative:+.0f} %)" if known else ""
    low, high = sorted((abs(change.low), abs(change.high)))
    return f"{_count(Estimate(abs(change.value), low, high))} {verb}{percentage}"


def _count(estimate: Estimate) -> str:
    """Return how many in a thousand, with the interval."""
    shown = []
    for side in (estimate.value, estimate.low, estimate.high):
        count = FEW * side
        shown.append(f"{count:,.0f}" if abs(count) >= 10.0 else f"{count:.1f}")
    value, low, high = (text.replace("-0.0", "0.0").replace("nan", "–") for text in shown)
    return f"{value} ({low} to {high})" if estimate.has_interval else value


def _whole(probability: float) -> str:
    """Return a probability in whole per cent, a dash where it is unknown."""
    return f"{100.0 * probability:.0f}" if math.isfinite(probability) else "–"


def _spread(estimate: Estimate) -> str:
    """Return a probability with half its interval."""
    value, low, high = (100.0 * v for v in (estimate.value, estimate.low, estimate.high))
    if not math.isfinite(value):
        return "–"
    if not estimate.has_interval:
        return f"{value:.1f} %"
    if low <= 0.0 or high >= 100.0:
        # An interval that ends at a border is no half on either side.
        return f"{value:.1f} ({low:.1f} to {high:.1f}) %"
    return f"{value:.1f} ± {0.5 * (high - low):.1f} %"


def _by_level(caption: str, columns: Mapping[str, Mapping[str, Estimate]]) -> Table:
    """Return a table of counts with a row an AIS level."""
    rows = [
        [f"AIS {level}+", *(_count(column[str(level)]) for column in columns.values())]
        for level in range(1, 7)
    ]
    return Table(caption, ["", *columns], rows)


def _outcome_tables(analysis: InjuryAnalysis) -> list[Table]:
    scenarios = analysis.scenarios
    tables = [
        _by_level(
            f"Head injuries in {FEW:,.0f} impacts (95 % interval).",
            {entry.title: entry.at_least for entry in scenarios.values()},
        )
    ]
    changed = {e.title: e.difference for e in scenarios.values() if e.difference is not None}
    if changed:
        tables.append(
            _by_level("Difference from the reference scenario, with the same draws.", changed)
        )
    if len(analysis.fronts) > 1:
        level = analysis.limit.level
        rows = [
            [entry.title, *(_count(e) for e in entry.by_front.values())]
            for entry in scenarios.values()
        ]
        names = [f"{name} ({100.0 * share:.0f} %)" for name, share in analysis.fronts.items()]
        caption = f"AIS {level}+ in {FEW:,.0f} impacts by car front (share of the impacts)."
        tables.append(Table(caption, ["scenario", *names], rows))
    return tables


def _observed_said(analysis: InjuryAnalysis) -> list[str]:
    observed = analysis.observed
    if not observed.injuries:
        return ["The study file names no injuries of a real case."]
    lines = []
    for entry in observed.injuries:
        low, high = entry.central_90
        by = ", ".join(
            f"{_whole(value)} % by {analysis.functions[name].title}"
            for name, value in entry.by_function.items()
        )
        label = capital(entry.label)
        lines.append(
            f"{label} (AIS {entry.level}): its probability was "
            f"{percent(entry.probability)}; in the central 90 % of the runs between "
            f"{_whole(low)} and {_whole(high)} %." + (f" By risk function: {by}." if by else "")
        )
    if (both := observed.all) is not None:
        lines.append(
            f"All of them together: {percent(both.independent)} if each run's risks are "
            f"independent, {percent(both.dependent)} if they are fully dependent."
        )
    return lines


def _halved_tables(analysis: InjuryAnalysis) -> list[Table]:
    speed = analysis.speed
    if not speed:
        return []
    rows = [
        [name, f"{_whole(entry.now)} %", interval(entry)] for name, entry in speed.halved.items()
    ]
    caption = (
        "The impact speed that halves the risk; the median of the case is "
        f"{number(speed.reference_speed)} km/h. '–': beyond the speeds of the study."
    )
    return [Table(caption, ["injury", "reference risk", "halved at [km/h] (95 %)"], rows)]


def _function_table(analysis: InjuryAnalysis) -> Table:
    rows = [
        [entry.title, entry.label,
         *(_spread(entry.at_least[str(k)]) if str(k) in entry.at_least else ""
           for k in range(1, 7))]
        for entry in analysis.functions.values()
    ]  # fmt: skip
    head = ["risk function", "read", *(f"AIS {k}+" for k in range(1, 7))]
    return Table("Mean risk in the reference scenario (95 % interval of the mean).", head, rows)


def _limit_said(analysis: InjuryAnalysis) -> list[str]:
    limit = analysis.limit
    lines = []
    for entry in analysis.scenarios.values():
        said = f"{capital(entry.title)}: " + (
            f"{percent(entry.above_limit)} of the runs exceed {limit.value:g}"
        )
        judged = next(iter(entry.limit.values()))
        if judged:
            said += (
                f"; as a test of AIS {limit.level}+ of the head the limit finds "
                f"{percent(judged.sensitivity)} of the injured; by these risk functions the "
                f"optimal limit (Youden) is {number(judged.best)}"
            )
        else:
            said += (
                f"; as a test of AIS {limit.level}+ of the head the limit cannot be rated, as "
                "the runs do not differ"
            )
        lines.append(said + ".")
    return lines


def _limit_table(analysis: InjuryAnalysis) -> Table:
    rows = [
        [words,
         *map(_spread, (judged.sensitivity, judged.specificity, judged.positive,
                        judged.negative)),
         interval(judged.area, 2), number(judged.best)]
        for words, judged in ratings_of(analysis).items()
    ]  # fmt: skip
    head = ["test of", "sensitivity", "specificity", "PPV (risk above)",
            "NPV (uninjured below)", "ROC area", "best limit"]  # fmt: skip
    return Table("The limit as a classifier (95 % intervals); outcomes are weighted by "
                 "their probability.", head, rows)  # fmt: skip


def _association_table(entry: ScenarioOutcome) -> Table:
    found = entry.association
    rows = [
        [style.words(name), interval(pair["spearman"], 2), interval(pair["kendall"], 2),
         interval(found.odds[name], 2) if found.odds else "–"]
        for name, pair in found.rank.items()
    ]  # fmt: skip
    caption = f"{entry.title}: {found.runs:,} runs."
    if len(found.levels) == 1:
        caption += f" All outcomes are AIS {found.levels[0]}, so there is no correlation."
    elif found.constant:
        caption += f" Constant: {', '.join(map(style.words, found.constant))}."
    if found.explained is not None:
        caption += f" The regression explains {100.0 * found.explained:.0f} % (McFadden)."
    return Table(caption, ["", "Spearman's rho", "Kendall's tau", "odds ratio per sd"], rows)


def _speed_said(analysis: InjuryAnalysis) -> list[str]:
    speed = analysis.speed
    if not speed:
        return ["No curve: the study does not vary the impact speed, or has too few runs for one."]
    return [
        f"From {speed.runs:,} runs of all scenarios that change the speed alone. The published "
        "curves are for pedestrians of 15 years and more and for death or any severe injury."
    ]


def _honesty(study: InjuryStudy, functions: Mapping[str, RiskFunction]) -> list[str]:
    together = (
        "The head takes the larger risk of its mechanisms (full dependence), which is a lower "
        "bound."
        if study.together == "dependent"
        else "The mechanisms are taken as independent, which is an upper bound."
    )
    lines = [
        "Every run's risk of AIS k or worse is the mean of the risk functions of a mechanism with "
        "the weights of the study file; a function without a level is left out for that level. "
        + together,
        "Adult functions are scaled to the child by age: HIC by the factors of the Q dummies, "
        "rotation by the mass of the brain to the power 2/3 (acceleration) or 1/3 (velocity). No "
        "contact of the head with the car counts as no risk.",
        "Intervals are 95 % t intervals between the independent parts of the design. They cover "
        "the sampling uncertainty only, not errors of the model or of the risk functions.",
    ]
    lines += [f"{f.title}: {f.source} [{f.label}]" for f in functions.values()]
    return lines
