"""What the viewer shows of runs, packed for its page."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcstudy.figures.crash import CAR, MeshLike, SceneLike
from mcstudy.figures.facets import triangles

Array = NDArray[np.float64]

IMPACT, FINE, COARSE = 0.25, 0.002, 0.01
"""s of the crash that is shown finely, and the steps of its frames then and afterwards."""
FILM = 40
"""Largest number of shapes of a deforming mesh."""
MOVED = 5e-4
"""m by which a node of a deforming mesh moves at least to be stored again."""
STEP = 1e-4
"""m, unit of stored displacements; sixteen bits reach 3.2 m."""
SPARSE = 20
"""Samples of a curve of which one is kept after the impact."""


@dataclass(frozen=True)
class Curve:
    """A history below the scene: label with unit, times (n,) in s, values (n,)."""

    label: str
    time: Array
    values: Array


@dataclass(frozen=True)
class ViewedRun:
    """A run to view: label, scene, curves, and times (s) of events by name."""

    label: str
    scene: SceneLike
    curves: Sequence[Curve] = ()
    events: Mapping[str, float] = field(default_factory=dict)


def pack_run(run: ViewedRun) -> dict[str, Any]:
    """Return a run as JSON-able numbers and base64 arrays.

    Parameters
    ----------
    run : ViewedRun
    """
    scene = run.scene
    frames = _frames(scene.time)
    return {
        "label": run.label,
        "time": pack_array(scene.time[frames]),
        "names": list(scene.names),
        "axes": np.asarray(scene.semi_axes).tolist(),
        "centre": pack_array(scene.centre[frames]),
        "orientation": pack_array(scene.orientation[frames]),
        "car": pack_array(scene.car[frames]),
        "outline": [pack_array(np.asarray(line)) for line in scene.outline],
        "half_width": float(np.abs(scene.plan[:, 1]).max()),
        "meshes": [_pack_mesh(mesh) for mesh in scene.meshes],
        "curves": [_pack_curve(curve) for curve in run.curves],
        "events": {name: float(at) for name, at in run.events.items() if np.isfinite(at)},
    }


def _frames(time: Array) -> NDArray[np.int64]:
    """Return the frames that are shown."""
    wanted = np.concatenate(
        [np.arange(0.0, IMPACT, FINE), np.arange(IMPACT, float(time[-1]) + COARSE, COARSE)]
    )
    return np.unique(np.clip(np.searchsorted(time, wanted - 1e-6), 0, len(time) - 1))


def pack_array(values: NDArray[Any], kind: str = "<f4") -> str:
    """Return an array as base64 text, little-endian.

    Parameters
    ----------
    values : array
    kind : str
        Type of its numbers.
    """
    # Numbers beyond single precision become infinite, which the pages leave out.
    with np.errstate(over="ignore", invalid="ignore"):
        table = np.ascontiguousarray(values, dtype=kind)
    return base64.b64encode(table.tobytes()).decode("ascii")


def _pack_mesh(mesh: MeshLike) -> dict[str, Any]:
    nodes = np.asarray(mesh.nodes)
    first = nodes[0] if nodes.ndim == 3 else nodes
    packed: dict[str, Any] = {
        "body": mesh.body,
        "car": mesh.body == CAR,
        "nodes": pack_array(first),
        "faces": pack_array(triangles(mesh.faces), "<u4"),
    }
    if nodes.ndim == 3 and mesh.time is not None:
        film = np.unique(np.linspace(0, len(nodes) - 1, FILM).round().astype(int))
        change = nodes[film] - first
        moved = np.flatnonzero(np.linalg.norm(change, axis=2).max(axis=0) > MOVED)
        packed |= {
            "film_time": pack_array(mesh.time[film]),
            "moved": pack_array(moved, "<u4"),
            "step": STEP,
            "change": pack_array(np.round(change[:, moved] / STEP), "<i2"),
        }
    return packed


def _pack_curve(curve: Curve) -> dict[str, Any]:
    early = np.flatnonzero(curve.time <= IMPACT)
    late = np.arange(early.size, curve.time.size, SPARSE)
    kept = np.concatenate([early, late])
    return {
        "label": curve.label,
        "time": pack_array(curve.time[kept]),
        "values": pack_array(curve.values[kept]),
    }
