"""The step loop: our forces and records between the steps of Pymunk's space, all compiled."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel, kernel
from models.contact.road import Road
from models.crash.body_contact import apply_self_contacts
from models.crash.car_contact import apply_car_contacts
from models.crash.ellipsoids import Ellipsoids
from models.crash.record import GOES_ON, EndReason, HeadContact
from models.crash.recorder import (
    limit_reason,
    note_head,
    rest_reason,
    speeds_of,
    time_at_rest,
    write_end,
)
from models.crash.surfaces import Contacts
from models.planar.body import PlanarBody
from models.planar.bushings import add_bushings
from models.planar.joints import PlanarJoints
from models.planar.recording import Memory, note_landing, write_poses, write_row
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
    Link,
    X,
    Z,
)
from models.planar.step_length import ticks_of_next_step
from models.vehicle.motion import CarMotion, car_state
from models.vehicle.zones import Zones

Array = NDArray[np.float64]

FASTEST = 1e3
"""Root mean square segment speed (m/s) beyond which a run has diverged (assumed)."""


class PlanarMotion(NamedTuple):
    """Positions and rates of ``n`` segments in world axes, as used by the contacts.

    Attributes
    ----------
    centre : (n, 3) array
        m.
    velocity : (n, 3) array
        m/s.
    angular_velocity : (n, 3) array
        rad/s.
    """

    centre: Array
    velocity: Array
    angular_velocity: Array


class PlanarLoads(NamedTuple):
    """Loads on the segments in world axes.

    Attributes
    ----------
    force : (n, 3) array
        N.
    torque : (n, 3) array
        About the centre of mass, N m.
    """

    force: Array
    torque: Array


class PlanarSettings(NamedTuple):
    """Parameters of the step loop and of the recording.

    Attributes
    ----------
    tick : float
        Finest step, s.
    coarse, flight, road : int
        Ticks per step in contact with the car, above it, and clear of it.
    time_limit : float
        Largest duration of a crash, s.
    step_limit : int
        Largest number of steps.
    frame_every : int
        Ticks between frames.
    head : int
        Row of the head.
    trunk : int
        Highest row of the trunk.
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


class PlanarCoreModel(NamedTuple):
    """Data that are constant during a run.

    Attributes
    ----------
    link : Link
        Addresses of the space.
    body : PlanarBody
    joints : PlanarJoints
    ellipsoids : Ellipsoids
        Of the body in the plane.
    front : Zones
        Geometry of the car's front, one of the types of ``models.crash.front``.
    road : Road
    car_motion : CarMotion
    settings : PlanarSettings
    """

    link: Link
    body: PlanarBody
    joints: PlanarJoints
    ellipsoids: Ellipsoids
    front: Zones
    road: Road
    car_motion: CarMotion
    settings: PlanarSettings


class PlanarCoreData(NamedTuple):
    """State, loads, workspace and recorded arrays, all changed during a run.

    Attributes
    ----------
    state : (b, 6) array
        See ``PlanarSpace``.
    given : (b, 5) array
        See ``PlanarSpace``.
    motion : PlanarMotion
    loads : PlanarLoads
    contacts : Contacts
    orientation : (n, 4) array
        Workspace of the frames.
    car : (6,) array
        As in ``models.vehicle.motion``.
    power : (channels,) array
        Workspace, W.
    memory : (entries,) array
        Values kept from step to step; see ``models.planar.recording.Memory``.
    blow : (entries,) array
        Unused here, as the head passes through the arms.
    record, frames, head_contact, summary : array
        As in ``models.crash.record``; road forces are NaN.
    """

    state: Array
    given: Array
    motion: PlanarMotion
    loads: PlanarLoads
    contacts: Contacts
    orientation: Array
    car: Array
    power: Array
    memory: Array
    blow: Array
    record: Array
    frames: Array
    head_contact: Array
    summary: Array


def empty_motion(n: int) -> PlanarMotion:
    """Return the motion of ``n`` segments at rest at the origin."""
    return PlanarMotion(np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)))


def empty_loads(n: int) -> PlanarLoads:
    """Return zero loads on ``n`` segments."""
    return PlanarLoads(np.zeros((n, 3)), np.zeros((n, 3)))


