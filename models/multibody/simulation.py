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
    """Parameters of the step loop and of the recording.

    Attributes
    ----------
    tick : float
        Finest step, s.
    coarse, slide, flight : int
        Largest step in ticks in quiet contact with the car, on the road alone, and in free flight.
    time_limit : float
        Largest duration of a crash, s.
    step_limit : int
        Largest number of steps.
    frame_every : int
        Ticks between frames.
    head : int
        Row of the head.
    trunk : int
        Highest row that counts as trunk.
    mobility : (n,) array
        1/kg, see ``models.multibody.stability.surface_mobility``.
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
    """Data that are constant during a run.

    Attributes
    ----------
    tree : Tree
    joints : Joints
    ellipsoids : Ellipsoids
    front : Zones
        Geometry of the car's front, one of the types of ``models.crash.front``.
    road : Road
    car_motion : CarMotion
    settings : Settings
    """

    tree: Tree
    joints: Joints
    ellipsoids: Ellipsoids
    front: Zones
    road: Road
    car_motion: CarMotion
    settings: Settings


class CoreData(NamedTuple):
    """State, loads, workspace and recorded arrays, all changed during a run.

    Attributes
    ----------
    motion : Motion
    loads : Loads
    contacts : Contacts
    car : (6,) array
        Position, yaw and their rates; see ``models.vehicle.motion``.
    power, old_power : (channels,) array
        Power on the body by channel at the end and the start of a step, W.
    memory : Memory
        Of the integrator.
    blow : (entries,) array
        The head's last impact on an arm; see ``models.crash.record.Blow``.
    work : (channels,) array
        Work on the body by channel, J.
    record : (rows, columns) array
        See ``models.crash.record.Column``.
    frames : (rows, 4 + SEGMENT_ENTRIES n) array
        See ``models.crash.record.Frame``.
    head_contact : (entries,) array
        See ``models.crash.record.HeadContact``.
    summary : (entries,) array
        See ``models.crash.record.Summary``.
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
    """Return the data of a run that starts from a motion.

    Parameters
    ----------
    motion : Motion
        Changed in place.
    patches : int
        Number of patches of the car's front.
    pairs : int
        Number of pairs of segments that can touch each other.
    record, frames : array
        Arrays to fill.
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
    """Return kinetic plus gravitational energy (J) of the tree.

    Parameters
    ----------
    tree : Tree
        Constant data of the segments.
    motion : Motion
        Positions and velocities of the segments.
    road : Road
        Gives the gravity components.
    """
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
def evaluate(model, data, time):
    """Compute loads, accelerations and the power (W) of all channels for the present state."""
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
        model.front, model.ellipsoids, data.car, motion, loads, contacts, tree, power, time
    )
    apply_road_contacts(model.ellipsoids, road, motion, loads, contacts, tree, power)
    apply_self_contacts(model.ellipsoids, motion, loads, contacts, tree, power)
    solve_accelerations(tree, motion, loads)


@inlined_kernel
def step(model, data, time, length):
    """Advance the state by one step.

    Parameters
    ----------
    model : CoreModel
    data : CoreData
        Changed in place.
    time : float
        End of the step, s.
    length : float
        Length of the step, s.
    """
    for k in range(CHANNELS):
        data.old_power[k] = data.power[k]
    predict(model.tree, data.motion, data.loads, data.memory, length)
    car_state(model.car_motion, time, data.car)
    evaluate(model, data, time)
    correct(model.tree, data.motion, data.loads, data.memory, length)
    for k in range(CHANNELS):
        data.work[k] += 0.5 * length * (data.old_power[k] + data.power[k])


@inlined_kernel
def _ticks_of_next_step(model, data):
    """Return the number of ticks of the next step.

    One while the head is fast near the car or meets the road; otherwise the numbers of the settings
    for the kind of contact, limited by stability.
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
    # The exact gap of the head in its present orientation.
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
    """Record the time at which trunk or head first touches the road."""
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
    evaluate(model, data, time)
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
            write_frame(
                shots, time, motion.orientation, motion, contacts, data.car, data.frames
            )  # fmt: skip
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
