"""Mesh of a hood: an outer sheet and an inner one of hat sections, on common grid lines.

All edges of the sections are grid lines, so that their shape is the same at every element size.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models import data
from models.shells.explicit import areas
from models.shells.material import Materials
from models.shells.parts import Gaps, Supports, Ties
from models.shells.state import Shells
from models.vehicle.profile import Vehicle

Array = NDArray[np.float64]
Index = NDArray[np.int64]

OUTER, INNER = 0, 1
SMALLEST, LARGEST = 0.008, 0.06
"""Sizes of the elements, m (assumed)."""
NARROW = 1.25
"""Length of an element, over the size asked for, from which on it is halved."""


@dataclass(frozen=True)
class HoodMesh:
    """Nodes and elements of a hood in the frame of the static car.

    Attributes
    ----------
    position : (n, 3) array
        m.
    plan : (n, 2) array
        s and y of the nodes, m.
    sheet : (n,) array
        OUTER or INNER.
    elements : (m, 4) array of int
        Nodes, counterclockwise seen from above.
    thickness : (m,) array
        m.
    material : (m,) array of int
        Row of ``materials``.
    materials : Materials
    normal : (3,) array
        Outward normal of the hood's plane.
    ties, gaps, supports
        See ``models.shells.parts``.
    """

    position: Array
    plan: Array
    sheet: Index
    elements: Index
    thickness: Array
    material: Index
    materials: Materials
    normal: Array
    ties: Ties
    gaps: Gaps
    supports: Supports


def hood_table(vehicle: str) -> dict[str, Any]:
    """Return the data file of a vehicle's hood.

    Raises
    ------
    ValueError
        If there is none.
    """
    if vehicle not in data.names("fem"):
        known = ", ".join(data.names("fem"))
        raise ValueError(f"{vehicle!r} has no finite elements; there are those of {known}")
    return data.load(f"fem/{vehicle}.toml")


def check_size(size: float) -> None:
    """Raise ``ValueError`` if an element size (m) is not within 8 to 60 mm."""
    if not SMALLEST <= size <= LARGEST:
        raise ValueError(
            f"element_size must lie within {SMALLEST:g} and {LARGEST:g} m, given {size:g}"
        )


def build_hood(
    vehicle: Vehicle, size: float, *, rib: float = 1.0, sheet: float = 1.0, strength: float = 1.0
) -> HoodMesh:
    """Return the hood of a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
    size : float
        Size of the elements, m.
    rib, sheet, strength : float
        Factors on the depth of the sections, the thickness of the sheets and the yield stress.

    Raises
    ------
    ValueError
        If the vehicle has no hood of finite elements.
    """
    table = hood_table(vehicle.name)
    ribs, hood = table["ribs"], table["hood"]
    across = _lines(_edges(ribs, "across", 0.0, hood["length"]), size)
    along = _lines(_edges(ribs, "along", -hood["half_width"], hood["half_width"]), size)
    s, y = (grid.ravel() for grid in np.meshgrid(across, along, indexing="ij"))
    depth, _ = _section(ribs, s, y, hood)
    cells = _cells(len(across), len(along))
    middle_s, middle_y = s[cells].mean(axis=1), y[cells].mean(axis=1)
    _, inside = _section(ribs, middle_s, middle_y, hood)
    outer = _on_hood(vehicle, s, y)
    normal = _normal(vehicle)
    held = np.unique(cells[inside])
    number = np.full(len(s), -1)
    number[held] = len(s) + np.arange(len(held))
    lower = outer[held] - rib * depth[held, None] * normal
    thickness = [sheet * table["sheets"][name]["thickness"] for name in ("outer", "inner")]
    names = list(table["materials"])
    rows = [names.index(table["sheets"][name]["material"]) for name in ("outer", "inner")]
    elements = np.concatenate([cells, number[cells[inside]]])
    count = [len(cells), int(inside.sum())]
    area = np.zeros(len(s))
    np.add.at(area, cells[inside].ravel(), np.repeat(_plan_area(s, y, cells[inside]) / 4.0, 4))
    flange = held[depth[held] == 0.0]
    bottom = held[depth[held] > 0.0]
    position = np.concatenate([outer, lower])
    plan = np.stack([np.concatenate([s, s[held]]), np.concatenate([y, y[held]])], axis=1)
    lumped = np.zeros(len(s))
    np.add.at(lumped, cells.ravel(), np.repeat(_plan_area(s, y, cells) / 4.0, 4))
    ties = table["ties"]
    apart = rib * depth[bottom]
    return HoodMesh(
        position=position,
        plan=plan,
        sheet=np.repeat([OUTER, INNER], [len(s), len(held)]),
        elements=elements,
        thickness=np.repeat(thickness, count),
        material=np.repeat(rows, count),
        materials=_materials(table["materials"], strength),
        normal=normal,
        ties=Ties(flange, number[flange], ties["stiffness"] * area[flange]),
        gaps=_gaps(table, bottom, number, apart, area, lumped, plan, sum(thickness) / 2.0, normal),
        supports=_supports(table["supports"], position, plan, len(s), number, normal),
    )


def outer_areas(hood: HoodMesh, shells: Shells) -> Array:
    """Return the area (n,) of the outer sheet about each node, m2; 0 on the inner sheet.

    Parameters
    ----------
    hood : HoodMesh
    shells : Shells
        Of the hood.
    """
    own = (hood.sheet[hood.elements] == OUTER).all(axis=1)
    area, quarter = np.zeros(len(hood.position)), areas(shells)[own] / 4.0
    for k in range(4):
        np.add.at(area, hood.elements[own, k], quarter)
    return area


def _edges(ribs: Mapping[str, Any], way: str, first: float, last: float) -> list[float]:
    """Return the edges of the sections, and of the channel along the hood's edges, in order."""
    steps = np.cumsum([0.0, ribs["flange"], ribs["web"], ribs["bottom"], ribs["web"],
                       ribs["flange"]])  # fmt: skip
    width = float(steps[-1])
    starts = [first, last - width, *(place - 0.5 * width for place in ribs[way])]
    found = [first, last, *(start + step for start in starts for step in steps)]
    return sorted({round(place, 9) for place in found if first <= place <= last})


