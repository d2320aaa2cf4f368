"""Figures of an injury study."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from mcstudy.figures import risk, style
from mcstudy.injury.functions import RiskFunction, speed_curves
from studies.failure_report import failure_map
from studies.injury.analysis import ages_of, proportional
from studies.injury.numbers import InjuryAnalysis, Rating, SpeedRisk
from studies.injury.schema import REFERENCE, InjuryStudy


def draw(
    study: InjuryStudy,
    cases: pd.DataFrame,
    analysis: InjuryAnalysis,
    functions: Mapping[str, RiskFunction],
) -> dict[str, Any]:
    """Return the study's figures by file name.

    Parameters
    ----------
    study : InjuryStudy
        Checked study file.
    cases : DataFrame
        Runs with risks and AIS.
    analysis : InjuryAnalysis
        Every number of the report.
    functions : mapping
        Risk functions by name.
    """
    scenarios = analysis.scenarios
    reference = cases[cases["scenario"] == REFERENCE]
    bars = {entry.title: entry.ais for entry in scenarios.values()}
    bars |= {
        f"{style.words(words)}, alone": shares
        for words, shares in scenarios[REFERENCE].mechanisms.items()
        if len(study.mechanisms) > 1
    }
    figures: dict[str, Any] = failure_map(analysis) | {"ais": risk.draw_ais(bars)}
    age = np.array([float(np.median(ages_of(study, reference)))])
    for stimulus in dict.fromkeys(function.stimulus for function in functions.values()):
        held = reference[stimulus].dropna().to_numpy(dtype=float)
        if held.size < 2:
            continue
        limit = study.limit.value if stimulus == study.limit.output else None
        end = max(1.15 * float(np.quantile(held, 0.995)), 0.0)
        if limit is not None and style.is_near(held, limit):
            end = max(end, 1.15 * limit)
        x = np.linspace(0.0, end or 1.0, 300)[1:]
        mine = {key: f for key, f in functions.items() if f.stimulus == stimulus}
        curves = {
            f.title: {level: f.risk(level, x, age) for level in f.levels} for f in mine.values()
        }
        unit = next(iter(mine.values())).unit
        figures[f"risk_{stimulus}"] = risk.draw_levels(
            curves, x, held, style.label(stimulus, unit), limit
        )
    figures["exceedance"] = risk.draw_exceedance(
        {
            entry.title: proportional(cases[cases["scenario"] == name], analysis.fronts)[
                study.limit.output
            ].to_numpy(float)
            for name, entry in scenarios.items()
        },
        style.label(study.limit.output, analysis.limit.unit),
        study.limit.value,
    )
    rocs = ratings_of(analysis)
    if rocs:
        figures["roc"] = risk.draw_roc(
            {
                title: (np.array(e.roc.false_alarm), np.array(e.roc.sensitivity))
                for title, e in rocs.items()
            },
            {title: (1.0 - e.specificity.value, e.sensitivity.value) for title, e in rocs.items()},
            f"limit {study.limit.value:g}",
        )
    if analysis.speed:
        figures["speed"] = _draw_speed(analysis.speed)
    return figures


def _draw_speed(speed: SpeedRisk) -> Any:
    x = np.array(speed.speed, dtype=float)
    bands = {
        name: {"speed": x}
        | {key: np.array(values, dtype=float) for key, values in vars(curve).items()}
        for name, curve in speed.curves.items()
    }
    grid = np.linspace(max(5.0, float(x[0])), float(x[-1]), 100)
    published = {c.title: (grid, c.risk(grid)) for c in speed_curves()}
    return risk.draw_speed_risk(bands, published, "risk against impact speed")


def ratings_of(analysis: InjuryAnalysis) -> dict[str, Rating]:
    """Return the limit's ratings by scenario and injury."""
    level = analysis.limit.level
    return {
        f"AIS {level}+ {style.words(words)}, {entry.title}": judged
        for entry in analysis.scenarios.values()
        for words, judged in entry.limit.items()
        if judged
    }
