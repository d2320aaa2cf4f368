"""Measured headform tests, each signal cut to its first impact."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.measurement.measured_data import Measured, Signal
from models.criteria.filters import settling_time
from models.headform.identification import CHANNEL_CLASS, check_uniform
from models.headform.record import Impact, first_impact

Array = NDArray[np.float64]

ACCELERATION = "head_acceleration"
RISEN = 0.03
"""Share of the peak above which a signal has risen (assumed)."""
LEAD = 0.25
"""Minimum lead of a record before its rise, as a share of the filter's settling time (assumed)."""


def keep_first_impacts(data: Measured) -> Measured:
    """Return measured tests whose head acceleration holds the first impact alone.

    Only tests of the headform model with such a signal and a recorded or fixed speed are changed;
    the notes of each test state what was left out.
    """
    if data.header.model != "headform" or ACCELERATION not in data.header.signals:
        return data
    signals, notes = {}, {name: list(lines) for name, lines in data.notes.items()}
    for row, name in enumerate(map(str, data.tests["test"])):
        own = dict(data.signals.get(name, {}))
        speed = data.input_value("impact_speed", row, "m/s")
        if ACCELERATION in own and speed is not None and _is_uniform(own[ACCELERATION][:, 0]):
            angle = data.input_value("impact_angle", row, "rad") or (0.0, 0.0)
            time, values = data.signal(name, ACCELERATION, "g")
            signal = data.header.signals[ACCELERATION]
            reach = settling_time(signal.channel_class) if signal.channel_class > 0.0 else 0.0
            found = first_impact(time, values, speed[0] * float(np.cos(angle[0])), reach)
            scale = units.factor("g", signal.unit)
            own[ACCELERATION] = np.stack([found.time, scale * found.acceleration], axis=1)
            notes.setdefault(name, []).extend(found.notes)
            notes[name] += _beginning(found, signal)
        signals[name] = own
    return replace(data, signals=signals, notes=notes)


def _beginning(impact: Impact, signal: Signal) -> list[str]:
    """Return a note on a filtered record that begins too late to hold first contact."""
    if not 0.0 < signal.channel_class < CHANNEL_CLASS:
        return []
    risen = int(np.argmax(impact.acceleration >= RISEN * impact.acceleration.max()))
    lead = float(impact.time[risen] - impact.time[0])
    if lead > LEAD * settling_time(signal.channel_class):
        return []
    return [
        f"the record begins {1e3 * lead:.1f} ms before the {signal.filter} signal rises: the "
        "filter's response before contact is missing, and penetration and intervals are "
        "unreliable; give the record from before contact"
    ]


def note_lines(data: Measured) -> list[str]:
    """Return the notes of all tests, each with the name of its test."""
    return [f"test {name}: {line}" for name, lines in data.notes.items() for line in lines]


def _is_uniform(time: Array) -> bool:
    try:
        check_uniform(time)
    except ValueError:
        return False
    return True
