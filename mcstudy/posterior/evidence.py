"""Evidence on inputs and outputs of a run, and what a bank of runs says of it."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.sampling import seeds

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Item:
    """One item of evidence, in the model's units.

    Attributes
    ----------
    name : str
        Input or output.
    value : float or None
        As measured; None for bounds and events.
    sd : float
        Standard uncertainty of the measurement.
    absolute, relative : float
        Standard deviation of the model's own error, and the same as a share of the simulated
        value.
    low, high : float
        Bounds between which the quantity lies, noise included.
    happened : bool or None
        Whether there is such a quantity at all, as of a head that struck the car.
    """

    name: str
    value: float | None = None
    sd: float = 0.0
    absolute: float = 0.0
    relative: float = 0.0
    low: float = -np.inf
    high: float = np.inf
    happened: bool | None = None

    @property
    def is_bound(self) -> bool:
        """Whether it says that the quantity lies between bounds."""
        return self.value is None and self.happened is None

    def noise(self, values: Array) -> Array:
        """Return the standard deviation (n,) of what is measured about simulated values (n,)."""
        model = np.hypot(self.absolute, self.relative * np.abs(values))
        return np.asarray(np.hypot(self.sd, model))


@dataclass(frozen=True)
class Bank:
    """Runs: values (n,) of inputs and outputs by name, NaN where a run has no such output."""

    values: Mapping[str, Array]

    @property
    def size(self) -> int:
        """Number of runs."""
        return len(next(iter(self.values.values())))


@dataclass(frozen=True)
class Simulated:
    """Simulated evidence: what would have been measured of the runs of a bank.

    A run without a quantity that was measured, or outside a bound, has likelihood zero: it is left
    out here, but counts in every prior probability.

    Attributes
    ----------
    rows : (m,) int array
        Run of each simulated set of evidence; a run has several, with noise of their own.
    noisy : (m, k) array
        Simulated measurements of the items that have a value.
    observed : (k,) array
        The measured ones.
    items : tuple of Item
        Those k items.
    possible : (n,) array
        Probability of the bounds and events by run, the share of its sets that are kept.
    """

    rows: NDArray[np.int64]
    noisy: Array
    observed: Array
    items: tuple[Item, ...]
    possible: Array


def simulate_evidence(bank: Bank, items: Sequence[Item], *, seed: int, copies: int) -> Simulated:
    """Return what would have been measured of the runs of a bank.

    Parameters
    ----------
    bank : Bank
    items : sequence of Item
        At least one with a value.
    seed : int
        Of the noise.
    copies : int
        Sets of evidence a run.

    Raises
    ------
    ValueError
        If no item has a value, or no run is possible.
    """
    measured = tuple(item for item in items if item.value is not None)
    if not measured:
        raise ValueError("no item of evidence has a value")
    n = bank.size
    rows = np.tile(np.arange(n), copies)
    kept = np.ones(n * copies, dtype=bool)
    columns = []
    # Streams go by name, so that the order of the items changes nothing.
    for item in items:
        values = bank.values[item.name]
        known = np.isfinite(values)[rows]
        if item.happened is not None:
            kept &= known == item.happened
            continue
        kept &= known
        draws = _stream(seed, item.name).standard_normal(n * copies)
        with np.errstate(invalid="ignore"):
            noisy = values[rows] + item.noise(values)[rows] * draws
        if item.is_bound:
            with np.errstate(invalid="ignore"):
                kept &= (noisy >= item.low) & (noisy <= item.high)
        else:
            columns.append(noisy)
    if not kept.any():
        raise ValueError("no run of the bank agrees with the bounds and events of the evidence")
    possible = np.bincount(rows[kept], minlength=n) / copies
    return Simulated(
        rows=rows[kept],
        noisy=np.stack(columns, axis=1)[kept],
        observed=np.array([float(item.value or 0.0) for item in measured]),
        items=measured,
        possible=possible,
    )


def _stream(seed: int, name: str) -> np.random.Generator:
    """Return the generator of the noise of an item."""
    key = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big")
    return seeds.generator(seed, seeds.EVIDENCE, key)
