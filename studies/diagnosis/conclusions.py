"""Effect of a model extension on the conclusions of a study."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from mcstudy import statistics
from mcstudy.sampling import designs, seeds
from mcstudy.sensitivity.rank_based import rank_first_order
from mcstudy.studyfile.study_inputs import map_inputs
from models.protocol import complete_status
from studies.kinds import parse_study
from studies.monte_carlo.schema import MonteCarloStudy
from studies.runs import load_study_model
from studies.sobol.schema import SobolStudy

OUTPUT = "hic15"
LIMIT = 700.0
"""HIC15 limit of the case's paper for a child."""
RUNS, FEWER_RUNS = 1000, 200
"""Runs for comparing conclusions, of a cheap model and of an expensive one."""
CHEAP = 0.01
"""CPU time of a run in s below which a model counts as cheap (assumed)."""
REPLICATE = 50


@dataclass(frozen=True)
class Conclusions:
    """Conclusions of a study: probability above the limit, median, and sensitivities."""

    exceedance: statistics.Estimate
    median: statistics.Estimate
    drivers: dict[str, statistics.Estimate]
    values: list[float]


def conclude(text: str) -> Conclusions | None:
    """Return the conclusions of a study file; None if it has none, or too many runs fail."""
    study = parse_study(text, "extended model")
    if not isinstance(study, MonteCarloStudy | SobolStudy) or not study.inputs:
        return None
    model = load_study_model(study)
    n = RUNS if model.cost < CHEAP else FEWER_RUNS
    uniforms = designs.draw("latin-hypercube", n, REPLICATE, len(study.inputs), study.seed)
    columns = map_inputs(study, model, uniforms)
    rows = np.stack([columns[item.name] for item in model.inputs], axis=1)
    batch = model.run_batch(rows)
    column = [item.name for item in model.outputs].index(OUTPUT)
    values = batch.outputs[:, column]
    good = np.isfinite(values) & np.isin(batch.status, list(complete_status(model)))
    if good.sum() < n // 2:
        return None
    replicate = (np.arange(n) // REPLICATE)[good]
    held = values[good]
    names = list(study.inputs)
    table = np.stack([columns[name][good] for name in names], axis=1)
    indices = rank_first_order(table, held, seeds.generator(study.seed, seeds.GIVEN_DATA))
    return Conclusions(
        statistics.probability(held > LIMIT, replicate),
        statistics.quantile(held, 0.5, replicate),
        {name: statistics.Estimate(*map(float, indices[:, k])) for k, name in enumerate(names)},
        [float(v) for v in held],
    )


def as_dict(found: Conclusions) -> dict[str, Any]:
    """Return conclusions as plain data."""
    return {
        "output": OUTPUT,
        "limit": LIMIT,
        "exceedance": found.exceedance,
        "median": found.median,
        "drivers": dict(found.drivers),
        "values": found.values,
    }
