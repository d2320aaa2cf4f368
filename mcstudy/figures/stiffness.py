"""Force against penetration: measured loops, fitted curves, corridors and the resulting HIC15."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcstudy.figures import style

Array = NDArray[np.float64]

_MEASURED = "#B5B5B5"
_AXES = {"xlabel": "penetration [mm]", "ylabel": "force [kN]"}


def draw_force_penetration(loops: Mapping[str, tuple[Array, Array]]) -> Figure:
    """Return loops of penetration (m) and force (N) by legend label."""
    with style.styled():
        figure = style.new_figure(5.2, 3.6)
        axes = figure.subplots()
        for k, (name, (depth, force)) in enumerate(loops.items()):
            axes.plot(1e3 * depth, force / 1e3, label=style.safe(name),
                      color=style.PALETTE[k % 8])  # fmt: skip
        axes.set(**_AXES, xlim=(0.0, None), ylim=(0.0, None))
        if len(loops) > 1:
            axes.legend(framealpha=0.9)
        return figure


@dataclass(frozen=True)
class FittedLoop:
    """A measured loop and its fitted curve: m and N."""

    name: str
    depth: Array
    force: Array
    knots: Array
    fitted: Array
    low: Array
    high: Array
    permanent: float


ENTRY = 1.75
"""Width of a legend entry, inches."""
MAX_PANELS = 12
"""Largest number of tests with a panel."""


def _panels(count: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with a panel for each of ``count`` tests, up to twelve."""
    shown = min(count, MAX_PANELS)
    columns = min(3, shown)
    rows = -(-shown // columns)
    figure = style.new_figure(width * columns, height * rows)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in grid.flat[shown:]:
        axes.set_visible(False)
    for axes in grid[:, 1:].flat:
        axes.tick_params(labelleft=False)
    return figure, list(grid.flat[:shown])


def draw_fits(loops: Sequence[FittedLoop]) -> Figure:
    """Return measured loops with fitted loading curves, intervals and unloading lines."""
    with style.styled():
        figure, panels = _panels(len(loops), 3.5, 2.7)
        for axes, loop in zip(panels, loops, strict=False):
            axes.plot(1e3 * loop.depth, loop.force / 1e3, color=_MEASURED, linewidth=3.0,
                      label="measured")  # fmt: skip
            axes.errorbar(
                1e3 * loop.knots, loop.fitted / 1e3,
                yerr=np.maximum([loop.fitted - loop.low, loop.high - loop.fitted], 0.0) / 1e3,
                color=style.BLUE, capsize=2.5, marker="o", markersize=3.5,
                label="fitted, 95 % interval",
            )  # fmt: skip
            axes.plot([1e3 * loop.knots[-1], 1e3 * loop.permanent], [loop.fitted[-1] / 1e3, 0.0],
                      color=style.ORANGE, linestyle="--", label="unloading")  # fmt: skip
            axes.set_title(style.safe(loop.name, 36))
        _label_outer(panels, **_AXES)
        panels[0].set(xlim=(0.0, None), ylim=(0.0, None))
        _legend_above(figure, panels[0])
        return figure


def draw_residuals(loops: Sequence[FittedLoop]) -> Figure:
    """Return measured minus fitted force of the loading parts against penetration."""
    with style.styled():
        figure = style.new_figure(6.4, 3.2)
        axes = figure.subplots()
        for k, loop in enumerate(loops):
            end = int(np.argmax(loop.depth)) + 1
            gap = loop.force[:end] - np.interp(loop.depth[:end], loop.knots, loop.fitted)
            axes.plot(1e3 * loop.depth[:end], gap, color=style.PALETTE[k % 8], linewidth=1.0,
                      label=style.safe(loop.name) if len(loops) <= 8 else None)  # fmt: skip
        axes.axhline(0.0, color="black", linewidth=0.8)
        axes.set(xlabel="penetration [mm]", ylabel="measured minus fitted force [N]")
        if len(loops) <= 8:
            axes.legend(fontsize=8, ncols=2, framealpha=0.9)
        return figure


def draw_pulses(pulses: Mapping[str, tuple[Array, Array, Array]]) -> Figure:
    """Return time (s), measured and simulated acceleration (g) by test."""
    with style.styled():
        figure, panels = _panels(len(pulses), 3.5, 2.5)
        for axes, (name, (time, measured, simulated)) in zip(panels, pulses.items(), strict=False):
            axes.plot(1e3 * time, measured, color=_MEASURED, linewidth=3.0, label="measured")
            axes.plot(1e3 * time, simulated, color=style.RED, linestyle="--", label="simulated")
            axes.set_title(style.safe(name, 36))
        _label_outer(panels, xlabel="time after contact [ms]", ylabel="acceleration [g]")
        _legend_above(figure, panels[0])
        return figure


def draw_corridor(
    corridor: Mapping[str, tuple[Array, Array]],
    curves: Sequence[tuple[Array, Array]],
    coordinates: Array,
    hic: Mapping[str, Array],
) -> Figure:
    """Return a stiffness corridor and the resulting HIC15.

    Parameters
    ----------
    corridor : mapping
        Penetration (m) and force (N) of ``lower``, ``median``, ``upper``.
    curves : sequence of (penetration, force)
        Of single tests (m, N), may be empty.
    coordinates : (k,) array
        Of the corridor, 0 to 1.
    hic : mapping
        HIC15 (k,) by label.
    """
    with style.styled():
        figure = style.new_figure(9.2, 3.7)
        left, right = figure.subplots(1, 2)
        (depth, lower), (_, upper) = corridor["lower"], corridor["upper"]
        knots = np.union1d(depth, corridor["upper"][0])
        left.fill_between(
            1e3 * knots, np.interp(knots, depth, lower) / 1e3,
            np.interp(knots, corridor["upper"][0], upper) / 1e3,
            color=style.BLUE, alpha=0.18, linewidth=0, label="lower to upper",
        )  # fmt: skip
        for k, (d, f) in enumerate(curves):
            left.plot(1e3 * d, f / 1e3, color=style.GREY, linewidth=0.8,
                      label="tests" if k == 0 else None)  # fmt: skip
        left.plot(1e3 * corridor["median"][0], corridor["median"][1] / 1e3, color=style.BLUE,
                  label="median")  # fmt: skip
        left.set(**_AXES, xlim=(0.0, None), ylim=(0.0, None), title="stiffness corridor")
        left.legend(framealpha=0.9, loc="upper left")
        for k, (name, values) in enumerate(hic.items()):
            right.plot(coordinates, values, label=style.safe(name), color=style.PALETTE[k % 8])
        for limit, word in ((700.0, "HIC15 700"), (1000.0, "HIC15 1000")):
            right.axhline(limit, color="black", linestyle="--" if limit < 900 else ":",
                          linewidth=1.0, label=word)  # fmt: skip
        right.set(xlabel="corridor coordinate, 0 lower to 1 upper [–]", ylabel="HIC15 [–]",
                  xlim=(0.0, 1.0), ylim=(0.0, None), title="HIC corridor")  # fmt: skip
        right.set_ylim(top=1.4 * right.get_ylim()[1])
        right.legend(framealpha=0.9, loc="upper left", ncols=2, fontsize=8)
        return figure


def _label_outer(panels: Sequence[Axes], xlabel: str, ylabel: str) -> None:
    """Label the left and the lowest panel of each column."""
    columns = min(3, len(panels))
    for k, axes in enumerate(panels):
        if k % columns == 0:
            axes.set_ylabel(ylabel)
        if k + columns >= len(panels):
            axes.set_xlabel(xlabel)
            axes.tick_params(labelbottom=True)


def _legend_above(figure: Figure, axes: Axes) -> None:
    """Put the legend of one panel above all of them."""
    handles, labels = axes.get_legend_handles_labels()
    columns = max(1, min(len(labels), int(figure.get_figwidth() / ENTRY)))
    figure.legend(handles, labels, loc="outside upper center", ncols=columns, fontsize=9)
