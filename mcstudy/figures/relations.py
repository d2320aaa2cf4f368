"""Associations of outputs with inputs and with each other."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mcstudy.figures import style
from mcstudy.figures.distributions import Mark
from mcstudy.statistics import Step, varies


def draw_correlations(correlations: pd.DataFrame, noise: float) -> Figure:
    """Return a heat map of rank correlations, inputs by outputs.

    Parameters
    ----------
    correlations : DataFrame
        Rows inputs, columns outputs, NaN where undefined.
    noise : float
        Largest absolute rho of 95 % of unrelated inputs; smaller ones are printed grey.
    """
    with style.styled():
        figure = style.new_figure(
            # High enough for the label of the colour bar.
            1.35 * len(correlations.columns) + 2.6,
            max(0.36 * len(correlations) + 1.6, 3.2),
        )
        axes = figure.subplots()
        values = correlations.to_numpy(dtype=float)
        sns.heatmap(
            correlations.astype(float).rename(index=style.quantity, columns=style.quantity),
            ax=axes,
            cmap=sns.diverging_palette(240, 30, s=85, l=50, as_cmap=True),
            vmin=-1.0,
            vmax=1.0,
            linewidths=0.5,
            annot=True,
            fmt=".2f",
            annot_kws={"fontsize": 8},
            cbar_kws={"label": "Spearman rank correlation [–]"},
        )
        for text, value in zip(axes.texts, values[np.isfinite(values)], strict=True):
            if abs(value) < noise:
                text.set_color("#A0A0A0")
        style.mark_missing(axes, np.isnan(values))
        axes.set(xlabel="", ylabel="")
        axes.tick_params(axis="x", rotation=35, length=0)
        axes.tick_params(axis="y", rotation=0, length=0)
        for tick in axes.get_xticklabels():
            tick.set_horizontalalignment("right")
        return figure


def draw_against_input(
    runs: pd.DataFrame,
    column: str,
    input_label: str,
    units: Mapping[str, str],
    marks: Mapping[str, Sequence[Mark]],
) -> Figure:
    """Return each output against one input, with the running median and 90 % band.

    Parameters
    ----------
    runs : DataFrame
    column : str
        Name of the input.
    input_label : str
        Axis label, with unit.
    units : mapping
        Outputs to draw and their units.
    marks : mapping
        Values to mark by output.
    """
    with style.styled():
        figure = style.new_figure(4.4 * len(units), 3.8)
        row = figure.subplots(1, len(units), squeeze=False)[0]
        for axes, (name, unit) in zip(row, units.items(), strict=True):
            part = runs[[column, name]].dropna()
            axes.scatter(part[column], part[name], s=6, color=style.SKY, alpha=0.45, linewidths=0)
            _band(axes, part[column].to_numpy(), part[name].to_numpy())
            outputs = part[name].to_numpy(dtype=float)
            shown = outputs[outputs <= np.quantile(outputs, 0.998, method="higher")]
            points = [mark.value for mark in marks.get(name, ())]
            for mark in marks.get(name, ()):
                colour = {"observed": style.RED, "limit": "black"}.get(mark.kind, style.GREEN)
                axes.axhline(
                    mark.value, color=colour, linewidth=1.3, label=mark.shown_with(shown),
                    linestyle="--",
                )  # fmt: skip
            room = 1.0 / (1.0 - style.covered(axes, 3.0)) - 1.0
            axes.set_ylim(*style.ends_of(shown, points, above=max(room, 0.3)))
            axes.set(xlabel=input_label, ylabel=style.label(name, unit))
            if axes.get_legend_handles_labels()[0]:
                axes.legend(loc="upper left", fontsize=8, framealpha=0.9)
        return figure


def _band(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    edges = np.quantile(x, np.linspace(0.0, 1.0, 13))
    middle: list[float] = []
    low: list[float] = []
    centre: list[float] = []
    high: list[float] = []
    for a, b in pairwise(edges):
        inside = (x >= a) & (x <= b)
        if inside.sum() >= 10:
            middle.append(float(np.median(x[inside])))
            for into, p in ((low, 0.05), (centre, 0.5), (high, 0.95)):
                into.append(float(np.quantile(y[inside], p)))
    if not middle:
        return
    axes.plot(middle, centre, color=style.BLUE, label="running median")
    axes.fill_between(
        middle, low, high, color=style.BLUE, alpha=0.18, linewidth=0, label="5 to 95 %"
    )


def draw_joint(
    runs: pd.DataFrame, first: tuple[str, str], second: tuple[str, str], point: Mapping[str, float]
) -> Figure:
    """Return two outputs against each other with density contours and the accident's values.

    Parameters
    ----------
    runs : DataFrame
    first, second : (str, str)
        Name and unit of an output.
    point : mapping
        Values of the accident by output, may be empty.
    """
    with style.styled():
        figure = style.new_figure(5.4, 4.4)
        axes = figure.subplots()
        part = runs[[first[0], second[0]]].dropna()
        axes.scatter(
            part[first[0]],
            part[second[0]],
            s=7,
            color=style.SKY,
            alpha=0.5,
            linewidths=0,
            label="runs",
        )
        if len(part) > 50 and _spreads(part.to_numpy(dtype=float)):
            sns.kdeplot(
                data=part, x=first[0], y=second[0], ax=axes, levels=[0.1, 0.5], color=style.BLUE,
                linewidths=1.3,
            )  # fmt: skip
            axes.plot([], [], color=style.BLUE, label="50 % and 90 % of the runs inside")
        if first[0] in point and second[0] in point:
            axes.scatter(
                point[first[0]], point[second[0]], marker="X", s=110, color=style.RED,
                edgecolors="white", label="accident", zorder=5,
            )  # fmt: skip
        axes.set(xlabel=style.label(*first), ylabel=style.label(*second))
        held = part[second[0]].to_numpy(dtype=float)
        axes.set_ylim(*style.ends_of(held, [point[k] for k in (second[0],) if k in point],
                                     above=0.22))  # fmt: skip
        axes.legend(loc="upper left", fontsize=8, framealpha=0.9)
        return figure


def _spreads(pair: np.ndarray) -> bool:
    """Return whether points spread in two dimensions, not along a line or at one point."""
    if not (varies(pair[:, 0]) and varies(pair[:, 1])):
        return False
    return bool(abs(np.corrcoef(pair.T)[0, 1]) < 1.0 - 1e-9)


def draw_convergence(tables: Mapping[str, Sequence[Step]], units: Mapping[str, str]) -> Figure:
    """Return the medians of each output over growing parts of the study.

    Parameters
    ----------
    tables : mapping
        Median of each part by output, at least one output.
    units : mapping
        Units by output.
    """
    with style.styled():
        figure = style.new_figure(4.4 * len(tables), 2.9)
        row = figure.subplots(1, len(tables), squeeze=False)[0]
        for axes, (name, table) in zip(row, tables.items(), strict=True):
            n = [entry.n for entry in table]
            values = [entry.value for entry in table]
            axes.plot(n, values, "o-", color=style.BLUE)
            axes.set_ylim(*style.ends_of(values))
            axes.set_xscale("log", base=2)
            axes.set_xticks(n, [f"{int(k)}" for k in n])
            axes.minorticks_off()
            axes.set(xlabel="runs [–]", ylabel="median " + style.label(name, units[name]))
        return figure
