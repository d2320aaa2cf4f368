"""A rigid car front made of zones: implementation of ``models.crash.front``.

The force of a zone tapers off at its borders, so that a segment passes from the hood edge to the
hood without being loaded twice. A patch of this front is a zone, and so is a region.
"""

import math

from models.compilation import inlined_kernel
from models.contact.geometry import roll_direction
from models.crash.surfaces import shape_of
from models.vehicle.zones import MAXIMUM_DEPTH, ROLL

BORDER = 0.04
"""Length (m) over which a zone tapers off at its borders (assumed)."""
ARC_BORDER = 0.15
"""Angle (rad) over which a roll tapers off at the ends of its arc (assumed)."""


@inlined_kernel
def nothing_to_prepare(front, ellipsoids, car, cosine, sine, motion, contacts, time):
    """Do nothing: the front has no state of its own; see ``models.crash.front.prepare``."""
    return


@inlined_kernel
def nothing_to_carry(front, car, cosine, sine, motion, loads, contacts, power, i):
    """Do nothing: the front has no state of its own; see ``models.crash.front.carry``."""
    return


@inlined_kernel
def zone_count(zones):
    """Return the number of patches."""
    return zones.radius.shape[0]


@inlined_kernel
def zone_reach(zones, ellipsoids, i):
    """Return the largest semi-axis (m) of a segment."""
    return ellipsoids.reach[i]


@inlined_kernel
def zone_survey(zones, ellipsoids, motion, i, cx, cy, cz, cosine, sine):
    """Do nothing: every zone is asked for itself.

    Parameters
    ----------
    zones : Zones
        Geometry of the front.
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    motion : Motion
        Positions and velocities of the segments.
    i : int
        Row of the segment.
    cx, cy, cz : float
        Ellipsoid centre in the car's frame, m.
    cosine, sine : float
        Of the car's yaw.
    """
    return


@inlined_kernel
def zone_may_touch(zones, j, margin, x, z):
    """Return whether a point lies within a margin of a zone in side view.

    Parameters
    ----------
    zones : Zones
        Geometry of the front.
    j : int
        Row of the zone.
    margin : float
        m.
    x, z : float
        Point in the car's frame, m.
    """
    return (
        x <= zones.box[j, 1] + margin
        and x >= zones.box[j, 0] - margin
        and z <= zones.box[j, 3] + margin
        and z >= zones.box[j, 2] - margin
    )


@inlined_kernel
def zone_is_near(zones, j, margin, x, y, z):
    """Return whether a point lies within a margin of a zone, in side view and of its width.

    Parameters
    ----------
    zones : Zones
        Geometry of the front.
    j : int
        Row of the zone.
    margin : float
        m.
    x, y, z : float
        Point in the car's frame, m.
    """
    return zone_may_touch(zones, j, margin, x, z) and abs(y) < zones.half_width[j] + margin


@inlined_kernel
def zone_pressure_point(zones, j, share, flesh, px, py, pz, cx, cy, cz):
    """Return the centre of pressure, on the line from the deepest point to the centre.

    Parameters
    ----------
    zones : Zones
        Geometry of the front.
    j : int
        Row of the zone.
    share : float
        Distance from the deepest point over that of the centre.
    flesh : float
        Penetration of the segment's flesh, m.
    px, py, pz : float
        Deepest point in the car's frame, m.
    cx, cy, cz : float
        Ellipsoid centre in the car's frame, m.
    """
    return px + share * (cx - px), py + share * (cy - py), pz + share * (cz - pz)


@inlined_kernel
def zones_are_joined(zones, j, k):
    """Return whether two zones share a border, across which a sliding segment stays in contact.

    Parameters
    ----------
    zones : Zones
        Geometry of the front.
    j, k : int
        Rows of the zones.
    """
    return zones.joined[j, k]


@inlined_kernel
def zone_friction(zones, j):
    """Return the coefficient of friction of a region."""
    return zones.friction[j]


@inlined_kernel
def zone_ploughing(zones, j):
    """Return the share of the ploughing resistance of a lasting dent in a region."""
    return zones.ploughing[j]


@inlined_kernel
def zone_reaction(zones, j, px, py, pz, fx, fy, fz):
    """Ignore the load on a patch: a rigid front does not respond to it.

    Parameters
    ----------
    zones : Zones
        Geometry of the front.
    j : int
        Row of the zone.
    px, py, pz : float
        Point of application in the car's frame, m.
    fx, fy, fz : float
        Force in world axes, N.
    """
    return


@inlined_kernel
def _taper(x, border):
    return min(max(x / border + 0.5, 0.0), 1.0)


