"""Code of a worker process. It imports models only, no pandas, figures or reports."""

import functools
import json
from collections.abc import Callable
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from models.protocol import Model
from models.registry import load_model


class ModelArgument(TypedDict):
    """Plain data that names a model."""

    name: str
    options: dict[str, Any]
    effects: dict[str, dict[str, float]]
    version: str


@functools.lru_cache(maxsize=4)
def _model(name: str, options: str, effects: str, version: str) -> Model:
    # The version distinguishes two states of a file that an option names.
    return load_model(name, json.loads(options), json.loads(effects))


def evaluate(
    argument: ModelArgument, rows: NDArray[np.float64], started: Callable[[int], None]
) -> tuple[NDArray[np.float64], list[str]]:
    """Run rows of inputs and return outputs and statuses.

    Parameters
    ----------
    argument : ModelArgument
        Name, options, effects and version of the model.
    rows : (n, d) array
        Inputs in the order of the model's.
    started : callable
        Called with the number of each row before it is run.
    """
    model = _model(
        argument["name"],
        json.dumps(argument["options"], sort_keys=True),
        json.dumps(argument["effects"], sort_keys=True),
        argument["version"],
    )
    batch = model.run_batch(rows, started)
    return batch.outputs, batch.status
