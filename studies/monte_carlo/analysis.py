"""Every number of a Monte Carlo report, from the table of runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from mcstudy import statistics, units
from mcstudy.errors import UserError
from mcstudy.figures import distributions
from mcstudy.studyfile.study_outputs import check_outputs, report_outputs
from mcstudy.typed_json import Real
from models.protocol import Model
from studies.monte_carlo.schema import MonteCarloStudy
from studies.runs import RunEnds, describe_runs


@dataclass(frozen=True)
class Exceedance:
    """Probability of an output above a known value.

    Attributes
    ----------
    value : in the output's unit.
    label : of the value.
    probability_above : of a run.
    """

    value: float
    label: str
    probability_above: statistics.Estimate


@dataclass(frozen=True)
class Observed(Exceedance):
    """Place of an observed value in the distribution of an output.

    Attributes
    ----------
    inside_central_90 : whether it lies between the 5 % and the 95 % quantile.
    percentile : share of the runs up to it.
    """

    inside_central_90: bool
    percentile: float


@dataclass(frozen=True)
class MonteCarloAnalysis(RunEnds):
    """Every number of a Monte Carlo report.

    Attributes
    ----------
    outputs : distribution by output.
    exceedance, observed : limits and observed values by reported output.
    convergence : median of the first runs, by reported output.
    rank_correlation : Spearman's coefficient by reported output and sampled input.
    rank_correlation_noise : size that unrelated ranks exceed in 5 of 100 cases.
    """

    outputs: Mapping[str, statistics.Described]
    exceedance: Mapping[str, Sequence[Exceedance]]
    observed: Mapping[str, Sequence[Observed]]
    convergence: Mapping[str, Sequence[statistics.Step]]
    rank_correlation: Mapping[str, Mapping[str, Real]]
    rank_correlation_noise: float


def marks_of(study: MonteCarloStudy, model: Model) -> dict[str, list[distributions.Mark]]:
    """Return the study's references by output, in the model's units.

    Raises
    ------
    UserError
        If an output or a unit does not fit the model.
    """
    known = {item.name: item for item in model.outputs}
    marks: dict[str, list[distributions.Mark]] = {}
    for k, entry in enumerate(study.report.references):
        place = f"report.references[{k}]"
        check_outputs([entry.output], model, place)
        try:
            value = entry.value * units.factor(entry.unit, known[entry.output].unit)
        except ValueError as error:
            raise UserError(f"{place}: {error}") from None
        marks.setdefault(entry.output, []).append(
            distributions.Mark(value, entry.label, entry.kind)
        )
    return marks


def analyse(study: MonteCarloStudy, model: Model, runs: pd.DataFrame) -> MonteCarloAnalysis:
    """Return every number that the report prints.

    Parameters
    ----------
    study : MonteCarloStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Table of the runs.
    """
    ended, held = describe_runs(study, model, runs)
    complete = runs[held]
    groups = None if study.design.method == "monte-carlo" else complete["replicate"].to_numpy()
    marks = marks_of(study, model)
    sampled = list(study.inputs)
    wanted = report_outputs(study, model)
    outputs = {
        item.name: statistics.describe(complete[item.name].to_numpy(dtype=float), item.unit, groups)
        for item in model.outputs
    }
    exceedance: dict[str, list[Exceedance]] = {}
    observed: dict[str, list[Observed]] = {}
    convergence = {}
    for name in wanted:
        values = complete[name].to_numpy(dtype=float)
        finite = np.isfinite(values)
        part, parts = values[finite], None if groups is None else groups[finite]
        if part.size < 2:
            continue
        convergence[name] = statistics.convergence(values, lambda v: float(np.median(v)))
        for mark in marks.get(name, ()):
            above = statistics.probability(part > mark.value, parts)
            if mark.kind == "observed":
                low, high = np.quantile(part, [0.05, 0.95])
                observed.setdefault(name, []).append(
                    Observed(
                        mark.value, mark.label, above,
                        inside_central_90=bool(low <= mark.value <= high),
                        percentile=float(np.mean(part <= mark.value)),
                    )
                )  # fmt: skip
            else:
                exceedance.setdefault(name, []).append(Exceedance(mark.value, mark.label, above))
    columns = complete[[*sampled, *wanted]].astype(float)
    # Ranks of a column that differs by rounding alone are meaningless.
    varying = columns.apply(lambda column: statistics.varies(column.to_numpy()))
    ranks = columns.where(varying, axis="columns").corr("spearman")
    table = ranks.loc[sampled, wanted]
    return MonteCarloAnalysis(
        **vars(ended),
        outputs=outputs,
        exceedance=exceedance,
        observed=observed,
        convergence=convergence,
        rank_correlation={
            name: {str(k): float(v) for k, v in table[name].items()} for name in wanted
        },
        # |rho| of unrelated ranks stays below this in 95 of 100 cases.
        rank_correlation_noise=float(1.96 / np.sqrt(max(len(complete) - 1, 1))),
    )
