"""Figures of one crash: kinematics strip, histories, animation."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from mcstudy.figures import style
from mcstudy.figures.facets import facet_collection, shaded, triangles, unit_normals

Array = NDArray[np.float64]


class MeshLike(Protocol):
    """A surface of facets; see the model protocol."""

    @property
    def nodes(self) -> Array: ...
    @property
    def faces(self) -> NDArray[np.int64]: ...
    @property
    def body(self) -> str: ...
    @property
    def time(self) -> Array | None: ...


class ForcesLike(Protocol):
    """Contact forces of a scene; see the model protocol."""

    @property
    def place(self) -> Array: ...
    @property
    def force(self) -> Array: ...


class SceneLike(Protocol):
    """Poses of ellipsoids, meshes and car; see the model protocol."""

    @property
    def time(self) -> Array: ...
    @property
    def names(self) -> Sequence[str]: ...
    @property
    def semi_axes(self) -> Array: ...
    @property
    def centre(self) -> Array: ...
    @property
    def orientation(self) -> Array: ...
    @property
    def car(self) -> Array: ...
    @property
    def outline(self) -> Sequence[Array]: ...
    @property
    def plan(self) -> Array: ...
    @property
    def meshes(self) -> Sequence[MeshLike]: ...
    @property
    def forces(self) -> ForcesLike | None: ...
    @property
    def tape(self) -> Array | None: ...


CAR = "car"
"""Rigid body of a mesh that is the car."""
MESH = "#E4E9EC"
"""Colour of facets that belong to no segment."""
LIGHT = np.array([0.4, -0.5, 0.77])
"""Direction of the light on facets."""
_CIRCLE = np.stack(
    [np.cos(np.linspace(0.0, 2.0 * np.pi, 41)), np.sin(np.linspace(0.0, 2.0 * np.pi, 41))]
)


def _rotation(q: Array) -> Array:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _colour(name: str) -> str:
    if name.endswith("_left"):
        return style.ORANGE
    return style.BLUE if name.endswith("_right") else "#B9C6CF"


def _shadow(scene: SceneLike, frame: int, segment: int, axes: tuple[int, int]) -> Array:
    """Return the (41, 2) outline of an ellipsoid's projection on two world axes."""
    R = _rotation(scene.orientation[frame, segment])
    shape = R @ np.diag(scene.semi_axes[segment] ** 2) @ R.T
    pick = np.ix_(axes, axes)
    values, vectors = np.linalg.eigh(shape[pick])
    ring = vectors @ (np.sqrt(np.maximum(values, 0.0))[:, None] * _CIRCLE)
    outline: Array = ring.T + scene.centre[frame, segment, list(axes)]
    return outline


def _draw_body(
    axes: Axes, scene: SceneLike, frame: int, plane: tuple[int, int], shift: tuple[float, float]
) -> None:
    # Far segments first, so that near ones cover them.
    depth_axis = ({0, 1, 2} - set(plane)).pop()
    order = np.argsort(scene.centre[frame, :, depth_axis])
    if plane == (0, 2):
        order = order[::-1]
    meshed = {mesh.body for mesh in scene.meshes}
    order = np.array([i for i in order if scene.names[int(i)] not in meshed], dtype=int)
    shapes = [_shadow(scene, frame, int(i), plane) - shift for i in order]
    colours = [_colour(scene.names[int(i)]) for i in order]
    axes.add_collection(
        PolyCollection(shapes, facecolors=colours, edgecolors="#333333", linewidths=0.6, alpha=0.92)
    )


def _positions(scene: SceneLike, mesh: MeshLike, frame: int) -> Array:
    """Return the nodes (k, 3) of a mesh in world axes."""
    nodes = mesh.nodes
    if nodes.ndim == 3:
        row = frame
        if mesh.time is not None:
            row = int(np.searchsorted(mesh.time, scene.time[frame], side="right")) - 1
        nodes = nodes[max(row, 0)]
    if not mesh.body:
        return np.asarray(nodes)
    if mesh.body == CAR:
        x, y, yaw = scene.car[frame]
        c, s = math.cos(yaw), math.sin(yaw)
        turned = nodes @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(turned + np.array([x, y, 0.0]))
    k = list(scene.names).index(mesh.body)
    return np.asarray(nodes @ _rotation(scene.orientation[frame, k]).T + scene.centre[frame, k])


