"""Sobol' indices of many outputs at once, with bootstrap intervals.

Base points come in blocks: a row of A, one row of A with one input (or group) from B for each
input, for second order one row of B with one input from A for each, and a row of B (A. Saltelli,
Computer Physics Communications 145, 2002; Saltelli et al., Computer Physics Communications 181,
2010). With outputs centred at their mean and V the variance over A and B::

    S_i  = mean(f_B (f_ABi - f_A)) / V                 first order (Saltelli 2010)
    T_i  = mean((f_A - f_ABi)^2) / (2 V)               total (M. Jansen, 1999)
    S_ij = mean(f_BAi f_ABj - f_A f_B) / V - S_i - S_j second order (Saltelli 2002)

Every estimator is a ratio of means over base points, so all bootstrap resamples of all inputs and
outputs are one matrix product of resampling weights with the terms of the base points. The
independent units are resampled: base points, or the replicates that they belong to.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mcstudy.statistics import scale_of, varies

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
    first_sum : (3, m) sum of all first-order indices.
    second : (3, d, d, m) upper triangle, NaN elsewhere; None without second-order rows.
    variance : (m,) of the outputs.
    blocks : number of base points used.
    """

    first: Array
    total: Array
    first_sum: Array
    second: Array | None
    variance: Array
    blocks: int


