"""Failed runs: their number and their location in the input space."""

from collections.abc import Collection
from typing import Any

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


def locate_failures(inputs: pd.DataFrame, failed: Flags, block: int = 1) -> dict[str, Any]:
    """Return number and location of the failed runs.

    Parameters
    ----------
    inputs : (n, d) DataFrame
        Sampled inputs.
    failed : (n,) array of bool
    block : int
        Rows that belong together, such as a base point's; they count as one in the test of
        uniformity.

    Returns
    -------
    dict
        ``runs``, ``share``, ``blocks`` (blocks with a failed run), ``map`` (share of failed runs in
        each tenth of each input) and ``where``: for inputs along which failures are unevenly
        distributed, their mean rank, 0 lowest to 1 highest, and whether they lie ``low``, ``high``,
        at both ``ends`` or in the ``middle``.
    """
    n = len(inputs)
    count = int(failed.sum())
    blocks = np.arange(n) // block
    hit = np.unique(blocks[failed])
    entry: dict[str, Any] = {
        "runs": count,
        "share": count / n if n else 0.0,
        "blocks": int(hit.size),
        "where": {},
        "map": {},
    }
    if not count:
        return entry
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
        entry["map"][name] = (lost / np.maximum(total, 1)).tolist()
        place = None
        if inputs.iloc[:, k].nunique() < 2:
            continue
        if abs(means[k] - 0.5) > SURE * noise:
            place = "high" if means[k] > 0.5 else "low"
        elif abs(from_middle[k] - 0.25) > SURE * middle_noise:
            place = "ends" if from_middle[k] > 0.25 else "middle"
        if place:
            entry["where"][name] = {"mean_rank": float(means[k]), "place": place}
    return entry


def endings(runs: pd.DataFrame, complete: Collection[str]) -> list[dict[str, Any]]:
    """Return the outcomes of the runs, the most frequent first.

    Parameters
    ----------
    runs : DataFrame
        With ``status`` and ``reason``.
    complete : collection of str
        Statuses that are no failure.

    Returns
    -------
    list of dict
        ``status``, ``ending`` (ok, failed, invalid, timeout or crashed), ``runs`` and the most
        frequent ``reason``, empty where none was recorded.
    """
    found = []
    told = runs["reason"] if "reason" in runs.columns else pd.Series("", index=runs.index)
    for status, count in runs["status"].value_counts().items():
        word = str(status)
        reasons = told[(runs["status"] == status) & (told != "")]
        found.append(
            {
                "status": word,
                "ending": "ok" if word in complete else _ENDINGS.get(word, "failed"),
                "runs": int(count),
                "reason": str(reasons.mode().iloc[0]) if len(reasons) else "",
            }
        )
    return found
