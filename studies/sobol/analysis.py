"""Every number of a Sobol' report, from the table of runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field

from mcstudy.errors import StudyError
from mcstudy.sampling import seeds
from mcstudy.sampling.factors import DUMMY, factors_of
from mcstudy.sampling.saltelli import block_size, is_base_row
from mcstudy.sensitivity.blocks import MIN_BLOCKS, is_enough, outputs_alike, whole_blocks
from mcstudy.sensitivity.main_effects import MainEffect
from mcstudy.sensitivity.sobol import Indices, estimate_indices, split_blocks
from mcstudy.statistics import Estimate
from mcstudy.studyfile.study_outputs import report_outputs
from mcstudy.typed_json import Real
from models.protocol import Model
from studies.factor_kind import FactorAnalysis
from studies.main_effects import main_effects_of
from studies.runs import RunEnds, check_failure_rate
from studies.sobol.schema import SobolStudy

Array = NDArray[np.float64]

STEPS = 6
"""Steps of the convergence figure: the last six doublings of the design."""
STEP_RESAMPLES = 200


@dataclass(frozen=True)
class TooFewPoints:
    """An output with too few base points for indices.

    Attributes
    ----------
    unit : unit of the output.
    base_points : base points with a value in every row.
    """

    unit: str
    base_points: int


@dataclass(frozen=True)
class IndexStep:
    """First-order and total indices by factor from the first n base points."""

    n: int
    first: Mapping[str, Estimate]
    total: Mapping[str, Estimate]


@dataclass(frozen=True)
class IndexedOutput(TooFewPoints):
    """Indices of an output.

    Attributes
    ----------
    variance : of the output; NaN where it is too large for a number.
    noise_sd : standard deviation of the model's noise.
    alone : sum of the first-order indices.
    first, total : first-order and total index by factor.
    second : second-order index by pair of factors ``a x b``, where they are estimated.
    """

    variance: Real
    noise_sd: Real
    alone: Estimate
    first: Mapping[str, Estimate]
    total: Mapping[str, Estimate]
    second: Mapping[str, Estimate] | None = None

    @property
    def varies(self) -> bool:
        """Whether the output varies."""
        return self.variance != 0.0


@dataclass(frozen=True)
class SobolAnalysis(FactorAnalysis):
    """Every number of a Sobol' report.

    Attributes
    ----------
    base_points : number of base points that are done.
    factors : names of the factors.
    outputs : indices by output.
    convergence : indices of the first base points, by reported output.
    main_effects : by reported output and input.
    widest : widest interval of a total index of the reported outputs; NaN if one is unknown.
    tolerance : widest interval that the study asks for.
    """

    base_points: int
    factors: Sequence[str]
    outputs: Mapping[
        str, Annotated[IndexedOutput | TooFewPoints, Field(union_mode="left_to_right")]
    ]
    convergence: Mapping[str, Sequence[IndexStep]]
    main_effects: Mapping[str, Mapping[str, MainEffect]]
    widest: Real
    tolerance: float | None

    @property
    def indexed(self) -> dict[str, IndexedOutput]:
        """Outputs that have indices."""
        return {k: v for k, v in self.outputs.items() if isinstance(v, IndexedOutput)}

    @property
    def reported(self) -> dict[str, IndexedOutput]:
        """Reported outputs that have indices."""
        indexed = self.indexed
        return {name: indexed[name] for name in self.convergence}


@dataclass(frozen=True)
class _Ranked:
    """Outputs with their indices, and the blocks of runs that give these.

    Attributes
    ----------
    ended : RunEnds
        How the runs ended.
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
        Indices by output, where it has any.
    wanted : dict
        Indices of the reported outputs.
    """

    ended: RunEnds
    complete: NDArray[np.bool_]
    cube: Array
    kept: NDArray[np.bool_]
    scramble: NDArray[np.int64]
    factors: tuple[str, ...]
    outputs: dict[str, IndexedOutput | TooFewPoints]
    wanted: dict[str, IndexedOutput]

    @property
    def widest(self) -> float:
        """Widest interval of a total index of the reported outputs."""
        widths = [
            total.high - total.low
            for entry in self.wanted.values()
            if entry.varies
            for factor, total in entry.total.items()
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


def analyse(study: SobolStudy, model: Model, runs: pd.DataFrame) -> SobolAnalysis:
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
    return SobolAnalysis(
        **vars(ranked.ended),
        groups={name: list(members) for name, members in study.groups.items()},
        base_points=len(ranked.cube),
        factors=list(ranked.factors),
        outputs=ranked.outputs,
        convergence=convergence,
        main_effects=main_effects,
        widest=ranked.widest,
        tolerance=study.design.tolerance,
    )


def _rank(study: SobolStudy, model: Model, runs: pd.DataFrame) -> _Ranked:
    """Return the indices of all outputs that can be given any."""
    factors = factors_of(list(study.inputs), study.groups)
    block = block_size(factors, second_order=study.design.second_order)
    ended, complete = check_failure_rate(study, model, runs, block)
    names = [item.name for item in model.outputs]
    cube, kept = whole_blocks(runs[names].to_numpy(dtype=float), complete, block)
    scramble = runs["replicate"].to_numpy()[::block]
    outputs: dict[str, IndexedOutput | TooFewPoints] = {}
    for pattern, same in outputs_alike(kept):
        found, points = None, int(pattern.sum())
        if is_enough(pattern):
            found = _indices(study, cube[pattern][:, :, same], scramble[pattern], len(factors))
        for k, column in enumerate(same.tolist()):
            item = model.outputs[column]
            few = TooFewPoints(item.unit, points)
            outputs[item.name] = few if found is None else _entry(few, found, k, factors)
    reported = report_outputs(study, model)
    wanted = {name: entry for name in reported if isinstance(entry := outputs[name], IndexedOutput)}
    if not wanted:
        raise StudyError(
            f"{', '.join(reported)}: too few of the {len(cube)} base points have no failed run and "
            "a value in every row; no index is given"
        )
    return _Ranked(ended, complete, cube, kept, scramble, factors, outputs, wanted)


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


def _entry(few: TooFewPoints, found: Indices, k: int, factors: Sequence[str]) -> IndexedOutput:
    """Return the indices of output ``k`` by factor."""
    second = None
    if found.second is not None:
        second = {
            f"{a} x {b}": _estimate(found.second[:, i, j, k])
            for i, a in enumerate(factors)
            for j, b in enumerate(factors)
            if i < j
        }
    return IndexedOutput(
        **vars(few),
        variance=float(found.variance[k]),
        noise_sd=float(np.sqrt(found.total[0, -1, k] * found.variance[k])),
        alone=_estimate(found.first_sum[:, k]),
        first=_by_factor(found.first[:, :, k], factors),
        total=_by_factor(found.total[:, :, k], factors),
        second=second,
    )


def _by_factor(table: Array, factors: Sequence[str]) -> dict[str, Estimate]:
    return {name: _estimate(table[:, j]) for j, name in enumerate(factors)}


def _estimate(triple: Array) -> Estimate:
    return Estimate(*triple.tolist())


def _convergence(
    study: SobolStudy, cube: Array, scramble: NDArray[np.int64], factors: Sequence[str]
) -> list[IndexStep]:
    """Return first and total indices on growing parts of the base points."""
    steps = []
    n = cube.shape[0]
    for size in sorted({n >> k for k in range(STEPS) if n >> k >= MIN_BLOCKS}):
        found = _indices(study, cube[:size], scramble[:size], len(factors), STEP_RESAMPLES)
        first, total = (_by_factor(t[:, :, 0], factors) for t in (found.first, found.total))
        steps.append(IndexStep(size, first, total))
    return steps
