"""What the viewer shows of runs, packed for its page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcstudy.figures.crash import CAR, MeshLike, SceneLike
from mcstudy.figures.facets import triangles
from mcstudy.viewer.packing import Packer

Array = NDArray[np.float64]

IMPACT, FINE, COARSE = 0.25, 0.002, 0.01
"""s of the crash that is shown finely, and the steps of its frames then and afterwards."""
FILM = 40
"""Largest number of shapes of a deforming mesh."""
MOVED = 5e-4
"""m by which a node of a deforming mesh moves at least to be stored again."""
STEP = 1e-4
"""m (rad of the car's yaw), unit of stored positions; sixteen bits of displacements reach 3.2 m."""
TURN = 1.0 / 32767.0
"""Unit of the entries of stored quaternions."""
INSTANT = 1e-6
"""s, unit of stored times."""
LEAST_ARROW = 20.0
"""N, smallest contact force that is shown."""
STRAIGHT = 1e-3
"""m within which corners of the tape are left out."""
LEVELS = 32767.0
"""Levels of a curve's values on either side of zero."""
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
    """A run to view: label, scene, curves, times (s) of events by name, length of the tape (m)."""

    label: str
    scene: SceneLike
    curves: Sequence[Curve] = ()
    events: Mapping[str, float] = field(default_factory=dict)
    tape_length: float | None = None


def pack_run(run: ViewedRun) -> dict[str, Any]:
    """Return a run as JSON-able numbers, places of arrays, and the arrays' text (``data``).

    Parameters
    ----------
    run : ViewedRun
    """
    scene, packer = run.scene, Packer()
    frames = _frames(scene.time)
    packed = {
        "label": run.label,
        "time": packer.add(scene.time[frames], "i4", INSTANT),
        "names": list(scene.names),
        "axes": np.asarray(scene.semi_axes).tolist(),
        "centre": packer.add(scene.centre[frames], "i4", STEP),
        "orientation": packer.add(scene.orientation[frames], "i2", TURN),
        "car": packer.add(scene.car[frames], "i4", STEP),
        "outline": [packer.add(np.asarray(line)) for line in scene.outline],
        "half_width": float(np.abs(scene.plan[:, 1]).max()),
        "meshes": [_pack_mesh(mesh, packer) for mesh in scene.meshes],
        "forces": _pack_forces(scene, frames, packer),
        "tape": packer.add(_corners(scene.tape)) if scene.tape is not None else None,
        "wad": run.tape_length,
        "curves": [_pack_curve(curve, packer) for curve in run.curves],
        "events": {name: float(at) for name, at in run.events.items() if np.isfinite(at)},
    }
    return packed | {"data": packer.data()}


def _frames(time: Array) -> NDArray[np.int64]:
    """Return the frames that are shown."""
    wanted = np.concatenate(
        [np.arange(0.0, IMPACT, FINE), np.arange(IMPACT, float(time[-1]) + COARSE, COARSE)]
    )
    return np.unique(np.clip(np.searchsorted(time, wanted - 1e-6), 0, len(time) - 1))


def _pack_forces(
    scene: SceneLike, frames: NDArray[np.int64], packer: Packer
) -> dict[str, Any] | None:
    """Return the forces that are shown, by frame: first entry of each frame, places, forces."""
    if scene.forces is None:
        return None
    place, force = scene.forces.place[frames], scene.forces.force[frames]
    shown = np.isfinite(place).all(axis=2) & (np.linalg.norm(force, axis=2) >= LEAST_ARROW)
    count = shown.sum(axis=1)
    return {
        "first": packer.add(np.concatenate([[0], np.cumsum(count)]), "u4"),
        "place": packer.add(place[shown], "i4", STEP),
        "force": packer.add(force[shown], "i4", 1.0),
    }


def _corners(path: Array) -> Array:
    """Return a path without the corners that lie on the straight line of their neighbours."""
    kept = [0]
    for k in range(2, len(path)):
        start, end = path[kept[-1]], path[k]
        inner = path[kept[-1] + 1 : k] - start
        along = (end - start) / np.linalg.norm(end - start)
        off = inner - np.outer(inner @ along, along)
        if np.linalg.norm(off, axis=1).max() > STRAIGHT:
            kept.append(k - 1)
    return path[[*kept, len(path) - 1]]


def _pack_mesh(mesh: MeshLike, packer: Packer) -> dict[str, Any]:
    nodes = np.asarray(mesh.nodes)
    first = nodes[0] if nodes.ndim == 3 else nodes
    packed: dict[str, Any] = {
        "body": mesh.body,
        "car": mesh.body == CAR,
        "nodes": packer.add(first, "i4", STEP),
        "faces": packer.add(triangles(mesh.faces), "u4"),
    }
    if nodes.ndim == 3 and mesh.time is not None:
        film = np.unique(np.linspace(0, len(nodes) - 1, FILM).round().astype(int))
        change = nodes[film] - first
        moved = np.flatnonzero(np.linalg.norm(change, axis=2).max(axis=0) > MOVED)
        packed |= {
            "film_time": packer.add(mesh.time[film], "i4", INSTANT),
            "moved": packer.add(moved, "u4"),
            "change": packer.add(change[:, moved], "i2", STEP),
        }
    return packed


def _pack_curve(curve: Curve, packer: Packer) -> dict[str, Any]:
    early = np.flatnonzero(curve.time <= IMPACT)
    late = np.arange(early.size, curve.time.size, SPARSE)
    kept = np.concatenate([early, late])
    values = curve.values[kept]
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    return {
        "label": curve.label,
        "time": packer.add(curve.time[kept], "i4", INSTANT),
        "values": packer.add(values, "i2", largest / LEVELS if largest > 0.0 else 1.0),
    }