@inlined_kernel
def update_motion(body, state, ahead, motion, contacts):
    """Compute motion, ellipsoid centres and shape matrices ``ahead`` s after a state.

    Bodies are extrapolated at constant velocity.

    Parameters
    ----------
    body : PlanarBody
    state : (b, 6) array
        x, z (m), angle (rad) and their rates of all bodies.
    ahead : float
        s.
    motion : PlanarMotion
        Filled.
    contacts : Contacts
        ``centre`` and ``shape`` are filled.
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
        xx, xz, zz = body.projection[i, 0], body.projection[i, 1], body.projection[i, 2]
        contacts.shape[i, 0] = c * c * xx - 2.0 * c * s * xz + s * s * zz
        contacts.shape[i, 2] = c * s * (xx - zz) + (c * c - s * s) * xz
        # The extent across the plane is arbitrary: there is no contact in that direction.
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
def _apply_loads(model, data, ahead):
    """Write the loads of a step of ``ahead`` s, and every body's own velocity.

    Chipmunk moves the bodies at their old velocities before it changes these, so the forces are
    evaluated at the positions after that move: explicit Euler becomes symplectic Euler.
    """
    body, ellipsoids = model.body, model.ellipsoids
    state, given, motion, loads = data.state, data.given, data.motion, data.loads
    contacts, power = data.contacts, data.power
    update_motion(body, state, ahead, motion, contacts)
    for j in range(contacts.zone_force.shape[0]):
        contacts.zone_force[j] = 0.0
    n = body.mass.shape[0]
    for i in range(n):
        for k in range(3):
            loads.force[i, k] = 0.0
            loads.torque[i, k] = 0.0
    apply_car_contacts(model.front, ellipsoids, data.car, motion, loads, contacts, body, power, 0.0)
    apply_self_contacts(ellipsoids, motion, loads, contacts, body, power)
    for i in range(n):
        given[i, FORCE_X], given[i, FORCE_Z] = loads.force[i, 0], loads.force[i, 2]
        given[i, TORQUE] = -loads.torque[i, 1]
        given[i, GIVEN_X], given[i, GIVEN_Z] = state[i, SPEED_X], state[i, SPEED_Z]
    _add_joint_torques(body, model.joints.torque, state, ahead, given)
    add_bushings(body, model.joints, state, ahead, given)


@inlined_kernel
def _end_reason(model, data, time):
    """Return why the run ends now, ``GOES_ON`` if it does not end."""
    memory = data.memory
    speed, spread = speeds_of(model.body.mass, data.motion)
    memory[Memory.QUIET] = time_at_rest(speed, spread, memory[Memory.LENGTH], memory[Memory.QUIET])
    # Chipmunk aborts the whole process when it meets a NaN.
    if not spread < FASTEST:
        return EndReason.NOT_FINITE.value
    reason = rest_reason(memory[Memory.QUIET], data.contacts)
    if reason != GOES_ON:
        return reason
    return limit_reason(time, memory[Memory.STEPS], model.settings)


@inlined_kernel
def _step(step_space, each_body, model, data, length):
    """Advance the space by a step of ``length`` (s)."""
    link, state, memory = model.link, data.state, data.memory
    head = model.settings.head
    memory[Memory.SPEED_X], memory[Memory.SPEED_Z] = state[head, SPEED_X], state[head, SPEED_Z]
    memory[Memory.SPIN], memory[Memory.LENGTH] = state[head, SPIN], length
    # With the mean speed the car reaches exactly its position at the step's end.
    car_state(model.car_motion, memory[Memory.TICKS] * model.settings.tick, data.car)
    _apply_loads(model, data, length)
    data.given[link.car, GIVEN_X] = (data.car[0] - state[link.car, X]) / length
    link.write_place[0] = 0
    each_body(link.space, link.writer, link.write_data)
    step_space(link.space, length)
    link.read_place[0] = 0
    each_body(link.space, link.reader, link.read_data)


@kernel
def simulate(step_space, each_body, model, data):
    """Run a space from its present state to rest.

    Parameters
    ----------
    step_space, each_body : callables
        As in ``models.planar.chipmunk``.
    model : PlanarCoreModel
    data : PlanarCoreData
        Changed in place; record, frames, head contact and summary are filled.
    """
    settings, memory, contacts = model.settings, data.memory, data.contacts
    car_state(model.car_motion, 0.0, data.car)
    _apply_loads(model, data, 0.0)
    while True:
        time = memory[Memory.TICKS] * settings.tick
        update_motion(model.body, data.state, 0.0, data.motion, contacts)
        row = int(memory[Memory.ROWS])
        if row < data.record.shape[0]:
            write_row(row, time, model, data)
            memory[Memory.ROWS] += 1.0
        shot = int(memory[Memory.SHOTS])
        if memory[Memory.TICKS] >= shot * settings.frame_every and shot < data.frames.shape[0]:
            write_poses(
                shot, time, model.body, data.state, data.orientation, data.motion, contacts,
                data.car, data.frames,
            )  # fmt: skip
            memory[Memory.SHOTS] += 1.0
        note_head(
            time, settings.head, data.motion, contacts, data.car, data.blow, data.head_contact,
            data.summary,
        )  # fmt: skip
        note_landing(time, settings, data)
        reason = _end_reason(model, data, time)
        if reason != GOES_ON:
            break
        met = math.isfinite(data.head_contact[HeadContact.TIME])
        landed = memory[Memory.ROAD_TIME] < math.inf or not met
        ticks = ticks_of_next_step(model, data, time, landed)
        memory[Memory.TICKS] += ticks
        memory[Memory.STEPS] += 1.0
        _step(step_space, each_body, model, data, ticks * settings.tick)
    speed, _ = speeds_of(model.body.mass, data.motion)
    write_end(
        reason, time, memory[Memory.STEPS], memory[Memory.ROWS], memory[Memory.SHOTS], speed,
        data.summary,
    )  # fmt: skip


@kernel
def show_surfaces(body, state, motion, contacts):
    """Compute motion and surfaces for a state, before the first step.

    Parameters
    ----------
    body : PlanarBody
    state : (b, 6) array
        x, z (m), angle (rad) and their rates of all bodies.
    motion : PlanarMotion
        Filled.
    contacts : Contacts
        ``centre`` and ``shape`` are filled.
    """
    update_motion(body, state, 0.0, motion, contacts)
