"""Ranges of outputs by variant of a model."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mcstudy.figures import style


@dataclass(frozen=True)
class Range:
    """An output of a variant: nominal run, and the smallest, median and largest perturbed one."""

    nominal: float
    low: float
    median: float
    high: float

    def times(self, factor: float) -> "Range":
        """Return the range multiplied by a factor."""
        return Range(*(factor * v for v in (self.nominal, self.low, self.median, self.high)))


def draw_ranges(outputs: Mapping[str, Mapping[str, Range]], *, columns: int = 3) -> Figure:
    """Return the ranges of every output, a panel an output and a row a variant.

    Parameters
    ----------
    outputs : mapping
        Range by variant, by axis label of the output.
    columns : int
        Panels side by side.
    """
    count = len(next(iter(outputs.values())))
    rows = -(-len(outputs) // columns)
    with style.styled():
        figure = style.new_figure(3.6 * columns + 1.2, (0.36 * count + 1.1) * rows + 0.4)
        grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
        for axes in grid.flat[len(outputs) :]:
            axes.set_visible(False)
        for axes, (output, ranges) in zip(grid.flat, outputs.items(), strict=False):
            labels = list(ranges)[::-1]
            for place, entry in enumerate(ranges[label] for label in labels):
                colour = style.PALETTE[(count - 1 - place) % len(style.PALETTE)]
                axes.plot([entry.low, entry.high], [place, place], color=colour, linewidth=5.0,
                          alpha=0.35, solid_capstyle="butt")  # fmt: skip
                axes.plot(entry.median, place, "o", color=colour, markersize=6)
                axes.plot(entry.nominal, place, "|", color="black", markersize=11)
            axes.set_yticks(np.arange(count), [style.safe(label, 26) for label in labels])
            axes.set_ylim(-0.6, count - 0.4)
            axes.xaxis.set_major_locator(MaxNLocator(5))
            axes.set_xlabel(output)
            axes.tick_params(axis="y", length=0)
            axes.grid(visible=False, axis="y")
        axes = grid[0, 0]
        axes.plot([], [], "o", color=style.GREY, label="median of the perturbed runs")
        axes.plot([], [], color=style.GREY, linewidth=5.0, alpha=0.35, label="their range")
        axes.plot([], [], "|", color="black", markersize=11, label="nominal run")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3,
                      fontsize=9)  # fmt: skip
        return figure