def split_blocks(outputs: Array, d: int, *, second_order: bool) -> Blocks:
    """Return the blocks of outputs in the row order of a Saltelli design.

    Parameters
    ----------
    outputs : array
        Shape (n (d + 2), m), or (n (2 d + 2), m) with second order.
    d : int
        Number of inputs or groups that are exchanged.
    second_order : bool
        Whether the design has the rows of second-order indices.

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
    replicate: NDArray[np.int64] | None = None,
    *,
    resamples: int = 1000,
    rng: np.random.Generator | None = None,
    centre: Literal["all", "base"] = "all",
) -> Indices:
    """Return the Sobol' indices of all inputs and outputs.

    Parameters
    ----------
    blocks : Blocks
        All finite.
    replicate : (n,) array of int, optional
        Replicate of each base point, resampled as a whole; by default each base point is its own.
    resamples : int
        Bootstrap resamples for the intervals; 0 leaves them NaN.
    rng : Generator, optional
        Of the resamples, by default with a fixed seed.
    centre : {"all", "base"}
        Outputs are centred at the mean of all rows (as SALib) or of A and B (as SciPy).

    Raises
    ------
    ValueError
        If a value is not finite or there are fewer than two base points.

    Notes
    -----
    An output that does not vary beyond rounding has indices of NaN and a variance of zero; no other
    output has, whatever its scale. One that varies, but not over A and B, has indices and a
    variance of NaN. Intervals are those of Student's t with the bootstrap's standard deviation,
    which is too small by sqrt((R - 1) / R) for R replicates (B. Efron, R. Tibshirani, An
    Introduction to the Bootstrap, 1993, section 5.3).
    """
    arrays = [blocks.A, blocks.B, blocks.AB] + ([] if blocks.BA is None else [blocks.BA])
    if not all(np.all(np.isfinite(a)) for a in arrays):
        raise ValueError("outputs must be finite: drop failed base points as whole blocks first")
    blocks, scales, held = _scaled(blocks)
    arrays = [blocks.A, blocks.B, blocks.AB] + ([] if blocks.BA is None else [blocks.BA])
    n, m = blocks.A.shape
    d = blocks.AB.shape[1]
    if n < 2:
        raise ValueError("indices take two base points or more")
    if centre == "base":
        mean = 0.5 * (blocks.A.mean(axis=0) + blocks.B.mean(axis=0))
    else:
        mean = np.concatenate([a.reshape(-1, m) for a in arrays]).mean(axis=0)
    pairs = [(i, j) for i in range(d) for j in range(i + 1, d)] if blocks.BA is not None else []
    table = _terms(blocks, mean, pairs)
    best = _ratios(table.mean(axis=0)[None], d, m, len(pairs))
    if replicate is None:
        replicate = np.arange(n)
    means, reach = _resampled(table, replicate, resamples, rng or np.random.default_rng(0))
    spread = _ratios(means, d, m, len(pairs))
    first, total = (_with_interval(best[k][0], spread[k], reach) for k in (0, 1))
    first_sum = _with_interval(best[0][0].sum(axis=0), spread[0].sum(axis=1), reach)
    second = None
    if pairs:
        second = np.full((3, d, d, m), np.nan)
        found = _with_interval(best[2][0], spread[2], reach)
        for k, (i, j) in enumerate(pairs):
            second[:, i, j] = found[:, k]
    return Indices(first, total, first_sum, second, _unscaled(best[3][0], scales, held), n)


def _scaled(blocks: Blocks) -> tuple[Blocks, Array, NDArray[np.bool_]]:
    """Return the blocks over the scale of each output, the scales, and which outputs vary.

    Squares of scaled values neither overflow nor vanish, and indices are scale-invariant. An output
    that does not vary beyond rounding becomes zero.
    """
    together = {"A": blocks.A, "B": blocks.B, "AB": blocks.AB}
    if blocks.BA is not None:
        together["BA"] = blocks.BA
    m = blocks.A.shape[1]
    columns = [np.concatenate([a[..., k].ravel() for a in together.values()]) for k in range(m)]
    scales = np.array([scale_of(column) for column in columns])
    held = np.array([varies(column) for column in columns], dtype=bool)
    parts = {key: np.where(held, a / scales, 0.0) for key, a in together.items()}
    return replace(blocks, **parts), scales, held


def _unscaled(variance: Array, scales: Array, held: NDArray[np.bool_]) -> Array:
    """Return the variances of the outputs from those of the scaled outputs."""
    with np.errstate(over="ignore", under="ignore"):
        found = variance * scales * scales
    # An underflowing variance must differ from the zero of a constant output.
    found = np.maximum(found, np.finfo(float).smallest_subnormal)
    return np.where(held, np.where(variance > 0.0, found, np.nan), 0.0)


def _terms(blocks: Blocks, mean: Array, pairs: Sequence[tuple[int, int]]) -> Array:
    """Return the terms (n, k) of every base point whose means make up all estimators."""
    n = blocks.size
    A, B, AB = blocks.A - mean, blocks.B - mean, blocks.AB - mean
    terms = [
        A + B,
        A**2 + B**2,
        (B[:, None] * (AB - A[:, None])).reshape(n, -1),
        ((A[:, None] - AB) ** 2).reshape(n, -1),
    ]
    if blocks.BA is not None:
        BA = blocks.BA - mean
        both = A * B
        terms += [BA[:, i] * AB[:, j] - both for i, j in pairs]
    return np.concatenate(terms, axis=1)


def _resampled(
    table: Array, replicate: NDArray[np.int64], resamples: int, rng: np.random.Generator
) -> tuple[Array, float]:
    """Return the terms' means over resampled replicates, and the interval's half-width in sd.

    Without resamples, or with one replicate, there are no means.
    """
    labels = np.unique(replicate, return_inverse=True)[1]
    sizes = np.bincount(labels).astype(float)
    count = sizes.size
    if count < 2 or not resamples:
        return np.empty((0, table.shape[1])), np.nan
    sums = np.zeros((count, table.shape[1]))
    np.add.at(sums, labels, table)
    weights = np.stack(
        [np.bincount(rng.integers(0, count, count), minlength=count) for _ in range(resamples)]
    ).astype(float)
    quantile = float(stats.t.ppf(0.5 + CONFIDENCE / 2.0, count - 1))
    means = weights @ sums / (weights @ sizes)[:, None]
    return means, quantile * float(np.sqrt(count / (count - 1)))


def _ratios(means: Array, d: int, m: int, pairs: int) -> tuple[Array, Array, Array, Array]:
    """Return first (r, d, m), total, second (r, pairs, m) and variance (r, m) of means of terms."""
    r = means.shape[0]
    cuts = np.cumsum([m, m, d * m, d * m])
    total_sum, squares, crossed, gaps, products = np.split(means, cuts, axis=1)
    variance = 0.5 * squares - (0.5 * total_sum) ** 2
    varies = variance > np.finfo(float).eps * np.maximum(squares, np.finfo(float).tiny)
    variance = np.where(varies, variance, 0.0)
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


def _with_interval(best: Array, spread: Array, reach: float) -> Array:
    """Return value, low and high at ``reach`` standard deviations of the resamples."""
    if spread.shape[0] < 2:
        return np.stack([best, np.full_like(best, np.nan), np.full_like(best, np.nan)])
    half = reach * spread.std(axis=0, ddof=1)
    return np.stack([best, best - half, best + half])
