"""Waterfall: a value, what adds to it, and the sum."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from mcstudy.figures import style
from mcstudy.statistics import Estimate


def draw_waterfall(
    base: Estimate,
    shares: Mapping[str, Estimate],
    whole: Estimate,
    *,
    label: str,
    ends: tuple[str, str],
) -> Figure:
    """Return the first value, bars that lead from it to the last one, and their intervals.

    The first and the last value are points, as the axis need not begin at zero.

    Parameters
    ----------
    base : Estimate
        First value.
    shares : mapping
        What each change adds, by name.
    whole : Estimate
        Sum of the changes.
    label : str
        Axis label with unit.
    ends : pair of str
        Labels of the first value and of the last.
    """
    names = [ends[0], *shares, ends[1]]
    starts = base.value + np.concatenate([[0.0], np.cumsum([e.value for e in shares.values()])])
    with style.styled():
        figure = style.new_figure(7.0, 0.42 * len(names) + 1.1)
        axes = figure.subplots()
        for k, (start, share) in enumerate(zip(starts, shares.values(), strict=False), start=1):
            colour = style.RED if share.value > 0.0 else style.BLUE
            axes.barh(k, share.value, left=start, color=colour, height=0.6)
            axes.plot([start + share.low, start + share.high], [k, k], color="black", linewidth=1.4)
        ends_at = [base.value, base.value + whole.value]
        axes.plot(ends_at, [0, len(names) - 1], "D", color=style.GREY, markersize=8)
        for k, at in enumerate(starts):
            axes.plot([at, at], [k, k + 1], color="#333333", linewidth=0.8)
        axes.set_yticks(np.arange(len(names)), [style.safe(name, 34) for name in names])
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel(label)
        axes.use_sticky_edges = False
        axes.margins(x=0.06)
        return figure
