"""Mesh of a hood: an outer sheet and an inner one of hat sections, on common grid lines.

All edges of the sections are grid lines, so that their shape is the same at every element size.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models import data
from models.shells.parts import Gaps, Supports, Ties
from models.vehicle.profile import Vehicle
from models.vehicle.structure.grid import grid_cells, grid_lines, node_areas
from models.vehicle.structure.panel import Panel
from models.vehicle.structure.sheet_metal import materials_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]

HOOD = "hood"
"""Zone of the car, and panel, of this mesh."""


def build_hood(
    vehicle: Vehicle,
    table: Mapping[str, Any],
    size: float,
    *,
    rib: float = 1.0,
    sheet: float = 1.0,
    strength: float = 1.0,
) -> Panel:
    """Return the hood of a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
    table : mapping
        Data file of the vehicle's shells.
    size : float
        Size of the elements, m.
    rib, sheet, strength : float
        Factors on the depth of the sections, the thickness of the sheets and the yield stress.
    """
    ribs, hood = table["ribs"], table["hood"]
    across = grid_lines(_edges(ribs, "across", 0.0, hood["length"]), size)
    along = grid_lines(_edges(ribs, "along", -hood["half_width"], hood["half_width"]), size)
    s, y = (grid.ravel() for grid in np.meshgrid(across, along, indexing="ij"))
    depth, _ = _section(ribs, s, y, hood)
    cells = grid_cells(len(across), len(along))
    middle_s, middle_y = s[cells].mean(axis=1), y[cells].mean(axis=1)
    _, inside = _section(ribs, middle_s, middle_y, hood)
    outer = _on_hood(vehicle, s, y)
    normal = _normal(vehicle)
    held = np.unique(cells[inside])
    number = np.full(len(s), -1)
    number[held] = len(s) + np.arange(len(held))
    lower = outer[held] - rib * depth[held, None] * normal
    thickness = [sheet * table["sheets"][name]["thickness"] for name in ("outer", "inner")]
    names = [table["sheets"][name]["material"] for name in ("outer", "inner")]
    count = [len(cells), int(inside.sum())]
    plan_area = _plan_area(s, y, cells)
    area = node_areas(len(s), cells[inside], plan_area[inside])
    flange = held[depth[held] == 0.0]
    bottom = held[depth[held] > 0.0]
    position = np.concatenate([outer, lower])
    plan = np.stack([np.concatenate([s, s[held]]), np.concatenate([y, y[held]])], axis=1)
    ties = table["ties"]
    between = (bottom, number[bottom], rib * depth[bottom] - sum(thickness) / 2.0,
               ties["contact"] * area[bottom])  # fmt: skip
    return Panel(
        name=HOOD,
        position=position,
        elements=np.concatenate([cells, number[cells[inside]]]),
        outer=np.repeat([True, False], count),
        thickness=np.repeat(thickness, count),
        material=np.repeat([0, 1], count),
        materials=materials_of(table["materials"], names, strength),
        zone=np.full(len(position), vehicle.zone_index(HOOD)),
        ties=Ties(flange, number[flange], ties["stiffness"] * area[flange]),
        gaps=_gaps(table.get("hard_points", []), between, s, y,
                   node_areas(len(s), cells, plan_area), normal),
        supports=_supports(table["supports"], position, plan, len(s), normal),
        held=np.zeros(len(position), dtype=np.bool_),
    )  # fmt: skip


def _edges(ribs: Mapping[str, Any], way: str, first: float, last: float) -> list[float]:
    """Return the edges of the sections, and of the channel along the hood's edges, in order."""
    steps = np.cumsum([0.0, ribs["flange"], ribs["web"], ribs["bottom"], ribs["web"],
                       ribs["flange"]])  # fmt: skip
    width = float(steps[-1])
    starts = [first, last - width, *(place - 0.5 * width for place in ribs[way])]
    found = [first, last, *(start + step for start in starts for step in steps)]
    return sorted({round(place, 9) for place in found if first <= place <= last})


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


def _gaps(
    hard_points: Sequence[Mapping[str, Any]],
    between: tuple[Index, Index, Array, Array],
    s: Array,
    y: Array,
    area: Array,
    normal: Array,
) -> Gaps:
    """Return the contacts between the sheets, and of the outer sheet with the structure below.

    ``between`` holds upper and lower nodes, clearances and stiffnesses of the sheets' own; ``s``,
    ``y`` and ``area`` are those of the outer sheet's nodes.
    """
    first, second, apart, stiff = between
    upper, lower, clearance, stiffness = [first], [second], [apart], [stiff]
    unloading = [np.ones(len(first))]
    for entry in hard_points:
        (s0, y0), (s1, y1) = entry["box"]
        own = np.flatnonzero((s >= s0) & (s <= s1) & (y >= y0) & (y <= y1))
        upper.append(own)
        lower.append(np.full(len(own), -1))
        clearance.append(np.full(len(own), entry["clearance"]))
        stiffness.append(entry["stiffness"] * area[own])
        unloading.append(np.full(len(own), entry["unloading"]))
    count = sum(len(rows) for rows in upper)
    return Gaps(
        upper=np.concatenate(upper),
        lower=np.concatenate(lower),
        clearance=np.concatenate(clearance),
        stiffness=np.concatenate(stiffness),
        unloading=np.concatenate(unloading),
        deepest=np.zeros(count),
        normal=np.tile(normal, (count, 1)),
    )


def _supports(
    entries: Sequence[Mapping[str, Any]],
    position: Array,
    plan: Array,
    outer: int,
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
        normal=np.tile(normal, (len(rows), 1)),
    )
