"""Dents that a crash leaves in the deforming parts of a car, seen from above."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.figures.crash import CAR, MeshLike, SceneLike

Array = NDArray[np.float64]

DEPTHS = 3
"""Number of dents whose depth is written."""
APART = 0.2
"""Distance (m) of dents of their own (assumed)."""
LEAST = 1.0
"""Depth (mm) below which a dent is not written."""


def deforming(scene: SceneLike) -> list[MeshLike]:
    """Return the meshes of a scene that deform and belong to the car."""
    return [mesh for mesh in scene.meshes if mesh.body == CAR and mesh.nodes.ndim == 3]


def draw_dents(scene: SceneLike) -> Figure | None:
    """Return displacements of a car's deforming parts, largest and lasting, or None without any.

    Parameters
    ----------
    scene : SceneLike
    """
    parts = deforming(scene)
    if not parts:
        return None
    corners = np.concatenate([mesh.nodes[0][mesh.faces] for mesh in parts])
    # Displacement of a facet: the mean of its nodes'.
    moved = [
        [np.linalg.norm(shape - mesh.nodes[0], axis=1)[mesh.faces].mean(axis=1)
         for shape in mesh.nodes]
        for mesh in parts
    ]  # fmt: skip
    over_time = 1000.0 * np.concatenate([np.array(part) for part in moved], axis=1)
    panels = {"largest displacement": over_time.max(axis=0), "lasting dent": over_time[-1]}
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    with style.styled():
        height = 4.6
        width = height * (high[1] - low[1]) / (high[0] - low[0])
        figure = style.new_figure(2.0 * width + 2.6, height + 1.3)
        grid = figure.subplots(1, 2, sharex=True, sharey=True)
        for axes, (title, values) in zip(grid, panels.items(), strict=True):
            scale = Normalize(0.0, max(float(values.max()), LEAST))
            shown = ScalarMappable(scale, style.SEQUENTIAL)
            # Seen from above with the car's front below: y to the left, x upwards is rearwards.
            outlines = list(np.stack([corners[..., 1], -corners[..., 0]], axis=-1))
            colours = shown.to_rgba(values)
            axes.add_collection(
                PolyCollection(
                    outlines, facecolors=colours, edgecolors="face", lw=0.3, rasterized=True
                )
            )
            for place, depth in _deepest(corners.mean(axis=1), values):
                # Towards the middle: the horizontal axis points to the right side of the car.
                aside = 18 if place[1] > 0.0 else -48
                axes.annotate(
                    f"{depth:.0f} mm", (place[1], -place[0]), xytext=(aside, 12),
                    textcoords="offset points", fontsize=8,
                    arrowprops={"arrowstyle": "-", "lw": 0.7},
                    bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.8},
                )  # fmt: skip
            axes.set_title(title)
            axes.set_xlim(high[1] + 0.03, low[1] - 0.03)
            axes.set_ylim(-high[0] - 0.03, -low[0] + 0.03)
            axes.set_aspect("equal")
            axes.set_xlabel("left of the centre line [m]")
            figure.colorbar(shown, ax=axes, label="displacement [mm]", shrink=0.8)
        grid[0].set_ylabel("behind the car's foremost point [m]")
        return figure


def _deepest(places: Array, values: Array) -> list[tuple[Array, float]]:
    """Return places and depths of the deepest dents, apart from each other."""
    found: list[tuple[Array, float]] = []
    left = values.copy()
    for _ in range(DEPTHS):
        k = int(np.argmax(left))
        if left[k] < LEAST:
            break
        found.append((places[k], float(left[k])))
        left[np.linalg.norm(places - places[k], axis=1) < APART] = 0.0
    return found
