"""A mesh of shells that comes to rest after an impact, and the dent that it keeps."""

import numpy as np
from numpy.typing import NDArray

from models.compilation import kernel
from models.shells.element import update_element
from models.shells.explicit import advance, clear_loads
from models.shells.parts import apply_parts

Array = NDArray[np.float64]

AROUND = 0.15
"""Distance (m) from a contact up to which a dent is its own (assumed)."""
SETTLING = 0.012
"""Time (s) over which a sheet comes to rest after an impact (assumed)."""
DAMPING = 600.0
"""Damping (1/s) of the sheet in that time: critical at 95 Hz (assumed)."""
RING = 0.3
"""Distance (m) from a contact up to which the sheet shows how it moved as a whole (assumed)."""


def settling_steps(step: float) -> int:
    """Return the number of steps (s) in which a sheet comes to rest."""
    return round(SETTLING / step)


def dent_near(start: Array, position: Array, normal: Array, place: Array) -> tuple[float, int]:
    """Return the depth (m) of the dent near a place, and the row of its deepest node.

    The depth is below the plane that the sheet around the dent has moved to: a hood that has come
    off its stops has no dent for that.

    Parameters
    ----------
    start, position : (n, 3) array
        Places of the sheet's nodes at rest and now, m.
    normal : (3,) array
        Outward normal.
    place : (3,) array
        m.
    """
    away = np.linalg.norm(start - place, axis=1)
    moved = (start - position) @ normal
    own, ring = away < AROUND, (away >= AROUND) & (away < RING)
    if not own.any():
        return 0.0, int(np.argmin(away))
    plane = np.column_stack([np.ones(len(start)), start[:, :2]])
    level = np.zeros(len(start))
    if np.count_nonzero(ring) > 3:
        level = plane @ np.linalg.lstsq(plane[ring], moved[ring], rcond=None)[0]
    depth = np.where(own, moved - level, -np.inf)
    deepest = int(np.argmax(depth))
    return float(max(depth[deepest], 0.0)), deepest


@kernel
def settle(
    nodes, shells, materials, start, ties, gaps, supports, step, count, frame, local
):  # fmt: skip
    """Let a mesh come to rest by damping in proportion to mass.

    Parameters
    ----------
    nodes, shells, materials
        The mesh; changed.
    start : (n, 3) array
        Places of the nodes at rest, m.
    ties, gaps, supports
        See ``models.shells.parts``.
    step : float
        s.
    count : int
        Number of steps.
    frame : (3, 3) array
        Workspace.
    local : (9,) array
        Workspace.
    """
    keep = 1.0 - DAMPING * step
    for _ in range(count):
        clear_loads(nodes)
        for e in range(shells.node.shape[0]):
            update_element(nodes, shells, materials, e, step, frame, local)
        apply_parts(nodes, start, ties, gaps, supports)
        for n in range(nodes.mass.shape[0]):
            for a in range(3):
                nodes.velocity[n, a] *= keep
                nodes.spin[n, a] *= keep
        advance(nodes, step, step)
