"""The explorer of a study: parallel coordinates and scatter matrix with linked choices."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.viewer.content import pack_array
from mcstudy.viewer.page import render_page

Array = NDArray[np.float64]

SHOWN = 6
"""Axes that are shown first."""


@dataclass(frozen=True)
class Column:
    """An input or output: name, label with unit, values (n,)."""

    name: str
    label: str
    values: Array


def render_explorer(
    title: str,
    runs: NDArray[np.int64],
    status: Sequence[str],
    columns: Sequence[Column],
    first: Sequence[str],
    *,
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
    address : str
        Start of the address at which a server shows a run; empty for a file.
    """
    names, codes = np.unique(np.asarray(status, dtype=str), return_inverse=True)
    counts = np.bincount(codes, minlength=names.size)
    shown = list(first)[:SHOWN]
    content = {
        "title": title,
        "address": address,
        "runs": pack_array(runs, "<u4"),
        "states": pack_array(codes, "<u1"),
        "statuses": [
            {"name": str(name).replace("_", " "), "count": int(k)}
            for name, k in zip(names, counts, strict=True)
        ],
        "columns": [
            {
                "name": column.name,
                "label": column.label,
                "shown": column.name in shown,
                "values": pack_array(column.values),
            }
            for column in sorted(
                columns, key=lambda c: shown.index(c.name) if c.name in shown else SHOWN
            )
        ],
    }
    return render_page("explorer", title, content, styles=("viewer.css", "explorer.css"))
