"""The step loop: from first contact to rest on the road."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel, kernel
from models.contact.road import Road
from models.crash.body_contact import apply_road_contacts, apply_self_contacts
from models.crash.car_contact import apply_car_contacts
from models.crash.ellipsoids import Ellipsoids
from models.crash.record import (
    BLOW_ENTRIES,
    GOES_ON,
    HEAD_CONTACT_ENTRIES,
    Blow,
    Column,
    EndReason,
    Summary,
)
from models.crash.recorder import (
    limit_reason,
    note_blow,
    note_head,
    rest_reason,
    speeds_of,
    time_at_rest,
    write_centre,
    write_contact_forces,
    write_end,
    write_frame,
)
from models.crash.stepping import HEAD_FALL, HEAD_FORCE, head_meets_car
from models.crash.surfaces import CHANNELS, Contacts, empty_contacts, update_surfaces
from models.multibody.bushings import apply_bushings
from models.multibody.integration import Memory, correct, empty_memory, predict
from models.multibody.joints import apply_joint_torques
from models.multibody.kinematics import centre_acceleration, update_kinematics
from models.multibody.stability import ticks_in_contact
from models.multibody.sweeps import solve_accelerations
from models.multibody.tree import Loads, Motion, Tree, empty_loads
from models.pedestrian.joints import Joints
from models.vehicle.motion import CarMotion, car_state
from models.vehicle.zones import Zones

Array = NDArray[np.float64]


class Settings(NamedTuple):
    """How a run is stepped and recorded.

    Attributes
    ----------
    tick : s, the finest step. coarse, slide, flight : ticks that a step may take in quiet contact
        with the car, on the road alone, and in free flight.
    time_limit : s of crash. step_limit : steps.
    frame_every : ticks between frames.
    head : row of the head. trunk : highest row that counts as trunk.
    mobility : (n,) 1/kg, as ``models.multibody.stability.surface_mobility`` gives it.
    """

    tick: float
    coarse: int
    slide: int
    flight: int
    time_limit: float
    step_limit: int
    frame_every: int
    head: int
    trunk: int
    mobility: Array


class CoreModel(NamedTuple):
    """What does not change in a run.

    Attributes
    ----------
    tree, joints, ellipsoids : of the body.
    front : geometry of the car's front, one of the types of ``models.crash.front``.
    road, car_motion : of the surroundings.
    settings : of the step loop.
    """

    tree: Tree
    joints: Joints
    ellipsoids: Ellipsoids
    front: Zones
    road: Road
    car_motion: CarMotion
    settings: Settings


class CoreData(NamedTuple):
    """State, loads, workspace and what is written down; all of it changes in a run.

    Attributes
    ----------
    motion, loads, contacts : of the body.
    car : (6,) place, yaw and their rates; see ``models.vehicle.motion``.
    power, old_power : (channels,) W on the body by channel, at both ends of a step.
    memory : of the integrator. blow : the head's last one; see ``models.crash.record``.
    work : (channels,) J on the body.
    record : (rows, columns). frames : (rows, 4 + 7 n). head_contact, summary : entries.
    """

    motion: Motion
    loads: Loads
    contacts: Contacts
    car: Array
    power: Array
    old_power: Array
    memory: Memory
    blow: Array
    work: Array
    record: Array
    frames: Array
    head_contact: Array
    summary: Array


def empty_data(motion: Motion, patches: int, pairs: int, record: Array, frames: Array) -> CoreData:
    """Return the data of a run that begins from a motion.

    Parameters
    ----------
    motion : Motion
        Changed in place.
    patches : int
        Of the car's front.
    pairs : int
        Of segments that can touch each other.
    record, frames : arrays
        To be filled.
    """
    n = motion.orientation.shape[0]
    return CoreData(
        motion=motion,
        loads=empty_loads(n),
        contacts=empty_contacts(n, patches, pairs),
        car=np.zeros(6),
        power=np.zeros(CHANNELS),
        old_power=np.zeros(CHANNELS),
        memory=empty_memory(n),
        blow=np.zeros(BLOW_ENTRIES),
        work=np.zeros(CHANNELS),
        record=record,
        frames=frames,
        head_contact=np.full(HEAD_CONTACT_ENTRIES, np.nan),
        summary=np.zeros(len(Summary)),
    )


@inlined_kernel
def total_energy(tree, motion, road):
    """Return kinetic plus gravitational energy (J) of the tree."""
    energy = 0.0
    for i in range(tree.mass.shape[0]):
        m = tree.mass[i]
        for k in range(3):
            v = motion.velocity[i, k]
            w = (
                motion.rotation[i, 0, k] * motion.angular_velocity[i, 0]
                + motion.rotation[i, 1, k] * motion.angular_velocity[i, 1]
                + motion.rotation[i, 2, k] * motion.angular_velocity[i, 2]
            )
            energy += 0.5 * m * v * v + 0.5 * tree.inertia[i, k] * w * w
        energy += m * road.gravity_down * motion.centre[i, 2]
        energy -= m * road.gravity_along * motion.centre[i, 0]
    return energy


@inlined_kernel
def evaluate(model, data):
    """Fill loads and accelerations for the present state, and the powers (W) of all channels."""
    tree, motion, loads, contacts = model.tree, data.motion, data.loads, data.contacts
    power, road = data.power, model.road
    for k in range(CHANNELS):
        power[k] = 0.0
    for j in range(contacts.zone_force.shape[0]):
        contacts.zone_force[j] = 0.0
    update_kinematics(tree, motion)
    for i in range(tree.mass.shape[0]):
        loads.force[i, 0] = tree.mass[i] * road.gravity_along
        loads.force[i, 1] = 0.0
        loads.force[i, 2] = -tree.mass[i] * road.gravity_down
        loads.torque[i, 0] = 0.0
        loads.torque[i, 1] = 0.0
        loads.torque[i, 2] = 0.0
    update_surfaces(model.ellipsoids, motion, contacts)
    apply_joint_torques(tree, model.joints, motion, loads, power)
    apply_bushings(tree, model.joints, motion, loads, power)
    apply_car_contacts(
        model.front, model.ellipsoids, data.car, motion, loads, contacts, tree, power
    )
    apply_road_contacts(model.ellipsoids, road, motion, loads, contacts, tree, power)
    apply_self_contacts(model.ellipsoids, motion, loads, contacts, tree, power)
    solve_accelerations(tree, motion, loads)


@inlined_kernel
def step(model, data, time, length):
    """Advance the state by a step of ``length`` (s) that ends at ``time`` (s)."""
    for k in range(CHANNELS):
        data.old_power[k] = data.power[k]
    predict(model.tree, data.motion, data.loads, data.memory, length)
    car_state(model.car_motion, time, data.car)
    evaluate(model, data)
    correct(model.tree, data.motion, data.loads, data.memory, length)
    for k in range(CHANNELS):
        data.work[k] += 0.5 * length * (data.old_power[k] + data.power[k])


@inlined_kernel
def _ticks_of_next_step(model, data):
    """Return how many ticks the next step may take.

    One while the head is fast near the car or meets the road; the settings say how many in free
    flight and otherwise.
    """
    settings, ellipsoids = model.settings, model.ellipsoids
    motion, contacts = data.motion, data.contacts
    head = settings.head
    if head_meets_car(head, ellipsoids, model.front, data.car, motion, contacts):
        return 1
    fall = -motion.velocity[head, 2]
    road = contacts.zone_force.shape[0] - 1
    ahead = 2.0 * settings.flight * settings.tick
    if contacts.segment_force[head, road] > HEAD_FORCE:
        return 1
    # The exact gap of the head as it lies.
    gap = contacts.centre[head, 2] - math.sqrt(contacts.shape[head, 5])
    if fall > HEAD_FALL and gap < ahead * fall + 1e-3:
        return 1
    wanted = settings.flight
    for i in range(motion.centre.shape[0]):
        gap = contacts.centre[i, 2] - ellipsoids.reach[i]
        if gap < -ahead * motion.velocity[i, 2] + 1e-3:
            wanted = settings.slide
    for j in range(road):
        if contacts.zone_force[j] > 0.0:
            wanted = settings.coarse
    return ticks_in_contact(settings, ellipsoids, contacts, wanted)


@inlined_kernel
def _write_record(row, time, model, data):
    """Write a row of the record."""
    motion, loads, record, road = data.motion, data.loads, data.record, model.road
    head = model.settings.head
    ax, ay, az = centre_acceleration(motion, loads, head)
    record[row, Column.ACCELERATION] = ax - road.gravity_along
    record[row, Column.ACCELERATION + 1] = ay
    record[row, Column.ACCELERATION + 2] = az + road.gravity_down
    for k in range(3):
        w, q = 0.0, 0.0
        for j in range(3):
            w += motion.rotation[head, j, k] * motion.angular_velocity[head, j]
            q += motion.rotation[head, j, k] * loads.angular_acceleration[head, j]
        record[row, Column.SPIN + k] = w
        record[row, Column.SPIN_RATE + k] = q
    write_contact_forces(row, time, head, motion, data.contacts, data.car, record)
    write_centre(row, model.tree.mass, motion, record)


@inlined_kernel
def _note_landing(time, settings, contacts, summary):
    """Note when trunk or head first meet the road."""
    road = contacts.zone_force.shape[0] - 1
    if summary[Summary.GROUND_TIME] == math.inf:
        for i in range(settings.trunk + 1):
            if contacts.segment_force[i, road] > 0.0:
                summary[Summary.GROUND_TIME] = time
        if contacts.segment_force[settings.head, road] > 0.0:
            summary[Summary.GROUND_TIME] = time


@kernel
def simulate(model, data):
    """Run from the present state to rest.

    Parameters
    ----------
    model : CoreModel
    data : CoreData
        Changed in place; record, frames, work, head contact and summary are filled.
    """
    settings, tree, motion, contacts = model.settings, model.tree, data.motion, data.contacts
    summary, head = data.summary, settings.head
    time, quiet = 0.0, 0.0
    car_state(model.car_motion, time, data.car)
    evaluate(model, data)
    summary[Summary.ENERGY_AT_START] = total_energy(tree, motion, model.road)
    summary[Summary.GROUND_TIME] = math.inf
    summary[Summary.HEAD_REGION] = -1.0
    data.blow[Blow.LAST] = -math.inf
    rows, shots, steps, ticks = 0, 0, 0, 0
    while True:
        if rows < data.record.shape[0]:
            _write_record(rows, time, model, data)
            rows += 1
        if ticks >= shots * settings.frame_every and shots < data.frames.shape[0]:
            write_frame(shots, time, motion.orientation, contacts, data.car, data.frames)
            shots += 1
        reason = limit_reason(time, steps, settings)
        if reason != GOES_ON:
            break
        jump = _ticks_of_next_step(model, data)
        length = jump * settings.tick
        steps += 1
        ticks += jump
        time = ticks * settings.tick
        step(model, data, time, length)
        note_blow(time, head, model.ellipsoids, motion, contacts, data.car, data.blow)
        note_head(time, head, motion, contacts, data.car, data.blow, data.head_contact, summary)
        _note_landing(time, settings, contacts, summary)
        speed, spread = speeds_of(tree.mass, motion)
        if not math.isfinite(spread):
            reason = EndReason.NOT_FINITE.value
            break
        quiet = time_at_rest(speed, spread, length, quiet)
        reason = rest_reason(quiet, contacts)
        if reason != GOES_ON:
            break
    update_kinematics(tree, motion)
    speed, _ = speeds_of(tree.mass, motion)
    write_end(reason, time, steps, rows, shots, speed, summary)
    summary[Summary.ENERGY_AT_END] = total_energy(tree, motion, model.road)
