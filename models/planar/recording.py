"""What a planar run writes down between steps: record, frames, head contact, landing."""

import math

from models.compilation import inlined_kernel
from models.crash.car_contact import car_force_of
from models.crash.record import (
    R_ACCELERATION,
    R_CENTRE,
    R_HEAD_CAR,
    R_HEAD_ROAD,
    R_RELATIVE,
    R_SPIN,
    R_SPIN_RATE,
    R_TIME,
    R_ZONES,
    S_GROUND_TIME,
    S_HEAD_DEPTH,
    S_HEAD_ZONE,
)
from models.planar.space import ANGLE, SPEED_X, SPEED_Z, SPIN, X, Z

TOUCH = 0.005
"""m above the road at which a segment counts as landed: the road's slop and the polygon's error."""

# Entries of the memory from step to step.
(
    M_TICKS,
    M_STEPS,
    M_ROWS,
    M_SHOTS,
    M_QUIET,
    M_LENGTH,
    M_TOUCHED,
    M_SPEED_X,
    M_SPEED_Z,
    M_SPIN,
    M_AIRBORNE,
    M_ROAD_TIME,
) = range(12)
MEMORY = 12


@inlined_kernel
def write_record(row, time, body, road, settings, state, contacts, car, memory, record):
    """Write a row, and into the one before the head's acceleration since then."""
    head = settings.head
    zones = contacts.zone_force.shape[0] - 1
    if row > 0:
        length = memory[M_LENGTH]
        spin_rate = (state[head, SPIN] - memory[M_SPIN]) / length
        ax = (state[head, SPEED_X] - memory[M_SPEED_X]) / length
        az = (state[head, SPEED_Z] - memory[M_SPEED_Z]) / length
        record[row - 1, R_ACCELERATION] = ax - road.pull
        record[row - 1, R_ACCELERATION + 2] = az + road.weight
        for k in range(3):
            record[row - 1, R_SPIN_RATE + k] = -spin_rate * body.normal[head, k]
            # The last row has no step after it.
            record[row, R_SPIN_RATE + k] = record[row - 1, R_SPIN_RATE + k]
            record[row, R_ACCELERATION + k] = record[row - 1, R_ACCELERATION + k]
    record[row, R_TIME] = time
    for k in range(3):
        record[row, R_SPIN + k] = -state[head, SPIN] * body.normal[head, k]
    record[row, R_RELATIVE] = state[head, SPEED_X] - car[3]
    record[row, R_RELATIVE + 2] = state[head, SPEED_Z]
    for j in range(zones):
        record[row, R_ZONES + j] = contacts.zone_force[j]
    record[row, R_HEAD_CAR] = car_force_of(contacts, head)
    # Pymunk's impulses on the road are no forces.
    record[row, R_HEAD_ROAD] = math.nan
    record[row, R_ZONES + zones] = math.nan
    total, x, z = 0.0, 0.0, 0.0
    for i in range(body.mass.shape[0]):
        total += body.mass[i]
        x += body.mass[i] * state[i, X]
        z += body.mass[i] * state[i, Z]
    record[row, R_CENTRE] = x / total
    record[row, R_CENTRE + 2] = z / total


@inlined_kernel
def write_frame(row, time, body, state, contacts, car, frames):
    """Write the poses of all segments as places and quaternions."""
    frames[row, 0] = time
    frames[row, 1], frames[row, 2], frames[row, 3] = car[0], car[1], car[2]
    for i in range(body.mass.shape[0]):
        first = 4 + 7 * i
        frames[row, first] = contacts.centre[i, 0]
        frames[row, first + 1] = body.side[i]
        frames[row, first + 2] = contacts.centre[i, 2]
        # The start's quaternion, turned about -y.
        c, s = math.cos(0.5 * state[i, ANGLE]), -math.sin(0.5 * state[i, ANGLE])
        w, x, y, z = (
            body.orientation[i, 0],
            body.orientation[i, 1],
            body.orientation[i, 2],
            body.orientation[i, 3],
        )
        frames[row, first + 3] = c * w - s * y
        frames[row, first + 4] = c * x + s * z
        frames[row, first + 5] = c * y + s * w
        frames[row, first + 6] = c * z - s * x


@inlined_kernel
def note_head(time, settings, state, contacts, car, memory, head_contact, summary):
    """Note the head's first contact with the car and its deepest place in it."""
    head = settings.head
    deepest = summary[S_HEAD_DEPTH]
    for j in range(contacts.zone_force.shape[0] - 1):
        if contacts.segment_force[head, j] <= 0.0:
            continue
        if memory[M_TOUCHED] == 0.0:
            memory[M_TOUCHED] = 1.0
            head_contact[0] = time
            head_contact[1] = state[head, SPEED_X] - car[3]
            head_contact[2] = 0.0
            head_contact[3] = state[head, SPEED_Z]
            for k in range(3):
                head_contact[4 + k] = contacts.normal[head, j, k]
        if contacts.largest[head, j] > deepest and summary[S_GROUND_TIME] == math.inf:
            deepest = contacts.largest[head, j]
            summary[S_HEAD_ZONE] = float(j)
            for k in range(3):
                head_contact[7 + k] = contacts.point[head, j, k]
    summary[S_HEAD_DEPTH] = deepest


@inlined_kernel
def lands(settings, motion, contacts, ahead, any_segment):
    """Return whether trunk or head, or any segment, touches the road within ``ahead`` s."""
    for i in range(contacts.centre.shape[0]):
        gap = contacts.centre[i, 2] - math.sqrt(contacts.shape[i, 5]) - TOUCH
        fall = max(-motion.velocity[i, 2], 0.0)
        if (any_segment or i <= settings.trunk or i == settings.head) and gap < ahead * fall:
            return True
    return False


@inlined_kernel
def note_landing(time, settings, motion, contacts, memory, summary):
    """Note when trunk or head lands, and when the road begins to act on the head's signals.

    That is when any segment lands after the body, its head having met the car, was in the air.
    """
    coarse = settings.coarse * settings.tick
    if summary[S_GROUND_TIME] == math.inf and lands(settings, motion, contacts, coarse, False):
        summary[S_GROUND_TIME] = time
        memory[M_ROAD_TIME] = min(memory[M_ROAD_TIME], time)
    if memory[M_TOUCHED] > 0.0 and memory[M_ROAD_TIME] == math.inf:
        low = lands(settings, motion, contacts, coarse, True)
        if low and memory[M_AIRBORNE] > 0.0:
            memory[M_ROAD_TIME] = time
        elif not low:
            memory[M_AIRBORNE] = 1.0
