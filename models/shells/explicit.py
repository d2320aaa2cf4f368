"""Central differences in time for a mesh of shells."""

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel, kernel
from models.shells.element import place_element, update_element
from models.shells.material import Materials
from models.shells.state import GAUSS, Nodes, Shells

Array = NDArray[np.float64]
Index = NDArray[np.int64]

COURANT = 0.9
"""Step over the time in which a wave crosses the smallest element (usual in explicit codes)."""
SPREAD = 1.0 / 12.0
"""Rotary inertia of a node over its mass times the area of an element, besides the plate's own:
keeps bending and transverse shear slower than membrane waves."""


@kernel
def _start(nodes, shells, frame, local):
    for e in range(shells.node.shape[0]):
        place_element(nodes, shells, e, frame, local)
        for k in range(3):
            for j in range(3):
                shells.frame[e, k, j] = frame[k, j]
        for k in range(9):
            shells.local[e, k] = local[k]


def build_shells(
    position: Array,
    node: Index,
    thickness: Array,
    material: Index,
    materials: Materials,
    points: int = 3,
) -> tuple[Nodes, Shells]:
    """Return nodes at rest and unstressed elements.

    Parameters
    ----------
    position : (n, 3) array
        m.
    node : (m, 4) array of int
        Nodes of the elements, counterclockwise; a triangle repeats its last node.
    thickness : (m,) array
        m.
    material : (m,) array of int
        Row of the material.
    materials : Materials
    points : int
        Points through the thickness: 1, 3 or 5.
    """
    place, weight = (np.array(values) for values in GAUSS[points])
    m, n = len(node), len(position)
    shells = Shells(
        node=np.ascontiguousarray(node, dtype=np.int64),
        material=np.ascontiguousarray(material, dtype=np.int64),
        thickness=np.array(thickness, dtype=np.float64),
        place=place,
        weight=weight,
        frame=np.zeros((m, 3, 3)),
        local=np.zeros((m, 9)),
        stress=np.zeros((m, points, 3)),
        plastic=np.zeros((m, points)),
        shear=np.zeros((m, 2)),
        bow=np.zeros((m, 6)),
        drill=np.zeros((m, 4)),
        energy=np.zeros(4),
    )
    nodes = Nodes(
        position=np.array(position, dtype=np.float64),
        velocity=np.zeros((n, 3)),
        spin=np.zeros((n, 3)),
        force=np.zeros((n, 3)),
        moment=np.zeros((n, 3)),
        mass=np.zeros(n),
        inertia=np.zeros(n),
        held=np.zeros((n, 6), dtype=np.bool_),
    )
    _start(nodes, shells, np.zeros((3, 3)), np.zeros(9))
    area = areas(shells)
    quarter = 0.25 * materials.density[shells.material] * area * shells.thickness
    rotary = quarter * (shells.thickness**2 / 12.0 + SPREAD * area)
    for k in range(4):
        np.add.at(nodes.mass, shells.node[:, k], quarter)
        np.add.at(nodes.inertia, shells.node[:, k], rotary)
    return nodes, shells


def areas(shells: Shells) -> Array:
    """Return the areas (m,) of the elements, m2."""
    x, y = shells.local[:, :4], shells.local[:, 4:8]
    return np.asarray(
        0.5
        * ((x[:, 2] - x[:, 0]) * (y[:, 3] - y[:, 1]) + (x[:, 1] - x[:, 3]) * (y[:, 2] - y[:, 0]))
    )


def stable_step(shells: Shells, materials: Materials) -> float:
    """Return the stable step (s) of a mesh.

    The length of an element is its area over its longest side or diagonal, the wave speed that of a
    plate.

    Parameters
    ----------
    shells : Shells
    materials : Materials
    """
    x, y = shells.local[:, :4], shells.local[:, 4:8]
    ends = [(0, 1), (1, 2), (2, 3), (3, 0)]
    sides = [np.hypot(x[:, a] - x[:, b], y[:, a] - y[:, b]) for a, b in ends]
    triangle = shells.node[:, 2] == shells.node[:, 3]
    longest = np.max(sides, axis=0)
    length = np.where(triangle, 2.0, 1.0) * areas(shells) / longest
    k = shells.material
    speed = np.sqrt(materials.young[k] / (materials.density[k] * (1.0 - materials.poisson[k] ** 2)))
    return COURANT * float((length / speed).min())


@inlined_kernel
def clear_loads(nodes, begin, end):
    """Set forces and moments of a range of nodes to zero."""
    for n in range(begin, end):
        for k in range(3):
            nodes.force[n, k] = 0.0
            nodes.moment[n, k] = 0.0


@inlined_kernel
def advance(nodes, begin, end, step, before):
    """Advance velocities over a step and positions with them, and return the kinetic energy (J).

    The energy is that at the time of the forces, from the velocities before and after it: with it
    the sum of all energies is kept by central differences.

    Parameters
    ----------
    nodes : Nodes
    begin, end : int
        Range.
    step : float
        Time from one position to the next, s.
    before : float
        Time from the velocities, at the middle of the last step, to those of this one, s.
    """
    energy = 0.0
    for n in range(begin, end):
        push, turn = before / nodes.mass[n], before / nodes.inertia[n]
        for k in range(3):
            if nodes.held[n, k]:
                nodes.velocity[n, k] = 0.0
            else:
                old = nodes.velocity[n, k]
                new = old + push * nodes.force[n, k]
                energy += 0.5 * nodes.mass[n] * old * new
                nodes.velocity[n, k] = new
                nodes.position[n, k] += step * new
            if nodes.held[n, 3 + k]:
                nodes.spin[n, k] = 0.0
            else:
                old = nodes.spin[n, k]
                new = old + turn * nodes.moment[n, k]
                energy += 0.5 * nodes.inertia[n] * old * new
                nodes.spin[n, k] = new
    return energy


@kernel
def internal_forces(nodes, shells, materials, step, frame, local):
    """Fill the forces of the elements on the nodes at their present place.

    Parameters
    ----------
    nodes : Nodes
        ``force`` and ``moment`` are overwritten; ``spin`` times the step is what the nodes have
        turned by since the last call.
    shells : Shells
        State of the elements; updated.
    materials : Materials
    step : float
        s.
    frame : (3, 3) array
        Workspace.
    local : (9,) array
        Workspace.
    """
    clear_loads(nodes, 0, nodes.mass.shape[0])
    for e in range(shells.node.shape[0]):
        update_element(nodes, shells, materials, e, step, frame, local)
