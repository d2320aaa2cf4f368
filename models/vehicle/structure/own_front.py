"""Panels of a user's own deck, placed on the car and given the zones of its facets."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from models.shells.parts import Gaps
from models.vehicle.structure.change import Change
from models.vehicle.structure.deck import Deck, read_deck
from models.vehicle.structure.panel import Panel, Structure, no_supports, no_ties
from models.vehicle.surface.mesh import SurfaceMesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]

NEAR = 0.02
"""Distance (m) of an element's middle from the car's surface up to which bodies can touch it
(assumed)."""


def read_own_front(
    path: Path, units: str, ignore: Collection[str], shift: Array, mesh: SurfaceMesh, rows: Index
) -> tuple[Structure, list[str]]:
    """Return the panels of a deck, each a set of elements that hang together, and notes.

    Parameters
    ----------
    path : Path
        Keyword file in the axes of the car's mesh.
    units, ignore
        See ``models.vehicle.structure.deck.read_deck``.
    shift : (3,) array
        What was added to the mesh's nodes to place it, m.
    mesh : SurfaceMesh
        The car's surface: elements near it can be touched, the others lie behind it.
    rows : (names,) array of int
        Row of the car's zone of each region of the mesh.

    Raises
    ------
    ValueError
        In one line, if the deck is not read, lies off the car, or a panel is not held.
    """
    deck = read_deck(path, units, ignore)
    position = deck.position + shift
    tree = cKDTree(mesh.corners.mean(axis=1))
    middle = position[deck.elements].mean(axis=1)
    away: Array = np.asarray(cKDTree(_sampled(mesh)).query(middle)[0])
    outer = away < NEAR
    if not outer.any():
        raise ValueError(
            f"{path}: no shell lies within {1e3 * NEAR:.0f} mm of the car's surface, the nearest "
            f"{away.min():.3g} m away; deck and mesh need the same axes and origin"
        )
    elements = _facing_out(position, deck.elements, outer, mesh, tree)
    _, facet = tree.query(position)
    zone = rows[mesh.region[facet]]
    panels = [
        _panel(path, deck, position, elements, outer, zone, own) for own in _islands(deck.elements)
    ]
    return Structure(tuple(panels), deck.digest), deck.notes


def _sampled(mesh: SurfaceMesh) -> Array:
    """Return the corners and middles of a mesh's facets and the middles of their sides (k, 3)."""
    corners = mesh.corners
    sides = 0.5 * (corners + np.roll(corners, 1, axis=1))
    return np.concatenate([mesh.nodes, corners.mean(axis=1), sides.reshape(-1, 3)])


def _facing_out(
    position: Array, elements: Index, outer: NDArray[np.bool_], mesh: SurfaceMesh, tree: cKDTree
) -> Index:
    """Return elements of which the outer ones face as the facets near them."""
    corner = position[elements]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    _, facet = tree.query(corner.mean(axis=1))
    inward = outer & (np.einsum("mk,mk->m", normal, mesh.area_vectors[facet]) < 0.0)
    triangle = elements[:, 2] == elements[:, 3]
    turned = np.where(triangle[:, None], elements[:, [1, 0, 2, 3]], elements[:, ::-1])
    return np.where(inward[:, None], turned, elements)


def _islands(elements: Index) -> list[Index]:
    """Return the rows of elements that hang together by nodes, one array an island."""
    count, nodes = len(elements), int(elements.max()) + 1
    links = coo_array(
        (np.ones(elements.size), (np.repeat(np.arange(count), 4), count + elements.ravel())),
        shape=(count + nodes,) * 2,
    )
    _, label = connected_components(links, directed=False)
    return [np.flatnonzero(label[:count] == k) for k in np.unique(label[:count])]


def _panel(
    path: Path,
    deck: Deck,
    position: Array,
    elements: Index,
    outer: NDArray[np.bool_],
    zone: Index,
    own: Index,
) -> Panel:
    """Return the panel of some elements."""
    used, local = np.unique(elements[own], return_inverse=True)
    name = deck.names[int(deck.part[own[0]])]
    if not deck.held[used].any():
        raise ValueError(
            f"{path}: {name!r} is held by nothing; fix nodes by *BOUNDARY_SPC or share nodes with "
            "a part of *MAT_RIGID"
        )
    nothing, none = np.zeros(0), np.zeros(0, dtype=np.int64)
    return Panel(
        name=name,
        position=position[used],
        elements=local.reshape(-1, 4),
        outer=outer[own],
        thickness=deck.thickness[deck.part[own]],
        material=deck.part[own],
        materials=deck.materials,
        zone=zone[used],
        ties=no_ties(),
        gaps=Gaps(none, none, nothing, nothing, nothing, nothing, np.zeros((0, 3))),
        supports=no_supports(),
        held=deck.held[used],
    )


def changed(structure: Structure, change: Change, zones: Sequence[str]) -> Structure:
    """Return a structure with other thicknesses and yield stresses.

    Parameters
    ----------
    structure : Structure
    change : Change
        Its factor on ribs does not apply.
    zones : sequence of str
        Names of the car's zones; a panel is changed as the zone in which most of its nodes lie.
    """
    panels = []
    for panel in structure.panels:
        zone = zones[int(np.bincount(panel.zone).argmax())]
        sheet, strength, _ = change.factors(zone)
        limits = strength * panel.materials.yield_stress
        panels.append(
            replace(
                panel,
                thickness=sheet * panel.thickness,
                materials=panel.materials._replace(yield_stress=limits),
            )
        )
    return replace(structure, panels=tuple(panels))
