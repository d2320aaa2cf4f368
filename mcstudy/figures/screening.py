"""Rankings of many inputs: elementary effects and given-data measures."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.figures.sensitivity import columns
from mcstudy.statistics import Estimate, by_size

Array = NDArray[np.float64]

NAMED = 8
"""Number of factors labelled in the scatter plot of elementary effects, the largest."""


@dataclass(frozen=True)
class Ranked(Estimate):
    """An estimate and whether it is above the noise line."""

    clear: bool


def draw_mean_effects(
    outputs: Mapping[str, tuple[str, Mapping[str, Ranked]]], dummy: str
) -> Figure:
    """Return mu* of the elementary effects of each factor, a panel an output.

    Parameters
    ----------
    outputs : mapping
        Unit and mu* by factor, by output.
    dummy : str
        Name of the dummy factor.
    """
    count = len(next(iter(outputs.values()))[1])
    with style.styled():
        figure = style.new_figure(4.3 * len(outputs), 0.3 * count + 1.4)
        row = figure.subplots(1, len(outputs), squeeze=False)[0]
        for axes, (name, (unit, table)) in zip(row, outputs.items(), strict=True):
            draw_ranking(axes, {k: v for k, v in table.items() if k != dummy}, table[dummy].high)
            axes.set_xlabel(style.label("mean size of effect μ*", unit))
            axes.set_title(style.words(name))
        handles, labels = row[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=9)
        return figure


def draw_ranking(axes: Axes, table: Mapping[str, Ranked], noise: float) -> None:
    """Draw bars with intervals in descending order, grey where not above the noise line.

    Parameters
    ----------
    axes : Axes
    table : mapping
        Estimate by name.
    noise : float
        Noise line, from the dummy.
    """
    order = sorted(table, key=lambda name: table[name].value)
    values, low, high = columns([table[name] for name in order])
    places = np.arange(len(order))
    colours = [style.BLUE if table[name].clear else style.GREY for name in order]
    axes.barh(
        places, values, 0.7, color=colours, xerr=np.maximum([values - low, high - values], 0.0),
        error_kw={"elinewidth": 1.0, "capsize": 1.5},
    )  # fmt: skip
    axes.axvline(noise, color="black", linestyle="--", linewidth=1.0, label="noise line (dummy)")
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.set_yticks(places, [style.quantity(name) for name in order])
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=False, axis="y")


def draw_elementary_effects(
    outputs: Mapping[str, tuple[str, Mapping[str, tuple[float, float]]]],
) -> Figure:
    """Return sigma against mu* of the elementary effects, a panel an output.

    Parameters
    ----------
    outputs : mapping
        Unit, and mu* and sigma by factor, by output.
    """
    with style.styled():
        figure = style.new_figure(4.3 * len(outputs), 3.9)
        row = figure.subplots(1, len(outputs), squeeze=False)[0]
        for axes, (name, (unit, effects)) in zip(row, outputs.items(), strict=True):
            table = {k: pair for k, pair in effects.items() if np.isfinite(pair[1])}
            order = by_size({key: pair[0] for key, pair in table.items()})
            size, spread = np.array([table[key] for key in order], dtype=float).reshape(-1, 2).T
            top = 1.08 * float(max(size.max(), spread.max(), 1e-300))
            for slope, dash in ((0.1, ":"), (0.5, "--"), (1.0, "-")):
                axes.plot([0.0, top], [0.0, slope * top], color=style.GREY, linestyle=dash,
                          linewidth=0.9, label=f"σ = {slope:g} μ*")  # fmt: skip
            axes.scatter(size, spread, s=22, color=style.BLUE, zorder=3)
            named = min(NAMED, len(order))
            heights = _spread_labels(size[:named], spread[:named], 0.4 * top, 0.05 * top)
            for k in range(named):
                axes.annotate(
                    style.quantity(order[k]), (size[k], spread[k]), fontsize=7, va="center",
                    xytext=(size[k] + 0.025 * top, heights[k]),
                )  # fmt: skip
            axes.set(xlim=(0.0, 1.3 * top), ylim=(0.0, 1.05 * top), title=style.words(name))
            axes.set_xlabel(style.label("mean size of effect μ*", unit))
            axes.set_ylabel(style.label("scatter of effect σ", unit))
        handles, labels = row[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3, fontsize=9)
        return figure


def _spread_labels(x: Array, y: Array, width: float, gap: float) -> Array:
    """Return heights of labels at (x, y), moved up where they would overlap."""
    placed = np.array(y)
    order = np.argsort(y)
    for k, index in enumerate(order):
        for below in order[:k]:
            near = abs(x[index] - x[below]) < width
            if near and placed[index] < placed[below] + gap:
                placed[index] = placed[below] + gap
    return placed


def draw_given_data(
    measures: Mapping[str, tuple[Mapping[str, Ranked], float]], titles: Mapping[str, str]
) -> Figure:
    """Return the rankings of one output by several measures, a panel a measure.

    Parameters
    ----------
    measures : mapping
        Estimate by input, and noise line, by measure.
    titles : mapping
        Axis label by measure.
    """
    count = len(next(iter(measures.values()))[0])
    with style.styled():
        figure = style.new_figure(4.3 * len(measures), 0.3 * count + 1.4)
        row = figure.subplots(1, len(measures), squeeze=False)[0]
        for axes, (name, (table, noise)) in zip(row, measures.items(), strict=True):
            draw_ranking(axes, table, noise)
            axes.set_xlabel(titles[name])
        handles, labels = row[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=9)
        return figure
