"""Contact of the segments with the car's front, independent of its geometry.

The front returns position and depth of the contact (``models.crash.front``), the law of the region
gives the force, which acts on the segment, and the front receives the reaction.
"""

import math

from models.compilation import inlined_kernel
from models.contact.dent import ploughing_coefficient, pressure_share
from models.contact.friction import friction_coefficient
from models.crash.front import (
    are_joined,
    carry,
    friction_of,
    may_touch,
    patch_count,
    ploughing_of,
    prepare,
    pressure_point,
    reach_of,
    react,
    separation_of,
    survey,
)
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

ENTRY_DEPTH = 0.03
"""Largest depth (m) of a segment at its first contact with a zone; a deeper one has passed the
border (beside the fender, from under the bumper) and is not in contact (assumed, ten times the
travel of a step), unless it comes from a zone that shares a border."""
HANDED_DEEPER = 0.005
"""Depth (m) by which a segment may be deeper than in the zone it comes from (assumed)."""


@inlined_kernel
def _plough(
    motion, loads, contacts, power, tree, car, i, mx, my, nz, resistance, support, dent
):  # fmt: skip
    """Add the ploughing force of a panel's dent on segment ``i``, at the ellipsoid's centre.

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
def apply_car_contacts(front, ellipsoids, car, motion, loads, contacts, tree, power, time):
    """Add the loads of the car on all segments, and the reactions on its front.

    Parameters
    ----------
    front : named tuple
        Geometry of the car's front; receives the reactions.
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    car : (6,) array
        x, y of the frame's origin (m), yaw (rad) and their rates; see ``models.vehicle.motion``.
    motion : Motion
        Positions and velocities of the segments.
    loads : Loads
        ``force`` and ``torque`` of the segments are increased in place.
    contacts : Contacts
        Penetrations, forces, points and normals of the car contacts are updated.
    tree : Tree or PlanarBody
        Gives the segments' masses.
    power : (channels,) array
        Power (W) on the body by work channel; increased in place.
    time : float
        s; a front with a state of its own advances to it.
    """
    cosine, sine = math.cos(car[2]), math.sin(car[2])
    count = patch_count(front)
    prepare(front, ellipsoids, car, cosine, sine, motion, contacts, time)
    for i in range(tree.mass.shape[0]):
        wx, wy = contacts.centre[i, 0] - car[0], contacts.centre[i, 1] - car[1]
        cx, cy = cosine * wx + sine * wy, -sine * wx + cosine * wy
        cz = contacts.centre[i, 2]
        reach = reach_of(front, ellipsoids, i)
        for j in range(count):
            contacts.segment_force[i, j] = 0.0
        # The loads before the zones are subtracted here, those after them are added below.
        for k in range(3):
            contacts.car_force[i, k] = -loads.force[i, k]
            contacts.car_torque[i, k] = -loads.torque[i, k]
        if cx > reach or ellipsoids.surface_law[i, 0] < 0:
            # Ahead of the foremost point, x = 0, or free of the car.
            for j in range(count):
                contacts.engaged[i, j] = False
            for k in range(3):
                contacts.car_force[i, k] = 0.0
                contacts.car_torque[i, k] = 0.0
            continue
        survey(front, ellipsoids, motion, i, cx, cy, cz, cosine, sine)
        for j in range(count):
            engaged = contacts.engaged[i, j]
            contacts.engaged[i, j] = False
            if not may_touch(front, j, reach, cx, cz):
                continue
            separation, nx, ny, nz, px, py, pz, weight, region = separation_of(
                front, ellipsoids, contacts, j, i, cx, cy, cz, cosine, sine
            )
            if separation >= 0.0 or weight == 0.0:
                continue
            penetration = -separation
            if not engaged and penetration > ENTRY_DEPTH:
                # A dent that moves across a border is equally deep on the other side.
                deepest = 0.0
                for k in range(count):
                    if are_joined(front, j, k) and contacts.engaged[i, k]:
                        deepest = max(deepest, contacts.largest[i, k])
                if penetration > deepest + HANDED_DEEPER:
                    continue
            contacts.engaged[i, j] = True
            if penetration > contacts.largest[i, j]:
                contacts.largest[i, j] = penetration
            law = ellipsoids.surface_law[i, region]
            dent = law_surface(ellipsoids, law, penetration)
            support = nx * (cx - px) + ny * (cy - py) + nz * (cz - pz)
            share = pressure_share(penetration - dent, dent, support)
            # Centre of pressure in world axes, normal and relative velocity there.
            bx, by, bz = pressure_point(front, j, share, penetration - dent, px, py, pz, cx, cy, cz)
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
                friction_of(front, region), normal, tx * tx + ty * ty + tz * tz, tree.mass[i]
            )
            fx, fy, fz = normal * mx - c * tx, normal * my - c * ty, normal * nz - c * tz
            push(motion, loads, i, qx, qy, bz, fx, fy, fz)
            react(front, j, bx, by, bz, -fx, -fy, -fz)
            approach = vx * mx + vy * my + vz * nz
            power[CAR_NORMAL] += elastic * approach
            power[CONTACT_DAMPING] += viscous * approach
            power[FRICTION] -= c * (tx * vx + ty * vy + tz * vz)
            ploughing = ploughing_of(front, region)
            if ploughing > 0.0:
                resistance = ploughing * normal
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
        carry(front, car, cosine, sine, motion, loads, contacts, power, i)
        for k in range(3):
            contacts.car_force[i, k] += loads.force[i, k]
            contacts.car_torque[i, k] += loads.torque[i, k]


@inlined_kernel
def car_force_of(contacts, i):
    """Return the resultant (N) of the car's forces on segment ``i``, friction included."""
    x, y, z = contacts.car_force[i, 0], contacts.car_force[i, 1], contacts.car_force[i, 2]
    return math.sqrt(x * x + y * y + z * z)
