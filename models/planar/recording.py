"""Recording specific to the planar model: accelerations, poses, landing."""

import math
from enum import IntEnum

from models.compilation import inlined_kernel
from models.crash.record import SEGMENT_ENTRIES, Column, Frame, HeadContact, Summary
from models.crash.recorder import write_centre, write_contact_forces, write_frame
from models.planar.space import ANGLE, SPEED_X, SPEED_Z, SPIN

TOUCH = 0.005
"""m above the road at which a segment counts as landed: the road's slop and the polygon's error."""


class Memory(IntEnum):
    """Entries of the values that are kept from step to step."""

    TICKS = 0
    STEPS = 1
    ROWS = 2
    SHOTS = 3
    QUIET = 4
    LENGTH = 5
    SPEED_X = 6
    SPEED_Z = 7
    SPIN = 8
    AIRBORNE = 9
    ROAD_TIME = 10


@inlined_kernel
def write_row(row, time, model, data):
    """Write a row of the record, and the head's acceleration since the last row into that row.

    Parameters
    ----------
    row : int
        Row of the record.
    time : float
        s.
    model : PlanarCoreModel
    data : PlanarCoreData
        ``record`` is filled.
    """
    body, road, head = model.body, model.road, model.settings.head
    state, memory, record = data.state, data.memory, data.record
    if row > 0:
        length = memory[Memory.LENGTH]
        spin_rate = (state[head, SPIN] - memory[Memory.SPIN]) / length
        ax = (state[head, SPEED_X] - memory[Memory.SPEED_X]) / length
        az = (state[head, SPEED_Z] - memory[Memory.SPEED_Z]) / length
        record[row - 1, Column.ACCELERATION] = ax - road.gravity_along
        record[row - 1, Column.ACCELERATION + 2] = az + road.gravity_down
        for k in range(3):
            record[row - 1, Column.SPIN_RATE + k] = -spin_rate * body.normal[head, k]
            # The last row has no step after it.
            record[row, Column.SPIN_RATE + k] = record[row - 1, Column.SPIN_RATE + k]
            record[row, Column.ACCELERATION + k] = record[row - 1, Column.ACCELERATION + k]
    for k in range(3):
        record[row, Column.SPIN + k] = -state[head, SPIN] * body.normal[head, k]
    write_contact_forces(row, time, head, data.motion, data.contacts, data.car, record)
    # Pymunk gives impulses on the road, not forces.
    record[row, Column.HEAD_ROAD_FORCE] = math.nan
    record[row, Column.REGION_FORCE + data.contacts.zone_force.shape[0] - 1] = math.nan
    write_centre(row, body.mass, data.motion, record)


@inlined_kernel
def write_poses(row, time, body, state, orientation, motion, contacts, car, frames):
    """Write the poses of all segments, with their initial quaternions rotated about y.

    Parameters
    ----------
    row : int
        Row of the frames.
    time : float
        s.
    body : PlanarBody
    state : (b, 6) array
        x, z (m), angle (rad) and their rates of all bodies.
    orientation : (n, 4) array
        Filled with the quaternions.
    motion : PlanarMotion
        Positions and velocities of the segments.
    contacts : Contacts
        State and results of the contacts.
    car : (6,) array
        x, y (m) and yaw (rad) of the car's frame and their rates.
    frames : (rows, 4 + SEGMENT_ENTRIES n) array
        Row ``row`` is filled.
    """
    for i in range(body.mass.shape[0]):
        # About -y.
        c, s = math.cos(0.5 * state[i, ANGLE]), -math.sin(0.5 * state[i, ANGLE])
        w, x, y, z = (
            body.orientation[i, 0],
            body.orientation[i, 1],
            body.orientation[i, 2],
            body.orientation[i, 3],
        )
        orientation[i, 0] = c * w - s * y
        orientation[i, 1] = c * x + s * z
        orientation[i, 2] = c * y + s * w
        orientation[i, 3] = c * z - s * x
    write_frame(row, time, orientation, motion, contacts, car, frames)
    for i in range(body.mass.shape[0]):
        frames[row, Frame.POSES + SEGMENT_ENTRIES * i + 1] = body.side[i]


@inlined_kernel
def lands(settings, motion, contacts, ahead, any_segment):
    """Return whether trunk or head, or any segment, touches the road within a given time.

    Parameters
    ----------
    settings : PlanarSettings
        Gives the rows of head and trunk.
    motion : PlanarMotion
        Velocities of the segments.
    contacts : Contacts
        Ellipsoid centres and shapes.
    ahead : float
        Time ahead, s.
    any_segment : bool
        Whether all segments count.
    """
    for i in range(contacts.centre.shape[0]):
        gap = contacts.centre[i, 2] - math.sqrt(contacts.shape[i, 5]) - TOUCH
        fall = max(-motion.velocity[i, 2], 0.0)
        if (any_segment or i <= settings.trunk or i == settings.head) and gap < ahead * fall:
            return True
    return False


@inlined_kernel
def note_landing(time, settings, data):
    """Record when trunk or head lands, and when the road begins to affect the head's signals.

    The latter is the first landing of any segment after the head has met the car and the body has
    been airborne.

    Parameters
    ----------
    time : float
        s.
    settings : PlanarSettings
    data : PlanarCoreData
        ``summary`` and ``memory`` are updated.
    """
    motion, contacts, memory, summary = data.motion, data.contacts, data.memory, data.summary
    coarse = settings.coarse * settings.tick
    if summary[Summary.GROUND_TIME] == math.inf and (
        lands(settings, motion, contacts, coarse, False)
    ):
        summary[Summary.GROUND_TIME] = time
        memory[Memory.ROAD_TIME] = min(memory[Memory.ROAD_TIME], time)
    met = math.isfinite(data.head_contact[HeadContact.TIME])
    if met and memory[Memory.ROAD_TIME] == math.inf:
        low = lands(settings, motion, contacts, coarse, True)
        if low and memory[Memory.AIRBORNE] > 0.0:
            memory[Memory.ROAD_TIME] = time
        elif not low:
            memory[Memory.AIRBORNE] = 1.0
