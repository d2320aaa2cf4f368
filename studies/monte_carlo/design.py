"""The design of a Monte Carlo study: its input values."""

import numpy as np
from numpy.typing import NDArray

from mcstudy.sampling import designs
from mcstudy.studyfile.study_inputs import map_inputs
from models.protocol import Model
from studies.monte_carlo.schema import MonteCarloStudy

Array = NDArray[np.float64]


def sample_inputs(study: MonteCarloStudy, model: Model) -> dict[str, Array]:
    """Return the (n,) values of every input of the model, in its units.

    Raises
    ------
    UserError
        If names, units, dependence or ranges do not fit the model.
    """
    design = study.design
    uniforms = designs.draw(design.method, design.n, design.size, len(study.inputs), study.seed)
    return map_inputs(study, model, uniforms)
