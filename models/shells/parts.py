"""What holds shells together and up: ties, gaps that close, supports; forces and stored energy."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Ties(NamedTuple):
    """Springs between two nodes at one place, the same in every direction (mastic).

    Attributes
    ----------
    first, second : (t,) array
        Nodes.
    stiffness : (t,) array
        N/m.
    """

    first: Index
    second: Index
    stiffness: Array


class Gaps(NamedTuple):
    """Gaps that carry pressure once they are closed.

    Attributes
    ----------
    upper, lower : (g,) array
        Nodes; -1 for a fixed structure below the upper node's place at rest.
    clearance : (g,) array
        Approach along the normal at which the gap closes, m.
    stiffness : (g,) array
        N/m.
    normal : (3,) array
        From lower to upper.
    """

    upper: Index
    lower: Index
    clearance: Array
    stiffness: Array
    normal: Array


class Supports(NamedTuple):
    """Springs to the car's body.

    Attributes
    ----------
    node : (s,) array
        Nodes.
    rest : (s, 3) array
        Their places without force, m.
    stiffness : (s,) array
        N/m.
    stop : (s,) array of bool
        Whether the support carries pressure against the normal only.
    normal : (3,) array
        Outward normal.
    """

    node: Index
    rest: Array
    stiffness: Array
    stop: NDArray[np.bool_]
    normal: Array


@inlined_kernel
def apply_parts(nodes, start, ties, gaps, supports):
    """Add the forces of ties, gaps and supports and return the energy (J) stored in them.

    Parameters
    ----------
    nodes : Nodes
        ``force`` is increased in place.
    start : (n, 3) array
        Places of the nodes at rest, m.
    ties : Ties
    gaps : Gaps
    supports : Supports
    """
    x, force, stored = nodes.position, nodes.force, 0.0
    for i in range(ties.first.shape[0]):
        a, b, k = ties.first[i], ties.second[i], ties.stiffness[i]
        for j in range(3):
            pull = k * (x[b, j] - x[a, j])
            force[a, j] += pull
            force[b, j] -= pull
            stored += 0.5 * pull * pull / k
    for i in range(gaps.upper.shape[0]):
        a, b = gaps.upper[i], gaps.lower[i]
        approach = 0.0
        for j in range(3):
            moved = x[a, j] - start[a, j]
            if b >= 0:
                moved -= x[b, j] - start[b, j]
            approach -= gaps.normal[j] * moved
        closed = approach - gaps.clearance[i]
        if closed <= 0.0:
            continue
        push = gaps.stiffness[i] * closed
        stored += 0.5 * push * closed
        for j in range(3):
            force[a, j] += push * gaps.normal[j]
            if b >= 0:
                force[b, j] -= push * gaps.normal[j]
    for i in range(supports.node.shape[0]):
        n, k = supports.node[i], supports.stiffness[i]
        if supports.stop[i]:
            depth = 0.0
            for j in range(3):
                depth -= supports.normal[j] * (x[n, j] - supports.rest[i, j])
            if depth > 0.0:
                stored += 0.5 * k * depth * depth
                for j in range(3):
                    force[n, j] += k * depth * supports.normal[j]
        else:
            for j in range(3):
                moved = x[n, j] - supports.rest[i, j]
                force[n, j] -= k * moved
                stored += 0.5 * k * moved * moved
    return stored
