"""Meshes of the single-sheet panels of a car's front: they lie on its lofted surface.

A panel's grid follows the profile line and the lateral stations. It is held along its borders, and
what lies behind it carries pressure after a clearance and keeps a part of its dent.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.shells.parts import Gaps, Supports
from models.vehicle.profile import Vehicle
from models.vehicle.structure.grid import grid_cells, grid_lines, node_areas
from models.vehicle.structure.panel import Panel, join_supports, no_supports, no_ties
from models.vehicle.structure.sheet_metal import materials_of
from models.vehicle.surface.generator import Loft

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def build_panel(
    vehicle: Vehicle,
    loft: Loft,
    entry: Mapping[str, Any],
    materials: Mapping[str, Mapping[str, float]],
    size: float,
    *,
    sheet: float = 1.0,
    strength: float = 1.0,
    behind: float = 1.0,
    mirrored: bool = False,
) -> Panel:
    """Return a panel of the data file.

    Parameters
    ----------
    vehicle : Vehicle
    loft : Loft
        The car's surface.
    entry : mapping
        Row of the data file's ``panels``.
    materials : mapping
        Rows of the data file's ``materials``.
    size : float
        Size of the elements, m.
    sheet, strength, behind : float
        Factors on thickness, yield stress, and stiffness of borders and backing.
    mirrored : bool
        Whether it is the panel of the right side.
    """
    begin, end = _span(vehicle, loft, entry)
    side = entry["lateral"]
    along = grid_lines([begin, *_inner_edges(vehicle, loft, begin, end), end], size)
    across = grid_lines([-y for y in reversed(side)] if mirrored else side, size)
    a, y = (grid.ravel() for grid in np.meshgrid(along, across, indexing="ij"))
    position = loft.points(a, y)
    cells = grid_cells(len(along), len(across))
    corner = position[cells]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    area = node_areas(len(position), cells, 0.5 * np.linalg.norm(normal, axis=1))
    outward = np.stack([node_areas(len(position), cells, normal[:, k]) for k in range(3)], axis=1)
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    number = np.arange(len(position)).reshape(len(along), len(across))
    right, left = ("left", "right") if mirrored else ("right", "left")
    borders = {"lower": number[0], "upper": number[-1], right: number[:, 0], left: number[:, -1]}
    count = len(cells)
    name = entry["name"]
    return Panel(
        name=f"{name} right" if mirrored else f"{name} left" if _is_pair(entry) else name,
        position=position,
        elements=cells,
        outer=np.ones(count, dtype=np.bool_),
        thickness=np.full(count, sheet * entry["thickness"]),
        material=np.zeros(count, dtype=np.int64),
        materials=materials_of(materials, [entry["material"]], strength),
        zone=_zones(vehicle, loft, entry, a),
        ties=no_ties(),
        gaps=_backing(entry.get("backing"), area, outward, behind),
        supports=join_supports([
            no_supports(),
            *(_border(position, nodes, behind * entry["borders"][where], outward)
              for where, nodes in borders.items() if where in entry["borders"]),
        ]),
        held=np.zeros(len(position), dtype=np.bool_),
    )  # fmt: skip


def _is_pair(entry: Mapping[str, Any]) -> bool:
    return bool(entry.get("pair", False))


def _zone_starts(vehicle: Vehicle, loft: Loft) -> dict[str, float]:
    """Return the length along the profile at which each zone of it begins, m."""
    zone = loft.line.zone[: loft.line.exposed]
    starts = np.flatnonzero(np.diff(zone, prepend=-1))
    return {vehicle.zones[zone[k]].name: float(loft.along[k]) for k in starts}


def _span(vehicle: Vehicle, loft: Loft, entry: Mapping[str, Any]) -> tuple[float, float]:
    """Return where a panel begins and ends along the profile, m."""
    starts = _zone_starts(vehicle, loft)
    names = list(starts)
    first, last = entry["span"]
    after = names.index(last) + 1
    trim = entry.get("trim", [0.0, 0.0])
    return starts[first] + trim[0], starts[names[after]] - trim[1]


def _inner_edges(vehicle: Vehicle, loft: Loft, begin: float, end: float) -> list[float]:
    """Return where zones meet between the ends of a panel, m."""
    return [place for place in _zone_starts(vehicle, loft).values() if begin < place < end]


def _zones(vehicle: Vehicle, loft: Loft, entry: Mapping[str, Any], along: Array) -> Index:
    """Return the row of the zone of each node."""
    if "zone" in entry:
        return np.full(len(along), vehicle.zone_index(entry["zone"]))
    place = np.searchsorted(loft.along[: loft.line.exposed], along + 1e-9, side="right") - 1
    return np.asarray(loft.line.zone[place])


def _backing(
    backing: Mapping[str, float] | None, area: Array, outward: Array, behind: float
) -> Gaps:
    """Return what lies behind a panel."""
    count = len(area) if backing else 0
    table = backing or {"clearance": 0.0, "stiffness": 0.0, "unloading": 1.0}
    return Gaps(
        upper=np.arange(count),
        lower=np.full(count, -1),
        clearance=np.full(count, table["clearance"]),
        stiffness=behind * table["stiffness"] * area[:count],
        unloading=np.full(count, table["unloading"]),
        deepest=np.zeros(count),
        normal=outward[:count].copy(),
    )


def _border(position: Array, nodes: Index, stiffness: float, outward: Array) -> Supports:
    """Return the supports along a border, of a stiffness in N/m per m."""
    step = np.linalg.norm(np.diff(position[nodes], axis=0), axis=1)
    length = np.zeros(len(nodes))
    for part, own in zip((step, step), (slice(None, -1), slice(1, None)), strict=True):
        length[own] += 0.5 * part
    return Supports(
        node=nodes,
        rest=position[nodes],
        stiffness=stiffness * length,
        stop=np.zeros(len(nodes), dtype=np.bool_),
        normal=outward[nodes],
    )


def mirrored_sides(entry: Mapping[str, Any]) -> tuple[bool, ...]:
    """Return whether each panel of a row is mirrored: a pair has both, any other is itself."""
    return (False, True) if _is_pair(entry) else (False,)
