"""Every number of an injury report, from the tables of runs."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.errors import StudyError
from mcstudy.injury.ais import LEVELS, Mechanism, combine, distribution, draw_ais, exceedance, mix
from mcstudy.injury.association import fit_proportional_odds, rank_correlations
from mcstudy.injury.classifier import judge_limit, receiver_operating_characteristic
from mcstudy.injury.functions import RiskFunction
from mcstudy.sampling import seeds
from mcstudy.statistics import Estimate, between_replicates, varies
from models.protocol import Model
from studies.injury.cells import fronts_of
from studies.injury.numbers import (
    Association,
    Change,
    FunctionRisk,
    InjuryAnalysis,
    LimitOf,
    ObservedCase,
    ObservedInjury,
    Rating,
    RocCurve,
    ScenarioOutcome,
    Together,
)
from studies.injury.schema import AS_IT_STANDS, HEAD, REFERENCE, InjuryStudy
from studies.injury.speed import describe_speed
from studies.paired_runs import BATCHES, batch_of
from studies.runs import RunEnds

Array = NDArray[np.float64]

CASES = "cases.parquet"
"""Table of the cases of an injury study, in its folder."""
PREDICTORS = ("hic15", "impact_speed", "throw_distance", "wad")
"""Predictors of the AIS, where a model has them."""


def risk_column(mechanism: str, level: int) -> str:
    """Return the column of a case's risk of AIS ``level`` or worse by a mechanism."""
    return f"risk_{mechanism}_ais{level}"


def outcomes_of(
    study: InjuryStudy, runs: pd.DataFrame, functions: Mapping[str, RiskFunction]
) -> pd.DataFrame:
    """Return the runs with their risks by mechanism and level and a drawn AIS of the head.

    The draw of a run depends on the study's seed and its run id, so that scenarios share it.

    Parameters
    ----------
    study : InjuryStudy
        Checked study file.
    runs : DataFrame
        Complete runs of all cells.
    functions : mapping
        Risk functions by name.
    """
    age = ages_of(study, runs)
    outputs = {name: runs[name].to_numpy(dtype=float) for name in
               {function.stimulus for function in functions.values()}}  # fmt: skip
    columns: dict[str, Array] = {}
    by_mechanism = {}
    for name, entry in study.mechanisms.items():
        pairs = [(functions[key], weight) for key, weight in entry.functions.items()]
        by_mechanism[name] = mix(Mechanism(name, pairs), outputs, age)
    by_mechanism[HEAD] = combine(list(by_mechanism.values()), study.together)
    for name, risks in by_mechanism.items():
        columns |= {risk_column(name, level): risks[:, level - 1] for level in LEVELS}
    uniforms = seeds.generator(study.seed, seeds.OUTCOME).random(study.design.n)
    ais = draw_ais(by_mechanism[HEAD], uniforms[runs["run"].to_numpy()])
    return pd.concat([runs.reset_index(drop=True), pd.DataFrame(columns | {"ais": ais})], axis=1)


def ages_of(study: InjuryStudy, runs: pd.DataFrame) -> Array:
    """Return the age of each run in years."""
    if study.age is not None:
        return np.full(len(runs), study.age)
    return runs["age"].to_numpy(dtype=float)


def analyse(
    study: InjuryStudy,
    model: Model,
    ended: RunEnds,
    cases: pd.DataFrame,
    functions: Mapping[str, RiskFunction],
) -> InjuryAnalysis:
    """Return every number that the report prints.

    Parameters
    ----------
    study : InjuryStudy
        Checked study file.
    model : Model
        Model of the runs.
    ended : RunEnds
        How the runs ended.
    cases : DataFrame
        From ``outcomes_of``.
    functions : mapping
        Risk functions by name.

    Raises
    ------
    StudyError
        If no run of a scenario with a front is left.
    """
    titles = {REFERENCE: AS_IT_STANDS} | {k: s.title for k, s in study.scenarios.items()}
    shares = {name: front.share for name, front in fronts_of(study).items()}
    total = sum(shares.values())
    shares = {name: share / total for name, share in shares.items()}
    parts = {name: cases[cases["scenario"] == name] for name in titles}
    for name, part in parts.items():
        if missing := [front for front in shares if not (part["front"] == front).any()]:
            raise StudyError(f"scenario {name}, front {missing[0]}: all runs failed")
    reference = parts[REFERENCE]
    return InjuryAnalysis(
        **vars(ended),
        fronts=shares,
        limit=LimitOf(**study.limit.model_dump(), unit=_unit_of(model, study.limit.output)),
        scenarios={
            name: ScenarioOutcome(
                title=titles[name],
                runs=len(part),
                **_outcome(study, part, shares),
                association=_associations(study, model, proportional(part, shares)),
                limit={
                    mechanism: _limit(study, part, mechanism, shares)
                    for mechanism in _judged_by(study, functions)
                },
                difference=None
                if name == REFERENCE
                else _differences(study, reference, part, shares),
            )
            for name, part in parts.items()
        },
        functions=_by_function(study, reference, functions, shares),
        observed=_observed(study, reference, functions, shares),
        speed=describe_speed(study, cases, shares),
    )


