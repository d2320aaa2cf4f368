"""A car's surface of facets: regions, wrap-around lines and open edges."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.figures.facets import facet_collection, shaded, unit_normals

Array = NDArray[np.float64]

LIGHT = np.array([0.45, 0.35, 0.82])
"""Direction of the light."""
_PLANES = {"from the left": (0, 2), "from above": (0, 1), "from ahead": (1, 2)}


@dataclass(frozen=True)
class Facets:
    """What is drawn: corners (m, 3, 3) in m, region (m,) of each facet and names of the regions."""

    corners: Array
    region: NDArray[np.int64]
    names: Sequence[str]


def draw_surface(
    facets: Facets, lines: Mapping[str, Array], open_edges: Array | None = None
) -> Figure:
    """Return a surface from the left, from above and from ahead.

    Parameters
    ----------
    facets : Facets
    lines : mapping
        (k, 3) points of lines on the surface by label, NaN where they are interrupted.
    open_edges : (e, 2, 3) array, optional
        Ends of the edges that belong to one facet only.
    """
    low, high = facets.corners.min(axis=(0, 1)), facets.corners.max(axis=(0, 1))
    size = high - low
    with style.styled():
        width = 11.0
        scale = 0.82 * width / (size[0] + size[1])
        figure = style.new_figure(width + 0.6, scale * (size[2] + size[1]) + 2.4)
        grid = figure.subplots(
            2, 2, width_ratios=[size[0], size[1]], height_ratios=[size[2], size[1]], squeeze=False
        )
        panels = {"from the left": grid[0, 0], "from ahead": grid[0, 1], "from above": grid[1, 0]}
        for title, axes in panels.items():
            _draw_view(axes, facets, lines, open_edges, title)
        legend = grid[1, 1]
        legend.set_axis_off()
        handles = [
            Patch(color=_colour(k), label=style.safe(style.words(name)))
            for k, name in enumerate(facets.names)
        ]
        legend.legend(handles=handles, loc="center", fontsize=8, ncols=1 + len(handles) // 12)
        return figure


def _colour(region: int) -> tuple[float, float, float]:
    """Return the colour of a region: the palette's, paler in the first round."""
    round_, place = divmod(region, len(style.PALETTE))
    pale = 0.45 if round_ % 2 == 0 else 0.0
    red, green, blue = (pale + (1.0 - pale) * v for v in to_rgb(style.PALETTE[place]))
    return red, green, blue


def _draw_view(
    axes: Axes,
    facets: Facets,
    lines: Mapping[str, Array],
    open_edges: Array | None,
    title: str,
) -> None:
    plane = _PLANES[title]
    base = np.array([_colour(k) for k in range(len(facets.names))])[facets.region]
    colours = shaded(base, unit_normals(facets.corners), LIGHT, 0.55)
    axes.add_collection(facet_collection(facets.corners, colours, plane))
    for label, points in lines.items():
        axes.plot(points[:, plane[0]], points[:, plane[1]], color="black", linewidth=1.0)
        if title == "from above":
            known = points[np.isfinite(points).all(axis=1)]
            x, y = known[np.argmin(np.abs(known[:, 1])), list(plane)].tolist()
            axes.annotate(style.safe(label), (x, y), fontsize=7, rotation=90, ha="right",
                          va="center", xytext=(-2, 0), textcoords="offset points")  # fmt: skip
    if open_edges is not None and len(open_edges):
        axes.add_collection(
            LineCollection(list(open_edges[:, :, list(plane)]), colors=style.RED, linewidths=1.2)
        )
    names = ("x, forward [m]", "y, left [m]", "height [m]")
    axes.autoscale()
    axes.set(aspect="equal", title=title, xlabel=names[plane[0]], ylabel=names[plane[1]])
