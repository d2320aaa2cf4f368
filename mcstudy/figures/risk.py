"""Figures of injury risk: against a stimulus, with bands, cases and levels."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.injury.risk_curve import RiskDescription, Rug
from mcstudy.statistics import Estimate

Array = NDArray[np.float64]

DASHES = ("--", ":", "-.", (0, (6, 2, 1, 2, 1, 2)), (0, (1, 4)))
"""Line styles of published curves, all grey."""
LEVEL_COLOURS = ("#56B4E9", "#009E73", "#E69F00", "#D55E00", "#CC79A7", "#000000")
"""Colours of AIS1 to AIS6, from Okabe and Ito's palette."""


def draw_risk_curve(found: RiskDescription, xlabel: str, title: str) -> Figure:
    """Return a fitted risk curve with band, cases, Turnbull's estimate, lines at 5, 25, 50 %.

    Parameters
    ----------
    found : RiskDescription
        From ``mcstudy.injury.risk_curve.describe_risk``.
    xlabel : str
        Stimulus and unit.
    title : str
        Injury.
    """
    with style.styled():
        figure = style.new_figure(7.6, 4.8)
        axes = figure.subplots()
        curve = found.curve
        x = np.array(curve.stimulus, dtype=float)
        axes.fill_between(x, np.array(curve.low), np.array(curve.high), color=style.BLUE,
                          alpha=0.18, linewidth=0, label="95 % band")  # fmt: skip
        axes.plot(x, np.array(curve.risk), color=style.BLUE, linewidth=1.8,
                  label=found.family)  # fmt: skip
        axes.plot(found.turnbull.stimulus, found.turnbull.risk, color=style.GREY, linewidth=1.0,
                  linestyle="--", label="without a family (Turnbull)")  # fmt: skip
        _draw_lines(axes, found.at)
        _draw_rug(axes, found.rug)
        axes.set(xlim=(0.0, float(x[-1])), ylim=(-0.06, 1.06), title=style.safe(title, 70))
        axes.set_xlabel(style.safe(xlabel, 70))
        axes.set_ylabel("risk [–]")
        axes.legend(loc="center right", fontsize=8)
        return figure


def _draw_lines(axes: Axes, points: Mapping[str, Estimate]) -> None:
    for risk, entry in points.items():
        p, at = float(risk), entry.value
        axes.plot([0.0, at, at], [p, p, -0.06], color=style.GREY, linewidth=0.8, linestyle=":")
        shown = f"{at:,.0f}" if 10.0 <= at < 1e6 else f"{at:.2g}"
        axes.annotate(f"{100 * p:g} %: {shown}", (0.0, p), xytext=(4, 2), fontsize=8,
                      textcoords="offset points", color=style.GREY)  # fmt: skip


def _draw_rug(axes: Axes, rug: Rug) -> None:
    x, injured = np.array(rug.stimulus, dtype=float), np.array(rug.injured, dtype=bool)
    for held, height, colour, label in (
        (injured, 1.03, style.RED, "injured"), (~injured, -0.03, style.GREEN, "uninjured"),
    ):  # fmt: skip
        axes.plot(x[held], np.full(int(held.sum()), height), "|", color=colour, markersize=7,
                  alpha=0.6, label=f"{label} ({int(held.sum()):,})")  # fmt: skip


def draw_levels(
    curves: Mapping[str, Mapping[int, Array]],
    x: Array,
    stimulus: Array,
    xlabel: str,
    limit: float | None = None,
) -> Figure:
    """Return published curves by AIS level above the study's density of the stimulus.

    Parameters
    ----------
    curves : mapping
        Risk at ``x`` by level, by title of the risk function.
    x : (k,) array
        Grid of the stimulus.
    stimulus : (n,) array
        Of the study's runs, finite.
    xlabel : str
        Stimulus and unit.
    limit : float, optional
        Limit of the stimulus, drawn as a line.
    """
    dashes = ("-", "--", ":", "-.")
    with style.styled():
        figure = style.new_figure(8.2, 6.4)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        for k, (title, levels) in enumerate(curves.items()):
            for level, risk in levels.items():
                above.plot(x, risk, color=LEVEL_COLOURS[level - 1], linestyle=dashes[k % 4],
                           linewidth=1.5, label=f"AIS{level}+, {title}")  # fmt: skip
        # As weights: Matplotlib's own density divides by differences of edges, which may vanish.
        end, bins = float(x[-1]), 60
        below.hist(stimulus, bins=bins, color=style.SKY, range=(0.0, end),
                   weights=np.full(stimulus.size, bins / (end * stimulus.size)))  # fmt: skip
        if limit is not None and 0.0 <= limit <= x[-1]:
            for axes in (above, below):
                axes.axvline(limit, color="black", linewidth=1.0, linestyle="--")
            above.text(limit, 1.02, f" limit {limit:,.6g}", fontsize=8)
        above.set(ylim=(0.0, 1.08), ylabel="risk [–]", xlim=(0.0, float(x[-1])))
        below.set_xlabel(xlabel)
        below.set_ylabel("density of runs")
        below.set_yticks([])
        figure.legend(*above.get_legend_handles_labels(), loc="outside lower center", ncols=3,
                      fontsize=7)  # fmt: skip
        return figure


