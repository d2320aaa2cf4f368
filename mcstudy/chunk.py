"""What a worker process runs of this package; it imports NumPy alone."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def evaluate_chunk(
    evaluate: Callable[[Any, Array], tuple[Array, list[str]]],
    argument: Any,
    ids: NDArray[np.int64],
    rows: Array,
) -> tuple[NDArray[np.int64], Array, list[str]]:
    """Return the run ids of a chunk with their outputs and statuses."""
    outputs, status = evaluate(argument, rows)
    return ids, outputs, status
