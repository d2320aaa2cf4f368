"""A watertight mesh of a whole car from the zones of its data file.

The profile line is lofted across the car: every zone has its plan bow and width, the panels a
crown, the edges a roll, and the sides are closed. The lateral shape is that of the data file's
table ``surface``.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from models import data
from models.vehicle.profile import Vehicle, load_vehicle
from models.vehicle.surface.mesh import SurfaceMesh
from models.vehicle.surface.profile_line import ProfileLine, draw_profile
from models.vehicle.zones import ROLL

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SPACING = 0.022
"""Largest distance of nodes along the profile up to the windscreen, m."""
COARSE = 0.2
"""Largest distance of nodes along roof, rear and underside, m."""
STATIONS = 70
"""Number of strips of facets across the car; with ``SPACING`` some 24,000 facets."""
SMOOTHED = 0.05
"""Length (m) along the profile over which width, bow and crown change between zones (assumed)."""
ROLLED = 0.6
"""Largest edge roll over a roll's own radius (assumed): the roll keeps a rounded end."""
LAMP = "lamp"
"""Region of the headlamps; their law is that of the zone in which they lie."""


@dataclass(frozen=True)
class Loft:
    """The profile line of a car drawn across its width.

    Attributes
    ----------
    line : ProfileLine
    along : (k,) array
        Length along the profile up to each of its points, m.
    width : (k,) array
        Half width there, m.
    stations : (n,) array
        Shares of the half width, from -1 (right) to 1 (left).
    nodes : (n, k, 3) array
        m.
    """

    line: ProfileLine
    along: Array
    width: Array
    stations: Array
    nodes: Array

    def points(self, along: Array, y: Array) -> Array:
        """Return the points (m, 3) of the surface at lengths along the profile and stations y, m.

        Beyond the car's half width they lie as far below its edge, on the flat side.
        """
        edge = np.interp(along, self.along, self.width)
        share = np.clip(y / edge, -1.0, 1.0)
        at = RegularGridInterpolator((self.stations, self.along), self.nodes)
        found = np.asarray(at(np.stack([share, along], axis=1)))
        found[:, 2] -= np.maximum(np.abs(y) - edge, 0.0)
        return found


@functools.cache
def loft_of(name: str) -> Loft:
    """Return the loft of a vehicle of the data folder.

    Raises
    ------
    ValueError
        If there is no vehicle of that name.
    """
    vehicle = load_vehicle(name)
    shape = data.load(f"vehicles/{name}.toml")["surface"]
    line = draw_profile(vehicle, shape["rear"], SPACING, COARSE)
    normal = _outward(line)
    width, curvature, crown, roll = (
        _smoothed(line, values) for values in _lateral(vehicle, line, shape)
    )
    stations = _stations(shape["edge_roll"] / float(width[: line.exposed].max()))
    nodes = np.empty((len(stations), len(line.points), 3))
    for k, s in enumerate(stations):
        y = s * width
        beyond = np.maximum(np.abs(y) - (width - roll), 0.0)
        inwards = roll - np.sqrt(np.maximum(roll**2 - beyond**2, 0.0))
        nodes[k, :, 0] = line.points[:, 0] - 0.5 * curvature * y**2 - inwards * normal[:, 0]
        nodes[k, :, 1] = y
        nodes[k, :, 2] = line.points[:, 1] - crown * s**2 - inwards * normal[:, 1]
    step = np.linalg.norm(np.diff(line.points, axis=0), axis=1)
    return Loft(line, np.concatenate([[0.0], np.cumsum(step)]), width, stations, nodes)


@functools.cache
def generate_surface(name: str) -> SurfaceMesh:
    """Return the mesh of a vehicle of the data folder.

    Parameters
    ----------
    name : str
        Name of the vehicle.

    Raises
    ------
    ValueError
        If there is no vehicle of that name.
    """
    vehicle = load_vehicle(name)
    shape = data.load(f"vehicles/{name}.toml")["surface"]
    loft = loft_of(name)
    nodes, line = loft.nodes, loft.line
    stations = loft.stations
    facets, place = _loft(len(stations), len(line.points))
    zone = line.zone[place]
    # Both sides are alike; the right one, first, is seen counterclockwise.
    side = _triangulate(nodes[0][:, [0, 2]])
    left = (len(stations) - 1) * len(line.points) + side[:, ::-1]
    facets = np.concatenate([facets, side, left])
    zone = np.concatenate([zone, np.full(2 * len(side), _side_row(vehicle))])
    flat = nodes.reshape(-1, 3)
    middle = flat[facets].mean(axis=1)
    zone = _with_strips(vehicle, zone, middle)
    names = [z.name for z in vehicle.zones]
    lamps = shape["lamps"]
    is_lamp = (
        (zone == vehicle.zone_index(lamps["zone"]))
        & (np.abs(middle[:, 1]) >= lamps["inner"])
        & (np.abs(middle[:, 1]) <= lamps["outer"])
    )
    region = np.where(is_lamp, len(names), zone)
    return SurfaceMesh(flat, facets, region, (*names, LAMP)).compact()


def laws_of_regions(vehicle: Vehicle, mesh: SurfaceMesh) -> Index:
    """Return the row of the zone whose law applies in each region of a mesh.

    Raises
    ------
    ValueError
        If a region is neither a zone of the vehicle nor its lamps.
    """
    lamps = data.load(f"vehicles/{vehicle.name}.toml")["surface"]["lamps"]["zone"]
    rows = [vehicle.zone_index(lamps if name == LAMP else name) for name in mesh.names]
    if -1 in rows:
        unknown = mesh.names[rows.index(-1)]
        known = ", ".join(zone.name for zone in vehicle.zones)
        raise ValueError(f"region {unknown!r} is no zone of {vehicle.name}: it has {known}")
    return np.array(rows, dtype=np.int64)


