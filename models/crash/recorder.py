"""Recording between steps in every crash model: record, frames, head contact, landing, rest."""

import math

from models.compilation import inlined_kernel
from models.crash.car_contact import car_force_of
from models.crash.record import (
    GOES_ON,
    REST_SPEED,
    REST_SPREAD,
    REST_TIME,
    SEGMENT_ENTRIES,
    Blow,
    Column,
    EndReason,
    Frame,
    HeadContact,
    SegmentFrame,
    Summary,
)

BLOW_GAP = 0.01
"""s without force after which a contact of the head with an arm is a new impact (assumed)."""
BLOW_FORCE = 300.0
"""Peak force (N) from which an arm contact counts as the head's first impact (assumed)."""


@inlined_kernel
def relative_velocity(head, motion, car):
    """Return the velocity of the head's centre of mass relative to the coincident point of the car.

    Parameters
    ----------
    head : int
        Row of the head.
    motion : Motion
        Positions and velocities of the segments.
    car : (6,) array
        x, y (m) and yaw (rad) of the car's frame and their rates.

    Returns
    -------
    ux, uy, uz : float
        Car axes, m/s.
    """
    ux = motion.velocity[head, 0] - car[3] + car[5] * (motion.centre[head, 1] - car[1])
    uy = motion.velocity[head, 1] - car[4] - car[5] * (motion.centre[head, 0] - car[0])
    cosine, sine = math.cos(car[2]), math.sin(car[2])
    return cosine * ux + sine * uy, -sine * ux + cosine * uy, motion.velocity[head, 2]


@inlined_kernel
def note_blow(time, head, ellipsoids, motion, contacts, car, blow):
    """Record time and velocity of the head's impact on an arm; a pause in the force ends an impact.

    Parameters
    ----------
    time : float
        s.
    head : int
        Row of the head.
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    motion : Motion
        Positions and velocities of the segments.
    contacts : Contacts
        State and results of the contacts.
    car : (6,) array
        x, y (m) and yaw (rad) of the car's frame and their rates.
    blow : (BLOW_ENTRIES,) array
        Entries ``Blow`` of the last impact; updated.
    """
    force = 0.0
    for k in range(ellipsoids.pairs.shape[0]):
        if ellipsoids.pairs[k, 0] == head or ellipsoids.pairs[k, 1] == head:
            force += contacts.pair_force[k]
    if force <= 0.0:
        return
    if time - blow[Blow.LAST] > BLOW_GAP:
        blow[Blow.START], blow[Blow.PEAK] = time, 0.0
        ux, uy, uz = relative_velocity(head, motion, car)
        blow[Blow.VELOCITY], blow[Blow.VELOCITY + 1], blow[Blow.VELOCITY + 2] = ux, uy, uz
    blow[Blow.LAST] = time
    blow[Blow.PEAK] = max(blow[Blow.PEAK], force)


