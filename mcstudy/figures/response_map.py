"""Maps: an output over two inputs, or over the places on a car's front seen from above."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.figures.facets import facet_collection, shaded, unit_normals
from mcstudy.text import number

Array = NDArray[np.float64]

FILL = 0.86
"""Share of the distance of two places that the square of a place fills."""
WRITTEN = 400
"""Largest number of cells of a panel in which values are written."""
LIGHT = np.array([0.2, 0.3, 0.93])
BODY = np.array([0.86, 0.87, 0.89])
"""Colour of the car below the squares."""
AHEAD = 0.12
"""Length (m) of the car shown ahead of and behind the places."""


@dataclass(frozen=True)
class CarFront:
    """A car below the places of a map.

    Attributes
    ----------
    corners : (m, 3, 3) array
        Of its facets, m.
    lines : mapping
        (k, 3) points of lines on it by label, m.
    """

    corners: Array
    lines: Mapping[str, Array]


@dataclass(frozen=True)
class MapPanel:
    """A panel: values at points.

    Attributes
    ----------
    title : str
    x, y : (n,) array
        Coordinates of the points.
    values : (n,) array
        NaN where there is none.
    """

    title: str
    x: Array
    y: Array
    values: Array


@dataclass(frozen=True)
class Scale:
    """The colours of the values.

    Attributes
    ----------
    label : str
        Name and unit.
    limits : sequence of float
        Between bands of one colour each; empty for a continuous scale.
    ends : (float, float), optional
        Of a continuous scale; by default those of the values.
    """

    label: str
    limits: Sequence[float] = field(default_factory=tuple)
    ends: tuple[float, float] | None = None

    def colours(self, values: Array) -> tuple[Any, Colormap]:
        """Return the norm and the colours for values."""
        palette = mpl.colormaps[style.SEQUENTIAL]
        if self.limits:
            count = len(self.limits) + 1
            shades = ListedColormap([palette(0.08 + 0.84 * k / (count - 1)) for k in range(count)])
            inner = list(self.limits)
            edges = [inner[0] - 1.0, *inner, inner[-1] + 1.0]
            return BoundaryNorm(edges, count, clip=True), shades
        low, high = self.ends or style.ends_of(values[np.isfinite(values)], below=0.0, above=0.0)
        return Normalize(low, high), palette


def draw_maps(
    rows: Sequence[Sequence[MapPanel]],
    labels: tuple[str, str],
    scale: Scale,
    front: CarFront | None = None,
) -> Figure:
    """Return a figure of maps on one scale.

    Parameters
    ----------
    rows : sequence of sequence of MapPanel
        Panels row by row, the same number in each.
    labels : (str, str)
        Of the axes.
    scale : Scale
    front : CarFront, optional
        Drawn from above, its front at the bottom; x and y of the panels are then the lateral
        position and the position along the car.
    """
    everything = np.concatenate([panel.values for row in rows for panel in row])
    norm, palette = scale.colours(everything)
    columns = max(map(len, rows))
    with style.styled():
        wide, high = _size(rows[0][0], front)
        figure = style.new_figure(wide * columns + 1.0, high * len(rows) + 0.9)
        grid = figure.subplots(len(rows), columns, squeeze=False)
        for line, row in zip(grid, rows, strict=True):
            for axes, panel in zip(line, row, strict=False):
                if front is None:
                    _draw_cells(axes, panel, norm, palette)
                else:
                    _draw_places(axes, panel, norm, palette, front)
                axes.set(xlabel=labels[0], ylabel=labels[1])
                if panel.title:
                    axes.set_title(style.safe(panel.title))
        if scale.limits:
            handles = [
                Patch(facecolor=palette(k), edgecolor=style.GREY, label=text)
                for k, text in enumerate(band_names(scale.limits))
            ]
            figure.legend(
                handles=handles, loc="outside upper center", ncols=min(len(handles), 6),
                title=style.safe(scale.label), fontsize=9,
            )  # fmt: skip
        else:
            figure.colorbar(
                ScalarMappable(norm, palette), ax=grid.ravel().tolist(), label=scale.label,
                shrink=0.9,
            )  # fmt: skip
        return figure


def band_names(limits: Sequence[float]) -> list[str]:
    """Return the names of the bands between limits, the lowest first."""
    told = [f"{limit:g}" for limit in limits]
    between = [f"{a} to {b}" for a, b in itertools.pairwise(told)]
    return [f"up to {told[0]}", *between, f"above {told[-1]}"]


def _size(panel: MapPanel, front: CarFront | None) -> tuple[float, float]:
    """Return width and height (inches) of a panel."""
    if front is None:
        return 5.2, 4.0
    wide = float(np.ptp(front.corners[:, :, 1]))
    long = float(np.ptp(panel.y)) + 2.0 * AHEAD + _spacing(panel.y)
    return 5.2, min(max(5.0 * long / wide, 2.4), 8.0)


def _spacing(values: Array) -> float:
    """Return the smallest distance of different values, 0.1 if there is one value only."""
    steps = np.diff(np.unique(np.round(values, 6)))
    steps = steps[steps > 1e-3 * max(float(np.ptp(values)), 1e-12)]
    return float(steps.min()) if steps.size else 0.1


def _edges(values: Array) -> Array:
    """Return the borders of the cells around rising values."""
    if values.size == 1:
        return np.asarray(values[0] + np.array([-0.5, 0.5]))
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


def _draw_cells(axes: Axes, panel: MapPanel, norm: Any, palette: Colormap) -> None:
    """Draw the cells of a grid of two inputs."""
    x, column = np.unique(panel.x, return_inverse=True)
    y, row = np.unique(panel.y, return_inverse=True)
    table = np.full((len(y), len(x)), np.nan)
    table[row.reshape(-1), column.reshape(-1)] = panel.values
    axes.set_facecolor("#F4F4F4")
    axes.pcolormesh(_edges(x), _edges(y), table, norm=norm, cmap=palette, edgecolors="white",
                    linewidth=0.4)  # fmt: skip
    axes.grid(visible=False)
    _write(axes, panel, norm, palette, 7.5 if table.size <= 150 else 6.0)


def _draw_places(
    axes: Axes, panel: MapPanel, norm: Any, palette: Colormap, front: CarFront
) -> None:
    """Draw squares at the places on a car's front."""
    long = _rows_apart(panel)
    low, high = panel.y.min() - long - AHEAD, panel.y.max() + long + AHEAD
    near = (front.corners[:, :, 0].max(axis=1) > low) & (front.corners[:, :, 0].min(axis=1) < high)
    corners = front.corners[near]
    normals = unit_normals(corners)
    # What faces down is hidden.
    corners, normals = corners[normals[:, 2] > 0.0], normals[normals[:, 2] > 0.0]
    axes.add_collection(facet_collection(corners, shaded(BODY, normals, LIGHT, 0.4), (1, 0)))
    for label, points in front.lines.items():
        axes.plot(points[:, 1], points[:, 0], color="black", linewidth=0.8, zorder=1.5)
        known = points[np.isfinite(points).all(axis=1)]
        if len(known) and low < known[-1, 0] < high:
            axes.annotate(style.safe(label), (known[-1, 1], known[-1, 0]), fontsize=7,
                          ha="left", va="center", xytext=(3, 0), textcoords="offset points",
                          annotation_clip=False)  # fmt: skip
    wide, deep = FILL * _spacing(panel.x), FILL * long
    for x, y, value in zip(panel.x, panel.y, panel.values, strict=True):
        known = np.isfinite(value)
        axes.add_patch(
            Rectangle((x - 0.5 * wide, y - 0.5 * deep), wide, deep,
                      facecolor=palette(norm(value)) if known else "#F4F4F4",
                      edgecolor="white", linewidth=0.5, zorder=2)
        )  # fmt: skip
    _write(axes, panel, norm, palette, 5.8 if len(panel.x) <= 150 else 4.6)
    half = 1.1 * float(np.abs(corners[:, :, 1]).max())
    axes.set(aspect="equal", xlim=(-half, half), ylim=(high, low))
    axes.grid(visible=False)


def _rows_apart(panel: MapPanel) -> float:
    """Return the distance (m) of neighbouring places along the car, at one lateral position."""
    steps = [np.diff(np.sort(panel.y[panel.x == x])) for x in np.unique(panel.x)]
    found = np.concatenate(steps)
    return float(np.median(found)) if found.size else _spacing(panel.x)


def _write(axes: Axes, panel: MapPanel, norm: Any, palette: Colormap, size: float) -> None:
    """Write the values into their cells, light on dark and dark on light."""
    if len(panel.values) > WRITTEN:
        return
    for x, y, value in zip(panel.x, panel.y, panel.values, strict=True):
        known = np.isfinite(value)
        red, green, blue, _ = palette(norm(value)) if known else (1.0, 1.0, 1.0, 1.0)
        dark = 0.299 * red + 0.587 * green + 0.114 * blue < 0.55
        axes.text(x, y, _written(value) if known else "–", ha="center", va="center",
                  fontsize=size, color="white" if dark else "black", zorder=3)  # fmt: skip


def _written(value: float) -> str:
    """Return a value in few characters."""
    return f"{value:.0f}" if 100.0 <= abs(value) < 1e6 else number(value, 2)