@inlined_kernel
def zone_separation(zones, ellipsoids, contacts, j, i, cx, cy, cz, cosine, sine):
    """Return the separation of a segment from a zone, with the contact geometry.

    Parameters
    ----------
    zones : Zones
        Geometry of the front.
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    contacts : Contacts
        State and results of the contacts.
    j, i : int
        Rows of the zone and of the segment.
    cx, cy, cz : float
        Ellipsoid centre in the car's frame, m.
    cosine, sine : float
        Of the car's yaw.

    Returns
    -------
    tuple of float
        ``(separation, nx, ny, nz, px, py, pz, weight, region)``: separation in m, normal and
        deepest point in the car's frame, border weight and region; a separation of 1.0 m with
        weight 0 means that the segment is far away.
    """
    half_width = zones.half_width[j]
    reach = ellipsoids.reach[i]
    inner = zones.inner[j]
    if abs(cy) > half_width + reach + BORDER or abs(cy) < inner - reach - BORDER:
        return 1.0, 1.0, 0.0, 0.0, cx, cy, cz, 0.0, j
    y = min(max(cy, -zones.bend[j]), zones.bend[j])
    bend = zones.curvature[j] * y
    shift = 0.5 * bend * y
    # Horizontal normal e = (ex, ey) of the bent zone; its axis runs along (-ey, ex).
    ex = 1.0 / math.sqrt(1.0 + bend * bend)
    ey = bend * ex
    d1 = (cx - zones.origin[j, 0] + shift) * ex
    d3 = cz - zones.origin[j, 1]
    if zones.kind[j] == ROLL:
        limit = zones.radius[j] + reach
        if d1 * d1 + d3 * d3 > limit * limit:
            return 1.0, 1.0, 0.0, 0.0, cx, cy, cz, 0.0, j
    else:
        n1, n3 = -zones.direction[j, 1], zones.direction[j, 0]
        if n3 < 0.0 or (n3 == 0.0 and n1 < 0.0):
            n1, n3 = -n1, -n3
        above = n1 * d1 + n3 * d3
        along = zones.direction[j, 0] * d1 + zones.direction[j, 1] * d3
        if (
            above > reach
            or above < -MAXIMUM_DEPTH
            or along < -reach - BORDER
            or along > zones.length[j] + reach + BORDER
        ):
            return 1.0, 1.0, 0.0, 0.0, cx, cy, cz, 0.0, j
    # Shape matrix in car axes: rotate the segment's world axes by minus the yaw.
    A = shape_of(contacts, i)
    # World components of the car-frame direction (ex, ey, 0).
    gx, gy = cosine * ex - sine * ey, sine * ex + cosine * ey
    p11 = gx * (A[0] * gx + A[1] * gy) + gy * (A[1] * gx + A[3] * gy)
    p13 = gx * A[2] + gy * A[4]
    p33 = A[5]
    if zones.kind[j] == ROLL:
        n1, n3, separation = roll_direction(d1, d3, p11, p13, p33)
        separation -= zones.radius[j]
    else:
        separation = (
            n1 * d1 + n3 * d3 - math.sqrt(p11 * n1 * n1 + 2.0 * p13 * n1 * n3 + p33 * n3 * n3)
        )
    # Deepest point of the ellipsoid: centre - A n / h, in car axes.
    nwx, nwy = n1 * gx, n1 * gy
    ax = A[0] * nwx + A[1] * nwy + A[2] * n3
    ay = A[1] * nwx + A[3] * nwy + A[4] * n3
    az = A[2] * nwx + A[4] * nwy + A[5] * n3
    h = math.sqrt(ax * nwx + ay * nwy + az * n3)
    px = cx - (cosine * ax + sine * ay) / h
    py = cy - (-sine * ax + cosine * ay) / h
    pz = cz - az / h
    weight = _taper(half_width - abs(py), BORDER)
    if inner > 0.0:
        weight *= _taper(abs(py) - inner, BORDER)
    if zones.kind[j] == ROLL:
        angle = math.atan2(n3, n1)
        weight *= _taper(angle - zones.arc[j, 0], ARC_BORDER)
        weight *= _taper(zones.arc[j, 1] - angle, ARC_BORDER)
    else:
        q1 = (px - zones.origin[j, 0] + 0.5 * zones.curvature[j] * py * py) * ex
        q3 = pz - zones.origin[j, 1]
        along = zones.direction[j, 0] * q1 + zones.direction[j, 1] * q3
        weight *= _taper(along, BORDER) * _taper(zones.length[j] - along, BORDER)
        if separation < -MAXIMUM_DEPTH:
            weight = 0.0
    return separation, n1 * ex, n1 * ey, n3, px, py, pz, weight, j
