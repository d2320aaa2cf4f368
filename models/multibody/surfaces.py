"""Contact of the segments with the car, the road and each other, as loads on the tree.

The car front is a row of *zones* in its own frame (x forward, z up, origin on the road under the
foremost point): rolls (cylinders across the car: spoiler, bumper, hood edge) and panels (planes:
grille, hood, windscreen, roof). Seen from above every zone follows a parabola of the given
curvature. The car's frame moves by a prescribed motion; the road is the plane z = 0.

At its borders a zone fades over ``BORDER``, so that a segment passes from the hood edge to the hood
with one contact's worth of force.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel
from models.contact.geometry import ellipsoid_direction, roll_direction, shape_matrix
from models.contact.law import DAMPING_ONSET, contact_force

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ROLL, PANEL = 0, 1

BORDER = 0.04
"""Length (m) over which a zone fades at its borders (assumed)."""
ARC_BORDER = 0.15
"""Angle (rad) over which a roll fades at the ends of its arc (assumed)."""
MAXIMUM_DEPTH = 0.30
"""Depth (m) below a panel beyond which a segment counts as under the car, not in it (assumed)."""
ENTRY_DEPTH = 0.03
"""Depth (m) within which a segment must first be seen by a zone; deeper, it came past the border
(beside the fender, from under the bumper) and is not in contact (assumed, ten times the way of a
step)."""
SLIP_VELOCITY = 0.1
"""Slip (m/s) at which Coulomb friction reaches 71 % of its bound (regularisation, assumed)."""
SLIP_RATE = 1000.0
"""Largest friction coefficient per segment mass (1/s): keeps the regularised friction of a light
segment under a hard blow slower than the step (assumed)."""

# Work channels.
(
    JOINT_ELASTIC,
    JOINT_DAMPING,
    CAR_NORMAL,
    ROAD_NORMAL,
    SELF_NORMAL,
    FRICTION,
    CONTACT_DAMPING,
) = range(7)
CHANNELS = 7
WORK_CHANNELS = (
    "joint_elastic",
    "joint_damping",
    "car_contact",
    "road_contact",
    "self_contact",
    "friction",
    "contact_damping",
)


class Zones(NamedTuple):
    """Car front, ``z`` zones.

    Attributes
    ----------
    kind : (z,) ``ROLL`` or ``PANEL``.
    origin : (z, 2) m, x and z of the roll's axis or of the panel's front border.
    radius : (z,) m (panel: 0).
    direction : (z, 2) unit vector (x, z) along the panel, front to rear.
    length : (z,) m along the panel.
    arc : (z, 2) rad, lowest and highest direction of the roll's normal, from x towards z.
    half_width : (z,) m. curvature : (z,) 1/m seen from above.
    box : (z, 4) m, lowest and highest x, lowest and highest z that a contact point can have.
    friction : (z + 1,) against the body; the last one is the road's.
    """

    kind: Index
    origin: Array
    radius: Array
    direction: Array
    length: Array
    arc: Array
    half_width: Array
    curvature: Array
    box: Array
    friction: Array


class Ellipsoids(NamedTuple):
    """Surfaces of ``n`` segments and their contact laws.

    Attributes
    ----------
    square : (n, 3) m2, squared semi-axes. reach : (n,) m, largest semi-axis.
    offset : (n, 3) m, ellipsoid centre from the centre of mass, own axes.
    laws : (m, KNOTS, 4) combined laws, counts : (m,) their knots, damping : (m,) N s/m.
    surface_law : (n, z + 1) law of a segment against a zone, last column the road.
    pairs : (p, 3) first segment, second segment and law of the contacts between segments.
    pair_gap : (p,) m, overlap of the undeformed ellipsoids that carries no force.
    pair_friction : float.
    """

    square: Array
    reach: Array
    offset: Array
    laws: Array
    counts: Index
    damping: Array
    surface_law: Index
    pairs: Index
    pair_gap: Array
    pair_friction: float


class Contacts(NamedTuple):
    """State and results of the contacts.

    Attributes
    ----------
    largest : (n, z + 1) m, largest penetration so far. pair_largest : (p,) m.
    pair_normal : (p, 3) last separating direction of a pair.
    engaged : (n, z) whether a segment entered a zone through its surface and is still in it.
    zone_force : (z + 1,) N, sum over segments of the normal force at this instant.
    segment_force : (n, z + 1) N, normal force at this instant.
    point : (n, z, 3) m, contact point in the car's frame at this instant.
    normal : (n, z, 3) car-frame normal at this instant (of the nearest approach).
    centre : (n, 3) m, ellipsoid centres, world.
    """

    largest: Array
    pair_largest: Array
    pair_normal: Array
    engaged: NDArray[np.bool_]
    zone_force: Array
    segment_force: Array
    point: Array
    normal: Array
    centre: Array


def empty_contacts(n: int, z: int, p: int) -> Contacts:
    """Return the state of an untouched set of contacts."""
    return Contacts(
        largest=np.zeros((n, z + 1)),
        pair_largest=np.zeros(p),
        pair_normal=np.zeros((p, 3)),
        engaged=np.zeros((n, z), dtype=np.bool_),
        zone_force=np.zeros(z + 1),
        segment_force=np.zeros((n, z + 1)),
        point=np.zeros((n, z, 3)),
        normal=np.zeros((n, z, 3)),
        centre=np.zeros((n, 3)),
    )


@inlined_kernel
def _fade(x, border):
    return min(max(x / border + 0.5, 0.0), 1.0)


@inlined_kernel
def _push(motion, loads, i, px, py, pz, fx, fy, fz):
    """Add a force at a world point to segment ``i``."""
    rx, ry, rz = px - motion.centre[i, 0], py - motion.centre[i, 1], pz - motion.centre[i, 2]
    loads.force[i, 0] += fx
    loads.force[i, 1] += fy
    loads.force[i, 2] += fz
    loads.torque[i, 0] += ry * fz - rz * fy
    loads.torque[i, 1] += rz * fx - rx * fz
    loads.torque[i, 2] += rx * fy - ry * fx


@inlined_kernel
def _point_velocity(motion, i, px, py, pz):
    rx, ry, rz = px - motion.centre[i, 0], py - motion.centre[i, 1], pz - motion.centre[i, 2]
    wx = motion.angular_velocity[i, 0]
    wy = motion.angular_velocity[i, 1]
    wz = motion.angular_velocity[i, 2]
    return (
        motion.velocity[i, 0] + wy * rz - wz * ry,
        motion.velocity[i, 1] + wz * rx - wx * rz,
        motion.velocity[i, 2] + wx * ry - wy * rx,
    )


@inlined_kernel
def _friction_coefficient(mu, normal, slip_square, mass):
    c = mu * normal / math.sqrt(slip_square + SLIP_VELOCITY * SLIP_VELOCITY)
    return min(c, SLIP_RATE * mass)


@inlined_kernel
def update_centres(ellipsoids, motion, contacts):
    """Fill the ellipsoid centres in world axes."""
    for i in range(motion.centre.shape[0]):
        x, y, z = ellipsoids.offset[i, 0], ellipsoids.offset[i, 1], ellipsoids.offset[i, 2]
        for k in range(3):
            contacts.centre[i, k] = (
                motion.centre[i, k]
                + motion.rotation[i, k, 0] * x
                + motion.rotation[i, k, 1] * y
                + motion.rotation[i, k, 2] * z
            )


@inlined_kernel
def zone_separation(zones, ellipsoids, motion, j, i, cx, cy, cz, cosine, sine):
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
    if abs(cy) > half_width + reach + BORDER:
        return 1.0, 1.0, 0.0, 0.0, cx, cy, cz, 0.0
    y = min(max(cy, -half_width), half_width)
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
    A = shape_matrix(
        motion.rotation,
        i,
        ellipsoids.square[i, 0],
        ellipsoids.square[i, 1],
        ellipsoids.square[i, 2],
    )
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
                zones, ellipsoids, motion, j, i, cx, cy, cz, cosine, sine
            )
            if separation >= 0.0 or weight == 0.0:
                continue
            penetration = -separation
            if not engaged and penetration > ENTRY_DEPTH:
                continue
            contacts.engaged[i, j] = True
            if penetration > contacts.largest[i, j]:
                contacts.largest[i, j] = penetration
            # World point, normal and relative velocity.
            qx = car[0] + cosine * px - sine * py
            qy = car[1] + sine * px + cosine * py
            mx, my = cosine * nx - sine * ny, sine * nx + cosine * ny
            vx, vy, vz = _point_velocity(motion, i, qx, qy, pz)
            ux = vx - car[3] + car[5] * (qy - car[1])
            uy = vy - car[4] - car[5] * (qx - car[0])
            rate = -(ux * mx + uy * my + vz * nz)
            law = ellipsoids.surface_law[i, j]
            elastic, viscous = contact_force(
                ellipsoids.laws,
                law,
                ellipsoids.counts[law],
                ellipsoids.damping[law],
                DAMPING_ONSET,
                penetration,
                rate,
                contacts.largest[i, j],
            )
            elastic *= weight
            viscous *= weight
            normal = elastic + viscous
            if normal == 0.0:
                continue
            tx, ty, tz = ux + rate * mx, uy + rate * my, vz + rate * nz
            c = _friction_coefficient(
                zones.friction[j], normal, tx * tx + ty * ty + tz * tz, tree.mass[i]
            )
            _push(
                motion, loads, i, qx, qy, pz,
                normal * mx - c * tx, normal * my - c * ty, normal * nz - c * tz,
            )  # fmt: skip
            approach = vx * mx + vy * my + vz * nz
            power[CAR_NORMAL] += elastic * approach
            power[CONTACT_DAMPING] += viscous * approach
            power[FRICTION] -= c * (tx * vx + ty * vy + tz * vz)
            contacts.zone_force[j] += normal
            contacts.segment_force[i, j] = normal
            contacts.point[i, j, 0] = px
            contacts.point[i, j, 1] = py
            contacts.point[i, j, 2] = pz
            contacts.normal[i, j, 0] = nx
            contacts.normal[i, j, 1] = ny
            contacts.normal[i, j, 2] = nz


@inlined_kernel
def apply_road_contacts(zones, ellipsoids, motion, loads, contacts, tree, power):
    """Add the loads of the road, the plane z = 0, on all segments."""
    road = zones.radius.shape[0]
    mu = zones.friction[road]
    for i in range(tree.mass.shape[0]):
        contacts.segment_force[i, road] = 0.0
        if contacts.centre[i, 2] > ellipsoids.reach[i]:
            contacts.largest[i, road] = 0.0
            continue
        R20, R21, R22 = motion.rotation[i, 2, 0], motion.rotation[i, 2, 1], motion.rotation[i, 2, 2]
        a, b, c = (
            ellipsoids.square[i, 0] * R20,
            ellipsoids.square[i, 1] * R21,
            ellipsoids.square[i, 2] * R22,
        )
        h = math.sqrt(a * R20 + b * R21 + c * R22)
        penetration = h - contacts.centre[i, 2]
        if penetration <= 0.0:
            # Flesh recovers once it leaves the road; a car's dent does not.
            contacts.largest[i, road] = 0.0
            continue
        if penetration > contacts.largest[i, road]:
            contacts.largest[i, road] = penetration
        px = (
            contacts.centre[i, 0]
            - (
                motion.rotation[i, 0, 0] * a
                + motion.rotation[i, 0, 1] * b
                + motion.rotation[i, 0, 2] * c
            )
            / h
        )
        py = (
            contacts.centre[i, 1]
            - (
                motion.rotation[i, 1, 0] * a
                + motion.rotation[i, 1, 1] * b
                + motion.rotation[i, 1, 2] * c
            )
            / h
        )
        pz = contacts.centre[i, 2] - h
        vx, vy, vz = _point_velocity(motion, i, px, py, pz)
        law = ellipsoids.surface_law[i, road]
        elastic, viscous = contact_force(
            ellipsoids.laws,
            law,
            ellipsoids.counts[law],
            ellipsoids.damping[law],
            DAMPING_ONSET,
            penetration,
            -vz,
            contacts.largest[i, road],
        )
        normal = elastic + viscous
        slip = vx * vx + vy * vy
        drag = _friction_coefficient(mu, normal, slip, tree.mass[i])
        _push(motion, loads, i, px, py, pz, -drag * vx, -drag * vy, normal)
        power[ROAD_NORMAL] += elastic * vz
        power[CONTACT_DAMPING] += viscous * vz
        power[FRICTION] -= drag * slip
        contacts.zone_force[road] += normal
        contacts.segment_force[i, road] = normal


@inlined_kernel
def apply_self_contacts(ellipsoids, motion, loads, contacts, tree, power):
    """Add the loads between segments (head and arms against the trunk, leg against leg)."""
    for k in range(ellipsoids.pairs.shape[0]):
        i, j = ellipsoids.pairs[k, 0], ellipsoids.pairs[k, 1]
        dx = contacts.centre[i, 0] - contacts.centre[j, 0]
        dy = contacts.centre[i, 1] - contacts.centre[j, 1]
        dz = contacts.centre[i, 2] - contacts.centre[j, 2]
        limit = ellipsoids.reach[i] + ellipsoids.reach[j]
        if dx * dx + dy * dy + dz * dz > limit * limit:
            contacts.pair_largest[k] = 0.0
            continue
        A = shape_matrix(
            motion.rotation,
            i,
            ellipsoids.square[i, 0],
            ellipsoids.square[i, 1],
            ellipsoids.square[i, 2],
        )
        B = shape_matrix(
            motion.rotation,
            j,
            ellipsoids.square[j, 0],
            ellipsoids.square[j, 1],
            ellipsoids.square[j, 2],
        )
        # The last direction gives a lower bound on the separation, mostly enough to go on.
        nx = contacts.pair_normal[k, 0]
        ny = contacts.pair_normal[k, 1]
        nz = contacts.pair_normal[k, 2]
        ha = math.sqrt(_form(A, nx, ny, nz))
        hb = math.sqrt(_form(B, nx, ny, nz))
        if nx * dx + ny * dy + nz * dz - ha - hb > -ellipsoids.pair_gap[k]:
            contacts.pair_largest[k] = 0.0
            continue
        nx, ny, nz, separation = ellipsoid_direction(dx, dy, dz, A, B, nx, ny, nz)
        contacts.pair_normal[k, 0] = nx
        contacts.pair_normal[k, 1] = ny
        contacts.pair_normal[k, 2] = nz
        penetration = -separation - ellipsoids.pair_gap[k]
        if penetration <= 0.0:
            contacts.pair_largest[k] = 0.0
            continue
        if penetration > contacts.pair_largest[k]:
            contacts.pair_largest[k] = penetration
        ha = math.sqrt(_form(A, nx, ny, nz))
        depth = -0.5 * separation
        # Half way between the two deepest points.
        px = contacts.centre[i, 0] - (A[0] * nx + A[1] * ny + A[2] * nz) / ha + depth * nx
        py = contacts.centre[i, 1] - (A[1] * nx + A[3] * ny + A[4] * nz) / ha + depth * ny
        pz = contacts.centre[i, 2] - (A[2] * nx + A[4] * ny + A[5] * nz) / ha + depth * nz
        ix, iy, iz = _point_velocity(motion, i, px, py, pz)
        jx, jy, jz = _point_velocity(motion, j, px, py, pz)
        vx, vy, vz = ix - jx, iy - jy, iz - jz
        rate = -(vx * nx + vy * ny + vz * nz)
        law = ellipsoids.pairs[k, 2]
        elastic, viscous = contact_force(
            ellipsoids.laws,
            law,
            ellipsoids.counts[law],
            ellipsoids.damping[law],
            DAMPING_ONSET,
            penetration,
            rate,
            contacts.pair_largest[k],
        )
        normal = elastic + viscous
        tx, ty, tz = vx + rate * nx, vy + rate * ny, vz + rate * nz
        slip = tx * tx + ty * ty + tz * tz
        mass = min(tree.mass[i], tree.mass[j])
        c = _friction_coefficient(ellipsoids.pair_friction, normal, slip, mass)
        fx, fy, fz = normal * nx - c * tx, normal * ny - c * ty, normal * nz - c * tz
        _push(motion, loads, i, px, py, pz, fx, fy, fz)
        _push(motion, loads, j, px, py, pz, -fx, -fy, -fz)
        power[SELF_NORMAL] -= elastic * rate
        power[CONTACT_DAMPING] -= viscous * rate
        power[FRICTION] -= c * slip


@inlined_kernel
def _form(A, x, y, z):
    return (
        A[0] * x * x
        + A[3] * y * y
        + A[5] * z * z
        + 2.0 * (A[1] * x * y + A[2] * x * z + A[4] * y * z)
    )
