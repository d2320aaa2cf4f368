"""Sensitivity indices: bars with intervals, heat maps, main effects, convergence."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.sensitivity.main_effects import MainEffect
from mcstudy.statistics import Estimate, by_size

Array = NDArray[np.float64]

_SHARE = "share of the variance [–]"


def draw_indices(
    outputs: Mapping[str, tuple[Mapping[str, Estimate], Mapping[str, Estimate]]], dummy: str
) -> Figure:
    """Return first and total indices with intervals, a panel an output.

    Parameters
    ----------
    outputs : mapping
        First-order and total index by factor, by output.
    dummy : str
        Name of the dummy factor; the upper bound of its total index is the noise line.
    """
    count = len(next(iter(outputs.values()))[1])
    with style.styled():
        figure = style.new_figure(4.3 * len(outputs), 0.34 * count + 1.5)
        row = figure.subplots(1, len(outputs), squeeze=False)[0]
        for axes, (name, (first, total)) in zip(row, outputs.items(), strict=True):
            _bars(axes, first, total, dummy)
            axes.set_title(style.words(name))
        handles, labels = row[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), fontsize=9)
        return figure


def _bars(
    axes: Axes, first: Mapping[str, Estimate], total: Mapping[str, Estimate], dummy: str
) -> None:
    order = sorted(total, key=lambda k: np.nan_to_num(total[k].value))
    places = np.arange(len(order))
    for shift, kind, table, colour in (
        (0.19, "first", first, style.BLUE), (-0.19, "total", total, style.ORANGE),
    ):  # fmt: skip
        values, low, high = columns([table[name] for name in order])
        axes.barh(
            places + shift, values, 0.36, color=colour, label=f"{kind} index",
            xerr=np.maximum([values - low, high - values], 0.0),
            error_kw={"elinewidth": 1.0, "capsize": 1.5},
        )  # fmt: skip
    noise = total[dummy].high
    if np.isfinite(noise):
        axes.axvline(noise, color="black", linestyle="--", linewidth=1.0,
                     label="noise line (dummy)")  # fmt: skip
    axes.set_yticks(places, [style.quantity(name) for name in order])
    axes.tick_params(axis="y", length=0)
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.set_xlabel(_SHARE)
    axes.grid(visible=False, axis="y")


def columns(estimates: Sequence[Estimate]) -> tuple[Array, Array, Array]:
    """Return values, lower and upper ends of estimates."""
    table = np.array([(e.value, e.low, e.high) for e in estimates], dtype=float).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


def draw_heatmap(outputs: Mapping[str, Mapping[str, Estimate]]) -> Figure:
    """Return total indices by output and factor; outputs that do not vary are hatched."""
    table = pd.DataFrame(
        {
            name: {factor: total.value for factor, total in totals.items()}
            for name, totals in outputs.items()
        },
        dtype=float,
    ).T
    with style.styled():
        figure = style.new_figure(
            0.62 * table.shape[1] + 3.4,
            # High enough for the label of the colour bar.
            max(0.34 * table.shape[0] + 1.6, 3.6),
        )
        axes = figure.subplots()
        sns.heatmap(
            table.rename(index=style.quantity, columns=style.quantity), ax=axes,
            cmap=sns.light_palette(style.BLUE, as_cmap=True), vmin=0.0, vmax=1.0, annot=True,
            fmt=".2f", annot_kws={"fontsize": 7}, linewidths=0.5,
            cbar_kws={"label": "total index [–]"},
        )  # fmt: skip
        style.mark_missing(axes, table.isna().to_numpy())
        axes.set(xlabel="", ylabel="")
        axes.tick_params(axis="x", rotation=40, length=0)
        axes.tick_params(axis="y", rotation=0, length=0)
        for tick in axes.get_xticklabels():
            tick.set_horizontalalignment("right")
        return figure


def draw_second_order(
    indices: Mapping[str, Estimate], factors: Sequence[str], title: str
) -> Figure:
    """Return the matrix of second-order indices of one output; grey: not distinct from zero.

    Parameters
    ----------
    indices : mapping
        Second-order index by pair of factors ``a x b``.
    factors : sequence of str
        Names of the factors.
    title : str
    """
    size = len(factors)
    values, distinct = np.full((size, size), np.nan), np.zeros((size, size), dtype=bool)
    for i, a in enumerate(factors):
        for j, b in enumerate(factors):
            if i < j:
                index = indices[f"{a} x {b}"]
                values[j, i] = index.value
                distinct[j, i] = index.low > 0.0 or index.high < 0.0
    with style.styled():
        figure = style.new_figure(0.6 * size + 2.6, max(0.42 * size + 1.6, 3.6))
        axes = figure.subplots()
        labels = [style.quantity(name) for name in factors]
        limit = max(0.05, float(np.nanmax(np.abs(values))))
        sns.heatmap(
            pd.DataFrame(np.where(distinct, values, 0.0), index=labels, columns=labels), ax=axes,
            mask=np.isnan(values), cmap=sns.diverging_palette(240, 30, s=85, l=50, as_cmap=True),
            vmin=-limit, vmax=limit, linewidths=0.5, cbar_kws={"label": "second-order index [–]"},
        )  # fmt: skip
        for j, i in zip(*np.nonzero(~np.isnan(values)), strict=True):
            axes.text(
                i + 0.5, j + 0.5, f"{values[j, i]:.2f}", fontsize=7, ha="center", va="center",
                color="black" if distinct[j, i] else style.GREY,
                fontweight="bold" if distinct[j, i] else "normal",
            )  # fmt: skip
        axes.grid(visible=False)
        axes.set(title=title, xlabel="", ylabel="")
        axes.tick_params(axis="x", rotation=40, length=0)
        axes.tick_params(axis="y", length=0)
        for tick in axes.get_xticklabels():
            tick.set_horizontalalignment("right")
        return figure


def draw_main_effects(effects: Mapping[str, MainEffect], ylabel: str) -> Figure:
    """Return conditional mean (with its 95 % interval) and 90 % band of an output by input.

    Parameters
    ----------
    effects : mapping
        Main effect by input.
    ylabel : str
        Label of the output, with its unit.
    """
    columns = min(4, len(effects))
    rows = -(-len(effects) // columns)
    with style.styled():
        figure = style.new_figure(3.0 * columns, 2.4 * rows)
        grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
        for axes in grid.flat[len(effects) :]:
            axes.set_visible(False)
        for axes, (name, entry) in zip(grid.flat, effects.items(), strict=False):
            x, mean, error, low, high = (
                np.asarray(part, dtype=float)
                for part in (entry.x, entry.mean, entry.error, entry.low, entry.high)
            )
            axes.fill_between(x, low, high, color=style.SKY, alpha=0.25, linewidth=0,
                              label="nine runs in ten")  # fmt: skip
            axes.fill_between(x, mean - 1.96 * error, mean + 1.96 * error, color=style.BLUE,
                              alpha=0.35, linewidth=0)  # fmt: skip
            axes.plot(x, mean, color=style.BLUE, label="conditional mean, 95 % interval")
            axes.set_xlabel(style.label(name, entry.unit))
        figure.supylabel(ylabel, fontsize=10)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=min(2, columns),
                      fontsize=9)  # fmt: skip
        return figure


MAX_LINES = 7
"""Number of factors in the convergence figure, the largest."""


def draw_convergence(convergence: Mapping[str, Mapping[int, Mapping[str, Estimate]]]) -> Figure:
    """Return total indices against the number of base points, a panel an output.

    Parameters
    ----------
    convergence : mapping
        Total indices by factor, by output and number of base points in ascending order.
    """
    with style.styled():
        figure = style.new_figure(4.3 * len(convergence), 4.4)
        row = figure.subplots(1, len(convergence), squeeze=False)[0]
        for axes, (name, steps) in zip(row, convergence.items(), strict=True):
            n = np.array(list(steps), dtype=float)
            last = list(steps.values())[-1]
            order = by_size({factor: total.value for factor, total in last.items()})[:MAX_LINES]
            for k, factor in enumerate(order):
                value, low, high = columns([totals[factor] for totals in steps.values()])
                colour = style.PALETTE[k % len(style.PALETTE)]
                axes.fill_between(n, low, high, color=colour, alpha=0.15, linewidth=0)
                axes.plot(n, value, color=colour, marker="o", markersize=3,
                          label=style.quantity(factor))  # fmt: skip
            axes.set_xscale("log", base=2)
            axes.set_xticks(n, [f"{v:.0f}" for v in n])
            axes.minorticks_off()
            axes.set(xlabel="base points [–]", title=style.words(name))
            axes.legend(fontsize=7, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.17))
        row[0].set_ylabel("total index [–]")
        return figure
