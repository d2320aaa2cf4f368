"""Distributions of outputs with intervals, known values and limits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mcstudy.figures import style


@dataclass(frozen=True)
class Mark:
    """A value to mark on an output's axis: value in the output's unit, label, kind."""

    value: float
    label: str
    kind: str


_MARK_STYLE: dict[str, dict[str, Any]] = {
    "observed": {"color": style.RED, "linestyle": "-"},
    "limit": {"color": "black", "linestyle": "--"},
    "simulated": {"color": style.GREEN, "linestyle": ":"},
}


def draw_distributions(
    runs: pd.DataFrame,
    units: Mapping[str, str],
    marks: Mapping[str, Sequence[Mark]],
    analysis: Mapping[str, Any],
) -> Figure:
    """Return histogram (above) and cumulative share (below) of each output.

    Parameters
    ----------
    runs : table of runs. units : outputs to draw and their units.
    marks : values to mark by output. analysis : ``outputs`` of the analysis, for the intervals.
    """
    with style.styled():
        figure = style.new_figure(4.4 * len(units), 6.6)
        axes = figure.subplots(2, len(units), squeeze=False, sharex="col")
        for k, (name, unit) in enumerate(units.items()):
            values = runs[name].to_numpy(dtype=float)
            values = values[np.isfinite(values)]
            _histogram(axes[0, k], values, analysis[name], marks.get(name, ()))
            _cumulative(axes[1, k], values, marks.get(name, ()))
            axes[1, k].set_xlabel(style.label(name, unit))
            axes[0, k].set_title(style.words(name))
            axes[0, k].set_ylabel("")
        axes[0, 0].set_ylabel("runs in the bin [–]")
        axes[1, 0].set_ylabel("share of runs below [–]")
        return figure


def _histogram(
    axes: Axes, values: np.ndarray, analysis: Mapping[str, Any], marks: Sequence[Mark]
) -> None:
    # The last half per cent on either side would squeeze the rest.
    low, high = np.quantile(values, [0.002, 0.998])
    points = [mark.value for mark in marks]
    low, high = min([low, *points]), max([high, *points])
    pad = 0.03 * (high - low)
    shown = values[(values >= low) & (values <= high)]
    sns.histplot(x=shown, bins=40, ax=axes, color=style.SKY, edgecolor="white", linewidth=0.3)
    quantiles = analysis["quantiles"]
    central = (quantiles["0.05"]["value"], quantiles["0.95"]["value"])
    axes.axvspan(*central, color=style.BLUE, alpha=0.10, label="central 90 %", zorder=0)
    median = quantiles["0.5"]
    axes.axvline(median["value"], color=style.BLUE, label="median, 95 % interval")
    if median["low"] is not None and median["high"] is not None:
        axes.axvspan(median["low"], median["high"], color=style.BLUE, alpha=0.35, linewidth=0)
    for mark in marks:
        axes.axvline(mark.value, label=mark.label, linewidth=1.6, **_MARK_STYLE[mark.kind])
    axes.set_xlim(low - pad, high + pad)
    axes.set_ylim(top=axes.get_ylim()[1] * 1.45)
    axes.legend(loc="upper right", frameon=True, framealpha=0.9, fontsize=8)


def _cumulative(axes: Axes, values: np.ndarray, marks: Sequence[Mark]) -> None:
    ordered = np.sort(values)
    share = np.arange(1, ordered.size + 1) / ordered.size
    axes.step(ordered, share, color=style.BLUE, where="post")
    # Dvoretzky-Kiefer-Wolfowitz band: holds for the whole curve at once.
    band = np.sqrt(np.log(2.0 / 0.05) / (2.0 * ordered.size))
    axes.fill_between(
        ordered,
        np.clip(share - band, 0.0, 1.0),
        np.clip(share + band, 0.0, 1.0),
        step="post",
        color=style.BLUE,
        alpha=0.2,
        linewidth=0,
    )
    for mark in marks:
        axes.axvline(mark.value, linewidth=1.6, **_MARK_STYLE[mark.kind])
    axes.set_ylim(0.0, 1.0)
