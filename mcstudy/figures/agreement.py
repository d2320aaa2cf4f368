"""Agreement of two methods: pairs, limits of agreement, variance split, disagreement."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from mcstudy.agreement import Agreement, Sources, VarianceSplit
from mcstudy.figures import style
from mcstudy.statistics import Estimate, by_size, varies

Array = NDArray[np.float64]

_SHARES = {
    "inputs": ("inputs alone", style.BLUE),
    "together": ("method and inputs together", style.SKY),
    "method": ("method alone", style.ORANGE),
}
_BINS = 12


def draw_pairs(
    values: Mapping[str, Array],
    units: Mapping[str, str],
    labels: tuple[str, str],
    found: Mapping[str, Agreement],
) -> Figure:
    """Return the runs of two methods against each other, and below them the limits of agreement.

    Parameters
    ----------
    values : mapping
        (n, 2) by output.
    units : mapping
        Units by output.
    labels : (str, str)
        Of the two methods.
    found : mapping
        Agreement by output.
    """
    with style.styled():
        figure = style.new_figure(4.4 * len(values), 7.4)
        axes = figure.subplots(2, len(values), squeeze=False)
        for k, (name, pair) in enumerate(values.items()):
            held = pair[np.isfinite(pair).all(axis=1)]
            _scatter(axes[0, k], held, found[name])
            axes[0, k].set_title(style.words(name))
            for axis, label in (("x", labels[0]), ("y", labels[1])):
                unit = style.label(name, units[name])
                axes[0, k].set(**{f"{axis}label": f"{label}: {unit}"})
            _limits(axes[1, k], held, found[name])
            unit = style.bracketed(units[name])
            axes[1, k].set_xlabel(f"mean of both {unit}")
            axes[1, k].set_ylabel(f"{labels[1]} minus {labels[0]} {unit}")
        return figure


def _scatter(axes: Axes, pair: Array, found: Agreement) -> None:
    axes.scatter(pair[:, 0], pair[:, 1], s=7, color=style.BLUE, alpha=0.35, linewidths=0)
    ends = style.ends_of(_inner(pair), below=0.06, above=0.06)
    axes.plot(ends, ends, color="black", linewidth=1.0, linestyle="--", label="equal")
    axes.set(xlim=ends, ylim=ends, aspect="equal")
    rank = found.rank_correlation
    known = np.isfinite(rank.value)
    text = f"rank correlation {_with_interval(rank)}" if known else "no rank correlation"
    axes.plot([], [], linestyle="none", label=text)
    axes.legend(loc="upper left", fontsize=8, framealpha=0.9, handlelength=1.2)


def _inner(values: Array) -> tuple[float, float]:
    """Return the 0.2 % and 99.8 % quantiles."""
    low = np.quantile(values, 0.002, method="lower")
    return float(low), float(np.quantile(values, 0.998, method="higher"))


def _with_interval(estimate: Estimate) -> str:
    shown = f"{estimate.value:.2f}"
    return (
        f"{shown} ({estimate.low:.2f} to {estimate.high:.2f})" if estimate.has_interval else shown
    )


def _limits(axes: Axes, pair: Array, found: Agreement) -> None:
    difference = pair[:, 1] - pair[:, 0]
    axes.scatter(pair.mean(axis=1), difference, s=7, color=style.BLUE, alpha=0.35, linewidths=0)
    for entry, label, line in (
        (found.bias, "mean difference", "-"),
        (found.upper, "95 % limits of agreement", "--"),
        (found.lower, None, "--"),
    ):
        axes.axhline(entry.value, color=style.RED, linewidth=1.4, linestyle=line, label=label)
        if entry.has_interval:
            axes.axhspan(entry.low, entry.high, color=style.RED, alpha=0.12, linewidth=0)
    axes.axhline(0.0, color="black", linewidth=0.8)
    lines = [found.lower.value, found.upper.value, 0.0]
    axes.set_ylim(*style.ends_of([*_inner(difference), *lines], below=0.08, above=0.28))
    axes.set_xlim(*style.ends_of(pair.mean(axis=1)))
    axes.legend(loc="upper left", fontsize=8, framealpha=0.9)


def draw_variance(split: Mapping[str, VarianceSplit]) -> Figure:
    """Return the shares of each output's variance: inputs, method, interaction.

    Parameters
    ----------
    split : mapping
        Split by output.
    """
    with style.styled():
        figure = style.new_figure(7.2, 0.62 * len(split) + 1.5)
        axes = figure.subplots()
        places = np.arange(len(split))[::-1]
        left = np.zeros(len(split))
        for place, entry in zip(places, split.values(), strict=True):
            if not np.isfinite(entry.inputs.value):
                axes.barh(place, 1.0, 0.62, color="#F4F4F4", edgecolor="#C4C4C4", hatch="///",
                          linewidth=0.0)  # fmt: skip
                axes.text(0.5, place, "does not vary", ha="center", va="center", fontsize=9)
        for key, (label, colour) in _SHARES.items():
            shares = np.nan_to_num([getattr(entry, key).value for entry in split.values()])
            axes.barh(places, shares, 0.62, left=left, color=colour, label=label)
            for place, start, share in zip(places, left, shares, strict=True):
                if share >= 0.045:
                    axes.text(
                        start + 0.5 * share, place, f"{100.0 * share:.0f} %", ha="center",
                        va="center", fontsize=9, color="white" if colour == style.BLUE else "black",
                    )  # fmt: skip
            left += shares
        axes.set_yticks(places, [style.words(name) for name in split])
        axes.tick_params(axis="y", length=0)
        axes.set(xlim=(0.0, 1.0), xlabel="share of the variance over methods and inputs [–]")
        axes.grid(visible=False, axis="y")
        figure.legend(loc="outside upper center", ncols=3, fontsize=9)
        return figure


def draw_breaking(breaking: Mapping[str, Sources]) -> Figure:
    """Return the sources of disagreement: gains in rank correlation without an input's part.

    Parameters
    ----------
    breaking : mapping
        Sources of disagreement by output; NaN where there is no rank correlation.
    """
    count = len(next(iter(breaking.values())).gains)
    with style.styled():
        figure = style.new_figure(4.3 * len(breaking), 0.27 * count + 1.5)
        row = figure.subplots(1, len(breaking), squeeze=False)[0]
        for axes, (name, entry) in zip(row, breaking.items(), strict=True):
            axes.set_title(style.words(name))
            axes.tick_params(axis="y", length=0)
            axes.grid(visible=False, axis="y")
            if not np.isfinite(entry.noise):
                axes.text(0.5, 0.5, "no rank correlation:\nit does not vary", ha="center",
                          va="center", transform=axes.transAxes)  # fmt: skip
                axes.set(xticks=[], yticks=[])
                continue
            order = by_size(entry.gains)[::-1]
            gains = [entry.gains[key] for key in order]
            colours = [style.BLUE if gain > entry.noise else "#B9C6CF" for gain in gains]
            axes.barh(np.arange(count), gains, 0.66, color=colours)
            axes.axvline(entry.noise, color="black", linestyle="--", linewidth=1.0,
                         label="noise line (dummies)")  # fmt: skip
            axes.axvline(0.0, color="black", linewidth=0.8)
            axes.set_yticks(np.arange(count), [style.words(key) for key in order])
            axes.set_xlabel("gain in rank correlation [–]")
        handles, labels = next(
            (found for axes in row if (found := axes.get_legend_handles_labels())[0]), ([], [])
        )
        if handles:
            figure.legend(handles, labels, loc="outside upper center", fontsize=9)
        return figure


def draw_along(
    inputs: Mapping[str, tuple[Array, str]],
    values: Mapping[str, Array],
    units: Mapping[str, str],
    labels: tuple[str, str],
) -> Figure:
    """Return both methods along the input over which each output disagrees most.

    Parameters
    ----------
    inputs : mapping
        By output the (n,) values of the input and its axis label.
    values : mapping
        (n, 2) by output.
    units : mapping
        Units by output.
    labels : (str, str)
        Of the two methods.
    """
    with style.styled():
        figure = style.new_figure(4.4 * len(values), 3.8)
        row = figure.subplots(1, len(values), squeeze=False)[0]
        for axes, (name, pair) in zip(row, values.items(), strict=True):
            x, label = inputs[name]
            held = np.isfinite(pair).all(axis=1)
            for k, colour in enumerate((style.BLUE, style.ORANGE)):
                middle, low, centre, high = _bands(x[held], pair[held, k])
                axes.plot(middle, centre, "o-", color=colour, markersize=3.5,
                          label=f"{labels[k]}, median")  # fmt: skip
                axes.fill_between(middle, low, high, color=colour, alpha=0.18, linewidth=0)
            axes.set(xlabel=label, ylabel=style.label(name, units[name]))
            axes.xaxis.set_major_locator(MaxNLocator(5))
            if not varies(x[held]):
                axes.set_xlim(*style.ends_of(x[held]))
            if varies(pair[held]):
                low, high = axes.get_ylim()
                axes.set_ylim(low, high + 0.22 * (high - low))
            else:
                axes.set_ylim(*style.ends_of(pair[held]))
            axes.legend(loc="upper left", fontsize=8, framealpha=0.9)
        return figure


def _bands(x: Array, y: Array) -> tuple[Sequence[float], ...]:
    """Return the middle of bins of equal count, and the quartiles and median of y in each."""
    parts = np.array_split(np.argsort(x, kind="stable"), _BINS)
    columns = [
        (float(np.median(x[part])), *np.quantile(y[part], [0.25, 0.5, 0.75]).tolist())
        for part in parts
        if part.size
    ]
    return tuple(zip(*columns, strict=True))
