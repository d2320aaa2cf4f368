"""Outputs and histories of a finished run."""

import functools
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.contact.law import SURFACE, interpolate_law
from models.crash.record import Column, HeadContact, Summary
from models.crash.scenario import Scenario
from models.crash.surfaces import WORK_CHANNELS
from models.crash.tape import Measured, Tape, tape_on_zones
from models.criteria import (
    brain_injury_criterion,
    clip_level,
    effective_mass,
    filter_cfc,
    impact_angle,
)
from models.criteria.hic import cumulative_area, maximise_window
from models.criteria.sampling import resultant, sample_record
from models.criteria.units import STANDARD_GRAVITY
from models.effects.chain import EffectChain
from models.effects.reading import Reading, record_reading
from models.pedestrian.anthropometry import HEAD
from models.protocol import History, chosen_histories, history_of
from models.vehicle.motion import stopping_distance

Array = NDArray[np.float64]

SAMPLING_RATE = 10_000.0
"""Hz of the uniform grid on which criteria are computed (SAE J211: ten times the CFC)."""
LINEAR_CLASS = 1000.0
"""Channel frequency class of head acceleration (SAE J211)."""
ANGULAR_CLASS = 180.0
"""Channel frequency class of head angular velocity and acceleration (assumed; the standard leaves
it to the user and the case does not state it)."""
HIGHEST_CLASS = 2400.0
"""Channel frequency class whose corner lies just below half the sampling rate."""
SHORTEST_PHASE = 40
"""Samples below which a phase is too short to filter."""


@dataclass(frozen=True)
class FilterClasses:
    """Channel frequency classes of the head's acceleration and of its angular signals, 0 for none.

    A channel that was measured with another class is simulated with that class.

    Attributes
    ----------
    linear : float
        Class of the acceleration.
    angular : float
        Class of angular velocity and acceleration.
    """

    linear: float = LINEAR_CLASS
    angular: float = ANGULAR_CLASS


@dataclass(frozen=True)
class Raw:
    """Raw results of the step loop; see ``models.multibody.simulation`` for the arrays.

    Road forces in the record may be NaN, and ``work`` empty, where a model does not compute them.

    Attributes
    ----------
    scenario : Scenario
    classes : FilterClasses
    chain : EffectChain
        Effects that are switched on.
    values : mapping of str to float
        All inputs by name.
    record : (rows, columns) array
        See ``models.crash.record.Column``.
    frames : (frames, columns) array
        See ``models.crash.record.Frame``.
    work : (channels,) array
        Work on the body by channel, J.
    head_contact : (entries,) array
        See ``models.crash.record.HeadContact``.
    summary : (entries,) array
        See ``models.crash.record.Summary``.
    primary_end : float
        End of the impact on the car and start of that on the road, s; infinite if the body never
        lands.
    rigid_road : bool
        Whether impacts on the road diverge as the step shrinks: the head's signals end before
        them.
    """

    scenario: Scenario
    classes: FilterClasses
    chain: EffectChain
    values: Mapping[str, float]
    record: Array
    frames: Array
    work: Array
    head_contact: Array
    summary: Array
    primary_end: float
    rigid_road: bool = False