@inlined_kernel
def note_head(time, head, motion, contacts, car, blow, head_contact, summary):
    """Record the head's first contact with the car and its deepest penetration.

    The impact velocity is that of the first impact: where the head hits an arm that lies on the
    car, the arm decelerates it before it reaches the car. A model in which the head passes through
    the arms leaves ``blow`` unchanged.

    Parameters
    ----------
    time : float
        s.
    head : int
        Row of the head.
    motion : Motion
        Positions and velocities of the segments.
    contacts : Contacts
        State and results of the contacts.
    car : (6,) array
        x, y (m) and yaw (rad) of the car's frame and their rates.
    blow : (BLOW_ENTRIES,) array
        Entries ``Blow`` of the head's last impact on an arm.
    head_contact : (HEAD_CONTACT_ENTRIES,) array
        Entries ``HeadContact``; updated.
    summary : (entries,) array
        ``HEAD_REGION`` and ``HEAD_DEPTH`` are updated.
    """
    deepest = summary[Summary.HEAD_DEPTH]
    for j in range(contacts.zone_force.shape[0] - 1):
        if contacts.segment_force[head, j] <= 0.0:
            continue
        if not math.isfinite(head_contact[HeadContact.TIME]):
            head_contact[HeadContact.TIME] = time
            ux, uy, uz = relative_velocity(head, motion, car)
            if time - blow[Blow.LAST] <= BLOW_GAP and blow[Blow.PEAK] >= BLOW_FORCE:
                ux = blow[Blow.VELOCITY]
                uy = blow[Blow.VELOCITY + 1]
                uz = blow[Blow.VELOCITY + 2]
            head_contact[HeadContact.VELOCITY] = ux
            head_contact[HeadContact.VELOCITY + 1] = uy
            head_contact[HeadContact.VELOCITY + 2] = uz
            for k in range(3):
                head_contact[HeadContact.NORMAL + k] = contacts.normal[head, j, k]
        if contacts.largest[head, j] > deepest and summary[Summary.GROUND_TIME] == math.inf:
            deepest = contacts.largest[head, j]
            summary[Summary.HEAD_REGION] = float(j)
            for k in range(3):
                head_contact[HeadContact.POINT + k] = contacts.point[head, j, k]
    summary[Summary.HEAD_DEPTH] = deepest


@inlined_kernel
def write_contact_forces(row, time, head, motion, contacts, car, record):
    """Write time, head velocity and forces into a row of the record.

    Parameters
    ----------
    row : int
        Row of the record.
    time : float
        s.
    head : int
        Row of the head.
    motion : Motion
        Positions and velocities of the segments.
    contacts : Contacts
        State and results of the contacts.
    car : (6,) array
        x, y (m) and yaw (rad) of the car's frame and their rates.
    record : (rows, columns) array
        Row ``row`` is filled.
    """
    record[row, Column.TIME] = time
    ux, uy, uz = relative_velocity(head, motion, car)
    record[row, Column.RELATIVE_VELOCITY] = ux
    record[row, Column.RELATIVE_VELOCITY + 1] = uy
    record[row, Column.RELATIVE_VELOCITY + 2] = uz
    road = contacts.zone_force.shape[0] - 1
    for j in range(road + 1):
        record[row, Column.REGION_FORCE + j] = contacts.zone_force[j]
    record[row, Column.HEAD_CAR_FORCE] = car_force_of(contacts, head)
    record[row, Column.HEAD_ROAD_FORCE] = contacts.segment_force[head, road]


@inlined_kernel
def write_centre(row, mass, motion, record):
    """Write the centre of gravity into a row of the record.

    Parameters
    ----------
    row : int
        Row of the record.
    mass : (n,) array
        Masses of the segments, kg.
    motion : Motion
        Positions and velocities of the segments.
    record : (rows, columns) array
        Row ``row`` is filled.
    """
    total = 0.0
    for k in range(3):
        record[row, Column.CENTRE + k] = 0.0
    for i in range(mass.shape[0]):
        total += mass[i]
        for k in range(3):
            record[row, Column.CENTRE + k] += mass[i] * motion.centre[i, k]
    for k in range(3):
        record[row, Column.CENTRE + k] /= total


