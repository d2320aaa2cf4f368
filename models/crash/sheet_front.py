"""A car's front of facets whose hood is a sheet of shells: implementation of ``front``."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel
from models.crash.facet_front import vector_to_car
from models.crash.facet_survey import Findings, rotation_of, to_static
from models.crash.sheet import (
    ASLEEP,
    LAST_CONTACT,
    NOW,
    RUNNING,
    Sheet,
    find_candidates,
    follow_bodies,
    is_near_sheet,
)
from models.crash.surfaces import CAR_NORMAL, push
from models.pedestrian.skin import Skin
from models.vehicle.surface.field import DistanceField

Array = NDArray[np.float64]


class SheetFront(NamedTuple):
    """A front of facets with a sheet in place of one region.

    Attributes
    ----------
    field, dive, friction, ploughing, skin, distributed, found
        See ``models.crash.facet_front.FacetFront``.
    sheet : Sheet
    row : (1,) array of int
        Region of the field that the sheet replaces.
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
    row: NDArray[np.int64]
    spins: Array


@inlined_kernel
def sheet_may_touch(front, j, margin, x, z):
    """Return whether the surveyed segment touches a region that is not the sheet's.

    Parameters
    ----------
    front : SheetFront
    j : int
        Row of the region.
    margin, x, z : float
        Not used.
    """
    return front.found.share[j] > 0.0 and j != front.row[0]


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
        for j in range(10):
            sheet.impulse[i, j] = 0.0
        for j in range(4):
            sheet.place[i, j] = 0.0
    if time > sheet.clock[NOW]:
        if sheet.clock[RUNNING] == 0.0 and is_near_sheet(sheet, front.skin.reach):
            sheet.clock[RUNNING] = 1.0
            sheet.clock[LAST_CONTACT] = time
        if sheet.clock[RUNNING] == 1.0:
            find_candidates(sheet, front.skin.reach)
            follow_bodies(sheet, ellipsoids, front.friction[front.row[0]], front.spins, time)
            if time - sheet.clock[LAST_CONTACT] > ASLEEP:
                sheet.clock[RUNNING] = 2.0
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
    J, row = front.sheet.impulse, front.row[0]
    contacts.engaged[i, row] = J[i, 9] > 0.0
    if J[i, 9] == 0.0:
        return
    fx, fy, fz = vector_to_car(front, J[i, 0], J[i, 1], J[i, 2])
    tx, ty, tz = vector_to_car(front, J[i, 3], J[i, 4], J[i, 5])
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
    contacts.zone_force[row] += J[i, 9]
    contacts.segment_force[i, row] = J[i, 9]
    contacts.largest[i, row] = max(contacts.largest[i, row], front.sheet.sunk[i])
    nx, ny, nz = vector_to_car(front, J[i, 6] / J[i, 9], J[i, 7] / J[i, 9], J[i, 8] / J[i, 9])
    contacts.normal[i, row, 0], contacts.normal[i, row, 1] = nx, ny
    contacts.normal[i, row, 2] = nz
    place, weight = front.sheet.place, front.sheet.place[i, 3]
    px, py, pz = vector_to_car(
        front, place[i, 0] / weight, place[i, 1] / weight, place[i, 2] / weight
    )
    contacts.point[i, row, 0] = px + front.dive[2]
    contacts.point[i, row, 1] = py
    contacts.point[i, row, 2] = pz + front.dive[3]
