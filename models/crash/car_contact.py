"""Contact of the segments with the zones of the car front.

At its borders a zone fades, so that a segment passes from the hood edge to the hood with one
contact's worth of force.
"""

import math

from models.compilation import inlined_kernel
from models.contact.dent import ploughing_coefficient, pressure_share
from models.contact.friction import friction_coefficient
from models.contact.geometry import roll_direction
from models.crash.surfaces import (
    CAR_NORMAL,
    CONTACT_DAMPING,
    FRICTION,
    PLOUGHING,
    law_force,
    law_surface,
    point_velocity,
    push,
    shape_of,
)
from models.vehicle.zones import MAXIMUM_DEPTH, ROLL

BORDER = 0.04
"""Length (m) over which a zone fades at its borders (assumed)."""
ARC_BORDER = 0.15
"""Angle (rad) over which a roll fades at the ends of its arc (assumed)."""
ENTRY_DEPTH = 0.03
"""Depth (m) within which a segment must first be seen by a zone; deeper, it came past the border
(beside the fender, from under the bumper) and is not in contact (assumed, ten times the way of a
step), unless a zone that shares a border hands it over."""
HANDED_DEEPER = 0.005
"""Depth (m) by which a segment handed over may be deeper than it was before (assumed)."""


@inlined_kernel
def _fade(x, border):
    return min(max(x / border + 0.5, 0.0), 1.0)


@inlined_kernel
def zone_separation(zones, ellipsoids, contacts, j, i, cx, cy, cz, cosine, sine):
    """Return separation, normal, contact point (car frame) and border weight.

    Parameters
    ----------
    j, i : zone and segment. cx, cy, cz : m, ellipsoid centre in the car's frame.
    cosine, sine : of the car's yaw.

    Returns
    -------
    tuple of float
        ``(separation, nx, ny, nz, px, py, pz, weight)``; a separation of 1.0 m stands for
        "far away" and comes with weight 0.
    """
    half_width = zones.half_width[j]
    reach = ellipsoids.reach[i]
    inner = zones.inner[j]
    if abs(cy) > half_width + reach + BORDER or abs(cy) < inner - reach - BORDER:
        return 1.0, 1.0, 0.0, 0.0, cx, cy, cz, 0.0
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
            return 1.0, 1.0, 0.0, 0.0, cx, cy, cz, 0.0
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
            return 1.0, 1.0, 0.0, 0.0, cx, cy, cz, 0.0
    # Shape matrix in car axes: turn the segment's world axes by minus the yaw.
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
    weight = _fade(half_width - abs(py), BORDER)
    if inner > 0.0:
        weight *= _fade(abs(py) - inner, BORDER)
    if zones.kind[j] == ROLL:
        angle = math.atan2(n3, n1)
        weight *= _fade(angle - zones.arc[j, 0], ARC_BORDER)
        weight *= _fade(zones.arc[j, 1] - angle, ARC_BORDER)
    else:
        q1 = (px - zones.origin[j, 0] + 0.5 * zones.curvature[j] * py * py) * ex
        q3 = pz - zones.origin[j, 1]
        along = zones.direction[j, 0] * q1 + zones.direction[j, 1] * q3
        weight *= _fade(along, BORDER) * _fade(zones.length[j] - along, BORDER)
        if separation < -MAXIMUM_DEPTH:
            weight = 0.0
    return separation, n1 * ex, n1 * ey, n3, px, py, pz, weight


@inlined_kernel
def _plough(
    motion, loads, contacts, power, tree, car, i, mx, my, nz, resistance, support, dent
):  # fmt: skip
    """Add the force of a panel's dent against the slip of segment ``i``, at the ellipsoid's centre.

    ``resistance`` (N) is the normal force times the panel's share, ``(mx, my, nz)`` the normal.
    """
    qx, qy, qz = contacts.centre[i, 0], contacts.centre[i, 1], contacts.centre[i, 2]
    vx, vy, vz = point_velocity(motion, i, qx, qy, qz)
    ux = vx - car[3] + car[5] * (qy - car[1])
    uy = vy - car[4] - car[5] * (qx - car[0])
    rate = ux * mx + uy * my + vz * nz
    tx, ty, tz = ux - rate * mx, uy - rate * my, vz - rate * nz
    slip = tx * tx + ty * ty + tz * tz
    if slip == 0.0:
        return
    unit = 1.0 / math.sqrt(slip)
    A = shape_of(contacts, i)
    mu = ploughing_coefficient(A, support, dent, unit * tx, unit * ty, unit * tz)
    c = friction_coefficient(mu, resistance, slip, tree.mass[i])
    push(motion, loads, i, qx, qy, qz, -c * tx, -c * ty, -c * tz)
    power[PLOUGHING] -= c * (tx * vx + ty * vy + tz * vz)


