"""Many runs of a model, in parallel, as one table."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from mcstudy.execution.workers import parallel_backend
from models.protocol import complete_inputs
from models.registry import load_model
from studies.runs import evaluator_of


def sweep(
    cases: Sequence[Mapping[str, float]],
    *,
    model: str = "multibody",
    options: Mapping[str, Any] | None = None,
    workers: int = -1,
) -> pd.DataFrame:
    """Run cases and return inputs, outputs and status.

    Parameters
    ----------
    cases : sequence of mapping
        The inputs of each that differ from nominal.
    model : str
        Name of the model.
    options : mapping, optional
        Options of the model.
    workers : int
        Processes, -1 for one per core.
    """
    loaded = load_model(model, options)
    names = [item.name for item in loaded.inputs]
    rows = np.array([[complete_inputs(loaded, case)[name] for name in names] for case in cases])
    with parallel_backend(workers):
        batch = evaluator_of(loaded, options or {}).evaluate(rows)
    table = pd.DataFrame(rows, columns=names)
    for k, item in enumerate(loaded.outputs):
        table[item.name] = batch.outputs[:, k]
    table["status"] = batch.status
    return table
