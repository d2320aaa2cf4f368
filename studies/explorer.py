"""The explorer of a sampled study: its runs, inputs and outputs on one page."""

import numpy as np
import pandas as pd

from mcstudy import units
from mcstudy.figures import style
from mcstudy.studyfile.schema import SampledStudy
from mcstudy.studyfile.study_outputs import report_outputs
from mcstudy.viewer import Column, render_explorer
from models.protocol import Model

STRONGEST = 3
"""Inputs that are shown first, those with the largest rank correlations with the first output."""


def explore_runs(
    study: SampledStudy, model: Model, runs: pd.DataFrame, *, address: str = ""
) -> str:
    """Return the explorer's page of the runs of a study.

    Parameters
    ----------
    study : SampledStudy
    model : Model
    runs : DataFrame
        One row a run.
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
        columns, [*outputs[:STRONGEST], *drivers], address=address,
    )  # fmt: skip