def _unit_of(model: Model, output: str) -> str:
    return next(item.unit for item in model.outputs if item.name == output)


def population(
    study: InjuryStudy, part: pd.DataFrame, values: Array, shares: Mapping[str, float]
) -> Estimate:
    """Return the mean of a probability over the car fronts by their shares, with its interval.

    Parameters
    ----------
    study : InjuryStudy
        Checked study file.
    part : DataFrame
        Runs of one scenario.
    values : (n,) array
        Probability of each run.
    shares : mapping
        Share of each car front, adding up to one.
    """
    by_batch = np.asarray(_by_batch(study, part, values, shares), dtype=float)
    return _within_bounds(between_replicates(by_batch, _mean(part, values, shares)))


def _within_bounds(estimate: Estimate) -> Estimate:
    """Return the estimate of a probability with its interval cut to 0 and 1."""
    low, high = (float(np.clip(side, 0.0, 1.0)) for side in (estimate.low, estimate.high))
    return Estimate(estimate.value, low, high)


def weights_of(part: pd.DataFrame, shares: Mapping[str, float]) -> Array:
    """Return the weight of each run: the share of its front over the front's runs."""
    counts = part["front"].value_counts()
    each = {name: share / counts[name] for name, share in shares.items() if name in counts}
    return np.asarray(part["front"].map(each), dtype=float)


def proportional(part: pd.DataFrame, shares: Mapping[str, float]) -> pd.DataFrame:
    """Return runs of every front in proportion to its share, the first of each."""
    largest = max(shares.values())
    kept = [
        held.iloc[: round(len(held) * shares[str(name)] / largest)]
        for name, held in part.groupby("front", sort=False)
    ]
    return pd.concat(kept)


def _mean(part: pd.DataFrame, values: Array, shares: Mapping[str, float]) -> float:
    front = part["front"].to_numpy()
    return float(sum(share * values[front == name].mean() for name, share in shares.items()))


def _by_batch(
    study: InjuryStudy, part: pd.DataFrame, values: Array, shares: Mapping[str, float]
) -> "pd.Series[float]":
    """Return the estimate of each independent part of the design that has runs of every front."""
    table = pd.DataFrame(
        {"batch": batch_of(study, part), "front": part["front"].to_numpy(), "value": values}
    )
    means = table.groupby(["batch", "front"])["value"].mean().unstack("front")
    weights = pd.Series(shares)
    return (means[list(weights.index)] * weights).sum(axis=1, skipna=False).dropna()


def _head(part: pd.DataFrame, level: int) -> Array:
    return part[risk_column(HEAD, level)].to_numpy(dtype=float)


def _outcome(study: InjuryStudy, part: pd.DataFrame, shares: Mapping[str, float]) -> dict[str, Any]:
    limit = study.limit
    above = (part[limit.output].to_numpy(dtype=float) > limit.value).astype(float)
    exceeding = np.array([_mean(part, _head(part, level), shares) for level in LEVELS])
    mechanisms = {
        name: [_mean(part, part[risk_column(name, level)].to_numpy(), shares) for level in LEVELS]
        for name in study.mechanisms
    }
    return {
        "at_least": {
            str(level): population(study, part, _head(part, level), shares)
            for level in LEVELS
        },
        "ais": distribution(exceeding).tolist(),
        "mechanisms": {k: distribution(np.array(v)).tolist() for k, v in mechanisms.items()},
        "above_limit": population(study, part, above, shares),
        "by_front": {
            name: population(
                study, part[part["front"] == name],
                _head(part[part["front"] == name], limit.level), {name: 1.0},
            )
            for name in shares
        },
    }  # fmt: skip


def _differences(
    study: InjuryStudy, reference: pd.DataFrame, part: pd.DataFrame, shares: Mapping[str, float]
) -> dict[str, Change]:
    """Return the change by a scenario per level; common random numbers reduce its variance."""
    found = {}
    for level in LEVELS:
        batches = [_by_batch(study, p, _head(p, level), shares) for p in (part, reference)]
        centre = [_mean(p, _head(p, level), shares) for p in (part, reference)]
        apart = np.asarray((batches[0] - batches[1]).dropna(), dtype=float)
        change = between_replicates(apart, centre[0] - centre[1])
        relative = centre[0] / centre[1] - 1.0 if centre[1] else np.nan
        found[str(level)] = Change(**vars(change), relative=relative)
    return found


def _associations(study: InjuryStudy, model: Model, part: pd.DataFrame) -> Association:
    """Return rank correlations with the drawn AIS, and its proportional-odds regression."""
    known = {item.name for item in model.inputs} | {item.name for item in model.outputs}
    names = [name for name in PREDICTORS if name in known]
    held = part[part[names].notna().all(axis=1)]
    constant = [name for name in names if not varies(held[name].to_numpy(dtype=float))]
    names = [name for name in names if name not in constant]
    levels = held["ais"].to_numpy()
    drawn = sorted(set(levels.tolist()))
    if len(held) < BATCHES or len(drawn) < 2:
        return Association(len(held), {}, None, constant, drawn)
    rng = seeds.generator(study.seed, seeds.BOOTSTRAP)
    rank = {
        name: rank_correlations(held[name].to_numpy(dtype=float), levels, rng) for name in names
    }
    try:
        fit = fit_proportional_odds({n: held[n].to_numpy(dtype=float) for n in names}, levels)
    except ValueError as error:
        return Association(len(held), rank, None, constant, drawn, no_odds=str(error))
    odds = {name: fit.odds_ratio(name) for name in names}
    explained = 1.0 - fit.log_likelihood / fit.null_log_likelihood
    return Association(len(held), rank, odds, constant, drawn, explained=explained)


