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
from mcstudy.statistics import Described, Distribution, Estimate, varies


@dataclass(frozen=True)
class Mark:
    """A value to mark on an output's axis: value in the output's unit, label, kind."""

    value: float
    label: str
    kind: str

    def shown_with(self, values: np.ndarray) -> str:
        """Return the legend label, which notes a mark too far from the values to be drawn."""
        label = style.safe(self.label)
        if style.is_near(values, self.value):
            return label
        return f"{label}\n({self.value:.3g}, beyond the picture)"


_MARK_STYLE: dict[str, dict[str, Any]] = {
    "observed": {"color": style.RED, "linestyle": "-"},
    "limit": {"color": "black", "linestyle": "--"},
    "simulated": {"color": style.GREEN, "linestyle": ":"},
}


def draw_distributions(
    runs: pd.DataFrame,
    units: Mapping[str, str],
    marks: Mapping[str, Sequence[Mark]],
    described: Mapping[str, Described],
) -> Figure:
    """Return histogram (above) and cumulative share (below) of each output.

    Parameters
    ----------
    runs : DataFrame
    units : mapping
        Outputs to draw and their units.
    marks : mapping
        Values to mark by output.
    described : mapping
        Distribution by output, for the intervals.
    """
    with style.styled():
        figure = style.new_figure(4.4 * len(units), 6.6)
        axes = figure.subplots(2, len(units), squeeze=False, sharex="col")
        for k, (name, unit) in enumerate(units.items()):
            values = runs[name].to_numpy(dtype=float)
            values = values[np.isfinite(values)]
            _histogram(axes[0, k], values, described[name], marks.get(name, ()))
            _cumulative(axes[1, k], values, marks.get(name, ()))
            axes[1, k].set_xlabel(style.label(name, unit))
            axes[0, k].set_title(style.words(name))
            axes[0, k].set_ylabel("")
        axes[0, 0].set_ylabel("runs in the bin [–]")
        axes[1, 0].set_ylabel("share of runs below [–]")
        return figure


def _histogram(axes: Axes, values: np.ndarray, described: Described, marks: Sequence[Mark]) -> None:
    # The outermost 0.2 per cent on either side would compress the rest.
    low = np.quantile(values, 0.002, method="lower")
    high = np.quantile(values, 0.998, method="higher")
    shown = values[(values >= low) & (values <= high)]
    if varies(shown) and isinstance(described, Distribution):
        sns.histplot(x=shown, bins=40, ax=axes, color=style.SKY, edgecolor="white", linewidth=0.3)
        _interval(axes, described.quantiles)
    else:
        share = "all" if shown.size == values.size else f"{shown.size:,} of"
        said = f"{shown[0]:,.4g} in {share} {values.size:,} runs"
        axes.vlines(shown[0], 0.0, shown.size, color=style.SKY, linewidth=4.0, label=said)
        axes.set_ylim(bottom=0.0)
    for mark in marks:
        drawn = {"label": mark.shown_with(shown), "linewidth": 1.6, **_MARK_STYLE[mark.kind]}
        if style.is_near(shown, mark.value):
            axes.axvline(mark.value, **drawn)
        else:
            axes.plot([], [], **drawn)
    ends = style.ends_of(shown, [mark.value for mark in marks], below=0.03, above=0.03)
    axes.set_xlim(*ends)
    room = 1.0 / (1.0 - style.covered(axes, 2.6))
    axes.set_ylim(top=axes.get_ylim()[1] * max(room, 1.45))
    axes.legend(loc="upper right", frameon=True, framealpha=0.9, fontsize=8)


def _interval(axes: Axes, quantiles: Mapping[str, Estimate]) -> None:
    """Draw the central 90 % and the median with its interval."""
    central = (quantiles["0.05"].value, quantiles["0.95"].value)
    axes.axvspan(*central, color=style.BLUE, alpha=0.10, label="central 90 %", zorder=0)
    median = quantiles["0.5"]
    axes.axvline(median.value, color=style.BLUE, label="median, 95 % interval")
    if median.has_interval:
        axes.axvspan(median.low, median.high, color=style.BLUE, alpha=0.35, linewidth=0)


def _cumulative(axes: Axes, values: np.ndarray, marks: Sequence[Mark]) -> None:
    # From one end of the axis to the other, so that a constant output shows its step.
    low, high = axes.get_xlim()
    ordered = np.concatenate([[min(low, values.min())], np.sort(values), [max(high, values.max())]])
    share = np.concatenate([np.arange(values.size + 1) / values.size, [1.0]])
    axes.step(ordered, share, color=style.BLUE, where="post")
    # Dvoretzky-Kiefer-Wolfowitz band: simultaneous for the whole curve.
    band = np.sqrt(np.log(2.0 / 0.05) / (2.0 * values.size))
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
        if low <= mark.value <= high:
            axes.axvline(mark.value, linewidth=1.6, **_MARK_STYLE[mark.kind])
    axes.set_ylim(0.0, 1.0)
