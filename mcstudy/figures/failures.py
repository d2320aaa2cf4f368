"""Location of failed runs in the input space."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.figure import Figure

from mcstudy.figures import style


def draw_failures(shares: Mapping[str, Sequence[float]]) -> Figure:
    """Return the share of failed runs in each part of each input's range, from low to high."""
    table = 100.0 * pd.DataFrame(dict(shares)).T
    parts = table.shape[1]
    table.columns = pd.Index([f"{100 * k // parts}–{100 * (k + 1) // parts}" for k in range(parts)])
    with style.styled():
        figure = style.new_figure(8.6, 0.3 * len(table) + 1.6)
        axes = figure.subplots()
        sns.heatmap(
            table.rename(index=style.quantity), ax=axes,
            cmap=sns.light_palette(style.RED, as_cmap=True), vmin=0.0,
            vmax=max(1.0, float(np.nanmax(table.to_numpy()))), linewidths=0.5,
            cbar_kws={"label": "failed runs [%]"},
        )  # fmt: skip
        axes.set(xlabel="rank of the input's value [%]", ylabel="")
        axes.tick_params(axis="x", rotation=0, length=0)
        axes.tick_params(axis="y", rotation=0, length=0)
        return figure
