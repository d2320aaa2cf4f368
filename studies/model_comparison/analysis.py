"""Every number of a model comparison."""

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.agreement import (
    Sources,
    compare,
    sources_of_disagreement,
    split_variance,
    without_rounding,
)
from mcstudy.errors import StudyError, UserError
from mcstudy.execution.results import status_counts
from mcstudy.sensitivity.given_data import MIN_RUNS, measure_given_data
from mcstudy.statistics import Estimate, scale_of, varies
from mcstudy.studyfile.study_outputs import check_outputs
from models.protocol import Model
from studies.model_cells import describe_models, known_values
from studies.model_comparison.numbers import (
    ApartRun,
    ComparedModel,
    ComparedOutput,
    ComparisonAnalysis,
    Disagreement,
    Pair,
    PublishedMethods,
    TooFewRuns,
)
from studies.model_comparison.schema import ModelComparison
from studies.paired_runs import batch_of

Array = NDArray[np.float64]

MIN_PAIRS = 20
"""Minimum runs with a value by both models for a comparison (assumed)."""
MAX_APART = 5
"""Number of listed runs with the largest differences."""


def analyse(
    study: ModelComparison,
    models: Mapping[str, Model],
    runs: Mapping[str, pd.DataFrame],
    nominal: Mapping[str, Mapping[str, Any]],
    outputs: list[str],
) -> ComparisonAnalysis:
    """Return every number that the report prints.

    Parameters
    ----------
    study : ModelComparison
        Checked study file.
    models : mapping
        Models by label.
    runs : mapping
        Table of runs by label; run k of each has the same inputs.
    nominal : mapping
        Outputs and poses of the nominal run by label.
    outputs : list of str
        Outputs that are compared.

    Raises
    ------
    StudyError
        If more runs of a model failed than the study allows, or no output can be compared.
    """
    ended = describe_models(study, models, runs)
    first = next(iter(models))
    inputs = runs[first][list(study.inputs)]
    ignored = {
        label: {i.name: i.ignored for i in model.inputs if i.ignored and i.name in study.inputs}
        for label, model in models.items()
    }
    compared: dict[str, ComparedOutput | TooFewRuns] = {}
    parts = batch_of(study, runs[first])
    unit_of = {item.name: item.unit for item in models[first].outputs}
    for name in outputs:
        values = pd.DataFrame(
            {label: known_values(part, models[label], name) for label, part in runs.items()}
        )
        held = values.notna().all(axis=1).to_numpy()
        compared[name] = few = TooFewRuns(unit_of[name], int(held.sum()))
        if held.sum() >= MIN_PAIRS:
            table = values.to_numpy(dtype=float)
            # Squares of scaled values neither overflow nor vanish.
            scale = scale_of(table)
            scatter = (table[held] / scale).var(axis=1, ddof=1).mean()
            compared[name] = ComparedOutput(
                **vars(few),
                variance=split_variance(table[held], parts[held]),
                method_sd=scale * float(np.sqrt(scatter)),
                spread={label: scale * float((values[label] / scale).std()) for label in models},
                pairs={
                    f"{one}/{two}": _pair(study, few.unit, table[:, [i, j]], inputs, parts)
                    for (i, one), (j, two) in combinations(enumerate(models), 2)
                },
            )
    named = [name for name in outputs if isinstance(compared[name], ComparedOutput)]
    if not named:
        raise StudyError(
            f"{', '.join(outputs)}: fewer than {MIN_PAIRS} runs have a value by every model"
        )
    return ComparisonAnalysis(
        **vars(ended),
        models={
            label: ComparedModel(
                model.name, model.version, ignored[label], status_counts(runs[label])
            )
            for label, model in models.items()
        },
        nominal={label: dict(entry["outputs"]) for label, entry in nominal.items()},
        published=published_methods(study, models[first]),
        outputs=compared,
        compared=named,
    )


def published_methods(study: ModelComparison, model: Model) -> dict[str, PublishedMethods]:
    """Return mean and standard deviation over the published simulations, by output in SI units.

    Raises
    ------
    UserError
        If an output or a unit of a table does not fit the model.
    """
    si = {item.name: item.unit for item in model.outputs}
    found = {}
    for k, table in enumerate(study.tables):
        check_outputs(list(table.units), model, f"tables[{k}].units")
        for name, given in table.units.items():
            try:
                factor = units.factor(given, si[name])
            except ValueError as error:
                raise UserError(f"tables[{k}].units.{name}: {error}") from None
            rows = [row.values[name] for row in table.rows
                    if row.kind == "simulated" and name in row.values]  # fmt: skip
            if len(rows) < 2:
                continue
            values = np.array(rows) * factor
            scale = scale_of(values)
            scaled = values / scale
            mean, sd = scale * float(scaled.mean()), scale * float(scaled.std(ddof=1))
            found[name] = PublishedMethods(si[name], len(rows), mean, sd)
    return found


def _pair(
    study: ModelComparison,
    unit: str,
    values: Array,
    inputs: pd.DataFrame,
    parts: NDArray[np.int64],
) -> Pair:
    """Return agreement, sources of disagreement and largest differences of two models.

    Parameters
    ----------
    study : ModelComparison
        Checked study file.
    unit : str
        Of the output.
    values : (n, 2) array
        Of the output by both models.
    inputs : (n, d) DataFrame
        Sampled inputs.
    parts : (n,) array of int
        Independent part of the design that each run belongs to.
    """
    held = np.isfinite(values).all(axis=1)
    one = values[held, 0]
    two = without_rounding(one, values[held, 1])
    table = inputs[held].to_numpy(dtype=float)
    gains, noise = sources_of_disagreement(one, two, table, study.seed)
    difference = two - one
    disagreement = None
    if held.sum() >= MIN_RUNS:
        given = measure_given_data(table, difference, study.seed)
        shares = given.values["first_order"]
        disagreement = Disagreement(
            {
                name: Estimate(*shares[:, k].tolist())
                for k, name in enumerate(map(str, inputs.columns))
            },
            given.noise["first_order"],
        )
    apart: list[ApartRun] = []
    if varies(difference):
        worst = np.argsort(-np.abs(difference - difference.mean()), kind="stable")[:MAX_APART]
        apart = [
            ApartRun(
                run=int(run),
                values=values[run].tolist(),
                inputs={str(k): float(v) for k, v in inputs.iloc[int(run)].items()},
            )
            for run in np.flatnonzero(held)[worst]
        ]
    return Pair(
        **vars(compare(one, two, parts[held])),
        unit=unit,
        breaking=Sources(dict(zip(map(str, inputs.columns), gains.tolist(), strict=True)), noise),
        most_apart=apart,
        disagreement=disagreement,
    )
