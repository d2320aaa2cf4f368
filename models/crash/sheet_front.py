"""A car's front of facets, parts of which are shells: implementation of ``models.crash.front``."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel
from models.crash.facet_front import facet_separation, vector_to_car
from models.crash.facet_survey import Findings, rotation_of, to_static
from models.crash.sheet import NOW, Sheet
from models.crash.sheet_motion import (
    clear_impulses,
    find_candidates,
    follow_bodies,
    take_picture,
    wake_groups,
)
from models.crash.surfaces import CAR_NORMAL, push
from models.pedestrian.skin import Skin
from models.vehicle.surface.field import DistanceField

Array = NDArray[np.float64]


class SheetFront(NamedTuple):
    """A front of facets with shells in place of one region of the field, its last.

    The shells belong to the car's zones as the facets do: their loads are those of their zones.

    Attributes
    ----------
    field, dive, friction, ploughing, skin, distributed, found
        See ``models.crash.facet_front.FacetFront``.
    sheet : Sheet
    spins : (n, 3) array
        Workspace: angular velocities of the segments in the static car's frame, rad/s.
    """

    field: DistanceField
    dive: Array
    friction: Array
    ploughing: Array
    skin: Skin
    distributed: Array
    found: Findings
    sheet: Sheet
    spins: Array


@inlined_kernel
def sheet_may_touch(front, j, margin, x, z):
    """Return whether the surveyed segment touches facets of a zone that the shells leave.

    Parameters
    ----------
    front : SheetFront
    j : int
        Row of the region.
    margin, x, z : float
        Not used.
    """
    return front.found.share[j] > 0.0


@inlined_kernel
def sheet_separation(front, ellipsoids, contacts, j, i, cx, cy, cz, cosine, sine):
    """Return the separation of the surveyed segment from a zone, or else from the shells at rest.

    Only the search for the first contact asks where the segment may not touch facets of the zone;
    see ``models.crash.facet_front.facet_separation``.
    """
    own = j if front.found.share[j] > 0.0 else front.friction.shape[0]
    return facet_separation(front, ellipsoids, contacts, own, i, cx, cy, cz, cosine, sine)


@inlined_kernel
def sheet_prepare(front, ellipsoids, car, cosine, sine, motion, contacts, time):
    """Step the sheet to the present pose of the bodies.

    Parameters
    ----------
    front : SheetFront
    ellipsoids : Ellipsoids
    car : (6,) array
        x, y (m) and yaw (rad) of the car's frame and their rates.
    cosine, sine : float
        Of the car's yaw.
    motion : Motion
        Positions and velocities of the segments.
    contacts : Contacts
        Centres of the ellipsoids.
    time : float
        s.
    """
    sheet = front.sheet
    segments = sheet.number.shape[0]
    M = front.found.turn
    c, s = front.dive[0], front.dive[1]
    for i in range(segments):
        wx, wy = contacts.centre[i, 0] - car[0], contacts.centre[i, 1] - car[1]
        x, y, z = to_static(
            front, cosine * wx + sine * wy, -sine * wx + cosine * wy, contacts.centre[i, 2]
        )
        sheet.present[i, 0], sheet.present[i, 1], sheet.present[i, 2] = x, y, z
        rotation_of(front, motion, i, cosine, sine, M)
        for a in range(3):
            for b in range(3):
                sheet.present[i, 3 + 3 * a + b] = M[a, b]
        ox, oy, oz = (
            motion.angular_velocity[i, 0],
            motion.angular_velocity[i, 1],
            motion.angular_velocity[i, 2] - car[5],
        )
        ax, ay = cosine * ox + sine * oy, -sine * ox + cosine * oy
        front.spins[i, 0], front.spins[i, 1] = c * ax - s * oz, ay
        front.spins[i, 2] = s * ax + c * oz
    clear_impulses(sheet)
    if time > sheet.clock[NOW] and wake_groups(sheet, ellipsoids):
        find_candidates(sheet, front.skin.reach)
        if sheet.body.awake.any() or sheet.number.any():
            follow_bodies(sheet, ellipsoids, front.friction, front.spins, time)
            if sheet.body.awake.any():
                take_picture(sheet, time)
    sheet.clock[NOW] = time
    for i in range(segments):
        for j in range(12):
            sheet.past[i, j] = sheet.present[i, j]


@inlined_kernel
def sheet_carry(front, car, cosine, sine, motion, loads, contacts, power, i):
    """Add the sheet's loads on a segment.

    Parameters
    ----------
    front : SheetFront
    car : (6,) array
        x, y (m) and yaw (rad) of the car's frame and their rates.
    cosine, sine : float
        Of the car's yaw.
    motion : Motion
        Velocities of the segments.
    loads : Loads
        Increased in place.
    contacts : Contacts
        Force, point and normal of the sheet's region are set.
    power : (channels,) array
        Power (W) on the body by work channel; increased in place.
    i : int
        Row of the segment.
    """
    J = front.sheet.impulse
    for row in range(front.friction.shape[0]):
        contacts.engaged[i, row] |= J[i, row, 9] > 0.0
        if J[i, row, 9] == 0.0:
            continue
        fx, fy, fz = vector_to_car(front, J[i, row, 0], J[i, row, 1], J[i, row, 2])
        tx, ty, tz = vector_to_car(front, J[i, row, 3], J[i, row, 4], J[i, row, 5])
        fx, fy = cosine * fx - sine * fy, sine * fx + cosine * fy
        tx, ty = cosine * tx - sine * ty, sine * tx + cosine * ty
        qx, qy, qz = contacts.centre[i, 0], contacts.centre[i, 1], contacts.centre[i, 2]
        push(motion, loads, i, qx, qy, qz, fx, fy, fz)
        loads.torque[i, 0] += tx
        loads.torque[i, 1] += ty
        loads.torque[i, 2] += tz
        rx, ry, rz = qx - motion.centre[i, 0], qy - motion.centre[i, 1], qz - motion.centre[i, 2]
        wx, wy, wz = (
            motion.angular_velocity[i, 0],
            motion.angular_velocity[i, 1],
            motion.angular_velocity[i, 2],
        )
        vx = motion.velocity[i, 0] + wy * rz - wz * ry
        vy = motion.velocity[i, 1] + wz * rx - wx * rz
        vz = motion.velocity[i, 2] + wx * ry - wy * rx
        power[CAR_NORMAL] += fx * vx + fy * vy + fz * vz + tx * wx + ty * wy + tz * wz
        _note(front, contacts, i, row, J[i, row, 9])


@inlined_kernel
def _note(front, contacts, i, row, force):
    """Enter the shells' force on a segment in a zone, N, and its place among the contacts."""
    sheet = front.sheet
    J, place = sheet.impulse, sheet.place
    contacts.zone_force[row] += force
    before = contacts.segment_force[i, row]
    contacts.segment_force[i, row] = before + force
    if before > force:
        # Facets of the same zone carry more: direction and place are theirs.
        return
    if sheet.body.region[sheet.sunk_at[i]] == row:
        contacts.largest[i, row] = max(contacts.largest[i, row], sheet.sunk[i])
    nx, ny, nz = vector_to_car(
        front, J[i, row, 6] / force, J[i, row, 7] / force, J[i, row, 8] / force
    )
    contacts.normal[i, row, 0], contacts.normal[i, row, 1] = nx, ny
    contacts.normal[i, row, 2] = nz
    weight = place[i, row, 3]
    px, py, pz = vector_to_car(
        front,
        place[i, row, 0] / weight,
        place[i, row, 1] / weight,
        place[i, row, 2] / weight,
    )
    contacts.point[i, row, 0] = px + front.dive[2]
    contacts.point[i, row, 1] = py
    contacts.point[i, row, 2] = pz + front.dive[3]
