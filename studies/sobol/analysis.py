"""Every number of a Sobol' report, from the table of runs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy import config, seeds
from mcstudy.config import SobolStudy
from mcstudy.errors import StudyError
from mcstudy.sensitivity.blocks import FEWEST_BLOCKS, is_enough, outputs_alike, whole_blocks
from mcstudy.sensitivity.factors import DUMMY, factors_of
from mcstudy.sensitivity.saltelli import block_size
from mcstudy.sensitivity.sobol import Indices, estimate_indices, split_blocks
from models.protocol import Model
from studies.execution import judge_runs
from studies.main_effects import main_effects_of

Array = NDArray[np.float64]

STEPS = 6
"""Steps of the convergence figure: the last six doublings of the design."""
STEP_RESAMPLES = 200


def analyse(study: SobolStudy, model: Model, runs: pd.DataFrame) -> dict[str, Any]:
    """Return every number that the report prints.

    Raises
    ------
    StudyError
        If more runs failed than the study allows, or no reported output can be given an index.
    """
    factors = factors_of(list(study.inputs), study.groups)
    block = block_size(factors, second_order=study.design.second_order)
    analysis, complete = judge_runs(study, model, runs, block)
    wanted = config.report_outputs(study, model)
    names = [item.name for item in model.outputs]
    cube, kept = whole_blocks(runs[names].to_numpy(dtype=float), complete, block)
    scramble = runs["replicate"].to_numpy()[::block]
    analysis |= {
        "base_points": len(cube),
        "factors": list(factors),
        "outputs": {},
        "convergence": {},
        "main_effects": {},
    }
    for pattern, same in outputs_alike(kept):
        entries: list[dict[str, Any]] = [{}] * same.size
        if is_enough(pattern):
            found = _indices(study, cube[pattern][:, :, same], scramble[pattern], len(factors))
            entries = [_entry(found, k, factors) for k in range(same.size)]
        for column, entry in zip(same.tolist(), entries, strict=True):
            item = model.outputs[column]
            counts = {"unit": item.unit, "base_points": int(pattern.sum())}
            analysis["outputs"][item.name] = counts | entry
    ranked = [name for name in wanted if "total" in analysis["outputs"][name]]
    if not ranked:
        raise StudyError(
            f"{', '.join(wanted)}: too few of the {len(cube)} base points have no failed run and a "
            "value in every row; no index is given"
        )
    # Of a block only A and B are drawn independently.
    drawn = runs[complete & np.isin(runs["run"] % block, (0, block - 1))]
    for name in ranked:
        column = names.index(name)
        held = kept[:, column]
        analysis["convergence"][name] = _convergence(
            study, cube[held][:, :, column : column + 1], scramble[held], factors
        )
        analysis["main_effects"][name] = main_effects_of(study, model, drawn, name)
    widths = [
        entry["high"] - entry["low"]
        for name in ranked
        if analysis["outputs"][name]["variance"]
        for factor, entry in analysis["outputs"][name]["total"].items()
        if factor != DUMMY
    ]
    # An interval that could not be estimated is not a narrow one.
    widest = float(np.max(np.nan_to_num(widths, nan=np.inf), initial=0.0))
    return analysis | {"widest": widest, "tolerance": study.design.tolerance}


def _indices(
    study: SobolStudy, cube: Array, scramble: NDArray[np.int64], d: int, resamples: int = 0
) -> Indices:
    """Return the indices of the outputs of whole base points (n, block, m)."""
    return estimate_indices(
        split_blocks(cube.reshape(-1, cube.shape[2]), d, second_order=study.design.second_order),
        scramble,
        resamples=resamples or study.report.resamples,
        rng=seeds.generator(study.seed, seeds.BOOTSTRAP),
    )


def _entry(found: Indices, k: int, factors: Sequence[str]) -> dict[str, Any]:
    """Return what is found for output ``k``, by factor."""
    entry: dict[str, Any] = {
        "variance": float(found.variance[k]),
        "noise_sd": float(np.sqrt(found.total[0, -1, k] * found.variance[k])),
    }
    entry["alone"] = _estimate(found.first_sum[:, k])
    for kind, table in (("first", found.first), ("total", found.total)):
        entry[kind] = {name: _estimate(table[:, j, k]) for j, name in enumerate(factors)}
    if found.second is not None:
        entry["second"] = {
            f"{a} x {b}": _estimate(found.second[:, i, j, k])
            for i, a in enumerate(factors)
            for j, b in enumerate(factors)
            if i < j
        }
    return entry


def _estimate(triple: Array) -> dict[str, float]:
    return dict(zip(("value", "low", "high"), triple.tolist(), strict=True))


def _convergence(
    study: SobolStudy, cube: Array, scramble: NDArray[np.int64], factors: Sequence[str]
) -> list[dict[str, Any]]:
    """Return first and total indices on growing parts of the base points."""
    steps = []
    n = cube.shape[0]
    for size in sorted({n >> k for k in range(STEPS) if n >> k >= FEWEST_BLOCKS}):
        found = _indices(study, cube[:size], scramble[:size], len(factors), STEP_RESAMPLES)
        entry = _entry(found, 0, factors)
        steps.append({"n": size, "first": entry["first"], "total": entry["total"]})
    return steps
