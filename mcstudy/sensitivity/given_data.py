"""Sensitivity from any sample of inputs and outputs, whatever its design.

- Rank-based first order: sort the runs by an input; outputs of neighbours share what that input
  explains (F. Gamboa, P. Gremaud, T. Klein, A. Lagnoux, Bernoulli 28, 2022).
- PAWN: how far the distribution of an output moves when an input is held (F. Pianosi, T. Wagener,
  Environmental Modelling and Software 67, 2015), by SALib.
- Delta: the moment-independent index of E. Borgonovo (2007), by SALib.

All three hold for dependent inputs, as measures of association: an input that only goes with
another one gets that one's share as well. A dummy, independent of everything, draws the noise line.
"""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy import seeds
from mcstudy.sensitivity.saltelli import DUMMY

Array = NDArray[np.float64]

FEWEST_RUNS = 50
"""Runs below which the measures say nothing (assumed)."""
SUBSAMPLES = 100
DUMMIES = 20
"""Dummies whose largest value in 20 draws the noise line: one in twenty passes it by chance."""


@dataclass(frozen=True)
class GivenData:
    """Measures of d inputs for one output: (3, d) value, low, high, and their noise lines.

    Attributes
    ----------
    inputs : names. first, pawn, delta : (3, d). noise : by measure. runs : used.
    """

    inputs: tuple[str, ...]
    first: Array
    pawn: Array
    delta: Array
    noise: dict[str, float]
    runs: int


def rank_first_order(values: Array, outputs: Array) -> Array:
    """Return the rank-based first-order index of each input.

    Parameters
    ----------
    values : (n, d). outputs : (n,), finite.
    """
    centred = outputs - outputs.mean()
    variance = float(centred @ centred)
    if variance == 0.0:
        return np.full(values.shape[1], np.nan)
    order = np.argsort(values, axis=0, kind="stable")
    sorted_outputs = centred[order]
    following = np.roll(sorted_outputs, -1, axis=0)
    return np.asarray((sorted_outputs * following).sum(axis=0) / variance)


def measure_given_data(
    inputs: tuple[str, ...], values: Array, outputs: Array, seed: int
) -> GivenData:
    """Return rank-based first order, PAWN and delta of the inputs of one output.

    Parameters
    ----------
    inputs : d names. values : (n, d). outputs : (n,), NaN where there is none.
    seed : of subsamples, dummies and SALib's resamples.

    Raises
    ------
    ValueError
        If fewer than 50 runs have the output.
    """
    held = np.isfinite(outputs)
    x, y = values[held], outputs[held]
    if y.size < FEWEST_RUNS:
        raise ValueError(f"{y.size} runs have a value, {FEWEST_RUNS} are needed")
    rng = seeds.generator(seed, seeds.PERMUTATION)
    dummies = rng.random((y.size, DUMMIES))
    first = rank_first_order(x, y)
    half = y.size // 2
    spread = np.empty((SUBSAMPLES, x.shape[1]))
    for k in range(SUBSAMPLES):
        part = rng.permutation(y.size)[:half]
        spread[k] = rank_first_order(x[part], y[part])
    # Half samples scatter about the whole one as it scatters about the truth.
    reach = 1.959963984540054 * np.sqrt(np.mean((spread - first) ** 2, axis=0))
    together = np.column_stack([x, dummies])
    pawn = _pawn(together, y, seed)
    delta = _delta(np.column_stack([x, dummies[:, :4]]), y, seed)
    d = x.shape[1]
    return GivenData(
        inputs=inputs,
        first=np.stack([first, first - reach, first + reach]),
        pawn=pawn[:, :d],
        delta=delta[:, :d],
        noise={
            "first": float(rank_first_order(dummies, y).max()),
            "pawn": float(pawn[0, d:].max()),
            "delta": float(delta[0, d:].max()),
        },
        runs=int(y.size),
    )


def _problem(d: int) -> dict[str, object]:
    return {"num_vars": d, "names": [f"x{k}" for k in range(d)], "bounds": [[0.0, 1.0]] * d}


def _pawn(values: Array, outputs: Array, seed: int) -> Array:
    """Return median, lowest and highest PAWN distance over the slices of each input."""
    from SALib.analyze import pawn

    with _salib(seed):
        found = pawn.analyze(_problem(values.shape[1]), values, outputs, S=10, seed=seed + 1)
    return np.stack([found["median"], found["minimum"], found["maximum"]])


def _delta(values: Array, outputs: Array, seed: int) -> Array:
    """Return Borgonovo's delta with its 95 % interval."""
    from SALib.analyze import delta

    with _salib(seed):
        found = delta.analyze(
            _problem(values.shape[1]), values, outputs, num_resamples=50, seed=seed + 1
        )
    key = "delta_balanced" if "delta_balanced" in found else "delta"
    conf = found.get(f"{key}_conf", found.get("delta_conf"))
    return np.stack([found[key], found[key] - conf, found[key] + conf])


@contextmanager
def _salib(seed: int) -> Iterator[None]:
    """Keep SALib from touching the global generator and the format of warnings for good."""
    state, formatting = np.random.get_state(), warnings.formatwarning  # noqa: NPY002
    try:
        np.random.seed(seed % 2**32)  # noqa: NPY002
        yield
    finally:
        np.random.set_state(state)  # noqa: NPY002
        warnings.formatwarning = formatting


__all__ = ["DUMMY", "GivenData", "measure_given_data", "rank_first_order"]
