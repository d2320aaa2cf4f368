"""Main effects of a study's inputs, in the units of its file."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.sensitivity.main_effects import MainEffect, main_effect
from mcstudy.studyfile.schema import SampledStudy
from models.protocol import Model


def main_effects_of(
    study: SampledStudy, model: Model, runs: pd.DataFrame, output: str
) -> dict[str, MainEffect]:
    """Return the conditional mean of an output along each sampled input.

    Parameters
    ----------
    study : SampledStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Independent draws of the inputs.
    output : str
        Name of the output.
    """
    values: NDArray[np.float64] = runs[output].to_numpy(dtype=float)
    model_unit = {item.name: item.unit for item in model.inputs}
    effects = {}
    for name, entry in study.inputs.items():
        scale = 1.0 / units.factor(entry.unit, model_unit[name])
        inputs = scale * runs[name].to_numpy(dtype=float)
        effects[name] = main_effect(inputs, values, entry.unit)
    return effects