@inlined_kernel
def apply_car_contacts(zones, ellipsoids, car, motion, loads, contacts, tree, power):
    """Add the loads of the car on all segments.

    ``car`` is (6,): x, y of the frame's origin (m), yaw (rad) and their rates; see
    ``models.vehicle.motion``.
    """
    cosine, sine = math.cos(car[2]), math.sin(car[2])
    count = zones.radius.shape[0]
    for i in range(tree.mass.shape[0]):
        wx, wy = contacts.centre[i, 0] - car[0], contacts.centre[i, 1] - car[1]
        cx, cy = cosine * wx + sine * wy, -sine * wx + cosine * wy
        cz = contacts.centre[i, 2]
        reach = ellipsoids.reach[i]
        for j in range(count):
            contacts.segment_force[i, j] = 0.0
        # Less what acted before, and what acts when all zones are done.
        for k in range(3):
            contacts.car_force[i, k] = -loads.force[i, k]
        if cx > reach or ellipsoids.surface_law[i, 0] < 0:
            # Ahead of the foremost point, x = 0, or free of the car.
            for j in range(count):
                contacts.engaged[i, j] = False
            for k in range(3):
                contacts.car_force[i, k] = 0.0
            continue
        for j in range(count):
            engaged = contacts.engaged[i, j]
            contacts.engaged[i, j] = False
            if (
                cx > zones.box[j, 1] + reach
                or cx < zones.box[j, 0] - reach
                or cz > zones.box[j, 3] + reach
                or cz < zones.box[j, 2] - reach
            ):
                continue
            separation, nx, ny, nz, px, py, pz, weight = zone_separation(
                zones, ellipsoids, contacts, j, i, cx, cy, cz, cosine, sine
            )
            if separation >= 0.0 or weight == 0.0:
                continue
            penetration = -separation
            if not engaged and penetration > ENTRY_DEPTH:
                # A dent that slides across a border is as deep on its other side.
                deepest = 0.0
                for k in range(count):
                    if zones.joined[j, k] and contacts.engaged[i, k]:
                        deepest = max(deepest, contacts.largest[i, k])
                if penetration > deepest + HANDED_DEEPER:
                    continue
            contacts.engaged[i, j] = True
            if penetration > contacts.largest[i, j]:
                contacts.largest[i, j] = penetration
            law = ellipsoids.surface_law[i, j]
            dent = law_surface(ellipsoids, law, penetration)
            support = nx * (cx - px) + ny * (cy - py) + nz * (cz - pz)
            share = pressure_share(penetration - dent, dent, support)
            # World point of the pressure's centre, normal and relative velocity there.
            bx, by, bz = px + share * (cx - px), py + share * (cy - py), pz + share * (cz - pz)
            qx = car[0] + cosine * bx - sine * by
            qy = car[1] + sine * bx + cosine * by
            mx, my = cosine * nx - sine * ny, sine * nx + cosine * ny
            vx, vy, vz = point_velocity(motion, i, qx, qy, bz)
            ux = vx - car[3] + car[5] * (qy - car[1])
            uy = vy - car[4] - car[5] * (qx - car[0])
            rate = -(ux * mx + uy * my + vz * nz)
            elastic, viscous = law_force(ellipsoids, law, penetration, rate, contacts.largest[i, j])
            elastic *= weight
            viscous *= weight
            normal = elastic + viscous
            if normal == 0.0:
                continue
            tx, ty, tz = ux + rate * mx, uy + rate * my, vz + rate * nz
            c = friction_coefficient(
                zones.friction[j], normal, tx * tx + ty * ty + tz * tz, tree.mass[i]
            )
            push(
                motion, loads, i, qx, qy, bz,
                normal * mx - c * tx, normal * my - c * ty, normal * nz - c * tz,
            )  # fmt: skip
            approach = vx * mx + vy * my + vz * nz
            power[CAR_NORMAL] += elastic * approach
            power[CONTACT_DAMPING] += viscous * approach
            power[FRICTION] -= c * (tx * vx + ty * vy + tz * vz)
            if zones.ploughing[j] > 0.0:
                resistance = zones.ploughing[j] * normal
                _plough(
                    motion, loads, contacts, power, tree, car, i, mx, my, nz,
                    resistance, support, dent,
                )  # fmt: skip
            contacts.zone_force[j] += normal
            contacts.segment_force[i, j] = normal
            contacts.point[i, j, 0] = px
            contacts.point[i, j, 1] = py
            contacts.point[i, j, 2] = pz
            contacts.normal[i, j, 0] = nx
            contacts.normal[i, j, 1] = ny
            contacts.normal[i, j, 2] = nz
        for k in range(3):
            contacts.car_force[i, k] += loads.force[i, k]


@inlined_kernel
def car_force_of(contacts, i):
    """Return the resultant (N) of the car's forces on segment ``i``, friction included."""
    x, y, z = contacts.car_force[i, 0], contacts.car_force[i, 1], contacts.car_force[i, 2]
    return math.sqrt(x * x + y * y + z * z)
