"""Sobol' indices of many outputs at once, with bootstrap intervals.

Base points come in blocks: a row of A, one row of A with one input (or group) from B for each
input, for second order one row of B with one input from A for each, and a row of B (A. Saltelli,
Computer Physics Communications 145, 2002; Saltelli et al., Computer Physics Communications 181,
2010). With outputs centred at their mean and V the variance over A and B::

    S_i  = mean(f_B (f_ABi - f_A)) / V                 first order (Saltelli 2010)
    T_i  = mean((f_A - f_ABi)^2) / (2 V)               total (M. Jansen, 1999)
    S_ij = mean(f_BAi f_ABj - f_A f_B) / V - S_i - S_j second order (Saltelli 2002)

Every estimator is a ratio of means over base points, so all bootstrap resamples of all inputs and
outputs are one matrix product of resampling weights with the terms of the base points.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Blocks:
    """Outputs of a Saltelli design by block.

    Attributes
    ----------
    A, B : (n, m) outputs at the base points.
    AB : (n, d, m) outputs at A with input i from B.
    BA : (n, d, m) outputs at B with input i from A, or None.
    """

    A: Array
    B: Array
    AB: Array
    BA: Array | None = None

    @property
    def size(self) -> int:
        """Base points."""
        return int(self.A.shape[0])


@dataclass(frozen=True)
class Indices:
    """Sobol' indices of d inputs (or groups) and m outputs, with intervals.

    Attributes
    ----------
    first, total : (3, d, m) value, low, high.
    second : (3, d, d, m) upper triangle, NaN elsewhere; None if the design has no such blocks.
    variance : (m,). blocks : base points used.
    """

    first: Array
    total: Array
    second: Array | None
    variance: Array
    blocks: int


def split_blocks(outputs: Array, d: int, *, second_order: bool) -> Blocks:
    """Return the blocks of outputs in the row order of a Saltelli design.

    Parameters
    ----------
    outputs : (n (d + 2), m), or (n (2 d + 2), m) with second order.
    d : inputs or groups that are exchanged.

    Raises
    ------
    ValueError
        If the number of rows is no multiple of a block's.
    """
    rows = 2 * d + 2 if second_order else d + 2
    if outputs.ndim != 2 or outputs.shape[0] % rows or outputs.shape[0] == 0:
        raise ValueError(f"outputs must have shape (n * {rows}, m), given {outputs.shape}")
    cube = outputs.reshape(-1, rows, outputs.shape[1])
    return Blocks(
        A=cube[:, 0],
        B=cube[:, -1],
        AB=cube[:, 1 : d + 1],
        BA=cube[:, d + 1 : 2 * d + 1] if second_order else None,
    )


def estimate_indices(
    blocks: Blocks,
    *,
    resamples: int = 1000,
    seed: np.random.SeedSequence | int = 0,
    centre: Literal["all", "base"] = "all",
) -> Indices:
    """Return the indices of all inputs and outputs.

    Parameters
    ----------
    blocks : Blocks, all finite.
    resamples : of base points, for the intervals; 0 leaves them NaN.
    seed : of the resamples.
    centre : where outputs are centred: at the mean of all rows (as SALib) or of A and B (as SciPy).

    Raises
    ------
    ValueError
        If a value is not finite or there are fewer than two base points.

    Notes
    -----
    An output that does not vary has indices of NaN.
    """
    arrays = [blocks.A, blocks.B, blocks.AB] + ([] if blocks.BA is None else [blocks.BA])
    if not all(np.all(np.isfinite(a)) for a in arrays):
        raise ValueError("outputs must be finite: drop failed base points as whole blocks first")
    n, m = blocks.A.shape
    d = blocks.AB.shape[1]
    if n < 2:
        raise ValueError("indices take two base points or more")
    if centre == "base":
        mean = 0.5 * (blocks.A.mean(axis=0) + blocks.B.mean(axis=0))
    else:
        mean = np.concatenate([a.reshape(-1, m) for a in arrays]).mean(axis=0)
    A, B, AB = blocks.A - mean, blocks.B - mean, blocks.AB - mean
    # Terms of every base point; all estimators are ratios of their means.
    terms = [
        A + B,
        A**2 + B**2,
        (B[:, None] * (AB - A[:, None])).reshape(n, -1),
        ((A[:, None] - AB) ** 2).reshape(n, -1),
    ]
    pairs = [(i, j) for i in range(d) for j in range(i + 1, d)] if blocks.BA is not None else []
    if blocks.BA is not None:
        BA = blocks.BA - mean
        both = A * B
        terms += [BA[:, i] * AB[:, j] - both for i, j in pairs]
    table = np.concatenate(terms, axis=1)
    best = _ratios(table.mean(axis=0)[None], d, m, len(pairs))
    spread = best
    if resamples:
        rng = np.random.default_rng(seed)
        weights = np.stack(
            [np.bincount(rng.integers(0, n, n), minlength=n) for _ in range(resamples)]
        ) / float(n)
        spread = _ratios(weights @ table, d, m, len(pairs))
    first, total = (_with_interval(best[k][0], spread[k]) for k in (0, 1))
    second = None
    if pairs:
        second = np.full((3, d, d, m), np.nan)
        found = _with_interval(best[2][0], spread[2])
        for k, (i, j) in enumerate(pairs):
            second[:, i, j] = found[:, k]
    return Indices(first, total, second, best[3][0], n)


def _ratios(means: Array, d: int, m: int, pairs: int) -> tuple[Array, Array, Array, Array]:
    """Return first (r, d, m), total, second (r, pairs, m) and variance (r, m) of means of terms."""
    r = means.shape[0]
    cuts = np.cumsum([m, m, d * m, d * m])
    total_sum, squares, crossed, gaps, products = np.split(means, cuts, axis=1)
    variance = 0.5 * squares - (0.5 * total_sum) ** 2
    varies = variance > np.finfo(float).eps * np.maximum(squares, np.finfo(float).tiny)
    over = np.where(varies, variance, np.nan)
    first = crossed.reshape(r, d, m) / over[:, None]
    total = 0.5 * gaps.reshape(r, d, m) / over[:, None]
    second = np.empty((r, pairs, m))
    if pairs:
        products = products.reshape(r, pairs, m)
        places = [(i, j) for i in range(d) for j in range(i + 1, d)]
        i, j = (np.array(side) for side in zip(*places, strict=True))
        second = products / over[:, None] - first[:, i] - first[:, j]
    return first, total, second, variance


def _with_interval(best: Array, spread: Array) -> Array:
    """Return value, low and high: normal intervals with the bootstrap's standard deviation."""
    if spread.shape[0] < 2:
        return np.stack([best, np.full_like(best, np.nan), np.full_like(best, np.nan)])
    reach = 1.959963984540054 * spread.std(axis=0, ddof=1)
    return np.stack([best, best - reach, best + reach])
