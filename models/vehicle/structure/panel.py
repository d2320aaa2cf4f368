"""Panels of shells, and their assembly into a structure that can be stepped."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.shells.assembly import Assembly
from models.shells.explicit import areas, build_shells, stable_step
from models.shells.material import Materials
from models.shells.parts import Gaps, Supports, Ties

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Panel:
    """A part of a car's front whose nodes it shares with no other, in the static car's frame.

    Attributes
    ----------
    name : str
    position : (n, 3) array
        m.
    elements : (m, 4) array of int
        Nodes, counterclockwise seen from outside; a triangle repeats its last node.
    outer : (m,) array of bool
        Elements that bodies can touch.
    thickness : (m,) array
        m.
    material : (m,) array of int
        Row of ``materials``.
    materials : Materials
    zone : (n,) array of int
        Row of the car's zone to which each node belongs.
    ties, gaps, supports
        See ``models.shells.parts``; nodes of this panel.
    held : (n,) array of bool
        Nodes fixed to the car.
    """

    name: str
    position: Array
    elements: Index
    outer: NDArray[np.bool_]
    thickness: Array
    material: Index
    materials: Materials
    zone: Index
    ties: Ties
    gaps: Gaps
    supports: Supports
    held: NDArray[np.bool_]

    @property
    def touched(self) -> Index:
        """Nodes that bodies can touch."""
        return np.unique(self.elements[self.outer])


@dataclass(frozen=True)
class Structure:
    """Panels of a car's front.

    Attributes
    ----------
    panels : tuple of Panel
    digest : str
        Of a user's deck; empty for generated panels.
    """

    panels: tuple[Panel, ...]
    digest: str = ""

    @property
    def element_count(self) -> int:
        """Number of elements."""
        return sum(len(panel.elements) for panel in self.panels)

    def assemble(self, points: int = 3) -> Assembly:
        """Return the panels at rest, all asleep.

        Parameters
        ----------
        points : int
            Points through the thickness: 1, 3 or 5.
        """
        panels = self.panels
        counts = np.array([
            [len(p.position), len(p.elements), len(p.ties.first), len(p.gaps.upper),
             len(p.supports.node), len(p.touched)]
            for p in panels
        ])  # fmt: skip
        first = np.zeros((counts.shape[1], len(panels) + 1), dtype=np.int64)
        first[:, 1:] = np.cumsum(counts, axis=0).T
        base = first[0]
        rows = np.cumsum([0, *(len(p.materials.young) for p in panels)])
        position = np.concatenate([p.position for p in panels])
        elements = np.concatenate([p.elements + base[k] for k, p in enumerate(panels)])
        materials = Materials(
            *(np.concatenate([m[k] for m in (p.materials for p in panels)])
              for k in range(len(Materials._fields)))
        )  # fmt: skip
        nodes, shells = build_shells(
            position,
            elements,
            np.concatenate([p.thickness for p in panels]),
            np.concatenate([p.material + rows[k] for k, p in enumerate(panels)]),
            materials,
            points,
        )
        nodes.held[np.concatenate([p.held for p in panels])] = True
        outer = np.concatenate([p.outer for p in panels])
        touched = np.unique(elements[outer])
        area, normal = _outer_areas(position, elements[outer], areas(shells)[outer])
        return Assembly(
            nodes=nodes, shells=shells, materials=materials, start=position.copy(),
            ties=_joined_ties(panels, base), gaps=_joined_gaps(panels, base),
            supports=_joined_supports(panels, base),
            touched=touched, area=area[touched], normal=normal[touched],
            region=np.concatenate([p.zone for p in panels])[touched],
            first=first, awake=np.zeros(len(panels), dtype=np.bool_),
            moving=np.zeros(len(panels)), stored=np.zeros(len(panels)),
            step=stable_step(shells, materials), frame=np.zeros((3, 3)), local=np.zeros(9),
        )  # fmt: skip


def no_ties() -> Ties:
    """Return no ties."""
    return Ties(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))


def no_supports() -> Supports:
    """Return no supports."""
    return Supports(
        node=np.zeros(0, dtype=np.int64), rest=np.zeros((0, 3)), stiffness=np.zeros(0),
        stop=np.zeros(0, dtype=np.bool_), normal=np.zeros((0, 3)),
    )  # fmt: skip


def join_supports(parts: Sequence[Supports]) -> Supports:
    """Return several supports in one."""
    return Supports(*(np.concatenate(rows) for rows in zip(*parts, strict=True)))


def _joined_ties(panels: Sequence[Panel], base: Index) -> Ties:
    parts = [
        Ties(p.ties.first + base[k], p.ties.second + base[k], p.ties.stiffness)
        for k, p in enumerate(panels)
    ]
    return Ties(*(np.concatenate(rows) for rows in zip(*parts, strict=True)))


def _joined_gaps(panels: Sequence[Panel], base: Index) -> Gaps:
    parts = [
        p.gaps._replace(
            upper=p.gaps.upper + base[k],
            # A fixed structure stays -1.
            lower=np.where(p.gaps.lower < 0, -1, p.gaps.lower + base[k]),
            deepest=p.gaps.deepest.copy(),
        )
        for k, p in enumerate(panels)
    ]
    return Gaps(*(np.concatenate(rows) for rows in zip(*parts, strict=True)))


def _joined_supports(panels: Sequence[Panel], base: Index) -> Supports:
    return join_supports([
        p.supports._replace(node=p.supports.node + base[k]) for k, p in enumerate(panels)
    ])  # fmt: skip


def _outer_areas(position: Array, elements: Index, area: Array) -> tuple[Array, Array]:
    """Return area (n,) about each node, m2, and unit normal (n, 3) of outer elements."""
    corner = position[elements]
    across = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    triangle = elements[:, 2] == elements[:, 3]
    share = np.where(triangle, 3.0, 4.0)
    total, normal = np.zeros(len(position)), np.zeros((len(position), 3))
    for k in range(4):
        own = ~triangle | (k < 3)
        np.add.at(total, elements[own, k], (area / share)[own])
        np.add.at(normal, elements[own, k], (across / share[:, None])[own])
    size = np.linalg.norm(normal, axis=1)
    return total, normal / np.where(size > 0.0, size, 1.0)[:, None]