def _judged_by(study: InjuryStudy, functions: Mapping[str, RiskFunction]) -> list[str]:
    """Return what the limit is judged by: the head, and each mechanism of the limit's output."""
    own = [
        name
        for name, entry in study.mechanisms.items()
        if {functions[key].stimulus for key in entry.functions} == {study.limit.output}
    ]
    return [HEAD, *own] if len(study.mechanisms) > 1 else [HEAD]


def _limit(
    study: InjuryStudy, part: pd.DataFrame, mechanism: str, shares: Mapping[str, float]
) -> Rating | None:
    """Return the limit as a classifier, with intervals between the parts of the design.

    It is None where all runs have the same output, or are injured with certainty or never.
    """
    limit = study.limit
    stimulus = part[limit.output].to_numpy(dtype=float)
    risk = part[risk_column(mechanism, limit.level)].to_numpy(dtype=float)
    alike = np.isfinite(stimulus).all() and not varies(stimulus)
    if alike or not 0.0 < risk.mean() < 1.0:
        return None
    weight = weights_of(part, shares)
    judged = judge_limit(stimulus, risk, limit.value, weight)
    roc = receiver_operating_characteristic(stimulus, risk, weight)
    batch = batch_of(study, part)
    rows = []
    for b in np.unique(batch):
        own = stimulus[batch == b], risk[batch == b]
        mine = judge_limit(*own, limit.value, weight[batch == b])
        # Without injured or without uninjured there is no curve.
        curved = 0.0 < own[1].mean() < 1.0
        area = (
            receiver_operating_characteristic(*own, weight[batch == b]).area if curved else np.nan
        )
        rows.append((mine.sensitivity, mine.specificity, mine.positive, mine.negative, area))
    centre = (judged.sensitivity, judged.specificity, judged.positive, judged.negative, roc.area)
    names = ("sensitivity", "specificity", "positive", "negative", "area")
    estimates = (
        _within_bounds(between_replicates(column[np.isfinite(column)], value))
        for column, value in zip(np.array(rows).T, centre, strict=True)
    )
    shown = np.linspace(0, roc.false_alarm.size - 1, min(200, roc.false_alarm.size)).astype(int)
    curve = RocCurve(roc.false_alarm[shown].tolist(), roc.sensitivity[shown].tolist())
    return Rating(**dict(zip(names, estimates, strict=True)), best=roc.best, roc=curve)


def _by_function(
    study: InjuryStudy,
    reference: pd.DataFrame,
    functions: Mapping[str, RiskFunction],
    shares: Mapping[str, float],
) -> dict[str, FunctionRisk]:
    """Return the mean risk by each risk function alone: the model-form uncertainty."""
    age = ages_of(study, reference)
    found = {}
    for name, function in functions.items():
        risks = exceedance(function, reference[function.stimulus].to_numpy(dtype=float), age)
        found[name] = FunctionRisk(
            title=function.title,
            label=function.label,
            source=function.source,
            at_least={
                str(level): population(study, reference, risks[:, level - 1], shares)
                for level in function.levels
            },
        )
    return found


def _observed(
    study: InjuryStudy,
    reference: pd.DataFrame,
    functions: Mapping[str, RiskFunction],
    shares: Mapping[str, float],
) -> ObservedCase:
    """Return the probabilities of the injuries of the real case."""
    entries, risks = [], []
    age = ages_of(study, reference)
    for item in study.observed:
        risk = reference[risk_column(item.mechanism, item.level)].to_numpy(dtype=float)
        risks.append(risk)
        by_function = {}
        for name in study.mechanisms[item.mechanism].functions:
            if item.level in functions[name].levels:
                stimulus = reference[functions[name].stimulus].to_numpy(dtype=float)
                own = exceedance(functions[name], stimulus, age)[:, item.level - 1]
                by_function[name] = _mean(reference, own, shares)
        low, high = np.quantile(
            risk, [0.05, 0.95], weights=weights_of(reference, shares), method="inverted_cdf"
        )
        entries.append(
            ObservedInjury(
                label=item.label,
                mechanism=item.mechanism,
                level=item.level,
                probability=population(study, reference, risk, shares),
                central_90=(float(low), float(high)),
                by_function=by_function,
            )
        )
    if len(risks) < 2:
        return ObservedCase(entries)
    stacked = np.stack(risks)
    dependent, independent = (
        population(study, reference, values, shares)
        for values in (stacked.min(axis=0), stacked.prod(axis=0))
    )
    return ObservedCase(entries, Together(dependent, independent))
