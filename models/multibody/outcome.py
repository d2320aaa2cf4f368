"""Outputs, histories and pictures of a finished run."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.contact.law import SURFACE, interpolate_law
from models.criteria import (
    brain_injury_criterion,
    clip_level,
    effective_mass,
    filter_cfc,
    head_injury_criterion,
    impact_angle,
)
from models.criteria.units import STANDARD_GRAVITY
from models.effects.chain import EffectChain
from models.effects.reading import Reading, record_reading
from models.multibody.setup import Crash
from models.multibody.simulation import (
    R_ACCELERATION,
    R_CENTRE,
    R_HEAD_CAR,
    R_HEAD_ROAD,
    R_RELATIVE,
    R_SPIN,
    R_SPIN_RATE,
    R_TIME,
    R_ZONES,
    S_ENERGY_END,
    S_ENERGY_START,
    S_GROUND_TIME,
    S_HEAD_DEPTH,
    S_HEAD_ZONE,
    S_TIME,
)
from models.multibody.surfaces import WORK_CHANNELS
from models.pedestrian.anthropometry import HEAD, SEGMENTS
from models.protocol import History, Scene, history_of
from models.vehicle.motion import stopping_distance
from models.vehicle.profile import (
    hood_edge_distance,
    static_point,
    surface_point,
    wrap_around_distance,
)
from models.vehicle.zones import ROLL

Array = NDArray[np.float64]

SAMPLING_RATE = 10_000.0
"""Hz of the uniform grid on which criteria are computed (SAE J211: ten times the CFC)."""
LINEAR_CLASS = 1000.0
"""Channel frequency class of head acceleration (SAE J211)."""
ANGULAR_CLASS = 180.0
"""Channel frequency class of head angular velocity and acceleration (assumed; the standard leaves
it to the user and the case does not state it)."""
SHORTEST_PHASE = 40
"""Samples below which a phase is too short to filter."""


@dataclass(frozen=True)
class Raw:
    """What the step loop leaves behind; see ``simulate`` for the arrays."""

    crash: Crash
    chain: EffectChain
    values: Mapping[str, float]
    record: Array
    frames: Array
    work: Array
    head_contact: Array
    summary: Array


@dataclass(frozen=True)
class _Signals:
    """Head signals on the uniform grid, filtered; the primary phase ends at sample ``split``."""

    time: Array
    acceleration: Array  # g, resultant
    spin: Array  # rad/s, own axes
    spin_rate: Array  # rad/s2, own axes
    split: int


def _signals(raw: Raw) -> _Signals:
    record = raw.record
    time = np.arange(int(record[-1, R_TIME] * SAMPLING_RATE) + 1) / SAMPLING_RATE

    def sampled(first: int) -> Array:
        return np.stack(
            [np.interp(time, record[:, R_TIME], record[:, first + k]) for k in range(3)], axis=1
        )

    felt = Reading(sampled(R_ACCELERATION) / STANDARD_GRAVITY, LINEAR_CLASS)
    acceleration = record_reading(raw.chain, raw.values, felt, SAMPLING_RATE, origin=0)
    ground = raw.summary[S_GROUND_TIME]
    split = time.size if math.isinf(ground) else int(np.searchsorted(time, ground))
    return _Signals(
        time=time,
        acceleration=np.linalg.norm(acceleration, axis=1),
        spin=filter_cfc(sampled(R_SPIN), SAMPLING_RATE, ANGULAR_CLASS),
        spin_rate=filter_cfc(sampled(R_SPIN_RATE), SAMPLING_RATE, ANGULAR_CLASS),
        split=max(split, min(SHORTEST_PHASE, time.size)),
    )


def measure(raw: Raw) -> dict[str, float]:
    """Return the outputs of a run that came to rest; NaN where one has no value."""
    record = raw.record
    signals = _signals(raw)
    car = slice(0, signals.split)
    road = slice(signals.split, signals.time.size)
    time, acceleration = signals.time, signals.acceleration
    path = record[-1, R_CENTRE : R_CENTRE + 2] - record[0, R_CENTRE : R_CENTRE + 2]
    spent = raw.work.sum()
    gained = raw.summary[S_ENERGY_END] - raw.summary[S_ENERGY_START]
    forward = np.diff(record[:, R_CENTRE]) / np.diff(record[:, R_TIME])
    outputs = {
        "hic15": head_injury_criterion(time[car], acceleration[car], 0.015)[0],
        "hic36": head_injury_criterion(time[car], acceleration[car], 0.036)[0],
        "clip_3ms": clip_level(time[car], acceleration[car]),
        "clip_3ms_consecutive": clip_level(time[car], acceleration[car], mode="consecutive"),
        "peak_head_acceleration": float(acceleration[car].max()),
        "head_angular_velocity": float(np.linalg.norm(signals.spin[car], axis=1).max()),
        "head_angular_acceleration": float(np.linalg.norm(signals.spin_rate[car], axis=1).max()),
        "bric": brain_injury_criterion(signals.spin[car]),
        "throw_distance": float(np.hypot(*path)),
        "launch_speed": float(forward.max()),
        "ground_hic15": 0.0,
        "ground_time": float(raw.summary[S_TIME]),
        "crash_duration": float(raw.summary[S_TIME]),
        "car_stopping_distance": stopping_distance(raw.crash.car_motion),
        "energy_residual": float((gained - spent) / np.abs(raw.work).max()),
    }
    if time[road].size > SHORTEST_PHASE:
        outputs["ground_hic15"] = head_injury_criterion(time[road], acceleration[road], 0.015)[0]
        outputs["ground_time"] = float(raw.summary[S_GROUND_TIME])
    return outputs | _head_contact(raw, signals)


def _head_contact(raw: Raw, signals: _Signals) -> dict[str, float]:
    """Return the outputs of the head's contact with the car, NaN if there was none."""
    contact = raw.head_contact
    zone = int(raw.summary[S_HEAD_ZONE])
    if not math.isfinite(contact[0]) or zone < 0:
        return {"head_impact_time": math.nan}
    vehicle, laws = raw.crash.vehicle, raw.crash.ellipsoids
    dive = raw.chain.act("inputs", raw.values, raw.values)["dive_angle"]
    surface = surface_point(raw.crash.zones, zone, contact[[7, 9]])
    wad = wrap_around_distance(vehicle.name, zone, static_point(vehicle, dive, surface))
    law = int(laws.surface_law[HEAD, zone])
    force = np.interp(signals.time, raw.record[:, R_TIME], raw.record[:, R_HEAD_CAR])
    car = slice(0, signals.split)
    return {
        "head_impact_time": float(contact[0]),
        "head_impact_speed": float(np.linalg.norm(contact[1:4])),
        "head_impact_angle": impact_angle(contact[1:4], contact[4:7]),
        "effective_head_mass": effective_mass(
            signals.time[car], force[car], signals.acceleration[car]
        ),
        "wad": wad,
        "head_dent_distance": wad - hood_edge_distance(vehicle.name),
        "head_fender_distance": vehicle.hood_side - abs(float(contact[8])),
        "hood_intrusion": float(
            interpolate_law(laws.laws, law, laws.counts[law], SURFACE, raw.summary[S_HEAD_DEPTH])
        ),
    }


