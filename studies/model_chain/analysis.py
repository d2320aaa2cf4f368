"""Every number of a model chain."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from mcstudy.attribution import Split, find_steps, split_difference
from mcstudy.errors import StudyError
from models.protocol import Model
from studies.model_cells import describe_models, known_values
from studies.model_chain.schema import ModelChain
from studies.runs import RunEnds


@dataclass(frozen=True)
class SplitOutput(Split):
    """Split of the mean difference of an output, in its unit."""

    unit: str


@dataclass(frozen=True)
class ChainAnalysis(RunEnds):
    """Every number of a model chain: first and last model, and the splits by output."""

    first: str
    last: str
    counts: Mapping[str, int]
    outputs: Mapping[str, SplitOutput]


def analyse(
    study: ModelChain,
    models: Mapping[str, Model],
    runs: Mapping[str, pd.DataFrame],
    outputs: Sequence[str],
) -> ChainAnalysis:
    """Return every number that the report prints.

    Parameters
    ----------
    study : ModelChain
        Checked study file.
    models, runs : mapping
        Models and tables of runs by label.
    outputs : sequence of str
        Outputs of the report.

    Raises
    ------
    StudyError
        If more runs of a model failed than the study allows, or two neighbours have too few draws
        in common.
    """
    ended = describe_models(study, models, runs)
    labels = list(models)
    steps = find_steps(study.changes)
    sizes = [len(held) for held in study.changes]
    unit_of = {item.name: item.unit for item in models[labels[0]].outputs}
    found = {}
    for name in outputs:
        values = np.full((len(labels), study.design.n), np.nan)
        for row, label in zip(values, labels, strict=True):
            own = known_values(runs[label], models[label], name)
            row[: own.size] = own
        try:
            split = split_difference(values, labels, steps, study.seed)
        except ValueError as error:
            raise StudyError(f"{name}: {error}") from None
        found[name] = SplitOutput(**vars(split), unit=unit_of[name])
    return ChainAnalysis(
        **vars(ended),
        first=labels[int(np.argmin(sizes))],
        last=labels[int(np.argmax(sizes))],
        counts={label: len(part) for label, part in runs.items()},
        outputs=found,
    )
