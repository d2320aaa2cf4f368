"""The profile line of a car in side view, from the zones of its data file."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.vehicle.profile import Vehicle, Zone
from models.vehicle.zones import ROLL

Array = NDArray[np.float64]

BRIDGE = math.radians(60.0)
"""Direction above or below the road's, from a roll's axis, in which the straight line begins that
closes the gap between two rolls apart (assumed: no segment reaches deeper between them)."""
GAP = 1e-6
"""Distance (m) of two ends above which there is a gap between zones."""


@dataclass(frozen=True)
class ProfileLine:
    """A closed line in side view, counterclockwise from the lowest point of the front.

    Attributes
    ----------
    points : (k, 2) array
        x and z, m.
    zone : (k,) array of int
        Row of the zone of each point.
    exposed : int
        Number of points before the rear and the underside begin.
    """

    points: Array
    zone: NDArray[np.int64]
    exposed: int


@dataclass(frozen=True)
class _Piece:
    """An arc or a straight line of the profile."""

    row: int
    start: Array
    end: Array
    centre: Array | None = None
    arc: tuple[float, float] = (0.0, 0.0)
    radius: float = 0.0

    @property
    def length(self) -> float:
        if self.centre is None:
            return float(np.linalg.norm(self.end - self.start))
        return self.radius * abs(self.arc[1] - self.arc[0])

    def at(self, share: Array) -> Array:
        """Return points (k, 2) at shares of the length."""
        if self.centre is None:
            return np.asarray(self.start + share[:, None] * (self.end - self.start))
        angle = self.arc[0] + share * (self.arc[1] - self.arc[0])
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.asarray(self.centre + self.radius * ring)


def draw_profile(vehicle: Vehicle, rear: float, spacing: float, coarse: float) -> ProfileLine:
    """Return the closed profile line of a car.

    Parameters
    ----------
    vehicle : Vehicle
    rear : float
        Distance of the rear face behind the end of the last zone, m.
    spacing : float
        Largest distance of points from the ground to the windscreen's upper end, m.
    coarse : float
        Largest distance of points elsewhere, m.
    """
    pieces = _pieces(vehicle)
    first, last = pieces[0].start, pieces[-1].end
    back = last[0] - rear
    corners = [last, np.array([back, last[1]]), np.array([back, first[1]]), first]
    top = max(k for k, piece in enumerate(pieces) if _is_struck(vehicle.zones[piece.row]))
    points, rows = [], []
    for k, piece in enumerate(pieces):
        count = max(1, math.ceil(piece.length / (spacing if k <= top else coarse)))
        points.append(piece.at(np.arange(count) / count))
        rows += [piece.row] * count
    exposed = len(rows)
    closing = (pieces[-1].row, pieces[-1].row, pieces[0].row)
    for (start, end), row in zip(itertools.pairwise(corners), closing, strict=True):
        count = max(1, math.ceil(float(np.linalg.norm(end - start)) / coarse))
        points.append(start + (np.arange(count) / count)[:, None] * (end - start))
        rows += [row] * count
    return ProfileLine(np.concatenate(points), np.array(rows, dtype=np.int64), exposed)


def _is_struck(zone: Zone) -> bool:
    """Return whether a zone is finely resolved: all but the roof, which is the last panel."""
    return zone.name != "roof"


def _pieces(vehicle: Vehicle) -> list[_Piece]:
    """Return arcs and lines from the lowest point of the front to the end of the last zone."""
    rows = [k for k, zone in enumerate(vehicle.zones) if zone.inner == 0.0]
    zones = [vehicle.zones[k] for k in rows]
    pieces: list[_Piece] = []
    for k, (row, zone) in enumerate(zip(rows, zones, strict=True)):
        below = zones[k - 1] if k else None
        above = zones[k + 1] if k + 1 < len(zones) else None
        if zone.kind == ROLL:
            low, high = (_arc_end(zone, other, k) for k, other in enumerate((below, above)))
            arc = (low, max(low, high))
            ends = [zone.origin + zone.radius * np.array([math.cos(a), math.sin(a)]) for a in arc]
            piece = _Piece(row, ends[0], ends[1], zone.origin, arc, zone.radius)
        else:
            start, end = _line_ends(zone)
            piece = _Piece(row, _cut(start, end, below), _cut(end, start, above))
        if pieces and np.linalg.norm(piece.start - pieces[-1].end) > GAP:
            # A gap between two zones is closed by a straight line.
            pieces.append(_Piece(pieces[-1].row, pieces[-1].end, piece.start))
        pieces.append(piece)
    return pieces


def _line_ends(panel: Zone) -> tuple[Array, Array]:
    return np.asarray(panel.origin), np.asarray(panel.origin + panel.length * panel.direction)


def _cut(end: Array, other: Array, roll: Zone | None) -> Array:
    """Return the end of a panel, or where the panel meets the roll that covers this end."""
    if roll is None or roll.kind != ROLL:
        return end
    along, away = other - end, end - roll.origin
    square = float(along @ along)
    half = float(along @ away) / square
    rest = half**2 - (float(away @ away) - roll.radius**2) / square
    # The end lies in the roll: the line leaves it on the way to the other end.
    inside = float(away @ away) < roll.radius**2
    return np.asarray(end + (math.sqrt(rest) - half) * along) if inside else end


def _arc_end(roll: Zone, other: Zone | None, which: int) -> float:
    """Return the direction (rad) from a roll's axis in which its visible arc begins or ends.

    ``which`` is 0 for its lower and 1 for its upper end.
    """
    limit = float(roll.arc[which])
    limit = min(limit, math.pi) if which else max(limit, -0.5 * math.pi)
    if other is None:
        return limit
    if other.kind == ROLL:
        across = other.origin - roll.origin
        apart = float(np.linalg.norm(across))
        towards = math.atan2(across[1], across[0])
        if apart >= roll.radius + other.radius:
            found = BRIDGE if which else -BRIDGE
        else:
            # The front one of the two points in which the circles meet.
            along = (apart**2 + roll.radius**2 - other.radius**2) / (2.0 * apart)
            turn = math.acos(min(1.0, max(-1.0, along / roll.radius)))
            found = towards - turn if which else towards + turn
    else:
        start, end = _line_ends(other)
        away = (_cut(start, end, roll) if which else _cut(end, start, roll)) - roll.origin
        found = math.atan2(away[1], away[0])
    return min(found, limit) if which else max(found, limit)
