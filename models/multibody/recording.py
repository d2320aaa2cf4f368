"""What a run writes down between steps: record, frames."""

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
from models.multibody.kinematics import centre_acceleration

BLOW_GAP = 0.01
"""s without force after which the head's next contact with an arm is another blow (assumed)."""
BLOW_FORCE = 300.0
"""N that an arm must have put on the head to count as the head's first blow (assumed)."""

# Entries of the head's last blow on an arm.
B_START, B_VELOCITY, B_LAST, B_PEAK = 0, 1, 4, 5
BLOW = 6


@inlined_kernel
def _relative_velocity(head, motion, car):
    """Return the velocity of the head's centre of mass relative to the car-fixed point where it is.

    In car axes, m/s.
    """
    ux = motion.velocity[head, 0] - car[3] + car[5] * (motion.centre[head, 1] - car[1])
    uy = motion.velocity[head, 1] - car[4] - car[5] * (motion.centre[head, 0] - car[0])
    cosine, sine = math.cos(car[2]), math.sin(car[2])
    return cosine * ux + sine * uy, -sine * ux + cosine * uy, motion.velocity[head, 2]


@inlined_kernel
def note_blow(time, head, ellipsoids, motion, contacts, car, blow):
    """Note when and how fast the head ran into an arm; one blow lasts until a gap of force."""
    force = 0.0
    for k in range(ellipsoids.pairs.shape[0]):
        if ellipsoids.pairs[k, 0] == head or ellipsoids.pairs[k, 1] == head:
            force += contacts.pair_force[k]
    if force <= 0.0:
        return
    if time - blow[B_LAST] > BLOW_GAP:
        blow[B_START], blow[B_PEAK] = time, 0.0
        ux, uy, uz = _relative_velocity(head, motion, car)
        blow[B_VELOCITY], blow[B_VELOCITY + 1], blow[B_VELOCITY + 2] = ux, uy, uz
    blow[B_LAST] = time
    blow[B_PEAK] = max(blow[B_PEAK], force)


@inlined_kernel
def note_head(time, head, motion, contacts, car, blow, head_contact, summary):
    """Note the head's first contact with the car and its deepest place in it.

    Its speed is that of the first blow: where the head lies on an arm that lies on the car, the
    arm has braked it before.
    """
    deepest = summary[S_HEAD_DEPTH]
    for j in range(contacts.zone_force.shape[0] - 1):
        if contacts.segment_force[head, j] <= 0.0:
            continue
        if not math.isfinite(head_contact[0]):
            head_contact[0] = time
            ux, uy, uz = _relative_velocity(head, motion, car)
            if time - blow[B_LAST] <= BLOW_GAP and blow[B_PEAK] >= BLOW_FORCE:
                ux, uy, uz = blow[B_VELOCITY], blow[B_VELOCITY + 1], blow[B_VELOCITY + 2]
            head_contact[1], head_contact[2], head_contact[3] = ux, uy, uz
            for k in range(3):
                head_contact[4 + k] = contacts.normal[head, j, k]
        if contacts.largest[head, j] > deepest and summary[S_GROUND_TIME] == math.inf:
            deepest = contacts.largest[head, j]
            summary[S_HEAD_ZONE] = float(j)
            for k in range(3):
                head_contact[7 + k] = contacts.point[head, j, k]
    summary[S_HEAD_DEPTH] = deepest


@inlined_kernel
def write_record(row, time, head, tree, road_surface, motion, loads, contacts, car, record):
    """Write a row of the record; see ``models.crash.record`` for its columns."""
    record[row, R_TIME] = time
    ax, ay, az = centre_acceleration(motion, loads, head)
    record[row, R_ACCELERATION] = ax - road_surface.pull
    record[row, R_ACCELERATION + 1] = ay
    record[row, R_ACCELERATION + 2] = az + road_surface.weight
    for k in range(3):
        w, q = 0.0, 0.0
        for j in range(3):
            w += motion.rotation[head, j, k] * motion.angular_velocity[head, j]
            q += motion.rotation[head, j, k] * loads.angular_acceleration[head, j]
        record[row, R_SPIN + k] = w
        record[row, R_SPIN_RATE + k] = q
    ux, uy, uz = _relative_velocity(head, motion, car)
    record[row, R_RELATIVE] = ux
    record[row, R_RELATIVE + 1] = uy
    record[row, R_RELATIVE + 2] = uz
    zones = contacts.zone_force.shape[0] - 1
    for j in range(zones):
        record[row, R_ZONES + j] = contacts.zone_force[j]
    record[row, R_ZONES + zones] = contacts.zone_force[zones]
    record[row, R_HEAD_CAR] = car_force_of(contacts, head)
    record[row, R_HEAD_ROAD] = contacts.segment_force[head, zones]
    total = 0.0
    for k in range(3):
        record[row, R_CENTRE + k] = 0.0
    for i in range(tree.mass.shape[0]):
        total += tree.mass[i]
        for k in range(3):
            record[row, R_CENTRE + k] += tree.mass[i] * motion.centre[i, k]
    for k in range(3):
        record[row, R_CENTRE + k] /= total


@inlined_kernel
def write_frame(row, time, motion, contacts, car, frames):
    """Write a frame: time, the car's place and yaw, ellipsoid centres and quaternions."""
    n = motion.orientation.shape[0]
    frames[row, 0] = time
    frames[row, 1], frames[row, 2], frames[row, 3] = car[0], car[1], car[2]
    for i in range(n):
        for k in range(3):
            frames[row, 4 + 7 * i + k] = contacts.centre[i, k]
        for k in range(4):
            frames[row, 7 + 7 * i + k] = motion.orientation[i, k]