def _lines(edges: Sequence[float], size: float) -> Array:
    """Return grid lines through all edges, about ``size`` apart."""
    lines = [edges[0]]
    for a, b in itertools.pairwise(edges):
        count = max(1, math.ceil((b - a) / (NARROW * size) - 1e-9))
        lines += [a + (b - a) * k / count for k in range(1, count + 1)]
    return np.array(lines)


def _section(
    ribs: Mapping[str, Any], s: Array, y: Array, hood: Mapping[str, Any]
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the depth of the inner sheet at places, m, and whether there is one."""
    half = 0.5 * ribs["bottom"]
    whole = half + ribs["web"] + ribs["flange"]
    depth, covered = np.zeros(len(s)), np.zeros(len(s), dtype=np.bool_)
    ends = ((s, ribs["across"], 0.0, hood["length"]),
            (y, ribs["along"], -hood["half_width"], hood["half_width"]))  # fmt: skip
    for place, own, first, last in ends:
        for middle in (first + whole, last - whole, *own):
            away = np.abs(place - middle)
            covered |= away <= whole + 1e-9
            share = np.clip((half + ribs["web"] - away) / ribs["web"], 0.0, 1.0)
            depth = np.maximum(depth, ribs["depth"] * np.where(share < 1e-6, 0.0, share))
    # The edge of the hood is a hem: both sheets in one.
    hem = (s < 1e-9) | (s > hood["length"] - 1e-9) | (np.abs(y) > hood["half_width"] - 1e-9)
    depth[hem] = 0.0
    return depth, covered


def _cells(rows: int, columns: int) -> Index:
    """Return the cells of a grid, counterclockwise seen from above (s rearwards, y to the left)."""
    i, j = (g.ravel() for g in np.meshgrid(np.arange(rows - 1), np.arange(columns - 1),
                                           indexing="ij"))  # fmt: skip
    a = i * columns + j
    return np.stack([a, a + 1, a + columns + 1, a + columns], axis=1)


def _plan_area(s: Array, y: Array, cells: Index) -> Array:
    """Return the areas of rectangular cells in plan, m2."""
    return np.asarray(np.ptp(s[cells], axis=1) * np.ptp(y[cells], axis=1))


def _normal(vehicle: Vehicle) -> Array:
    direction = vehicle.zones[vehicle.zone_index("hood")].direction
    return np.array([direction[1], 0.0, -direction[0]])


def _on_hood(vehicle: Vehicle, s: Array, y: Array) -> Array:
    """Return the places (n, 3) on a vehicle's hood, crowned and bent as its surface of facets."""
    zone = vehicle.zones[vehicle.zone_index("hood")]
    crown = data.load(f"vehicles/{vehicle.name}.toml")["surface"]["crown"]
    bend = vehicle.bend[vehicle.zone_index("hood")]
    x = zone.origin[0] + s * zone.direction[0] - 0.5 * zone.curvature * y**2
    z = zone.origin[1] + s * zone.direction[1] - crown * (y / bend) ** 2
    return np.stack([x, y, z], axis=1)


def _materials(table: Mapping[str, Mapping[str, float]], strength: float) -> Materials:
    """Return the materials of a data file, yield stresses times a factor."""
    columns = {
        name: np.array([float(row[name]) for row in table.values()]) for name in Materials._fields
    }
    columns["yield_stress"] = strength * columns["yield_stress"]
    return Materials(**columns)


def _gaps(
    table: Mapping[str, Any],
    bottom: Index,
    number: Index,
    apart: Array,
    area: Array,
    lumped: Array,
    plan: Array,
    sheets: float,
    normal: Array,
) -> Gaps:
    """Return the contacts between the sheets, and of the outer sheet with the structure below."""
    upper, lower = [bottom], [number[bottom]]
    clearance = [apart - sheets]
    stiffness = [table["ties"]["contact"] * area[bottom]]
    for entry in table.get("hard_points", []):
        (s0, y0), (s1, y1) = entry["box"]
        s, y = plan[: len(lumped)].T
        own = np.flatnonzero((s >= s0) & (s <= s1) & (y >= y0) & (y <= y1))
        upper.append(own)
        lower.append(np.full(len(own), -1))
        clearance.append(np.full(len(own), entry["clearance"]))
        stiffness.append(entry["stiffness"] * lumped[own])
    return Gaps(
        upper=np.concatenate(upper),
        lower=np.concatenate(lower),
        clearance=np.concatenate(clearance),
        stiffness=np.concatenate(stiffness),
        normal=normal,
    )


def _supports(
    entries: Sequence[Mapping[str, Any]],
    position: Array,
    plan: Array,
    outer: int,
    number: Index,
    normal: Array,
) -> Supports:
    """Return the supports, each spread over the nodes of its patch; on the inner sheet if any."""
    node, stiffness, stop = [], [], []
    for entry in entries:
        away = np.linalg.norm(plan - np.array(entry["place"]), axis=1)
        near = np.flatnonzero(away <= entry["radius"])
        inner = near[near >= outer]
        own = inner if inner.size else near
        if not own.size:
            own = np.array([int(np.argmin(away))])
        node.append(own)
        stiffness.append(np.full(len(own), entry["stiffness"] / len(own)))
        stop.append(np.full(len(own), bool(entry.get("stop", False))))
    rows = np.concatenate(node)
    return Supports(
        node=rows,
        rest=position[rows],
        stiffness=np.concatenate(stiffness),
        stop=np.concatenate(stop),
        normal=normal,
    )
