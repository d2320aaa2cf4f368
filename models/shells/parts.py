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
    """Gaps that carry pressure once they are closed, and may keep a part of what they were pressed.

    Attributes
    ----------
    upper, lower : (g,) array
        Nodes; -1 for a fixed structure below the upper node's place at rest.
    clearance : (g,) array
        Approach along the normal at which the gap closes, m.
    stiffness : (g,) array
        N/m.
    unloading : (g,) array
        Stiffness in unloading over that in loading; 1 for an elastic structure.
    deepest : (g,) array
        Largest approach beyond the clearance so far, m.
    normal : (g, 3) array
        From lower to upper.
    """

    upper: Index
    lower: Index
    clearance: Array
    stiffness: Array
    unloading: Array
    deepest: Array
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
    normal : (s, 3) array
        Outward normals.
    """

    node: Index
    rest: Array
    stiffness: Array
    stop: NDArray[np.bool_]
    normal: Array


@inlined_kernel
def apply_ties(nodes, ties, begin, end):
    """Add the forces of a range of ties and return the energy (J) stored in them.

    Parameters
    ----------
    nodes : Nodes
        ``force`` is increased in place.
    ties : Ties
    begin, end : int
        Range.
    """
    x, force, stored = nodes.position, nodes.force, 0.0
    for i in range(begin, end):
        a, b, k = ties.first[i], ties.second[i], ties.stiffness[i]
        for j in range(3):
            pull = k * (x[b, j] - x[a, j])
            force[a, j] += pull
            force[b, j] -= pull
            stored += 0.5 * pull * pull / k
    return stored


@inlined_kernel
def apply_gaps(nodes, start, gaps, begin, end):
    """Add the forces of a range of gaps and return the energy (J) that they took in.

    Parameters
    ----------
    nodes : Nodes
        ``force`` is increased in place.
    start : (n, 3) array
        Places of the nodes at rest, m.
    gaps : Gaps
        ``deepest`` is updated.
    begin, end : int
        Range.
    """
    x, force, taken = nodes.position, nodes.force, 0.0
    for i in range(begin, end):
        a, b = gaps.upper[i], gaps.lower[i]
        approach = 0.0
        for j in range(3):
            moved = x[a, j] - start[a, j]
            if b >= 0:
                moved -= x[b, j] - start[b, j]
            approach -= gaps.normal[i, j] * moved
        closed = approach - gaps.clearance[i]
        k, ratio = gaps.stiffness[i], gaps.unloading[i]
        deepest = max(gaps.deepest[i], closed)
        if deepest <= 0.0:
            continue
        gaps.deepest[i] = deepest
        push = max(k * deepest - ratio * k * (deepest - closed), 0.0)
        taken += 0.5 * k * deepest * deepest * (1.0 - 1.0 / ratio) + 0.5 * push * push / (ratio * k)
        for j in range(3):
            force[a, j] += push * gaps.normal[i, j]
            if b >= 0:
                force[b, j] -= push * gaps.normal[i, j]
    return taken


@inlined_kernel
def apply_supports(nodes, supports, begin, end):
    """Add the forces of a range of supports and return the energy (J) stored in them.

    Parameters
    ----------
    nodes : Nodes
        ``force`` is increased in place.
    supports : Supports
    begin, end : int
        Range.
    """
    x, force, stored = nodes.position, nodes.force, 0.0
    for i in range(begin, end):
        n, k = supports.node[i], supports.stiffness[i]
        if supports.stop[i]:
            depth = 0.0
            for j in range(3):
                depth -= supports.normal[i, j] * (x[n, j] - supports.rest[i, j])
            if depth > 0.0:
                stored += 0.5 * k * depth * depth
                for j in range(3):
                    force[n, j] += k * depth * supports.normal[i, j]
        else:
            for j in range(3):
                moved = x[n, j] - supports.rest[i, j]
                force[n, j] -= k * moved
                stored += 0.5 * k * moved * moved
    return stored
