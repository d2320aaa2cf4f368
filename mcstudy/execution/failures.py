"""Failed runs: their number and their location in the input space."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.execution.chunk import CRASHED, NOT_FINITE, TIMEOUT, UNPHYSICAL

Flags = NDArray[np.bool_]

_ENDINGS = {TIMEOUT: "timeout", CRASHED: "crashed", NOT_FINITE: "invalid", UNPHYSICAL: "invalid"}

PARTS = 10
"""Number of parts of equal counts into which an input's range is cut."""
SURE = 2.5
"""Standard deviations beyond which failures count as uneven (assumed): one input in forty is so by
chance."""


@dataclass(frozen=True)
class Place:
    """Place of the failures along an input.

    Attributes
    ----------
    mean_rank : of the failed runs, 0 lowest to 1 highest.
    place : ``low``, ``high``, at both ``ends`` or in the ``middle``.
    """

    mean_rank: float
    place: str


@dataclass(frozen=True)
class Failures:
    """Number and location of the failed runs.

    Attributes
    ----------
    runs : number of failed runs.
    share : of all runs.
    blocks : number of blocks with a failed run.
    where : place by input, for those along which failures are unevenly distributed.
    map : share of failed runs in each tenth of each input.
    """

    runs: int
    share: float
    blocks: int
    where: Mapping[str, Place]
    map: Mapping[str, Sequence[float]]


@dataclass(frozen=True)
class Ending:
    """Runs with the same outcome.

    Attributes
    ----------
    status : status of the runs.
    ending : ok, failed, invalid, timeout or crashed.
    runs : number of runs.
    reason : the most frequent one, empty where none was recorded.
    """

    status: str
    ending: str
    runs: int
    reason: str


def locate_failures(inputs: pd.DataFrame, failed: Flags, block: int = 1) -> Failures:
    """Return number and location of the failed runs.

    Parameters
    ----------
    inputs : (n, d) DataFrame
        Sampled inputs.
    failed : (n,) array of bool
    block : int
        Rows that belong together, such as a base point's; they count as one in the test of
        uniformity.
    """
    n = len(inputs)
    count = int(failed.sum())
    blocks = np.arange(n) // block
    hit = np.unique(blocks[failed])
    where: dict[str, Place] = {}
    shares: dict[str, list[float]] = {}
    found = Failures(count, count / n if n else 0.0, int(hit.size), where, shares)
    if not count:
        return found
    ranks = (inputs.rank().to_numpy() - 0.5) / n
    # Rows of a block share inputs: one mean rank a block, of no more than a uniform's variance.
    lost_ranks = pd.DataFrame(ranks[failed])
    means = lost_ranks.groupby(blocks[failed]).mean().mean().to_numpy()
    from_middle = (lost_ranks - 0.5).abs().groupby(blocks[failed]).mean().mean().to_numpy()
    # Standard deviations of a uniform and of its distance from the middle, over the blocks.
    noise, middle_noise = np.sqrt(1.0 / 12.0 / hit.size), np.sqrt(1.0 / 48.0 / hit.size)
    part = np.minimum((ranks * PARTS).astype(int), PARTS - 1)
    for k, name in enumerate(map(str, inputs.columns)):
        total = np.bincount(part[:, k], minlength=PARTS)
        lost = np.bincount(part[failed, k], minlength=PARTS)
        shares[name] = (lost / np.maximum(total, 1)).tolist()
        place = None
        if inputs.iloc[:, k].nunique() < 2:
            continue
        if abs(means[k] - 0.5) > SURE * noise:
            place = "high" if means[k] > 0.5 else "low"
        elif abs(from_middle[k] - 0.25) > SURE * middle_noise:
            place = "ends" if from_middle[k] > 0.25 else "middle"
        if place:
            where[name] = Place(float(means[k]), place)
    return found


def endings(runs: pd.DataFrame, complete: Collection[str]) -> list[Ending]:
    """Return the outcomes of the runs, the most frequent first.

    Parameters
    ----------
    runs : DataFrame
        With ``status`` and ``reason``.
    complete : collection of str
        Statuses that are no failure.
    """
    found = []
    # A table that was joined with one without reasons has holes.
    known = "reason" in runs.columns
    told = runs["reason"].fillna("") if known else pd.Series("", index=runs.index)
    for status, count in runs["status"].value_counts().items():
        word = str(status)
        reasons = told[(runs["status"] == status) & (told != "")]
        found.append(
            Ending(
                status=word,
                ending="ok" if word in complete else _ENDINGS.get(word, "failed"),
                runs=int(count),
                reason=str(reasons.mode().iloc[0]) if len(reasons) else "",
            )
        )
    return found
