"""The step loop: from first contact to rest on the road."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel, kernel
from models.crash.body_contact import apply_road_contacts, apply_self_contacts
from models.crash.car_contact import apply_car_contacts
from models.crash.record import (
    NOT_FINITE,
    REST,
    REST_ON_CAR,
    REST_SPEED,
    REST_SPREAD,
    REST_TIME,
    S_CENTRE_SPEED,
    S_ENERGY_END,
    S_ENERGY_START,
    S_FRAMES,
    S_GROUND_TIME,
    S_HEAD_ZONE,
    S_REASON,
    S_RECORDS,
    S_STEPS,
    S_TIME,
    STEP_LIMIT,
    TIME_LIMIT,
)
from models.crash.stepping import HEAD_FALL, HEAD_FORCE, head_meets_car
from models.crash.surfaces import CHANNELS, update_surfaces
from models.multibody.bushings import apply_bushings
from models.multibody.integration import Memory, correct, empty_memory, predict
from models.multibody.joints import apply_joint_torques
from models.multibody.kinematics import update_kinematics
from models.multibody.recording import B_LAST, BLOW, note_blow, note_head, write_frame, write_record
from models.multibody.stability import ticks_in_contact
from models.multibody.sweeps import solve_accelerations
from models.vehicle.motion import car_state

Array = NDArray[np.float64]


class Scratch(NamedTuple):
    """Workspace of the step loop."""

    car: Array
    power: Array
    old_power: Array
    memory: Memory
    blow: Array


def empty_scratch(n: int) -> Scratch:
    """Return the workspace for ``n`` segments."""
    return Scratch(
        np.zeros(6), np.zeros(CHANNELS), np.zeros(CHANNELS), empty_memory(n), np.zeros(BLOW)
    )


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


@inlined_kernel
def total_energy(tree, motion, road_surface):
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
        energy += m * road_surface.weight * motion.centre[i, 2]
        energy -= m * road_surface.pull * motion.centre[i, 0]
    return energy


@inlined_kernel
def evaluate(tree, joints, ellipsoids, zones, road_surface, car, motion, loads, contacts, power):
    """Fill loads and accelerations for the present state; write the powers (W) of all channels."""
    for k in range(CHANNELS):
        power[k] = 0.0
    for j in range(contacts.zone_force.shape[0]):
        contacts.zone_force[j] = 0.0
    update_kinematics(tree, motion)
    for i in range(tree.mass.shape[0]):
        loads.force[i, 0] = tree.mass[i] * road_surface.pull
        loads.force[i, 1] = 0.0
        loads.force[i, 2] = -tree.mass[i] * road_surface.weight
        loads.torque[i, 0] = 0.0
        loads.torque[i, 1] = 0.0
        loads.torque[i, 2] = 0.0
    update_surfaces(ellipsoids, motion, contacts)
    apply_joint_torques(tree, joints, motion, loads, power)
    apply_bushings(tree, joints, motion, loads, power)
    apply_car_contacts(zones, ellipsoids, car, motion, loads, contacts, tree, power)
    apply_road_contacts(zones, ellipsoids, road_surface, motion, loads, contacts, tree, power)
    apply_self_contacts(ellipsoids, motion, loads, contacts, tree, power)
    solve_accelerations(tree, motion, loads)


@inlined_kernel
def _ticks_of_next_step(settings, ellipsoids, zones, car, motion, contacts):
    """Return how many ticks the next step may take.

    One while the head is fast near the car or meets the road; the settings say how many in free
    flight and otherwise.
    """
    head = settings.head
    if head_meets_car(head, ellipsoids, zones, car, motion, contacts):
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
def _speeds(tree, motion):
    """Return the speed of the centre of gravity and the root mean square segment speed."""
    total, square = 0.0, 0.0
    px, py, pz = 0.0, 0.0, 0.0
    for i in range(tree.mass.shape[0]):
        m = tree.mass[i]
        vx, vy, vz = motion.velocity[i, 0], motion.velocity[i, 1], motion.velocity[i, 2]
        total += m
        px += m * vx
        py += m * vy
        pz += m * vz
        square += m * (vx * vx + vy * vy + vz * vz)
    return math.sqrt(px * px + py * py + pz * pz) / total, math.sqrt(square / total)


@kernel
def simulate(
    tree, joints, ellipsoids, zones, road_surface, car_motion, settings,
    motion, loads, contacts, scratch, work, record, frames, head_contact, summary,
):  # fmt: skip
    """Run from the present state to rest.

    Parameters
    ----------
    tree, joints, ellipsoids, zones, road_surface, car_motion, settings
        Constant data.
    motion, loads, contacts, scratch
        State and workspace, changed in place.
    work : (CHANNELS,) J, filled: work on the body by channel.
    record : (rows, 18 + z + 1), frames : (rows, 4 + 7 n), filled.
    head_contact : (10,) NaN, filled at the head's first contact with the car: time, velocity
        relative to the car at its first blow (3), normal (3); at its deepest: contact point (3),
        all in the car's frame.
    summary : (SUMMARY,), filled.
    """
    car, power, old_power = scratch.car, scratch.power, scratch.old_power
    memory = scratch.memory
    head = settings.head
    road = zones.radius.shape[0]
    time = 0.0
    car_state(car_motion, time, car)
    evaluate(tree, joints, ellipsoids, zones, road_surface, car, motion, loads, contacts, power)
    summary[S_ENERGY_START] = total_energy(tree, motion, road_surface)
    summary[S_GROUND_TIME] = math.inf
    summary[S_HEAD_ZONE] = -1.0
    rows, shots, steps, ticks = 0, 0, 0, 0
    scratch.blow[B_LAST] = -math.inf
    quiet = 0.0
    reason = TIME_LIMIT
    while True:
        if rows < record.shape[0]:
            write_record(rows, time, head, tree, road_surface, motion, loads, contacts, car, record)
            rows += 1
        if ticks >= shots * settings.frame_every and shots < frames.shape[0]:
            write_frame(shots, time, motion, contacts, car, frames)
            shots += 1
        if time >= settings.time_limit:
            break
        if steps >= settings.step_limit:
            reason = STEP_LIMIT
            break
        for k in range(CHANNELS):
            old_power[k] = power[k]
        jump = _ticks_of_next_step(settings, ellipsoids, zones, car, motion, contacts)
        h = jump * settings.tick
        predict(tree, motion, loads, memory, h)
        steps += 1
        ticks += jump
        time = ticks * settings.tick
        car_state(car_motion, time, car)
        evaluate(tree, joints, ellipsoids, zones, road_surface, car, motion, loads, contacts, power)
        correct(tree, motion, loads, memory, h)
        for k in range(CHANNELS):
            work[k] += 0.5 * h * (old_power[k] + power[k])
        note_blow(time, head, ellipsoids, motion, contacts, car, scratch.blow)
        note_head(time, head, motion, contacts, car, scratch.blow, head_contact, summary)
        # First landing of trunk or head.
        if summary[S_GROUND_TIME] == math.inf:
            for i in range(settings.trunk + 1):
                if contacts.segment_force[i, road] > 0.0:
                    summary[S_GROUND_TIME] = time
            if contacts.segment_force[head, road] > 0.0:
                summary[S_GROUND_TIME] = time
        speed, spread = _speeds(tree, motion)
        if not math.isfinite(spread):
            reason = NOT_FINITE
            break
        quiet = quiet + h if speed < REST_SPEED and spread < REST_SPREAD else 0.0
        if quiet >= REST_TIME:
            reason = REST
            break
    update_kinematics(tree, motion)
    speed, spread = _speeds(tree, motion)
    if reason == REST:
        for j in range(road):
            if contacts.zone_force[j] > 0.0:
                reason = REST_ON_CAR
    summary[S_REASON] = float(reason)
    summary[S_TIME] = time
    summary[S_STEPS] = float(steps)
    summary[S_RECORDS] = float(rows)
    summary[S_FRAMES] = float(shots)
    summary[S_ENERGY_END] = total_energy(tree, motion, road_surface)
    summary[S_CENTRE_SPEED] = speed
