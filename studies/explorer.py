"""The explorer of a sampled study: its runs, inputs and outputs on one page."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from mcstudy import units
from mcstudy.execution.results import ResultsFolder
from mcstudy.figures import style
from mcstudy.studyfile.schema import SampledStudy
from mcstudy.studyfile.study_outputs import report_outputs
from mcstudy.viewer import Column, Stored, render_explorer
from models.protocol import Model
from studies.stored_scenes import stored_scenes

CAPTION = (
    "Every run: drag along an axis or over a plot to choose runs, click a point to pick one. Runs "
    "of the list are kept in three dimensions; mcstudy view shows any other one."
)
STRONGEST = 3
"""Inputs that are shown first, those with the largest rank correlations with the first output."""


def explore_runs(
    study: SampledStudy,
    model: Model,
    runs: pd.DataFrame,
    *,
    stored: Sequence[Stored] = (),
    address: str = "",
) -> str:
    """Return the explorer's page of the runs of a study.

    Parameters
    ----------
    study : SampledStudy
    model : Model
    runs : DataFrame
        One row a run.
    stored : sequence of Stored
        Runs that the page shows in three dimensions.
    address : str
        Start of the address at which a server shows a run; empty for a file.
    """
    columns = []
    for item in model.inputs:
        if item.name not in study.inputs:
            continue
        given = study.inputs[item.name].unit
        values = runs[item.name].to_numpy(dtype=float) * units.factor(item.unit, given)
        columns.append(Column(item.name, style.label(item.name, given), values))
    for output in model.outputs:
        values = runs[output.name].to_numpy(dtype=float)
        if np.isfinite(values).any():
            columns.append(Column(output.name, style.label(output.name, output.unit), values))
    outputs = report_outputs(study, model)
    first = runs[outputs[0]].astype(float).rank()
    strength = {
        name: abs(first.corr(runs[name].astype(float).rank()))
        for name in study.inputs
        if runs[name].nunique() > 1 and first.nunique() > 1
    }
    drivers = sorted(strength, key=lambda name: -np.nan_to_num(strength[name]))[:STRONGEST]
    return render_explorer(
        study.title, runs["run"].to_numpy(dtype=np.int64), runs["status"].tolist(),
        columns, [*outputs[:STRONGEST], *drivers], stored=stored, address=address,
    )  # fmt: skip


def explorer_pages(
    study: SampledStudy, model: Model, runs: pd.DataFrame, folder: ResultsFolder
) -> dict[str, str]:
    """Return the explorer of a study for its report, by caption.

    Parameters
    ----------
    study : SampledStudy
    model : Model
    runs : DataFrame
        One row a run.
    folder : ResultsFolder
        Of the study; holds the runs that are kept in three dimensions.
    """
    return {CAPTION: explore_runs(study, model, runs, stored=stored_scenes(folder))}