class Signals:
    """Head signals of a run on the uniform grid, filtered; each is computed on first access.

    Attributes
    ----------
    time : (n,) array
        s.
    split : int
        Sample at which the primary phase ends.
    head_time : (k,) array
        Time of the head's signals, s; with a rigid road it ends with the primary phase.
    """

    def __init__(self, raw: Raw) -> None:
        self._raw = raw
        end = raw.record[-1, Column.TIME]
        self.time: Array = np.arange(int(end * SAMPLING_RATE) + 1) / SAMPLING_RATE
        road = raw.primary_end
        split = self.time.size if math.isinf(road) else int(np.searchsorted(self.time, road))
        self.split = max(split, min(SHORTEST_PHASE, self.time.size))
        self.head_time = self.time[: self.split] if raw.rigid_road else self.time

    def sampled(self, first: int, columns: int, time: Array | None = None) -> Array:
        """Return columns of the record on the grid, or at the given times.

        Parameters
        ----------
        first : int
            First column.
        columns : int
            Number of columns.
        time : (n,) array, optional
            s; by default the uniform grid.

        Returns
        -------
        (n, columns) array
        """
        grid = self.time if time is None else time
        return sample_record(self._raw.record, first, columns, grid)

    @functools.cached_property
    def acceleration(self) -> Array:
        """Resultant acceleration (n,) in g."""
        raw = self._raw
        true = self.sampled(Column.ACCELERATION, 3, self.head_time)
        true /= STANDARD_GRAVITY
        felt = Reading(true, raw.classes.linear)
        read = record_reading(raw.chain, raw.values, felt, SAMPLING_RATE, origin=0)
        return resultant(read.acceleration)

    @functools.cached_property
    def angular(self) -> Array:
        """Angular velocity in rad/s and acceleration in rad/s2 (n, 6), own axes."""
        signal = self.sampled(Column.SPIN, 6, self.head_time)
        frequency_class = self._raw.classes.angular
        if not frequency_class:
            return signal
        return filter_cfc(signal, SAMPLING_RATE, frequency_class, overwrite=True)


def measures(
    raw: Raw, signals: Signals, measured: Measured = tape_on_zones
) -> dict[str, Callable[[], float]]:
    """Return the output evaluators, by name, of a run that came to rest.

    Parameters
    ----------
    raw : Raw
    signals : Signals
    measured : callable
        Measures distances on the car.
    """
    record, time = raw.record, signals.time
    car = slice(0, signals.split)
    road = slice(signals.split, time.size)
    landed = time[road].size > SHORTEST_PHASE

    @functools.cache
    def area() -> Array:
        return cumulative_area(time[car], signals.acceleration[car])

    def hic(window: float) -> float:
        return maximise_window(time[car], signals.acceleration[car], area(), window)[0]

    def ground_hic() -> float:
        felt = signals.acceleration[road]
        return maximise_window(time[road], felt, cumulative_area(time[road], felt), 0.015)[0]

    def clip(mode: str) -> float:
        return clip_level(time[car], signals.acceleration[car], mode=mode)

    def throw() -> float:
        path = (
            record[-1, Column.CENTRE : Column.CENTRE + 2]
            - record[0, Column.CENTRE : Column.CENTRE + 2]
        )
        return float(np.hypot(*path))

    def ground_time() -> float:
        # A body may come to rest on its limbs, or on the car, without landing.
        touched = landed and math.isfinite(raw.summary[Summary.GROUND_TIME])
        return float(raw.summary[Summary.GROUND_TIME if touched else Summary.TIME])

    def energy_residual() -> float:
        gained = raw.summary[Summary.ENERGY_AT_END] - raw.summary[Summary.ENERGY_AT_START]
        return float((gained - raw.work.sum()) / np.abs(raw.work).max())

    return {
        "hic15": lambda: hic(0.015),
        "hic36": lambda: hic(0.036),
        "clip_3ms": lambda: clip("cumulative"),
        "clip_3ms_consecutive": lambda: clip("consecutive"),
        "peak_head_acceleration": lambda: float(signals.acceleration[car].max()),
        "head_angular_velocity": lambda: float(resultant(signals.angular[car, :3]).max()),
        "head_angular_acceleration": lambda: float(resultant(signals.angular[car, 3:]).max()),
        "bric": lambda: brain_injury_criterion(signals.angular[car, :3]),
        "throw_distance": throw,
        "launch_speed": lambda: float(
            (np.diff(record[:, Column.CENTRE]) / np.diff(record[:, Column.TIME])).max()
        ),
        "ground_hic15": lambda: ground_hic() if landed else 0.0,
        "ground_time": ground_time,
        "crash_duration": lambda: float(raw.summary[Summary.TIME]),
        "car_stopping_distance": lambda: stopping_distance(raw.scenario.car_motion),
        "energy_residual": energy_residual,
        **_head_contact(raw, signals, measured),
    }


