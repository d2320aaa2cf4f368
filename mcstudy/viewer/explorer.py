"""The explorer of a study: parallel coordinates and scatter matrix with linked choices."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcstudy.viewer.packing import Packer, pack_text
from mcstudy.viewer.page import MARK, render_page, viewer_shell

Array = NDArray[np.float64]

MANY, LEVELS, LARGEST = 5000, 32767.0, 1e30
"""Runs from which on values are held to sixteen bits; levels on either side of zero; largest value
for which that is done."""
SHOWN = 6
"""Axes that are shown first."""


@dataclass(frozen=True)
class Column:
    """An input or output: name, label with unit, values (n,)."""

    name: str
    label: str
    values: Array


def _pack(values: Array, packer: Packer) -> dict[str, Any]:
    """Return the place of a column's values: of many runs to sixteen bits, else as they are."""
    finite = np.abs(values[np.isfinite(values)])
    if values.size < MANY or not 0.0 < finite.max(initial=0.0) < LARGEST:
        return packer.add(values)
    return packer.add(values, "i2", float(finite.max()) / LEVELS)


@dataclass(frozen=True)
class Stored:
    """A run that the page shows in three dimensions: number, why it is kept, from ``pack_run``."""

    run: int
    why: str
    packed: Mapping[str, Any]


def render_explorer(
    title: str,
    runs: NDArray[np.int64],
    status: Sequence[str],
    columns: Sequence[Column],
    first: Sequence[str],
    *,
    stored: Sequence[Stored] = (),
    address: str = "",
) -> str:
    """Return an HTML page on which the runs of a study are explored, without a network.

    Parameters
    ----------
    title : str
    runs : (n,) int array
        Number of each run.
    status : sequence of str
        Status of each run.
    columns : sequence of Column
        Inputs and outputs.
    first : sequence of str
        Names of the axes that are shown first, the most important ones in front.
    stored : sequence of Stored
        Runs that the page shows in three dimensions.
    address : str
        Start of the address at which a server shows any run; empty for a file.
    """
    names, codes = np.unique(np.asarray(status, dtype=str), return_inverse=True)
    counts = np.bincount(codes, minlength=names.size)
    shown, packer = list(first)[:SHOWN], Packer()
    table = {
        "runs": packer.add(runs, "u4"),
        "states": packer.add(codes, "u1"),
        "columns": [
            {
                "name": column.name,
                "label": column.label,
                "shown": column.name in shown,
                "values": _pack(column.values, packer),
            }
            for column in sorted(
                columns, key=lambda c: shown.index(c.name) if c.name in shown else SHOWN
            )
        ],
    }
    content = {
        "title": title,
        "address": address,
        "mark": MARK,
        "viewer": pack_text(viewer_shell(title)) if stored and not address else "",
        "stored": [vars(entry) for entry in stored],
        "statuses": [
            {"name": str(name).replace("_", " "), "count": int(k)}
            for name, k in zip(names, counts, strict=True)
        ],
        "table": table | {"data": packer.data()},
    }
    return render_page("explorer", title, content, styles=("viewer.css", "explorer.css"))