@inlined_kernel
def write_frame(row, time, orientation, motion, contacts, car, frames):
    """Write a frame: time, the car's position and yaw, poses of the ellipsoids and loads on them.

    Parameters
    ----------
    row : int
        Row of the frames.
    time : float
        s.
    orientation : (n, 4) array
        Quaternions of the segments.
    motion : Motion
        Positions and velocities of the segments.
    contacts : Contacts
        State and results of the contacts.
    car : (6,) array
        x, y (m) and yaw (rad) of the car's frame and their rates.
    frames : (rows, 4 + SEGMENT_ENTRIES n) array
        Row ``row`` is filled.
    """
    frames[row, Frame.TIME] = time
    for k in range(3):
        frames[row, Frame.CAR + k] = car[k]
    road = contacts.zone_force.shape[0] - 1
    for i in range(orientation.shape[0]):
        first = Frame.POSES + SEGMENT_ENTRIES * i
        for k in range(3):
            frames[row, first + SegmentFrame.CENTRE + k] = contacts.centre[i, k]
        for k in range(4):
            frames[row, first + SegmentFrame.ORIENTATION + k] = orientation[i, k]
        fx, fy, fz = contacts.car_force[i, 0], contacts.car_force[i, 1], contacts.car_force[i, 2]
        rx = motion.centre[i, 0] - contacts.centre[i, 0]
        ry = motion.centre[i, 1] - contacts.centre[i, 1]
        rz = motion.centre[i, 2] - contacts.centre[i, 2]
        force, torque = first + SegmentFrame.CAR_FORCE, first + SegmentFrame.CAR_TORQUE
        frames[row, force], frames[row, force + 1], frames[row, force + 2] = fx, fy, fz
        frames[row, torque] = contacts.car_torque[i, 0] + ry * fz - rz * fy
        frames[row, torque + 1] = contacts.car_torque[i, 1] + rz * fx - rx * fz
        frames[row, torque + 2] = contacts.car_torque[i, 2] + rx * fy - ry * fx
        frames[row, first + SegmentFrame.ROAD_FORCE] = contacts.segment_force[i, road]


@inlined_kernel
def speeds_of(mass, motion):
    """Return the speed of the centre of gravity and the root mean square segment speed (m/s)."""
    total, square = 0.0, 0.0
    px, py, pz = 0.0, 0.0, 0.0
    for i in range(mass.shape[0]):
        m = mass[i]
        vx, vy, vz = motion.velocity[i, 0], motion.velocity[i, 1], motion.velocity[i, 2]
        total += m
        px += m * vx
        py += m * vy
        pz += m * vz
        square += m * (vx * vx + vy * vy + vz * vz)
    return math.sqrt(px * px + py * py + pz * pz) / total, math.sqrt(square / total)


@inlined_kernel
def time_at_rest(speed, spread, length, before):
    """Return the time (s) for which a body has been at rest after a step.

    Parameters
    ----------
    speed : float
        Speed of the centre of gravity, m/s.
    spread : float
        Root mean square segment speed, m/s.
    length : float
        Length of the step, s.
    before : float
        Time at rest before the step, s.
    """
    return before + length if speed < REST_SPEED and spread < REST_SPREAD else 0.0


@inlined_kernel
def rest_reason(quiet, contacts):
    """Return the end reason of a body that has been at rest for ``quiet`` s, or ``GOES_ON``."""
    if quiet < REST_TIME:
        return GOES_ON
    for j in range(contacts.zone_force.shape[0] - 1):
        if contacts.zone_force[j] > 0.0:
            return EndReason.REST_ON_CAR.value
    return EndReason.REST_ON_ROAD.value


@inlined_kernel
def limit_reason(time, steps, settings):
    """Return the limit that ends the run, or ``GOES_ON``.

    Parameters
    ----------
    time : float
        s.
    steps : int
        Steps taken.
    settings : Settings or PlanarSettings
        Gives ``time_limit`` and ``step_limit``.
    """
    if time >= settings.time_limit:
        return EndReason.TIME_LIMIT.value
    if steps >= settings.step_limit:
        return EndReason.STEP_LIMIT.value
    return GOES_ON


@inlined_kernel
def write_end(reason, time, steps, rows, shots, speed, summary):
    """Write the end of a run and the numbers of recorded rows into the summary.

    Parameters
    ----------
    reason : int
        Value of ``EndReason``.
    time : float
        s.
    steps, rows, shots : int
        Numbers of steps, rows of the record and frames.
    speed : float
        Speed of the centre of gravity, m/s.
    summary : (entries,) array
        Filled.
    """
    summary[Summary.END_REASON] = float(reason)
    summary[Summary.TIME] = time
    summary[Summary.STEPS] = float(steps)
    summary[Summary.RECORDS] = float(rows)
    summary[Summary.FRAMES] = float(shots)
    summary[Summary.CENTRE_SPEED] = speed
