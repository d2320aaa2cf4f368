"""Many runs of a model, in parallel, as one table."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from models.protocol import complete_inputs
from models.registry import load_model
from studies.worker import ModelArgument, evaluate

CHUNK = 12
"""Runs a task."""


def sweep(
    cases: Sequence[Mapping[str, float]],
    *,
    model: str = "multibody",
    options: Mapping[str, Any] | None = None,
    workers: int = -1,
) -> pd.DataFrame:
    """Run cases, given by the inputs that differ from nominal; return inputs, outputs, status."""
    loaded = load_model(model, options)
    names = [item.name for item in loaded.inputs]
    rows = np.array([[complete_inputs(loaded, case)[name] for name in names] for case in cases])
    argument: ModelArgument = {
        "effects": {},
        "name": model,
        "options": dict(options or {}),
        "version": loaded.version,
    }
    parts = [rows[k : k + CHUNK] for k in range(0, len(rows), CHUNK)]
    found = Parallel(n_jobs=workers)(delayed(evaluate)(argument, part) for part in parts)
    table = pd.DataFrame(rows, columns=names)
    outputs = np.concatenate([part[0] for part in found])
    for k, item in enumerate(loaded.outputs):
        table[item.name] = outputs[:, k]
    table["status"] = [word for part in found for word in part[1]]
    return table
