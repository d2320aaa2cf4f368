"""Shells with what holds them, in groups that share no node and are stepped only while awake."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel, kernel
from models.shells.element import update_element
from models.shells.explicit import advance, clear_loads
from models.shells.material import Materials
from models.shells.parts import Gaps, Supports, Ties, apply_gaps, apply_supports, apply_ties
from models.shells.state import Nodes, Shells

Array = NDArray[np.float64]
Index = NDArray[np.int64]

NODES, ELEMENTS, TIES, GAPS, SUPPORTS, TOUCHED = range(6)
"""Rows of ``Assembly.first``."""


class Assembly(NamedTuple):
    """Groups of shells; everything is ordered by group.

    Attributes
    ----------
    nodes : Nodes
    shells : Shells
    materials : Materials
    start : (n, 3) array
        Places of the nodes at rest, m.
    ties, gaps, supports
        See ``models.shells.parts``.
    touched : (t,) array of int
        Nodes that bodies can touch.
    area : (t,) array
        Area about each, m2.
    normal : (t, 3) array
        Outward normal at each at rest.
    region : (t,) array of int
        Row of the car's zone that each belongs to.
    first : (6, groups + 1) array of int
        First row of each group in the nodes, elements, ties, gaps, supports and touched nodes.
    awake : (groups,) array of bool
        Groups that are stepped; the others stay as they are.
    moving, stored : (groups,) array
        Kinetic energy, and energy in ties, gaps and supports, at the last step, J.
    step : float
        Largest stable step, s.
    frame : (3, 3) array
        Workspace.
    local : (9,) array
        Workspace.
    """

    nodes: Nodes
    shells: Shells
    materials: Materials
    start: Array
    ties: Ties
    gaps: Gaps
    supports: Supports
    touched: Index
    area: Array
    normal: Array
    region: Index
    first: Index
    awake: NDArray[np.bool_]
    moving: Array
    stored: Array
    step: float
    frame: Array
    local: Array


@kernel
def load_groups(assembly, step):
    """Fill the forces of elements, ties, gaps and supports on the nodes of the groups awake.

    Parameters
    ----------
    assembly : Assembly
    step : float
        s.
    """
    first, nodes = assembly.first, assembly.nodes
    for g in range(assembly.awake.shape[0]):
        if not assembly.awake[g]:
            continue
        clear_loads(nodes, first[NODES, g], first[NODES, g + 1])
        for e in range(first[ELEMENTS, g], first[ELEMENTS, g + 1]):
            update_element(
                nodes, assembly.shells, assembly.materials, e, step, assembly.frame, assembly.local
            )
        assembly.stored[g] = (
            apply_ties(nodes, assembly.ties, first[TIES, g], first[TIES, g + 1])
            + apply_gaps(nodes, assembly.start, assembly.gaps, first[GAPS, g], first[GAPS, g + 1])
            + apply_supports(nodes, assembly.supports, first[SUPPORTS, g], first[SUPPORTS, g + 1])
        )


@kernel
def move_groups(assembly, step, before):
    """Advance the nodes of the groups awake.

    Parameters
    ----------
    assembly : Assembly
    step, before : float
        See ``models.shells.explicit.advance``.
    """
    first = assembly.first
    for g in range(assembly.awake.shape[0]):
        if assembly.awake[g]:
            assembly.moving[g] = advance(
                assembly.nodes, first[NODES, g], first[NODES, g + 1], step, before
            )


@inlined_kernel
def displacement_of(assembly, t):
    """Return how far (m) a touched node has moved into the car, along its normal at rest."""
    n, moved = assembly.touched[t], 0.0
    for k in range(3):
        moved -= assembly.normal[t, k] * (assembly.nodes.position[n, k] - assembly.start[n, k])
    return moved