def draw_speed_risk(
    bands: Mapping[str, Mapping[str, Array]],
    published: Mapping[str, tuple[Array, Array]],
    title: str,
) -> Figure:
    """Return risk against impact speed with bands, and published curves.

    Parameters
    ----------
    bands : mapping
        ``speed`` (km/h), ``risk``, ``low``, ``high`` by label.
    published : mapping
        Speed (km/h) and risk by label.
    title : str
    """
    with style.styled():
        figure = style.new_figure(8.2, 6.2)
        axes = figure.subplots()
        for k, (label, entry) in enumerate(bands.items()):
            colour = style.PALETTE[k % len(style.PALETTE)]
            axes.fill_between(entry["speed"], entry["low"], entry["high"], color=colour, alpha=0.2,
                              linewidth=0)  # fmt: skip
            axes.plot(entry["speed"], entry["risk"], color=colour, linewidth=1.8,
                      label=style.safe(label))  # fmt: skip
        for k, (label, (speed, risk)) in enumerate(published.items()):
            axes.plot(speed, risk, color=style.GREY, linestyle=DASHES[k % len(DASHES)],
                      linewidth=1.2, label=style.safe(label))  # fmt: skip
        axes.set(ylim=(0.0, 1.0), title=title)
        axes.set_xlabel("impact speed [km/h]")
        axes.set_ylabel("risk [–]")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2,
                      fontsize=8)  # fmt: skip
        return figure


def draw_ais(shares: Mapping[str, Sequence[float]]) -> Figure:
    """Return the distribution of the AIS, a bar by level for each scenario or mechanism."""
    with style.styled():
        figure = style.new_figure(7.6, 0.55 * len(shares) + 1.5)
        axes = figure.subplots()
        left = np.zeros(len(shares))
        places = np.arange(len(shares))[::-1]
        table = np.array(list(shares.values()), dtype=float)
        for level in range(table.shape[1]):
            colour = "#D9D9D9" if level == 0 else LEVEL_COLOURS[level - 1]
            axes.barh(places, table[:, level], 0.7, left=left, color=colour, edgecolor="white",
                      linewidth=0.6, label=f"AIS {level}")  # fmt: skip
            for place, start, width in zip(places, left, table[:, level], strict=True):
                if width > 0.06:
                    colour = "black" if level in (0, 1, 3) else "white"
                    axes.text(start + width / 2, place, f"{100 * width:.0f} %", fontsize=7,
                              ha="center", va="center", color=colour)  # fmt: skip
            left = left + table[:, level]
        axes.set_yticks(places, [style.safe(label, 30) for label in shares])
        axes.set(xlim=(0.0, 1.0), xlabel="share of outcomes [–]")
        axes.grid(visible=False, axis="y")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=7,
                      fontsize=8)  # fmt: skip
        return figure


def draw_roc(
    curves: Mapping[str, tuple[Array, Array]],
    marks: Mapping[str, tuple[float, float]],
    label: str,
) -> Figure:
    """Return ROC curves with a limit marked on each.

    Parameters
    ----------
    curves : mapping
        False-alarm rate and sensitivity by title.
    marks : mapping
        The same of the limit, by title.
    label : str
        Of the limit.
    """
    with style.styled():
        figure = style.new_figure(6.4, 5.6)
        axes = figure.subplots()
        axes.plot([0, 1], [0, 1], color=style.GREY, linewidth=0.8, linestyle=":")
        for k, (title, (x, y)) in enumerate(curves.items()):
            colour = style.PALETTE[k % len(style.PALETTE)]
            axes.plot(x, y, color=colour, label=style.safe(title))
            alarm, hit = marks[title]
            axes.plot(alarm, hit, "o", color=colour, markeredgecolor="black", markersize=7)
        axes.plot([], [], "o", color="white", markeredgecolor="black", label=label)
        axes.set(xlim=(0, 1), ylim=(0, 1), xlabel="1 – specificity [–]", ylabel="sensitivity [–]")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2,
                      fontsize=8)  # fmt: skip
        return figure


def draw_exceedance(samples: Mapping[str, Array], xlabel: str, limit: float) -> Figure:
    """Return the share of runs above each value, with a simultaneous 95 % band.

    Parameters
    ----------
    samples : mapping
        (n,) by label; NaN counts as never above.
    xlabel : str
        Output and unit.
    limit : float
        Limit of the output, drawn as a line.
    """
    with style.styled():
        figure = style.new_figure(7.2, 4.2)
        axes = figure.subplots()
        largest = 0.0
        for k, (label, sample) in enumerate(samples.items()):
            held = np.sort(sample[np.isfinite(sample)])
            share = np.arange(held.size, -1, -1) / sample.size
            held = np.concatenate([[0.0], held])
            # Dvoretzky, Kiefer and Wolfowitz: simultaneous for the whole curve.
            reach = float(np.sqrt(np.log(2.0 / 0.05) / (2.0 * sample.size)))
            colour = style.PALETTE[k % len(style.PALETTE)]
            axes.fill_between(held, np.clip(share - reach, 0, 1), np.clip(share + reach, 0, 1),
                              step="post", color=colour, alpha=0.18, linewidth=0)  # fmt: skip
            axes.step(held, share, where="post", color=colour, label=style.safe(label))
            largest = max(largest, float(np.quantile(held, 0.995)))
        line: dict[str, Any] = {"color": "black", "linewidth": 1.0, "linestyle": "--"}
        if style.is_near([largest], limit):
            axes.axvline(limit, label=f"limit {limit:g}", **line)
            largest = max(largest, limit)
        else:
            axes.plot([], [], label=f"limit {limit:g}, beyond the picture", **line)
        axes.set(xlim=(0.0, 1.05 * largest or 1.0), ylim=(0.0, 1.0))
        axes.set_xlabel(xlabel)
        axes.set_ylabel("share of the runs above [–]")
        axes.legend(fontsize=8)
        return figure
