"""Front profile of a car, its stiffness corridors and its wrap-around line."""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models import data
from models.contact.corridor import Corridor, read_corridor, read_curve
from models.vehicle.tape import EDGE_TANGENT, tape_over
from models.vehicle.zones import MAXIMUM_DEPTH, PANEL, ROLL, Zones

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Zone:
    """One zone of the static front; lengths in m, angles in rad.

    Attributes
    ----------
    name : str
    coordinate : str
        Input that is the zone's corridor coordinate.
    kind, origin, radius, direction, length, arc, inner, half_width, curvature, ploughing
        See ``Zones``.
    corridor : Corridor
    """

    name: str
    kind: int
    coordinate: str
    origin: Array
    radius: float
    direction: Array
    length: float
    arc: Array
    inner: float
    half_width: float
    curvature: float
    ploughing: float
    corridor: Corridor


@dataclass(frozen=True)
class Vehicle:
    """A car front from a data file.

    Attributes
    ----------
    name, title, source : str
        Identification.
    dive_pivot, rotation_centre : float
        Distances behind the foremost point, m.
    hood_side : float
        Distance from the centre line to the gap between hood and fender, m.
    zones : tuple of Zone
        From the ground up.
    """

    name: str
    title: str
    source: str
    dive_pivot: float
    rotation_centre: float
    hood_side: float
    zones: tuple[Zone, ...]

    @functools.cached_property
    def joined(self) -> NDArray[np.bool_]:
        """The (z, z) table of zones that are adjacent, side by side or end to end."""
        return _joined(self.zones)

    @functools.cached_property
    def bend(self) -> Array:
        """Half width (z,) over which each zone is curved, including adjacent zones, m."""
        return np.array([_widest(self.zones, zone) for zone in self.zones])

    @functools.cached_property
    def zone_table(self) -> Zones:
        """The zones of the static car in compiled form, without boxes and friction."""
        zones = self.zones
        return Zones(
            kind=np.array([z.kind for z in zones]),
            origin=np.array([z.origin for z in zones]),
            radius=np.array([z.radius for z in zones]),
            direction=np.array([z.direction for z in zones]),
            length=np.array([z.length for z in zones]),
            arc=np.array([z.arc for z in zones]),
            inner=np.array([z.inner for z in zones]),
            half_width=np.array([z.half_width for z in zones]),
            curvature=np.array([z.curvature for z in zones]),
            bend=self.bend,
            joined=self.joined,
            box=np.zeros((len(zones), 4)),
            friction=np.zeros(len(zones)),
            ploughing=np.array([z.ploughing for z in zones]),
        )

    def with_curve(self, name: str, knots: Sequence[Sequence[float]]) -> "Vehicle":
        """Return the vehicle with one loading curve in place of a zone's corridor.

        Unloading and damping stay those of the corridor's median.

        Parameters
        ----------
        name : str
            Name of the zone.
        knots : sequence of pairs
            Penetration (m) and force (N), from (0, 0).

        Raises
        ------
        ValueError
            If there is no such zone, or the knots are no loading curve.
        """
        row = self.zone_index(name)
        if row < 0:
            known = ", ".join(zone.name for zone in self.zones)
            raise ValueError(f"vehicle {self.name!r} has no zone {name!r}; it has {known}")
        median = self.zones[row].corridor.median
        try:
            curve = read_curve(knots, median.unloading_ratio, median.damping)
        except (ValueError, TypeError) as error:
            raise ValueError(f"curve of the {name}: {error}") from None
        zones = list(self.zones)
        zones[row] = replace(zones[row], corridor=Corridor(curve, curve, curve))
        return replace(self, zones=tuple(zones))

    def zone_index(self, name: str) -> int:
        """Return the row of a zone, or -1 if the car has no zone of that name."""
        for j, zone in enumerate(self.zones):
            if zone.name == name:
                return j
        return -1


def vehicle_names() -> tuple[str, ...]:
    """Return the names of the vehicles in the data folder."""
    return data.names("vehicles")


@functools.cache
def load_vehicle(name: str) -> Vehicle:
    """Return a vehicle of the data folder.

    Raises
    ------
    ValueError
        If there is no vehicle of that name.
    """
    if name not in vehicle_names():
        raise ValueError(f"no vehicle {name!r}: choose one of {', '.join(vehicle_names())}")
    table = data.load(f"vehicles/{name}.toml")
    return Vehicle(
        name=name,
        title=table["title"],
        source=table["source"],
        dive_pivot=table["dive_pivot"],
        rotation_centre=table["rotation_centre"],
        hood_side=table["hood_side"],
        zones=tuple(_read_zone(row) for row in table["zones"]),
    )


