"""Every number of a Sobol' report, from the table of runs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.errors import StudyError
from mcstudy.sampling import seeds
from mcstudy.sampling.factors import DUMMY, factors_of
from mcstudy.sampling.saltelli import block_size, is_base_row
from mcstudy.sensitivity.blocks import MIN_BLOCKS, is_enough, outputs_alike, whole_blocks
from mcstudy.sensitivity.sobol import Indices, estimate_indices, split_blocks
from mcstudy.statistics import Estimate
from mcstudy.studyfile.study_outputs import report_outputs
from models.protocol import Model
from studies.main_effects import main_effects_of
from studies.runs import check_failure_rate
from studies.sobol.schema import SobolStudy

Array = NDArray[np.float64]

STEPS = 6
"""Steps of the convergence figure: the last six doublings of the design."""
STEP_RESAMPLES = 200


@dataclass(frozen=True)
class _Ranked:
    """Outputs with their indices, and the blocks of runs that give these.

    Attributes
    ----------
    begun : dict
        First entries of the analysis.
    complete : (n,) bool array
        Runs that did not fail.
    cube : (base points, block, outputs) array
        Outputs of the runs by base point.
    kept : (base points, outputs) bool array
        Whether a base point has a value in every row.
    scramble : (base points,) int array
        Scramble of each base point.
    factors : tuple of str
        Names of the factors.
    outputs : dict
        Indices by output.
    wanted : list of str
        Reported outputs that have an index.
    """

    begun: dict[str, Any]
    complete: NDArray[np.bool_]
    cube: Array
    kept: NDArray[np.bool_]
    scramble: NDArray[np.int64]
    factors: tuple[str, ...]
    outputs: dict[str, dict[str, Any]]
    wanted: list[str]

    @property
    def widest(self) -> float:
        """Widest interval of a total index of the reported outputs."""
        widths = [
            entry["high"] - entry["low"]
            for name in self.wanted
            if self.outputs[name]["variance"]
            for factor, entry in self.outputs[name]["total"].items()
            if factor != DUMMY
        ]
        # An interval that could not be estimated counts as infinitely wide.
        return float(np.max(np.nan_to_num(widths, nan=np.inf), initial=0.0))


def widest_interval(study: SobolStudy, model: Model, runs: pd.DataFrame) -> float:
    """Return the widest interval of a total index of the reported outputs.

    Parameters
    ----------
    study : SobolStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Runs of the whole base points.

    Raises
    ------
    StudyError
        As ``analyse``.
    """
    return _rank(study, model, runs).widest


def analyse(study: SobolStudy, model: Model, runs: pd.DataFrame) -> dict[str, Any]:
    """Return every number that the report prints.

    Parameters
    ----------
    study : SobolStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Runs of the whole base points.

    Raises
    ------
    StudyError
        If more runs failed than the study allows, or no reported output can be given an index.
    """
    ranked = _rank(study, model, runs)
    names = [item.name for item in model.outputs]
    drawn = runs[ranked.complete & is_base_row(runs["run"].to_numpy(), ranked.cube.shape[1])]
    convergence, main_effects = {}, {}
    for name in ranked.wanted:
        column = names.index(name)
        held = ranked.kept[:, column]
        convergence[name] = _convergence(
            study, ranked.cube[held][:, :, [column]], ranked.scramble[held], ranked.factors
        )
        main_effects[name] = main_effects_of(study, model, drawn, name)
    return ranked.begun | {
        "groups": {name: list(members) for name, members in study.groups.items()},
        "base_points": len(ranked.cube),
        "factors": list(ranked.factors),
        "outputs": ranked.outputs,
        "convergence": convergence,
        "main_effects": main_effects,
        "widest": ranked.widest,
        "tolerance": study.design.tolerance,
    }


def _rank(study: SobolStudy, model: Model, runs: pd.DataFrame) -> _Ranked:
    """Return the indices of all outputs that can be given any."""
    factors = factors_of(list(study.inputs), study.groups)
    block = block_size(factors, second_order=study.design.second_order)
    begun, complete = check_failure_rate(study, model, runs, block)
    names = [item.name for item in model.outputs]
    cube, kept = whole_blocks(runs[names].to_numpy(dtype=float), complete, block)
    scramble = runs["replicate"].to_numpy()[::block]
    outputs: dict[str, dict[str, Any]] = {}
    for pattern, same in outputs_alike(kept):
        entries: list[dict[str, Any]] = [{}] * same.size
        if is_enough(pattern):
            found = _indices(study, cube[pattern][:, :, same], scramble[pattern], len(factors))
            entries = [_entry(found, k, factors) for k in range(same.size)]
        for column, entry in zip(same.tolist(), entries, strict=True):
            item = model.outputs[column]
            outputs[item.name] = {"unit": item.unit, "base_points": int(pattern.sum())} | entry
    reported = report_outputs(study, model)
    wanted = [name for name in reported if "total" in outputs[name]]
    if not wanted:
        raise StudyError(
            f"{', '.join(reported)}: too few of the {len(cube)} base points have no failed run and "
            "a value in every row; no index is given"
        )
    return _Ranked(begun, complete, cube, kept, scramble, factors, outputs, wanted)


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
    """Return the indices of output ``k`` by factor."""
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
    return Estimate(*triple.tolist()).as_dict()


def _convergence(
    study: SobolStudy, cube: Array, scramble: NDArray[np.int64], factors: Sequence[str]
) -> list[dict[str, Any]]:
    """Return first and total indices on growing parts of the base points."""
    steps = []
    n = cube.shape[0]
    for size in sorted({n >> k for k in range(STEPS) if n >> k >= MIN_BLOCKS}):
        found = _indices(study, cube[:size], scramble[:size], len(factors), STEP_RESAMPLES)
        entry = _entry(found, 0, factors)
        steps.append({"n": size, "first": entry["first"], "total": entry["total"]})
    return steps
