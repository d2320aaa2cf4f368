"""Panels of curves, bands and points: simulations beside references."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter
from numpy.typing import NDArray

from mcstudy.figures import style

Array = NDArray[np.float64]
Legend = Literal["best", "upper left", "upper right", "lower left", "lower right"]


@dataclass(frozen=True)
class Curve:
    """A line, or points if ``marker`` is given and ``line`` is empty."""

    x: Array
    y: Array
    label: str | None = None
    colour: str = style.BLUE
    line: str = "-"
    marker: str = ""


@dataclass(frozen=True)
class Band:
    """A band between ``low`` and ``high`` over ``x``."""

    x: Array
    low: Array
    high: Array
    label: str | None = None
    colour: str = style.GREY


@dataclass(frozen=True)
class Panel:
    """One pair of axes: labels with units, curves, bands, optional limits."""

    xlabel: str
    ylabel: str
    curves: Sequence[Curve]
    bands: Sequence[Band] = field(default_factory=tuple)
    title: str = ""
    xlim: tuple[float | None, float | None] | None = None
    ylim: tuple[float | None, float | None] | None = None
    legend: Legend = "best"


def draw_panels(
    panels: Sequence[Panel], *, columns: int = 2, width: float = 4.8, height: float = 3.6
) -> Figure:
    """Return a figure of panels.

    Parameters
    ----------
    panels : sequence of Panel
    columns : int
        Panels in a row.
    width, height : float
        Size of a panel, inches.
    """
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    with style.styled():
        figure = style.new_figure(width * columns, height * rows)
        grid = figure.subplots(rows, columns, squeeze=False)
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        for axes, panel in zip(grid.flat, panels, strict=False):
            _draw(axes, panel)
        return figure


def use_log_scale(axes: Axes, which: Literal["x", "y"]) -> None:
    """Give axes a logarithmic scale along x or y with ticks in plain numbers.

    The style does not parse dollar signs, so powers of ten would be printed as source text.
    """
    axes.set(**{f"{which}scale": "log"})
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _draw(axes: Axes, panel: Panel) -> None:
    for band in panel.bands:
        axes.fill_between(
            band.x, band.low, band.high, color=band.colour, alpha=0.2, linewidth=0,
            label=_label(band),
        )  # fmt: skip
    for curve in panel.curves:
        axes.plot(
            curve.x, curve.y, color=curve.colour, linestyle=curve.line or "none",
            marker=curve.marker or None, markersize=3.5, label=_label(curve),
        )  # fmt: skip
    axes.set(xlabel=panel.xlabel, ylabel=panel.ylabel)
    axes.set_title(style.safe(panel.title) if panel.title else "")
    if panel.xlim is not None:
        axes.set_xlim(*panel.xlim)
    if panel.ylim is not None:
        axes.set_ylim(*panel.ylim)
    labels = [curve.label for curve in panel.curves] + [band.label for band in panel.bands]
    if any(labels):
        axes.legend(fontsize=8, framealpha=0.9, loc=panel.legend)


def _label(drawn: Curve | Band) -> str | None:
    """Return the legend label of a curve or band, if any."""
    return style.safe(drawn.label) if drawn.label else None