def _draw_meshes(
    axes: Axes, scene: SceneLike, frame: int, plane: tuple[int, int], shift: tuple[float, float]
) -> None:
    """Draw the facets that face the viewer: of the car first, then of the body, far ones first."""
    depth_axis = ({0, 1, 2} - set(plane)).pop()
    towards = -1.0 if plane == (0, 2) else 1.0
    away = np.zeros(3)
    away[list(plane)] = shift
    car: list[tuple[Array, Array]] = []
    body: list[tuple[Array, Array]] = []
    for mesh in scene.meshes:
        corners = _positions(scene, mesh, frame)[triangles(mesh.faces)]
        normal = unit_normals(corners)
        seen = towards * normal[:, depth_axis] > 0.0
        owner = mesh.body if mesh.body != CAR else ""
        base = np.array(to_rgb(_colour(owner) if owner else MESH))
        colours = shaded(base, normal[seen], LIGHT, 0.72)
        (body if owner else car).append((corners[seen] - away, colours))
    for parts in (car, body):
        if parts:
            corners, colours = (np.concatenate(part) for part in zip(*parts, strict=True))
            axes.add_collection(facet_collection(corners, colours, plane, towards), autolim=False)


def _has_car(scene: SceneLike) -> bool:
    """Return whether a mesh stands for the car's outlines."""
    return any(mesh.body == CAR for mesh in scene.meshes)


def _draw_car_side(axes: Axes, scene: SceneLike, x: float) -> None:
    if _has_car(scene):
        return
    for line in scene.outline:
        axes.plot(line[:, 0] + x, line[:, 1], color="#333333", linewidth=1.2)


def _draw_car_plan(axes: Axes, scene: SceneLike, frame: int) -> None:
    if _has_car(scene):
        return
    x, y, yaw = scene.car[frame]
    c, s = math.cos(yaw), math.sin(yaw)
    plan = scene.plan @ np.array([[c, s], [-s, c]]) + (x, y)
    axes.fill(plan[:, 0], plan[:, 1], facecolor="#EFEFEF", edgecolor="#333333", linewidth=1.2)


def draw_strip(scene: SceneLike, times: Sequence[float]) -> Figure:
    """Return side views at the given times (s) in the car's frame, left limbs orange."""
    return draw_strips({"": scene}, times)


def draw_strips(scenes: Mapping[str, SceneLike], times: Sequence[float]) -> Figure:
    """Return the side views of several scenes, one row each, at the same times.

    In the car's frame, left limbs orange.

    Parameters
    ----------
    scenes : mapping
        Scenes by the label of their row.
    times : sequence of float
        s.
    """
    with style.styled():
        figure = style.new_figure(2.75 * len(times), 0.5 + 2.5 * len(scenes))
        rows = figure.subplots(len(scenes), len(times), sharex=True, sharey=True, squeeze=False)
        for row, (label, scene) in zip(rows, scenes.items(), strict=True):
            for axes, time in zip(row, times, strict=True):
                frame = int(np.argmin(np.abs(scene.time - time)))
                car = (float(scene.car[frame, 0]), 0.0)
                _draw_meshes(axes, scene, frame, (0, 2), car)
                _draw_car_side(axes, scene, 0.0)
                _draw_body(axes, scene, frame, (0, 2), car)
                axes.axhline(0.0, color="#333333", linewidth=0.8)
                axes.set(xlim=(-1.25, 0.5), ylim=(-0.05, 1.55), aspect="equal")
                axes.set_title(f"{1e3 * scene.time[frame]:.0f} ms")
            row[0].set_ylabel(f"{style.safe(label)}\nheight [m]" if label else "height [m]")
        for axes in rows[-1]:
            axes.set_xlabel("x in the car's frame [m]")
        figure.suptitle("left limbs orange, right limbs blue", fontsize=9, color=style.GREY)
        return figure


def draw_history(
    time: Array,
    channels: Mapping[str, Array],
    *,
    ylabel: str,
    until: float,
    marks: Mapping[str, float] | None = None,
) -> Figure:
    """Return channels against time.

    Parameters
    ----------
    time : (n,) array
        s.
    channels : mapping
        (n,) values by legend label.
    ylabel : str
        Label with unit.
    until : float
        End of the time axis, s.
    marks : mapping, optional
        Times (s) of vertical lines by label.
    """
    curves = {name: (time, values) for name, values in channels.items()}
    figure = draw_curves(curves, ylabel=ylabel, until=until)
    with style.styled():
        axes = figure.axes[0]
        for name, at in (marks or {}).items():
            if at <= until:
                axes.axvline(1e3 * at, color=style.GREY, linestyle="--", linewidth=1.0,
                             label=style.safe(name))  # fmt: skip
        if len(channels) > 1 or marks:
            axes.legend(framealpha=0.9)
        return figure


