"""Figures of a posterior: densities, intervals by evidence, ranks, contours."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import stats

from mcstudy.figures import style
from mcstudy.figures.panels import Band, Curve, Panel, draw_panels
from mcstudy.posterior.contours import Family

Array = NDArray[np.float64]

NAMES = {
    "prior": ("before the evidence", style.GREY, ":"),
    "posterior": ("given the evidence", style.BLUE, "-"),
    "plain": ("the same without model errors", style.ORANGE, "--"),
}
"""Label, colour and line of each density."""


def draw_densities(
    curves: Mapping[str, Sequence[float]], label: str, unit: str, interval: tuple[float, float]
) -> Figure:
    """Return prior and posterior densities.

    Parameters
    ----------
    curves : mapping
        Densities by name, and their ``grid``.
    label, unit : str
        Axis label with unit, and that unit.
    interval : pair of float
        Central 95 % interval of the posterior, which is shaded.
    """
    grid = np.array(curves["grid"])
    lines = [
        Curve(grid, np.array(curves[name]), words, colour=colour, line=line)
        for name, (words, colour, line) in NAMES.items()
    ]
    inside = (grid >= interval[0]) & (grid <= interval[1])
    height = np.array(curves["posterior"])[inside]
    band = Band(grid[inside], np.zeros(height.size), height, "95 % interval", colour=style.BLUE)
    return draw_panels(
        [Panel(label, f"density [1/({unit})]", lines, [band], ylim=(0.0, None),
               legend="upper right")],
        width=6.4, height=3.8,
    )  # fmt: skip


def draw_forest(
    rows: Mapping[str, tuple[float, tuple[float, float], tuple[float, float]]], label: str
) -> Figure:
    """Return medians with 50 and 90 % intervals, a row each, the first one marked by a line.

    Parameters
    ----------
    rows : mapping
        Median, 50 % and 90 % interval by label.
    label : str
        Axis label with unit.
    """
    with style.styled():
        figure = style.new_figure(7.0, 0.34 * len(rows) + 1.0)
        axes = figure.subplots()
        for k, (median, inner, outer) in enumerate(rows.values()):
            axes.plot(outer, [k, k], color=style.BLUE, linewidth=1.6)
            axes.plot(inner, [k, k], color=style.BLUE, linewidth=5.0, solid_capstyle="butt")
            axes.plot(median, k, "o", color="white", markeredgecolor="black", markersize=5)
        first = next(iter(rows.values()))
        axes.axvspan(*first[2], color=style.GREY, alpha=0.12, linewidth=0)
        axes.set_yticks(np.arange(len(rows)), [style.safe(name, 44) for name in rows])
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel(label)
        return figure


def draw_ranks(counts: Sequence[int]) -> Figure:
    """Return the ranks of the runs left out, with the band that 95 % of the bars keep to.

    Parameters
    ----------
    counts : sequence of int
        Runs by equal parts of the rank.
    """
    total, bins = sum(counts), len(counts)
    low, high = stats.binom(total, 1.0 / bins).ppf([0.025, 0.975])
    with style.styled():
        figure = style.new_figure(6.4, 3.2)
        axes = figure.subplots()
        places = (np.arange(bins) + 0.5) / bins
        axes.axhspan(low, high, color=style.GREY, alpha=0.2, linewidth=0,
                     label="95 % of uniform ranks")  # fmt: skip
        axes.bar(places, counts, width=0.9 / bins, color=style.BLUE)
        axes.set(xlabel="rank of the true value in its posterior [–]", ylabel="runs left out")
        axes.set_xlim(0.0, 1.0)
        axes.set_ylim(0.0, 1.25 * max(max(counts), high))
        axes.legend(loc="upper right")
        return figure


def draw_contours(families: Sequence[Family], xlabel: str, ylabel: str) -> Figure:
    """Return families of curves with bands.

    Parameters
    ----------
    families : sequence of Family
    xlabel, ylabel : str
        Axis labels with units.
    """
    curves, bands = [], []
    for family, colour in zip(families, style.PALETTE, strict=False):
        x = np.array(family.x)
        curves.append(Curve(x, np.array(family.middle), family.label, colour=colour))
        bands.append(Band(x, np.array(family.low), np.array(family.high), colour=colour))
    panel = Panel(xlabel, ylabel, curves, bands, ylim=(0.0, None), legend="upper left")
    return draw_panels([panel], width=6.8, height=4.4)