def _head_contact(raw: Raw, signals: Signals, measured: Measured) -> dict[str, Callable[[], float]]:
    """Return the output evaluators of the head's contact with the car; NaN if there was none."""
    contact = raw.head_contact
    zone = int(raw.summary[Summary.HEAD_REGION])
    if not math.isfinite(contact[HeadContact.TIME]) or zone < 0:
        return {"head_impact_time": lambda: math.nan}
    velocity, normal, point = (
        contact[first : first + 3]
        for first in (HeadContact.VELOCITY, HeadContact.NORMAL, HeadContact.POINT)
    )
    vehicle, laws = raw.scenario.vehicle, raw.scenario.ellipsoids
    law = int(laws.surface_law[HEAD, zone])

    @functools.cache
    def tape() -> Tape:
        return measured(raw.scenario, zone, point)

    def mass() -> float:
        car = slice(0, signals.split)
        force = signals.sampled(Column.HEAD_CAR_FORCE, 1, signals.time[car])[:, 0]
        return effective_mass(signals.time[car], force, signals.acceleration[car])

    def intrusion() -> float:
        depth = raw.summary[Summary.HEAD_DEPTH]
        return float(interpolate_law(laws.laws, law, laws.counts[law], SURFACE, depth))

    return {
        "head_impact_time": lambda: float(contact[HeadContact.TIME]),
        "head_impact_speed": lambda: float(np.linalg.norm(velocity)),
        "head_impact_angle": lambda: impact_angle(velocity, normal),
        "effective_head_mass": mass,
        "wad": lambda: tape().wrap_around,
        "head_dent_distance": lambda: tape().wrap_around - tape().leading_edge,
        "head_fender_distance": lambda: vehicle.hood_side - abs(float(point[1])),
        "hood_intrusion": intrusion,
    }


def histories(
    raw: Raw, signals: Signals, wanted: Collection[str] | None = None
) -> dict[str, History]:
    """Return head and contact histories on the uniform grid and the totals of the energy balance.

    Parameters
    ----------
    raw : Raw
    signals : Signals
    wanted : collection of str, optional
        Channels ``<group>_<channel>``; by default all, with the energy balance.

    Returns
    -------
    dict of str to History
        By group.
    """

    def column(k: int, time: Array) -> Callable[[], Array]:
        return lambda: signals.sampled(k, 1, time)[:, 0]

    def spin(k: int) -> Callable[[], Array]:
        return lambda: signals.angular[:, k]

    zones, head = raw.scenario.vehicle.zones, signals.head_time
    head_channels: dict[str, tuple[str, Callable[[], Array]]] = {
        "acceleration": ("g", lambda: signals.acceleration),
        "angular_velocity": ("rad/s", lambda: resultant(signals.angular[:, :3])),
        **{f"angular_velocity_{axis}": ("rad/s", spin(k)) for k, axis in enumerate("xyz")},
        "angular_acceleration": ("rad/s2", lambda: resultant(signals.angular[:, 3:])),
        "velocity_relative_to_car": (
            "m/s",
            lambda: resultant(signals.sampled(Column.RELATIVE_VELOCITY, 3, head)),
        ),
        **{
            f"velocity_relative_to_car_{axis}": ("m/s", column(Column.RELATIVE_VELOCITY + k, head))
            for k, axis in enumerate("xyz")
        },
        "car_force": ("N", column(Column.HEAD_CAR_FORCE, head)),
    }
    contact_channels = {
        zone.name: ("N", column(Column.REGION_FORCE + j, signals.time))
        for j, zone in enumerate(zones)
    }
    if not raw.rigid_road:
        head_channels["road_force"] = ("N", column(Column.HEAD_ROAD_FORCE, head))
        contact_channels["road"] = ("N", column(Column.REGION_FORCE + len(zones), signals.time))
    centre = {axis: ("m", column(Column.CENTRE + k, signals.time)) for k, axis in enumerate("xyz")}
    found = chosen_histories(head, {"head": head_channels}, wanted) | chosen_histories(
        signals.time, {"contact_force": contact_channels, "centre_of_gravity": centre}, wanted
    )
    if wanted is None and raw.work.size:
        work = {name: (np.array([raw.work[k]]), "J") for k, name in enumerate(WORK_CHANNELS)}
        found["work"] = history_of(np.array([raw.summary[Summary.TIME]]), work)
    return found