def _read_zone(row: dict[str, object]) -> Zone:
    def numbers(key: str) -> Array:
        return np.array(row[key], dtype=np.float64)

    roll = row["kind"] == "roll"
    origin = numbers("centre" if roll else "start")
    along = np.array([-1.0, 0.0]) if roll else numbers("end") - origin
    length = float(np.linalg.norm(along))
    return Zone(
        name=str(row["name"]),
        kind=ROLL if roll else PANEL,
        coordinate=str(row["coordinate"]),
        origin=origin,
        radius=float(numbers("radius")) if roll else 0.0,
        direction=along / length,
        length=0.0 if roll else length,
        arc=np.radians(numbers("arc")) if roll else np.zeros(2),
        inner=float(numbers("inner")) if "inner" in row else 0.0,
        half_width=float(numbers("half_width")),
        curvature=float(numbers("curvature")),
        ploughing=float(numbers("ploughing")) if "ploughing" in row else 0.0,
        corridor=read_corridor(row),
    )


def _turn(points: Array, angle: float) -> Array:
    """Rotate (x, z) vectors nose down by ``angle`` rad."""
    c, s = math.cos(angle), math.sin(angle)
    return np.stack([c * points[..., 0] + s * points[..., 1],
                     -s * points[..., 0] + c * points[..., 1]], axis=-1)  # fmt: skip


def dive_shift(vehicle: Vehicle, dive_angle: float) -> Array:
    """Return the (x, z) shift after the rotation about the origin that keeps the front at x = 0."""
    pivot = np.array([-vehicle.dive_pivot, 0.0])
    shift = pivot - _turn(pivot, dive_angle)
    rolls = vehicle.zone_table.kind == ROLL
    turned = _turn(vehicle.zone_table.origin, dive_angle)[:, 0] + vehicle.zone_table.radius
    return np.array([-float(turned[rolls].max()), float(shift[1])])


def build_zones(
    vehicle: Vehicle, dive_angle: float, friction_body_car: float, ploughing: float = 1.0
) -> Zones:
    """Return the compiled form of the front of a diving car.

    Parameters
    ----------
    vehicle : Vehicle
    dive_angle : float
        Nose down, rad.
    friction_body_car : float
        Coefficient of friction.
    ploughing : float
        Factor on the ploughing of all panels.
    """
    table = vehicle.zone_table
    shift = dive_shift(vehicle, dive_angle)
    origin = _turn(table.origin, dive_angle) + shift
    direction = _turn(table.direction, dive_angle)
    end = origin + table.length[:, None] * direction
    low, high = np.minimum(origin, end), np.maximum(origin, end)
    depth = np.where(table.kind == PANEL, MAXIMUM_DEPTH, 0.0)
    sweep = 0.5 * table.curvature * table.half_width**2
    box = np.stack(
        [low[:, 0] - table.radius - sweep, high[:, 0] + table.radius,
         low[:, 1] - table.radius - depth, high[:, 1] + table.radius], axis=1,
    )  # fmt: skip
    return table._replace(
        origin=origin,
        direction=direction,
        arc=table.arc - dive_angle,
        box=box,
        friction=np.full(len(vehicle.zones), friction_body_car),
        ploughing=ploughing * table.ploughing,
    )


GAP = 0.05
"""m between the ends of two zones up to which they are joined (assumed)."""


def _beside(zone: Zone, other: Zone) -> bool:
    """Return whether two zones lie side by side in one surface."""
    same = np.array_equal(other.origin, zone.origin)
    return same and (other.inner == zone.half_width or zone.inner == other.half_width)


def _ends(zone: Zone) -> Array:
    """Return the (2, 2) lower and upper end (x, z) of a zone in side view."""
    if zone.kind == ROLL:
        ring = np.stack([np.cos(zone.arc), np.sin(zone.arc)], axis=1)
        return np.asarray(zone.origin + zone.radius * ring)
    return np.array([zone.origin, zone.origin + zone.length * zone.direction])


def _joined(zones: Sequence[Zone]) -> NDArray[np.bool_]:
    """Return the (z, z) table of zones that are adjacent, side by side or end to end."""
    table = np.zeros((len(zones), len(zones)), dtype=np.bool_)
    for i, zone in enumerate(zones):
        for j, other in enumerate(zones):
            apart = np.linalg.norm(_ends(zone)[:, None] - _ends(other)[None], axis=2).min()
            table[i, j] = i != j and (_beside(zone, other) or apart <= GAP)
    return table


