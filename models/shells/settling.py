"""A mesh of shells that comes to rest after an impact, and the dent that it keeps."""

import numpy as np
from numpy.typing import NDArray

from models.compilation import kernel
from models.shells.assembly import TOUCHED, Assembly, load_groups, move_groups

Array = NDArray[np.float64]

AROUND = 0.15
"""Distance (m) from a contact up to which a dent is its own (assumed)."""
SETTLING = 0.012
"""Time (s) over which a sheet comes to rest after an impact (assumed)."""
DAMPING = 600.0
"""Damping (1/s) of the sheet in that time: critical at 95 Hz (assumed)."""
RANK = 0.05
"""Singular values, over the largest, that a plane through a nearly flat sheet leaves out."""
RING = 0.3
"""Distance (m) from a contact up to which the sheet shows how it moved as a whole (assumed)."""


def settling_steps(step: float) -> int:
    """Return the number of steps (s) in which a sheet comes to rest."""
    return round(SETTLING / step)


def dent_near(body: Assembly, place: Array) -> tuple[float, int]:
    """Return the depth (m) of the dent near a place, and its deepest touched node (row of them).

    The depth is below the plane that the sheet around the dent has moved to: a hood that has come
    off its stops has no dent for that. Only the group that is nearest to the place counts.

    Parameters
    ----------
    body : Assembly
    place : (3,) array
        m.
    """
    start, now = body.start[body.touched], body.nodes.position[body.touched]
    away = np.linalg.norm(start - place, axis=1)
    moved = np.einsum("tk,tk->t", body.normal, start - now)
    nearest = int(np.argmin(away))
    group = int(np.searchsorted(body.first[TOUCHED], nearest, side="right")) - 1
    same = np.zeros(len(start), dtype=np.bool_)
    same[body.first[TOUCHED, group] : body.first[TOUCHED, group + 1]] = True
    own, ring = same & (away < AROUND), same & (away >= AROUND) & (away < RING)
    if not own.any():
        return 0.0, nearest
    plane = np.column_stack([np.ones(len(start)), start - place])
    level = np.zeros(len(start))
    if np.count_nonzero(ring) > 3:
        level = plane @ np.linalg.lstsq(plane[ring], moved[ring], rcond=RANK)[0]
    depth = np.where(own, moved - level, -np.inf)
    deepest = int(np.argmax(depth))
    return float(max(depth[deepest], 0.0)), deepest


@kernel
def settle(assembly, step, count):
    """Let the groups awake come to rest by damping in proportion to mass.

    Parameters
    ----------
    assembly : Assembly
        Changed.
    step : float
        s.
    count : int
        Number of steps.
    """
    keep = 1.0 - DAMPING * step
    nodes = assembly.nodes
    for _ in range(count):
        load_groups(assembly, step)
        for n in range(nodes.mass.shape[0]):
            for a in range(3):
                nodes.velocity[n, a] *= keep
                nodes.spin[n, a] *= keep
        move_groups(assembly, step, step)
