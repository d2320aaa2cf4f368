"""Main effect of one input: conditional mean and band of an output."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcstudy.statistics import scale_of

Array = NDArray[np.float64]

BINS = 16


def main_effect(values: Array, outputs: Array) -> dict[str, Any]:
    """Return conditional mean, its standard error and the central 90 % of an output.

    Parameters
    ----------
    values : (n,) array
        Of the input.
    outputs : (n,) array
        NaN where undefined.

    Returns
    -------
    dict
        ``x`` (median of the input in each bin of equal counts), ``mean``, ``error``, ``low``,
        ``high``.
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
    return dict(zip(("x", "mean", "error", "low", "high"), table.T, strict=True))
