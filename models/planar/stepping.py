"""The step loop: our forces and record between the steps of Pymunk's space, all compiled."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel, kernel
from models.crash.body_contact import apply_self_contacts
from models.crash.car_contact import apply_car_contacts, zone_separation
from models.crash.record import (
    NOT_FINITE,
    REST,
    REST_ON_CAR,
    REST_SPEED,
    REST_SPREAD,
    REST_TIME,
    S_CENTRE_SPEED,
    S_FRAMES,
    S_REASON,
    S_RECORDS,
    S_STEPS,
    S_TIME,
    STEP_LIMIT,
    TIME_LIMIT,
)
from models.crash.stepping import HEAD_NEAR, head_meets_car
from models.planar.bushings import add_bushings
from models.planar.recording import (
    M_LENGTH,
    M_QUIET,
    M_ROAD_TIME,
    M_ROWS,
    M_SHOTS,
    M_SPEED_X,
    M_SPEED_Z,
    M_SPIN,
    M_STEPS,
    M_TICKS,
    M_TOUCHED,
    lands,
    note_head,
    note_landing,
    write_frame,
    write_record,
)
from models.planar.space import (
    ANGLE,
    FORCE_X,
    FORCE_Z,
    GIVEN_X,
    GIVEN_Z,
    SPEED_X,
    SPEED_Z,
    SPIN,
    TORQUE,
    X,
    Z,
)
from models.vehicle.motion import car_state

Array = NDArray[np.float64]

CLEAR = 0.1
"""m ahead of the car from which a segment cannot meet it within the longest step (assumed)."""

FASTEST = 1e3
"""m/s of segments on average beyond which a run has come apart (assumed)."""


class PlanarMotion(NamedTuple):
    """Places and rates of ``n`` segments in world axes, (n, 3), as the contacts read them."""

    centre: Array
    velocity: Array
    angular_velocity: Array


class PlanarLoads(NamedTuple):
    """Loads (n, 3) on the segments in world axes."""

    force: Array
    torque: Array


class PlanarSettings(NamedTuple):
    """How a run is stepped and recorded.

    Attributes
    ----------
    tick : s, the finest step. coarse, flight, road : ticks a step in contact with the car, above
        it, and clear of it. time_limit : s. step_limit : steps. frame_every : ticks.
    head : row of the head. trunk : highest row of the trunk.
    """

    tick: float
    coarse: int
    flight: int
    road: int
    time_limit: float
    step_limit: int
    frame_every: int
    head: int
    trunk: int


def empty_motion(n: int) -> PlanarMotion:
    """Return the motion of ``n`` segments at rest at the origin."""
    return PlanarMotion(np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)))


def empty_loads(n: int) -> PlanarLoads:
    """Return no load on ``n`` segments."""
    return PlanarLoads(np.zeros((n, 3)), np.zeros((n, 3)))


@inlined_kernel
def update_motion(body, state, ahead, motion, contacts):
    """Write motion, ellipsoid centres and shape matrices ``ahead`` s after a state.

    Bodies move on at the velocities that they have.
    """
    for i in range(body.mass.shape[0]):
        angle = state[i, ANGLE] + ahead * state[i, SPIN]
        c, s = math.cos(angle), math.sin(angle)
        x, z = state[i, X] + ahead * state[i, SPEED_X], state[i, Z] + ahead * state[i, SPEED_Z]
        motion.centre[i, 0], motion.centre[i, 2] = x, z
        motion.velocity[i, 0], motion.velocity[i, 2] = state[i, SPEED_X], state[i, SPEED_Z]
        motion.angular_velocity[i, 1] = -state[i, SPIN]
        ox, oz = body.offset[i, 0], body.offset[i, 1]
        contacts.centre[i, 0] = x + c * ox - s * oz
        contacts.centre[i, 2] = z + s * ox + c * oz
        xx, xz, zz = body.shadow[i, 0], body.shadow[i, 1], body.shadow[i, 2]
        contacts.shape[i, 0] = c * c * xx - 2.0 * c * s * xz + s * s * zz
        contacts.shape[i, 2] = c * s * (xx - zz) + (c * c - s * s) * xz
        # Across the plane any extent will do: there is no contact along it.
        contacts.shape[i, 3] = 1.0
        contacts.shape[i, 5] = s * s * xx + 2.0 * c * s * xz + c * c * zz


@inlined_kernel
def _add_joint_torques(body, table, state, ahead, given):
    cells = table.shape[1] - 1
    for i in range(1, body.mass.shape[0]):
        p = body.parent[i]
        angle = state[i, ANGLE] - state[p, ANGLE] + ahead * (state[i, SPIN] - state[p, SPIN])
        place = (angle + math.pi) / (2.0 * math.pi) * cells
        place = min(max(place, 0.0), cells - 1e-9)
        k = int(place)
        torque = table[i, k] + (place - k) * (table[i, k + 1] - table[i, k])
        given[i, TORQUE] += torque
        given[p, TORQUE] -= torque


@inlined_kernel
def _speeds(body, state):
    """Return the speed of the centre of gravity and the root mean square segment speed."""
    total, x, z, square = 0.0, 0.0, 0.0, 0.0
    for i in range(body.mass.shape[0]):
        m, vx, vz = body.mass[i], state[i, SPEED_X], state[i, SPEED_Z]
        total += m
        x += m * vx
        z += m * vz
        square += m * (vx * vx + vz * vz)
    return math.hypot(x, z) / total, math.sqrt(square / total)


@inlined_kernel
def _is_near(head, ellipsoids, zones, car, contacts):
    """Return whether the head is within ``HEAD_NEAR`` of a zone."""
    x, z = contacts.centre[head, 0] - car[0], contacts.centre[head, 2]
    for j in range(zones.radius.shape[0]):
        found = zone_separation(zones, ellipsoids, contacts, j, head, x, 0.0, z, 1.0, 0.0)
        if found[0] < HEAD_NEAR:
            return True
    return False


@inlined_kernel
def _ticks_of_next_step(settings, ellipsoids, zones, car, motion, contacts, landed):
    head = settings.head
    if head_meets_car(head, ellipsoids, zones, car, motion, contacts) and (
        _is_near(head, ellipsoids, zones, car, contacts)
    ):
        return 1
    for j in range(contacts.zone_force.shape[0] - 1):
        if contacts.zone_force[j] > 0.0:
            return settings.coarse
    if not landed and lands(settings, motion, contacts, 2.0 * settings.road * settings.tick, True):
        return settings.coarse
    for i in range(contacts.centre.shape[0]):
        if contacts.centre[i, 0] - car[0] < ellipsoids.reach[i] + CLEAR:
            return settings.flight
    return settings.road


@inlined_kernel
def _apply_loads(
    body, joints, ellipsoids, zones, state, ahead, given, motion, loads, contacts, car, power
):  # fmt: skip
    """Write the loads of a step of ``ahead`` s, and every body's own velocity.

    Chipmunk moves the bodies at their old velocities before it changes these, so the forces are
    those where the bodies will then be: explicit Euler becomes the symplectic one.
    """
    update_motion(body, state, ahead, motion, contacts)
    for j in range(contacts.zone_force.shape[0]):
        contacts.zone_force[j] = 0.0
    n = body.mass.shape[0]
    for i in range(n):
        for k in range(3):
            loads.force[i, k] = 0.0
            loads.torque[i, k] = 0.0
    apply_car_contacts(zones, ellipsoids, car, motion, loads, contacts, body, power)
    apply_self_contacts(ellipsoids, motion, loads, contacts, body, power)
    for i in range(n):
        given[i, FORCE_X], given[i, FORCE_Z] = loads.force[i, 0], loads.force[i, 2]
        given[i, TORQUE] = -loads.torque[i, 1]
        given[i, GIVEN_X], given[i, GIVEN_Z] = state[i, SPEED_X], state[i, SPEED_Z]
    _add_joint_torques(body, joints.torque, state, ahead, given)
    add_bushings(body, joints, state, ahead, given)


@inlined_kernel
def _end_reason(settings, body, state, contacts, memory, time):
    """Return why the run ends now, -1 if it goes on."""
    speed, spread = _speeds(body, state)
    quiet = speed < REST_SPEED and spread < REST_SPREAD
    memory[M_QUIET] = memory[M_QUIET] + memory[M_LENGTH] if quiet else 0.0
    # Chipmunk ends the whole process where it meets a number that is none.
    if not spread < FASTEST:
        return NOT_FINITE
    if memory[M_QUIET] >= REST_TIME:
        for j in range(contacts.zone_force.shape[0] - 1):
            if contacts.zone_force[j] > 0.0:
                return REST_ON_CAR
        return REST
    if time >= settings.time_limit:
        return TIME_LIMIT
    if memory[M_STEPS] >= settings.step_limit:
        return STEP_LIMIT
    return -1


@kernel
def simulate(
    step_space, each_body, link, body, joints, ellipsoids, zones, road, car_motion, settings,
    state, given, motion, loads, contacts, car, power, memory,
    record, frames, head_contact, summary,
):  # fmt: skip
    """Run a space from its present state to rest.

    Parameters
    ----------
    step_space, each_body : as in ``models.planar.chipmunk``. link : of the space.
    body, joints, ellipsoids, zones, road, car_motion, settings : constant data.
    state, given : of the space, changed in place.
    motion, loads, contacts, car, power, memory : workspace; car as in ``models.vehicle.motion``.
    record, frames, head_contact, summary : as in ``models.multibody.simulation``; road forces are
        NaN.
    """
    head = settings.head
    reason = -1
    car_state(car_motion, 0.0, car)
    _apply_loads(
        body, joints, ellipsoids, zones, state, 0.0, given, motion, loads, contacts, car, power
    )
    while True:
        time = memory[M_TICKS] * settings.tick
        update_motion(body, state, 0.0, motion, contacts)
        row = int(memory[M_ROWS])
        if row < record.shape[0]:
            write_record(row, time, body, road, settings, state, contacts, car, memory, record)
            memory[M_ROWS] += 1.0
        shot = int(memory[M_SHOTS])
        if memory[M_TICKS] >= shot * settings.frame_every and shot < frames.shape[0]:
            write_frame(shot, time, body, state, contacts, car, frames)
            memory[M_SHOTS] += 1.0
        note_head(time, settings, state, contacts, car, memory, head_contact, summary)
        note_landing(time, settings, motion, contacts, memory, summary)
        reason = _end_reason(settings, body, state, contacts, memory, time)
        if reason >= 0:
            break
        landed = memory[M_ROAD_TIME] < math.inf or memory[M_TOUCHED] == 0.0
        ticks = _ticks_of_next_step(settings, ellipsoids, zones, car, motion, contacts, landed)
        length = ticks * settings.tick
        memory[M_SPEED_X], memory[M_SPEED_Z] = state[head, SPEED_X], state[head, SPEED_Z]
        memory[M_SPIN], memory[M_LENGTH] = state[head, SPIN], length
        memory[M_TICKS] += ticks
        memory[M_STEPS] += 1.0
        # The mean speed brings the car exactly to where it is at the step's end.
        car_state(car_motion, memory[M_TICKS] * settings.tick, car)
        _apply_loads(
            body, joints, ellipsoids, zones, state, length, given,
            motion, loads, contacts, car, power,
        )  # fmt: skip
        given[link.car, GIVEN_X] = (car[0] - state[link.car, X]) / length
        link.write_place[0] = 0
        each_body(link.space, link.writer, link.write_data)
        step_space(link.space, length)
        link.read_place[0] = 0
        each_body(link.space, link.reader, link.read_data)
    speed, _ = _speeds(body, state)
    summary[S_REASON] = float(reason)
    summary[S_TIME] = time
    summary[S_STEPS] = memory[M_STEPS]
    summary[S_RECORDS] = memory[M_ROWS]
    summary[S_FRAMES] = memory[M_SHOTS]
    summary[S_CENTRE_SPEED] = speed


@kernel
def show_surfaces(body, state, motion, contacts):
    """Fill motion and surfaces for a state, before there is a step."""
    update_motion(body, state, 0.0, motion, contacts)
