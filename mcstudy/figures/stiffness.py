"""Force against penetration: measured loops, fitted curves, corridors and what comes of them."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcstudy.figures import style

Array = NDArray[np.float64]

_AXES = {"xlabel": "penetration [mm]", "ylabel": "force [kN]"}


def draw_force_penetration(loops: Mapping[str, tuple[Array, Array]]) -> Figure:
    """Return loops of penetration (m) and force (N) by legend label."""
    with style.styled():
        figure = style.new_figure(5.2, 3.6)
        axes = figure.subplots()
        for k, (name, (depth, force)) in enumerate(loops.items()):
            axes.plot(1e3 * depth, force / 1e3, label=name, color=style.PALETTE[k % 8])
        axes.set(**_AXES, xlim=(0.0, None), ylim=(0.0, None))
        if len(loops) > 1:
            axes.legend(framealpha=0.9)
        return figure
