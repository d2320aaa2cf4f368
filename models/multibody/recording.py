"""What a run writes down between steps: record, frames."""

import math

from models.compilation import inlined_kernel
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
)
from models.multibody.kinematics import centre_acceleration


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
    # Velocity of the head's centre of gravity relative to the car-fixed point where it is.
    ux = motion.velocity[head, 0] - car[3] + car[5] * (motion.centre[head, 1] - car[1])
    uy = motion.velocity[head, 1] - car[4] - car[5] * (motion.centre[head, 0] - car[0])
    cosine, sine = math.cos(car[2]), math.sin(car[2])
    record[row, R_RELATIVE] = cosine * ux + sine * uy
    record[row, R_RELATIVE + 1] = -sine * ux + cosine * uy
    record[row, R_RELATIVE + 2] = motion.velocity[head, 2]
    zones = contacts.zone_force.shape[0] - 1
    force = 0.0
    for j in range(zones):
        force += contacts.segment_force[head, j]
        record[row, R_ZONES + j] = contacts.zone_force[j]
    record[row, R_ZONES + zones] = contacts.zone_force[zones]
    record[row, R_HEAD_CAR] = force
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
