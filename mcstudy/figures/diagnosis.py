"""Figures of a diagnosis: pulses and residuals, location of the misfit, causes, gain."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mcstudy.figures import style
from mcstudy.figures.panels import Band, Curve, Panel, draw_panels

COLOURS = {"base": style.BLUE, "extended": style.RED}
NAMES = {"base": "base model", "extended": "extended model"}
LARGEST = 10.0
"""Standard errors at which the colour scale of a map ends."""
MIN_COUNT = 1e-3


def draw_pulses(curves: Sequence[Mapping[str, Any]], label: str) -> Figure:
    """Return measured and simulated pulses of some tests, with their residuals below.

    Parameters
    ----------
    curves : sequence of mapping
        One a test: time (s), measured, and by model mean, low, high.
    label : str
        Of the channel, with its unit.
    """
    upper, lower = [], []
    for entry in curves:
        time = 1e3 * np.array(entry["time"])
        measured = np.array(entry["measured"])
        title = str(entry["test"])
        if entry.get("impact_speed") is not None:
            title += f", {entry['impact_speed']:.1f} m/s"
        shown = [Curve(time, measured, "measured", "#000000")]
        rest, bands, around = [], [], []
        for key, colour in COLOURS.items():
            if key not in entry:
                continue
            part = {name: np.array(values) for name, values in entry[key].items()}
            shown.append(Curve(time, part["mean"], NAMES[key], colour, "--"))
            bands.append(Band(time, part["low"], part["high"], None, colour))
            rest.append(Curve(time, measured - part["mean"], NAMES[key], colour))
            around.append(
                Band(time, part["low"] - part["mean"], part["high"] - part["mean"], None, colour)
            )
        upper.append(Panel("time [ms]", label, shown, bands, title))
        lower.append(Panel("time [ms]", f"measured - simulated: {label}", rest, around))
    return draw_panels([*upper, *lower], columns=len(upper), width=3.9, height=3.2)


def draw_map(where: Mapping[str, Any], labels: Mapping[str, str], regime: str) -> Figure:
    """Return measured minus simulated, in standard errors, by part of the pulse and group of tests.

    Parameters
    ----------
    where : mapping
        Regions by channel, window and group.
    labels : mapping
        Labels of the channels.
    regime : str
        Label of the input by which the tests are grouped.
    """
    regions = [r for r in where["regions"] if r["channel"] in labels]
    channels = list(dict.fromkeys(r["channel"] for r in regions))
    with style.styled():
        figure = style.new_figure(7.5, 2.2 * len(channels) + 0.5)
        grid = figure.subplots(len(channels), 1, squeeze=False)[:, 0]
        for axes, channel in zip(grid, channels, strict=True):
            own = [r for r in regions if r["channel"] == channel]
            groups = list(dict.fromkeys(r["group"] for r in own))
            groups = [g for g in ("low", "middle", "high", "all") if g in groups]
            table = np.array([[r["z"] for r in own if r["group"] == g] for g in groups])
            edges = [1e3 * r["begin"] for r in own if r["group"] == groups[0]]
            edges.append(1e3 * next(r["end"] for r in reversed(own) if r["group"] == groups[0]))
            rows = np.arange(len(groups) + 1)
            mesh = axes.pcolormesh(edges, rows, table, cmap="PuOr_r", vmin=-LARGEST, vmax=LARGEST)
            for j in range(table.shape[0]):
                for k in range(table.shape[1]):
                    middle = 0.5 * (edges[k] + edges[k + 1])
                    colour = "white" if abs(table[j, k]) > 0.7 * LARGEST else "black"
                    axes.text(middle, j + 0.5, f"{table[j, k]:+.1f}", ha="center", va="center",
                              fontsize=8, color=colour)  # fmt: skip
            names = []
            for group in groups:
                first = next(r for r in own if r["group"] == group)
                names.append(f"{first['low']:.3g} to {first['high']:.3g}")
            axes.set_yticks(rows[:-1] + 0.5, names)
            axes.set(xlabel="time after the start of the pulse [ms]", ylabel=regime,
                     title=style.safe(labels[channel]))  # fmt: skip
            axes.grid(visible=False)
            figure.colorbar(mesh, ax=axes, label="measured minus simulated\n[standard errors]")
        return figure


def draw_evidence(effects: Sequence[Mapping[str, Any]]) -> Figure:
    """Return the log Bayes factors of the causes over the base model."""
    # Causes with less evidence than the base model are cut at the left limit.
    shown = list(effects)[:12]
    with style.styled():
        figure = style.new_figure(7.0, 0.34 * max(len(shown), 3) + 1.2)
        axes = figure.subplots()
        values = [row["log_evidence"] for row in shown]
        colours = [style.RED if k == 0 or row["ambiguous"] else style.GREY
                   for k, row in enumerate(shown)]  # fmt: skip
        places = np.arange(len(shown))
        axes.barh(places, values, color=colours, height=0.65)
        axes.set_yticks(places, [row["name"].replace("_", " ") for row in shown])
        # Bars keep their height when there are fewer than three.
        axes.set_ylim(max(len(shown), 3) - 0.5, -0.5)
        axes.axvline(3.0, color="black", linestyle=":", linewidth=1.0)
        axes.set_xscale("symlog", linthresh=10.0)
        top = max(10.0, 2.0 * max(values))
        axes.set_xlim(-10.0, top)
        ticks = [-10.0, 0.0, *(10.0**k for k in range(1, 8) if 10.0**k <= top)]
        axes.set_xticks(ticks, [f"{tick:,.0f}" for tick in ticks])
        axes.minorticks_off()
        axes.set_xlabel("log Bayes factor over the base model [natural log units]")
        axes.grid(visible=False, axis="y")
        return figure


def draw_gain(gains: Sequence[Mapping[str, Any]], labels: Mapping[str, str]) -> Figure:
    """Return the predictive gain on held-out tests in per cent of the base model's score."""
    shown = [g for g in gains if g["score"] in labels and abs(g["base"]) > MIN_COUNT]
    regions = list(dict.fromkeys(g["region"] for g in shown))
    with style.styled():
        rows = max(len(shown) // max(len(regions), 1), 3)
        figure = style.new_figure(2.9 * max(len(regions), 2) + 1.0, 0.42 * rows + 1.5)
        grid = figure.subplots(1, len(regions), squeeze=False, sharey=True)[0]
        for axes, region in zip(grid, regions, strict=True):
            own = [g for g in shown if g["region"] == region]
            for k, gain in enumerate(own):
                entry = gain["relative"]
                axes.plot([100.0 * entry["low"], 100.0 * entry["high"]], [k, k], color=style.RED)
                axes.plot(100.0 * entry["value"], k, "o", color=style.RED,
                          label="extended model" if k == 0 else None)  # fmt: skip
                process = 100.0 * (1.0 - gain["gaussian_process"] / gain["base"])
                axes.plot(process, k, "s", color=style.BLUE, markerfacecolor="none",
                          label="Gaussian process" if k == 0 else None)  # fmt: skip
            axes.set_yticks(range(len(own)), [labels[g["score"]] for g in own])
            axes.invert_yaxis()
            axes.axvline(0.0, color="black", linewidth=0.8)
            axes.xaxis.set_major_locator(MaxNLocator(5))
            axes.set_title(f"{region} the speeds used")
        figure.supxlabel("improvement over the base model [%]", fontsize="medium")
        handles, names = grid[0].get_legend_handles_labels()
        figure.legend(handles, names, fontsize=8, loc="outside upper right", ncols=2)
        return figure


def draw_conclusions(base: Mapping[str, Any], extended: Mapping[str, Any], label: str) -> Figure:
    """Return exceedance of the output and first-order indices, base against extended model.

    Parameters
    ----------
    base, extended : mapping
        ``values``, ``limit`` (base) and ``drivers`` (value, low, high by input).
    label : str
        Of the output, with its unit.
    """
    with style.styled():
        figure = style.new_figure(9.5, 3.8)
        left, right = figure.subplots(1, 2)
        for key, part in (("base", base), ("extended", extended)):
            values = np.sort(np.array(part["values"]))
            share = 1.0 - np.arange(values.size) / values.size
            left.step(values, share, color=COLOURS[key], label=NAMES[key])
        left.axvline(base["limit"], color="black", linestyle=":",
                     label=f"limit {base['limit']:g}")  # fmt: skip
        left.set(xlabel=label, ylabel="share of impacts above [-]", ylim=(0.0, 1.02))
        left.legend(fontsize=8)
        names = sorted(extended["drivers"], key=lambda n: -extended["drivers"][n]["value"])[:8]
        for k, name in enumerate(names):
            for shift, key, part in ((-0.15, "base", base), (0.15, "extended", extended)):
                entry = part["drivers"].get(name)
                if entry is None:
                    continue
                right.plot([entry["low"], entry["high"]], [k + shift] * 2, color=COLOURS[key])
                right.plot(entry["value"], k + shift, "o", color=COLOURS[key])
        right.set_yticks(range(len(names)), [style.words(n) for n in names])
        right.invert_yaxis()
        right.set_xlabel("first-order index [-]")
        return figure


def draw_scalars(
    rows: Mapping[str, Sequence[Mapping[str, Any]]], labels: Mapping[str, str]
) -> Figure:
    """Return measured against simulated scalars, with bars of two standard errors."""
    names = [name for name in rows if rows[name]]
    with style.styled():
        figure = style.new_figure(4.2 * min(len(names), 3), 3.6 * -(-len(names) // 3))
        grid = figure.subplots(-(-len(names) // 3), min(len(names), 3), squeeze=False)
        for axes in grid.flat[len(names) :]:
            axes.set_visible(False)
        for axes, name in zip(grid.flat, names, strict=False):
            measured = np.array([row["measured"] for row in rows[name]])
            for key, colour in COLOURS.items():
                if key not in rows[name][0]:
                    continue
                x = np.array([row[key] for row in rows[name]])
                spread = 2.0 * np.array([row[f"{key}_sd"] for row in rows[name]])
                axes.errorbar(x, measured, xerr=spread, fmt="o", color=colour, markersize=3.5,
                              elinewidth=0.8, label=NAMES[key])  # fmt: skip
            ends = [measured.min(), measured.max()]
            axes.plot(ends, ends, color="black", linewidth=0.8)
            axes.set(xlabel=f"simulated: {labels[name]}", ylabel=f"measured: {labels[name]}")
            axes.legend(fontsize=8)
        return figure
