"""Outputs and histories of a headform test."""

import functools
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.criteria import clip_level, head_injury_criterion
from models.criteria.filters import settling_time
from models.effects.reading import Record, retime
from models.headform.impact import (
    ABSORBED,
    END_SLIDE,
    END_SPIN,
    END_TIME,
    NORMAL,
    PENETRATION,
    RATE,
    REBOUND,
    SLIDE,
    SPIN,
    Impactor,
)
from models.headform.target import SAMPLING_RATE, Strike
from models.protocol import History, chosen_histories

Array = NDArray[np.float64]

QUIET = 0.005
"""Least free flight (s) before and after the contact; more where the filter needs it."""


@dataclass(frozen=True)
class Test:
    """One test: raw results of the step loop and the recorded signal.

    Attributes
    ----------
    impactor : Impactor
    strike : Strike
        Raw results.
    reading : Record
        Recorded components of the acceleration, the first along the initial normal, g.
    quiet : int
        Samples of free flight before and after the contact.
    """

    impactor: Impactor
    strike: Strike
    reading: Record
    quiet: int

    @property
    def acceleration(self) -> Array:
        """Recorded resultant acceleration (n,), g."""
        return np.asarray(functools.reduce(np.hypot, self.reading.acceleration.T))


def quiet_samples(channel_class: float) -> int:
    """Return the samples of free flight around a contact that the filter's response needs."""
    settling = settling_time(channel_class) if channel_class > 0.0 else 0.0
    return round(max(QUIET, settling) * SAMPLING_RATE)


def measures(test: Test) -> dict[str, Callable[[], float]]:
    """Return the output evaluators, by name, of a test that ended."""
    acceleration = test.acceleration
    time = np.arange(acceleration.size) / SAMPLING_RATE
    struck, impactor = test.strike, test.impactor
    record, summary = struck.record, struck.summary
    energy = 0.5 * impactor.mass * (struck.speeds[0] ** 2 + struck.speeds[1] ** 2)
    left = 0.5 * impactor.mass * (summary[REBOUND] ** 2 + summary[END_SLIDE] ** 2)
    left += 0.5 * impactor.inertia * summary[END_SPIN] ** 2
    return {
        "hic15": lambda: head_injury_criterion(time, acceleration, 0.015)[0],
        "hic36": lambda: head_injury_criterion(time, acceleration, 0.036)[0],
        "clip_3ms": lambda: clip_level(time, acceleration),
        "clip_3ms_consecutive": lambda: clip_level(time, acceleration, mode="consecutive"),
        "peak_head_acceleration": lambda: float(acceleration.max()),
        "peak_force": lambda: float(record[:, NORMAL].max()),
        "hood_intrusion": lambda: struck.dent[0],
        "permanent_dent": lambda: struck.dent[1],
        "rebound_speed": lambda: float(summary[REBOUND]),
        "contact_duration": lambda: float(summary[END_TIME]),
        "head_angular_velocity": lambda: float(np.abs(record[:, SPIN]).max()),
        "energy_residual": lambda: float((energy - summary[ABSORBED] - left) / energy),
    }


def histories(test: Test, wanted: Collection[str] | None) -> dict[str, History]:
    """Return the histories of headform and hood, or the wanted ones; time 0 is first contact."""
    quiet = test.quiet
    record, last = test.strike.record, test.strike.record[-1]
    before = np.arange(-quiet, 0) / SAMPLING_RATE
    after = np.arange(1, quiet + 1) / SAMPLING_RATE
    rate, slide = test.strike.speeds

    def padded(column: int, first: Array | float, end: Array | float) -> Array:
        longer = np.empty(record.shape[0] + 2 * quiet)
        longer[:quiet] = first
        longer[quiet:-quiet] = record[:, column]
        longer[-quiet:] = end
        return longer

    def recorded(values: Array) -> Array:
        # All measured channels share one recorder.
        return retime(values, test.reading.clock, quiet)

    sources: dict[str, dict[str, tuple[str, Callable[[], Array]]]] = {
        "head": {
            "acceleration": ("g", lambda: test.acceleration),
            "acceleration_normal": ("g", lambda: test.reading.acceleration[:, 0]),
            "acceleration_tangential": (
                "g",
                lambda: np.asarray(functools.reduce(np.hypot, test.reading.acceleration.T[1:])),
            ),
            "velocity_normal": ("m/s", lambda: padded(RATE, rate, last[RATE])),
            "velocity_tangential": ("m/s", lambda: padded(SLIDE, slide, last[SLIDE])),
            "angular_velocity": ("rad/s", lambda: padded(SPIN, 0.0, last[SPIN])),
        },
        "hood": {
            "force": ("N", lambda: recorded(padded(NORMAL, 0.0, 0.0))),
            "penetration": (
                "m",
                lambda: recorded(
                    padded(PENETRATION, before * rate, last[PENETRATION] + after * last[RATE])
                ),
            ),
        },
    }
    time = np.arange(-quiet, record.shape[0] + quiet) / SAMPLING_RATE
    return chosen_histories(time, sources, wanted)
