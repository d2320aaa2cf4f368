"""Every number of a Morris report, from the table of runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import pandas as pd
from pydantic import Field

from mcstudy.errors import StudyError
from mcstudy.figures.screening import Ranked
from mcstudy.sampling.morris import draw_trajectories
from mcstudy.sensitivity.blocks import is_enough, whole_blocks
from mcstudy.sensitivity.morris import ElementaryEffects, estimate_effects
from mcstudy.studyfile.study_outputs import report_outputs
from mcstudy.typed_json import Real
from models.protocol import Model
from studies.factor_kind import FactorAnalysis
from studies.morris.schema import MorrisStudy
from studies.runs import check_failure_rate


@dataclass(frozen=True)
class FactorEffect(Ranked):
    """Elementary effects of a factor: mu* with its interval, mean and standard deviation.

    Attributes
    ----------
    mean : mu, the mean of the effects with their sign.
    sigma : standard deviation of the effects; NaN for groups.
    """

    mean: Real
    sigma: Real


@dataclass(frozen=True)
class TooFewTrajectories:
    """An output with too few trajectories for a ranking.

    Attributes
    ----------
    unit : unit of the output.
    trajectories : trajectories with a value in every row.
    """

    unit: str
    trajectories: int


@dataclass(frozen=True)
class RankedOutput(TooFewTrajectories):
    """Elementary effects on an output by factor."""

    factors: Mapping[str, FactorEffect]

    @property
    def varies(self) -> bool:
        """Whether any factor, or the dummy, changes the output."""
        return any(effect.value != 0.0 for effect in self.factors.values())


@dataclass(frozen=True)
class MorrisAnalysis(FactorAnalysis):
    """Every number of a Morris report.

    Attributes
    ----------
    trajectories : number of trajectories that are done.
    factors : names of the factors.
    outputs : elementary effects by output.
    ranked : reported outputs that can be ranked.
    """

    trajectories: int
    factors: Sequence[str]
    outputs: Mapping[
        str, Annotated[RankedOutput | TooFewTrajectories, Field(union_mode="left_to_right")]
    ]
    ranked: Sequence[str]

    @property
    def reported(self) -> dict[str, RankedOutput]:
        """Reported outputs that can be ranked."""
        found = {name: self.outputs[name] for name in self.ranked}
        return {name: entry for name, entry in found.items() if isinstance(entry, RankedOutput)}


def analyse(study: MorrisStudy, model: Model, runs: pd.DataFrame) -> MorrisAnalysis:
    """Return every number that the report prints.

    Parameters
    ----------
    study : MorrisStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Runs of the whole trajectories.

    Raises
    ------
    StudyError
        If more runs failed than the study allows, or no reported output can be ranked.
    """
    inputs = list(study.inputs)
    drawn = draw_trajectories(inputs, study.groups, study.design.n, study.design.levels, study.seed)
    ended, complete = check_failure_rate(study, model, runs, drawn.block)
    names = [item.name for item in model.outputs]
    cube, kept = whole_blocks(runs[names].to_numpy(dtype=float), complete, drawn.block)
    levels = drawn.levels[: len(runs)].reshape(len(cube), drawn.block, -1)
    outputs: dict[str, RankedOutput | TooFewTrajectories] = {}
    for column, item in enumerate(model.outputs):
        held = kept[:, column]
        outputs[item.name] = few = TooFewTrajectories(item.unit, int(held.sum()))
        if is_enough(held):
            found = estimate_effects(
                inputs, study.groups, levels[held].reshape(-1, len(inputs) + 1),
                cube[held, :, column].ravel(), study.design.levels,
                resamples=study.report.resamples, seed=study.seed,
            )  # fmt: skip
            outputs[item.name] = RankedOutput(**vars(few), factors=_by_factor(found, drawn.factors))
    wanted = report_outputs(study, model)
    ranked = [name for name in wanted if isinstance(outputs[name], RankedOutput)]
    if not ranked:
        raise StudyError(
            f"{', '.join(wanted)}: too few of the {len(cube)} trajectories have no failed run and "
            "a value in every row; nothing is ranked"
        )
    return MorrisAnalysis(
        **vars(ended),
        groups={name: list(members) for name, members in study.groups.items()},
        trajectories=len(cube),
        factors=list(drawn.factors),
        outputs=outputs,
        ranked=ranked,
    )


def _by_factor(found: ElementaryEffects, factors: tuple[str, ...]) -> dict[str, FactorEffect]:
    table = zip(factors, found.mean, found.mu_star.T, found.sigma, strict=True)
    return {
        name: FactorEffect(
            value=float(size[0]),
            low=float(size[1]),
            high=float(size[2]),
            # The last factor is the dummy.
            clear=bool(size[1] > found.mu_star[2, -1]),
            mean=float(mean),
            sigma=float(spread),
        )
        for name, mean, size, spread in table
    }