def histories(raw: Raw) -> dict[str, History]:
    """Return head and contact histories on the uniform grid, and the energy balance's totals."""
    signals = _signals(raw)
    record, time = raw.record, signals.time

    def sampled(column: int) -> Array:
        return np.interp(time, record[:, R_TIME], record[:, column])

    relative = np.stack([sampled(R_RELATIVE + k) for k in range(3)], axis=1)
    head = {
        "acceleration": (signals.acceleration, "g"),
        "angular_velocity": (np.linalg.norm(signals.spin, axis=1), "rad/s"),
        "angular_velocity_x": (signals.spin[:, 0], "rad/s"),
        "angular_velocity_y": (signals.spin[:, 1], "rad/s"),
        "angular_velocity_z": (signals.spin[:, 2], "rad/s"),
        "angular_acceleration": (np.linalg.norm(signals.spin_rate, axis=1), "rad/s2"),
        "velocity_relative_to_car": (np.linalg.norm(relative, axis=1), "m/s"),
        "velocity_relative_to_car_x": (relative[:, 0], "m/s"),
        "velocity_relative_to_car_y": (relative[:, 1], "m/s"),
        "velocity_relative_to_car_z": (relative[:, 2], "m/s"),
        "car_force": (sampled(R_HEAD_CAR), "N"),
        "road_force": (sampled(R_HEAD_ROAD), "N"),
    }
    contact = {
        zone.name: (sampled(R_ZONES + j), "N") for j, zone in enumerate(raw.crash.vehicle.zones)
    }
    contact["road"] = (sampled(R_ZONES + len(raw.crash.vehicle.zones)), "N")
    centre = {axis: (sampled(R_CENTRE + k), "m") for k, axis in enumerate(("x", "y", "z"))}
    work = {name: (np.array([raw.work[k]]), "J") for k, name in enumerate(WORK_CHANNELS)}
    end = np.array([raw.summary[S_TIME]])
    return {
        "head": history_of(time, head),
        "contact_force": history_of(time, contact),
        "centre_of_gravity": history_of(time, centre),
        "work": history_of(end, work),
    }


def scene(raw: Raw) -> Scene:
    """Return the poses of the segments and the car's outlines."""
    frames, n = raw.frames, len(SEGMENTS)
    pose = frames[:, 4:].reshape(-1, n, 7)
    zones = raw.crash.zones
    outline = []
    for j in range(zones.radius.size):
        if zones.kind[j] == ROLL:
            angle = np.linspace(0.0, 2.0 * math.pi, 61)
            ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            outline.append(zones.origin[j] + zones.radius[j] * ring)
        else:
            outline.append(
                np.array([zones.origin[j], zones.origin[j] + zones.length[j] * zones.direction[j]])
            )
    width = zones.half_width.max()
    y = np.linspace(-width, width, 41)
    bumper = raw.crash.vehicle.zone_index("bumper")
    nose = -0.5 * zones.curvature[bumper] * y**2
    rear = np.full(2, zones.box[:, 0].min())
    plan = np.stack(
        [np.concatenate([nose, rear, nose[:1]]), np.concatenate([y, [width, -width], y[:1]])],
        axis=1,
    )
    return Scene(
        time=frames[:, 0].copy(),
        names=SEGMENTS,
        semi_axes=np.sqrt(raw.crash.ellipsoids.square),
        centre=pose[:, :, :3].copy(),
        orientation=pose[:, :, 3:].copy(),
        car=frames[:, 1:4].copy(),
        outline=outline,
        plan=plan,
    )