def draw_curves(
    curves: Mapping[str, tuple[Array, Array]],
    *,
    ylabel: str,
    until: float,
    since: float = 0.0,
    points: Mapping[str, float] | None = None,
) -> Figure:
    """Return curves, each over its own times, against time.

    Parameters
    ----------
    curves : mapping
        Times (n,) in s and values (n,) by legend label.
    ylabel : str
        Label with unit.
    until, since : float
        End and begin of the time axis, s.
    points : mapping, optional
        Time (s) of a point on a curve, by its label.
    """
    with style.styled():
        figure = style.new_figure(6.4, 3.6)
        axes = figure.subplots()
        for k, (name, (time, values)) in enumerate(curves.items()):
            shown = (time >= since) & (time <= until)
            colour = style.PALETTE[k % len(style.PALETTE)]
            axes.plot(1e3 * time[shown], values[shown], label=style.safe(name), color=colour)
            at = (points or {}).get(name, np.nan)
            if since <= at <= until:
                axes.plot(1e3 * at, np.interp(at, time, values), "o", color=colour)
        axes.set(xlabel="time after first contact [ms]", ylabel=ylabel)
        axes.set(xlim=(1e3 * since, 1e3 * until))
        axes.set_ylim(bottom=0.0)
        if len(curves) > 1:
            axes.legend(framealpha=0.9)
        return figure


def write_animation(scene: SceneLike, path: Path, *, frames: int = 120) -> None:
    """Write a GIF of the whole crash from the side and from above.

    Time runs slowly at first (the impact) and faster afterwards; the clock is on the picture.

    Parameters
    ----------
    scene : SceneLike
    path : Path
        Of the GIF.
    frames : int
        Largest number of frames.
    """
    # Thousands of facets take a third of a second a frame.
    chosen = _animation_frames(scene.time, frames // 2 if scene.meshes else frames)
    low = scene.centre[:, :, 0].min() - 0.8
    high = max(scene.centre[:, :, 0].max(), scene.car[:, 0].max()) + 0.6
    right = min(float(scene.centre[:, :, 1].min()), -1.0) - 0.4
    left = max(float(scene.centre[:, :, 1].max()), float(scene.car[:, 1].max()) + 1.0) + 0.4
    width = 9.6
    scale = 0.88 * width / (high - low)  # inches a metre, equal on both views
    side_height, plan_height = 2.7 * scale, (left - right) * scale
    height = side_height + plan_height + 1.4
    pictures = []
    with style.styled():
        figure = Figure(figsize=(width, height), dpi=90)
        canvas = FigureCanvasAgg(figure)
        above = figure.add_axes((0.08, 0.5 / height, 0.88, plan_height / height))
        bottom = (0.5 + plan_height + 0.55) / height
        side = figure.add_axes((0.08, bottom, 0.88, side_height / height))
        side.set(xlim=(low, high), ylim=(-0.1, 2.6), ylabel="height [m]")
        above.set(xlim=(low, high), ylim=(right, left))
        above.set(xlabel="x along the road [m]", ylabel="y, left [m]")
        side.fill_between([low, high], -0.1, 0.0, color="#D9D9D9", linewidth=0)
        # Axes and road are drawn once; each frame draws what moves on a copy of them.
        canvas.draw()  # type: ignore[no-untyped-call]
        background = canvas.copy_from_bbox(figure.bbox)  # type: ignore[no-untyped-call]
        still = {id(artist) for artist in _artists(side, above)}
        for frame in chosen:
            canvas.restore_region(background)  # type: ignore[no-untyped-call]
            clock = f"t = {1e3 * scene.time[frame]:.0f} ms"
            side.text(0.0, 1.03, clock, transform=side.transAxes, fontsize=12, clip_on=False)
            _draw_meshes(side, scene, frame, (0, 2), (0.0, 0.0))
            _draw_car_side(side, scene, float(scene.car[frame, 0]))
            _draw_body(side, scene, frame, (0, 2), (0.0, 0.0))
            _draw_car_plan(above, scene, frame)
            _draw_meshes(above, scene, frame, (0, 1), (0.0, 0.0))
            _draw_body(above, scene, frame, (0, 1), (0.0, 0.0))
            for artist in _artists(side, above):
                if id(artist) not in still:
                    figure.draw_artist(artist)
                    artist.remove()
            image = np.asarray(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
            pictures.append(Image.fromarray(image).quantize(64, Image.Quantize.FASTOCTREE))
    path.parent.mkdir(parents=True, exist_ok=True)
    pictures[0].save(
        path, save_all=True, append_images=pictures[1:], duration=60, loop=0, optimize=True
    )


def _artists(*panels: Axes) -> list[Artist]:
    """Return lines, patches, collections and texts of the panels, in drawing order."""
    return [
        artist
        for axes in panels
        for artist in (*axes.patches, *axes.lines, *axes.collections, *axes.texts)
    ]


def _animation_frames(time: Array, count: int) -> list[int]:
    """Return frames spaced evenly over time**0.6, which slows the impact down."""
    end = float(time[-1])
    wanted = end * np.linspace(0.0, 1.0, count) ** (1.0 / 0.6)
    return sorted({int(np.argmin(np.abs(time - t))) for t in wanted})
