"""Every number of a multi-fidelity study."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.errors import StudyError
from mcstudy.injury.functions import risk_function
from mcstudy.multifidelity.allocation import ACV, MFMC
from mcstudy.multifidelity.estimators import (
    NestedRuns,
    estimate_average,
    estimate_exceedance,
    estimate_mean,
    estimate_quantile,
    estimate_sd,
)
from mcstudy.statistics import Estimate
from mcstudy.typed_json import Real
from models.protocol import Model
from studies.model_cells import describe_models, known_values
from studies.multi_fidelity.schema import FidelityStudy, Risk
from studies.runs import RunEnds

Array = NDArray[np.float64]

QUANTILES = (0.05, 0.5, 0.95)
LEVELS = 25
"""Levels of the drawn exceedance."""


@dataclass(frozen=True)
class Allotment:
    """Costs and runs of each model, by label.

    Attributes
    ----------
    method : of the estimates.
    order : models that are used, the reference first.
    left_out : models that do not pay.
    costs : s of one core for a run.
    runs : number of runs.
    pilot_correlation : with the reference, of the output that the budget serves.
    predicted_ratio : variance of its mean over that of the reference alone at the same cost.
    seconds : budget, s.
    replicates : independent parts of the design.
    """

    method: str
    order: Sequence[str]
    left_out: Sequence[str]
    costs: Mapping[str, Real]
    runs: Mapping[str, int]
    pilot_correlation: Mapping[str, Real]
    predicted_ratio: Real
    seconds: Real
    replicates: int


@dataclass(frozen=True)
class Statistic:
    """A statistic of the reference model's output.

    Attributes
    ----------
    label : in words.
    several : by all models.
    alone : by the reference's own runs.
    ratio : width of the first interval over that which the budget would have given the reference
        alone; NaN where either is open.
    """

    label: str
    several: Estimate
    alone: Estimate
    ratio: Real


@dataclass(frozen=True)
class Exceedance:
    """Probability of exceeding levels of an output: by all models, and by each model's own runs."""

    levels: Sequence[Real]
    several: Sequence[Estimate]
    own: Mapping[str, Sequence[Real]]


@dataclass(frozen=True)
class FidelityOutput:
    """An output: unit, correlation with the reference by model, statistics, exceedance curve."""

    unit: str
    correlation: Mapping[str, Real]
    statistics: Sequence[Statistic]
    exceedance: Exceedance


@dataclass(frozen=True)
class FidelityAnalysis(RunEnds):
    """Every number of a multi-fidelity study: allotment, and outputs by name."""

    allotment: Allotment
    outputs: Mapping[str, FidelityOutput]


def analyse(
    study: FidelityStudy,
    models: Mapping[str, Model],
    runs: Mapping[str, pd.DataFrame],
    allotment: Allotment,
    outputs: Sequence[str],
) -> FidelityAnalysis:
    """Return every number that the report prints.

    Parameters
    ----------
    study : FidelityStudy
        Checked study file.
    models, runs : mapping
        Models and tables of runs by label.
    allotment : Allotment
    outputs : sequence of str
        Outputs of the report.

    Raises
    ------
    StudyError
        If more runs of a model failed than the study allows, or an output has too few values.
    """
    ended = describe_models(study, models, runs)
    unit_of = {item.name: item.unit for item in models[allotment.order[0]].outputs}
    found = {}
    for name in outputs:
        values = tuple(known_values(runs[label], models[label], name) for label in allotment.order)
        if np.isfinite(values[0]).sum() < 2 * allotment.replicates:
            raise StudyError(f"{name}: too few runs of {allotment.order[0]} have a value")
        found[name] = _of_output(study, name, unit_of[name], values, allotment)
    return FidelityAnalysis(**vars(ended), allotment=allotment, outputs=found)


def _of_output(
    study: FidelityStudy, name: str, unit: str, values: tuple[Array, ...], allotment: Allotment
) -> FidelityOutput:
    method = allotment.method if allotment.method in (MFMC, ACV) else MFMC
    nested = NestedRuns(method, values, allotment.replicates)
    dear = allotment.order[0]
    # The reference alone would have had more runs than it has beside the others.
    fewer = math.sqrt(values[0].size * allotment.costs[dear] / allotment.seconds)
    rows = [
        _statistic("mean", nested, estimate_mean, fewer),
        _statistic("standard deviation", nested, estimate_sd, fewer),
    ]
    for probability in QUANTILES:
        label = f"{100.0 * probability:g} % quantile"
        rows.append(
            _statistic(label, nested, partial(estimate_quantile, probability=probability), fewer)
        )
    rows += [
        _statistic(
            f"probability above {limit:g}", nested,
            partial(estimate_exceedance, level=limit), fewer,
        )
        for limit in study.report.limits.get(name, ())
    ]  # fmt: skip
    for risk in study.report.risks:
        function = risk_function(risk.function)
        if function.stimulus == name:
            label = f"risk of AIS{risk.level}+, {function.title}, age {risk.age:g}"
            average = partial(estimate_average, transform=partial(_risk, risk))
            rows.append(_statistic(label, nested, average, fewer))
    return FidelityOutput(
        unit, _correlations(nested, allotment), rows, _exceedance(nested, allotment)
    )


def _risk(risk: Risk, stimulus: Array) -> Array:
    return risk_function(risk.function).risk(risk.level, stimulus, risk.age)


def _statistic(
    label: str, nested: NestedRuns, estimate: Callable[[NestedRuns], Estimate], fewer: float
) -> Statistic:
    several, alone = estimate(nested), estimate(nested.alone)
    width = fewer * (alone.high - alone.low)
    ratio = (several.high - several.low) / width if width > 0.0 else math.nan
    return Statistic(label, several, alone, ratio)


def _correlations(nested: NestedRuns, allotment: Allotment) -> dict[str, float]:
    """Return the correlation of each model's runs with those of the reference."""
    first = nested.values[0]
    found = {}
    for label, values in zip(allotment.order, nested.values, strict=True):
        both = np.isfinite(first) & np.isfinite(values[: first.size])
        pair = first[both], values[: first.size][both]
        varying = both.sum() > 2 and min(part.std() for part in pair) > 0.0
        found[label] = float(np.corrcoef(*pair)[0, 1]) if varying else math.nan
    return found


def _exceedance(nested: NestedRuns, allotment: Allotment) -> Exceedance:
    known = [values[np.isfinite(values)] for values in nested.values]
    levels = np.linspace(known[0].min(), known[0].max(), LEVELS)
    return Exceedance(
        levels.tolist(),
        [estimate_exceedance(nested, float(level)) for level in levels],
        {
            label: [float((values > level).mean()) for level in levels]
            for label, values in zip(allotment.order, known, strict=True)
        },
    )
