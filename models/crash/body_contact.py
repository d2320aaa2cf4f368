"""Contact of the segments with the road and with each other."""

import math

from models.compilation import inlined_kernel
from models.contact.dent import pressure_share
from models.contact.friction import friction_coefficient
from models.contact.geometry import ellipsoid_direction
from models.crash.surfaces import (
    CONTACT_DAMPING,
    FRICTION,
    ROAD_NORMAL,
    SELF_NORMAL,
    law_force,
    point_velocity,
    push,
    shape_of,
)


@inlined_kernel
def apply_road_contacts(ellipsoids, road_surface, motion, loads, contacts, tree, power):
    """Add the loads of the road, the plane z = 0, on all segments.

    Parameters
    ----------
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    road_surface : Road
        Friction of the road.
    motion : Motion
        Positions and velocities of the segments.
    loads : Loads
        ``force`` and ``torque`` of the segments are increased in place.
    contacts : Contacts
        Penetrations and forces of the road contacts are updated.
    tree : Tree or PlanarBody
        Gives the segments' masses.
    power : (channels,) array
        Power (W) on the body by work channel; increased in place.
    """
    road = contacts.zone_force.shape[0] - 1
    for i in range(tree.mass.shape[0]):
        contacts.segment_force[i, road] = 0.0
        if contacts.centre[i, 2] > ellipsoids.reach[i]:
            contacts.largest[i, road] = 0.0
            continue
        h = math.sqrt(contacts.shape[i, 5])
        penetration = h - contacts.centre[i, 2]
        if penetration <= 0.0:
            # Flesh recovers after it leaves the road; a dent in the car does not.
            contacts.largest[i, road] = 0.0
            continue
        if penetration > contacts.largest[i, road]:
            contacts.largest[i, road] = penetration
        # The flesh is flattened on the road.
        left = 1.0 - pressure_share(penetration, 0.0, h)
        px = contacts.centre[i, 0] - left * contacts.shape[i, 2] / h
        py = contacts.centre[i, 1] - left * contacts.shape[i, 4] / h
        pz = contacts.centre[i, 2] - left * h
        vx, vy, vz = point_velocity(motion, i, px, py, pz)
        law = ellipsoids.surface_law[i, road]
        elastic, viscous = law_force(ellipsoids, law, penetration, -vz, contacts.largest[i, road])
        normal = elastic + viscous
        slip = vx * vx + vy * vy
        wet = px > road_surface.wet_from
        mu = road_surface.wet_friction if wet else road_surface.friction
        drag = friction_coefficient(mu, normal, slip, tree.mass[i])
        push(motion, loads, i, px, py, pz, -drag * vx, -drag * vy, normal)
        power[ROAD_NORMAL] += elastic * vz
        power[CONTACT_DAMPING] += viscous * vz
        power[FRICTION] -= drag * slip
        contacts.zone_force[road] += normal
        contacts.segment_force[i, road] = normal


@inlined_kernel
def apply_self_contacts(ellipsoids, motion, loads, contacts, tree, power):
    """Add the loads between segments (head and arms against the trunk, leg against leg).

    Parameters
    ----------
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    motion : Motion
        Positions and velocities of the segments.
    loads : Loads
        ``force`` and ``torque`` of the segments are increased in place.
    contacts : Contacts
        Penetrations, normals and forces of the pairs are updated.
    tree : Tree or PlanarBody
        Gives the segments' masses.
    power : (channels,) array
        Power (W) on the body by work channel; increased in place.
    """
    for k in range(ellipsoids.pairs.shape[0]):
        contacts.pair_force[k] = 0.0
        i, j = ellipsoids.pairs[k, 0], ellipsoids.pairs[k, 1]
        dx = contacts.centre[i, 0] - contacts.centre[j, 0]
        dy = contacts.centre[i, 1] - contacts.centre[j, 1]
        dz = contacts.centre[i, 2] - contacts.centre[j, 2]
        limit = ellipsoids.reach[i] + ellipsoids.reach[j]
        if dx * dx + dy * dy + dz * dz > limit * limit:
            contacts.pair_largest[k] = 0.0
            continue
        A = shape_of(contacts, i)
        B = shape_of(contacts, j)
        # The last direction gives a lower bound on the separation, which often rules out contact.
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
        ix, iy, iz = point_velocity(motion, i, px, py, pz)
        jx, jy, jz = point_velocity(motion, j, px, py, pz)
        vx, vy, vz = ix - jx, iy - jy, iz - jz
        rate = -(vx * nx + vy * ny + vz * nz)
        law = ellipsoids.pairs[k, 2]
        elastic, viscous = law_force(ellipsoids, law, penetration, rate, contacts.pair_largest[k])
        normal = elastic + viscous
        contacts.pair_force[k] = normal
        tx, ty, tz = vx + rate * nx, vy + rate * ny, vz + rate * nz
        slip = tx * tx + ty * ty + tz * tz
        mass = min(tree.mass[i], tree.mass[j])
        c = friction_coefficient(ellipsoids.pair_friction, normal, slip, mass)
        fx, fy, fz = normal * nx - c * tx, normal * ny - c * ty, normal * nz - c * tz
        push(motion, loads, i, px, py, pz, fx, fy, fz)
        push(motion, loads, j, px, py, pz, -fx, -fy, -fz)
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