def _widest(zones: Sequence[Zone], zone: Zone) -> float:
    """Return the half width (m) of a zone including the zones beside it."""
    return max([zone.half_width, *(z.half_width for z in zones if _beside(zone, z))])


def diving_points(vehicle: Vehicle, dive_angle: float, points: Array) -> Array:
    """Return points of the static car in the frame of the diving car.

    Parameters
    ----------
    vehicle : Vehicle
    dive_angle : float
        Nose down, rad.
    points : (k, 2) array
        x and z in the frame of the static car, m.

    Returns
    -------
    (k, 2) array
        x and z, m.
    """
    return np.asarray(_turn(points, dive_angle) + dive_shift(vehicle, dive_angle))


def static_point(vehicle: Vehicle, dive_angle: float, point: Array) -> Array:
    """Return a point of the diving car in the frame of the static car.

    Parameters
    ----------
    vehicle : Vehicle
    dive_angle : float
        Nose down, rad.
    point : (2,) array
        x and z in the frame of the diving car, m.

    Returns
    -------
    (2,) array
        x and z, m.
    """
    return _turn(np.asarray(point) - dive_shift(vehicle, dive_angle), -dive_angle)


@functools.cache
def _tape(vehicle_name: str, zone: int) -> Array:
    """Return the (k, 2) path (x, z) of a taut tape over the zones up to ``zone``.

    It starts on the road under the foremost point and follows the convex hull of the zones from
    the ground up; of a panel at the end only its front border is included.
    """
    vehicle = load_vehicle(vehicle_name)
    points = []
    # A side zone coincides with another zone in side view.
    below = [entry for entry in vehicle.zones[:zone] if entry.inner == 0.0]
    for entry in [*below, vehicle.zones[zone]]:
        if entry.kind == ROLL:
            angle = np.linspace(-math.pi / 2.0, math.pi, 541)
            ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            points.append(entry.origin + entry.radius * ring)
        else:
            points.append(np.array([entry.origin, entry.origin + entry.length * entry.direction]))
    if vehicle.zones[zone].kind != ROLL:
        points[-1] = points[-1][:1]
    return tape_over(np.concatenate(points))


def wrap_around_distance(vehicle_name: str, zone: int, point: Array) -> float:
    """Return the length (m) of a taut tape from the road to a point of a zone.

    Parameters
    ----------
    vehicle_name : str
    zone : int
        Row of the zone that contains the point.
    point : (2,) array
        x and z on the zone's surface, static car, m.
    """
    step = np.diff(wrap_around_path(vehicle_name, zone, point), axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    return float(length[:-1].sum() + length[-1])


def wrap_around_path(vehicle_name: str, zone: int, point: Array) -> Array:
    """Return the corners (k, 2) of that tape, x and z of the static car, m.

    Parameters
    ----------
    vehicle_name : str
    zone : int
        Row of the zone that contains the point.
    point : (2,) array
        x and z on the zone's surface, static car, m.
    """
    line = _tape(vehicle_name, zone)
    step = np.diff(line, axis=0)
    ahead = np.arctan2(step[:, 1], step[:, 0])
    direct = np.arctan2(point[1] - line[:, 1], point[0] - line[:, 0])
    # The tape leaves the hull where the straight line to the point is flatter than the hull.
    leaves = np.append(direct[:-1] <= ahead + 1e-12, True)
    return np.concatenate([line[: int(np.argmax(leaves)) + 1], np.reshape(point, (1, 2))])


def surface_point(zones: Zones, zone: int, point: Array) -> Array:
    """Return the point of a zone's undeformed surface that is nearest to a point.

    Parameters
    ----------
    zones : Zones
        Geometry of the front.
    zone : int
        Row of the zone.
    point : (2,) array
        x and z, m.

    Returns
    -------
    (2,) array
        x and z, m.
    """
    away = np.asarray(point) - zones.origin[zone]
    if zones.kind[zone] == ROLL:
        return np.asarray(zones.origin[zone] + zones.radius[zone] * away / np.linalg.norm(away))
    along = np.clip(away @ zones.direction[zone], 0.0, zones.length[zone])
    return np.asarray(zones.origin[zone] + along * zones.direction[zone])


@functools.cache
def hood_edge_distance(vehicle_name: str) -> float:
    """Return the wrap-around distance (m) of the hood's leading edge line."""
    line = _tape(vehicle_name, load_vehicle(vehicle_name).zone_index("hood_edge"))
    step = np.diff(line, axis=0)
    slope = np.arctan2(step[:, 1], -step[:, 0])
    first = int(np.argmax(slope <= EDGE_TANGENT))
    return float(np.hypot(step[:first, 0], step[:first, 1]).sum())