def _lateral(
    vehicle: Vehicle, line: ProfileLine, shape: dict[str, float]
) -> tuple[Array, Array, Array, Array]:
    """Return half width, plan curvature, crown and edge roll (k,) of the points of a profile."""
    zones = vehicle.zones
    outer = vehicle.bend
    panels = np.array([zone.kind != ROLL and zone.direction[0] < -0.5 for zone in zones])
    rolls = np.array([
        min(shape["edge_roll"], ROLLED * zone.radius) if zone.kind == ROLL else shape["edge_roll"]
        for zone in zones
    ])  # fmt: skip
    curvature = np.array([zone.curvature for zone in zones])
    row = line.zone
    return outer[row], curvature[row], shape["crown"] * panels[row], rolls[row]


def _smoothed(line: ProfileLine, values: Array) -> Array:
    """Return values averaged along the closed profile with a Gaussian weight."""
    points = line.points
    ahead, behind = (np.linalg.norm(np.roll(points, k, axis=0) - points, axis=1) for k in (-1, 1))
    weight = 0.5 * (ahead + behind)
    along = np.concatenate([[0.0], np.cumsum(ahead)[:-1]])
    length = float(ahead.sum())
    apart = np.abs(along[:, None] - along[None])
    apart = np.minimum(apart, length - apart)
    kernel = weight[None] * np.exp(-0.5 * (apart / SMOOTHED) ** 2)
    return np.asarray((kernel @ values) / kernel.sum(axis=1))


def _outward(line: ProfileLine) -> Array:
    """Return the outward unit normals (k, 2) of a counterclockwise closed line."""
    points = line.points
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return np.asarray(across / np.linalg.norm(across, axis=1)[:, None])


def _stations(edge: float) -> Array:
    """Return lateral stations from -1 (right) to 1 (left), denser over the rolled edges."""
    rolled = max(6, STATIONS // 10)
    middle = STATIONS - 2 * rolled
    # Equal angles over the edge roll.
    turn = 1.0 - edge + edge * np.sin(0.5 * math.pi * np.arange(1, rolled + 1) / rolled)
    inner = np.linspace(-(1.0 - edge), 1.0 - edge, middle + 1)
    return np.concatenate([-turn[::-1], inner, turn])


def _loft(stations: int, count: int) -> tuple[Index, Index]:
    """Return the facets between neighbouring stations and the profile point of each."""
    k, p = (
        grid.ravel()
        for grid in np.meshgrid(np.arange(stations - 1), np.arange(count), indexing="ij")
    )
    q = (p + 1) % count
    a, b = k * count + p, k * count + q
    c, d = a + count, b + count
    facets = np.concatenate([np.stack([a, d, b], axis=1), np.stack([a, c, d], axis=1)])
    return facets, np.concatenate([p, p])


def _side_row(vehicle: Vehicle) -> int:
    """Return the row of the zone whose law the sides of the car have: the fenders'."""
    strips = [k for k, zone in enumerate(vehicle.zones) if zone.inner > 0.0]
    return strips[0] if strips else len(vehicle.zones) - 1


def _with_strips(vehicle: Vehicle, zone: Index, middle: Array) -> Index:
    """Return the zones of facets with the strips beside a panel in place of the panel."""
    found = zone.copy()
    for row, strip in enumerate(vehicle.zones):
        if strip.inner == 0.0:
            continue
        beside = [
            k
            for k, other in enumerate(vehicle.zones)
            if other.inner == 0.0 and np.array_equal(other.origin, strip.origin)
        ]
        found[np.isin(zone, beside) & (np.abs(middle[:, 1]) > strip.inner)] = row
    return found


def _triangulate(points: Array) -> Index:
    """Return facets (k - 2, 3) of a simple counterclockwise polygon (k, 2), by cutting off ears."""
    rest = list(range(len(points)))
    found = []
    while len(rest) > 3:
        best, ear = -1.0, -1
        for k in range(len(rest)):
            a, b, c = (points[rest[(k + j) % len(rest)]] for j in (-1, 0, 1))
            quality = _corner(a, b, c)
            if quality > best and not _holds_a_point(points, rest, k):
                best, ear = quality, k
        if ear < 0:
            raise ValueError("the side of the car crosses itself")
        n = len(rest)
        found.append([rest[ear - 1], rest[ear], rest[(ear + 1) % n]])
        del rest[ear]
    return np.array([*found, rest], dtype=np.int64)


def _corner(a: Array, b: Array, c: Array) -> float:
    """Return the area of a triangle over the square of its longest side, -1 if it is clockwise."""
    u, v = b - a, c - b
    area = float(u[0] * v[1] - u[1] * v[0])
    longest = max(float(side @ side) for side in (u, v, c - a))
    return area / longest if area > 0.0 else -1.0


def _holds_a_point(points: Array, rest: list[int], k: int) -> bool:
    """Return whether the ear at place ``k`` contains another corner of the polygon."""
    n = len(rest)
    ends = (rest[k - 1], rest[k], rest[(k + 1) % n])
    a, b, c = (points[j] for j in ends)
    others = points[[j for j in rest if j not in ends]]

    def left_of(p: Array, q: Array) -> NDArray[np.bool_]:
        return np.asarray(
            (q[0] - p[0]) * (others[:, 1] - p[1]) - (q[1] - p[1]) * (others[:, 0] - p[0]) >= 0.0
        )

    return bool((left_of(a, b) & left_of(b, c) & left_of(c, a)).any())
