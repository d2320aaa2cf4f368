"""Main effect of one input: conditional mean and band of an output."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.statistics import scale_of
from mcstudy.typed_json import Real

Array = NDArray[np.float64]

BINS = 16


@dataclass(frozen=True)
class MainEffect:
    """Conditional mean and band of an output along one input, in bins of equal counts.

    Attributes
    ----------
    unit : unit of the input.
    x : median of the input in each bin.
    mean, error : conditional mean and its standard error.
    low, high : ends of the central 90 % of the output.
    """

    unit: str
    x: Sequence[Real]
    mean: Sequence[Real]
    error: Sequence[Real]
    low: Sequence[Real]
    high: Sequence[Real]


def main_effect(values: Array, outputs: Array, unit: str = "1") -> MainEffect:
    """Return conditional mean, its standard error and the central 90 % of an output.

    Parameters
    ----------
    values : (n,) array
        Of the input.
    outputs : (n,) array
        NaN where undefined.
    unit : str
        Of the input.
    """
    held = np.isfinite(outputs)
    x, scale = values[held], scale_of(outputs)
    y = outputs[held] / scale
    parts = np.array_split(np.argsort(x, kind="stable"), min(BINS, max(1, x.size // 8)))
    rows = [
        (np.median(x[p]), y[p].mean(), y[p].std(ddof=1) / np.sqrt(p.size),
         *np.quantile(y[p], [0.05, 0.95]))
        for p in parts
        if p.size > 1
    ]  # fmt: skip
    table = np.array(rows).reshape(-1, 5) * np.array([1.0, scale, scale, scale, scale])
    return MainEffect(unit, *table.T.tolist())
