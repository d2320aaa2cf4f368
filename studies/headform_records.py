"""Measured headform tests, each signal cut to its first impact."""

from dataclasses import replace

import numpy as np

from mcstudy import units
from mcstudy.measured import Measured
from models.headform.identification import check_uniform
from models.headform.record import first_impact

ACCELERATION = "head_acceleration"


def keep_first_impacts(data: Measured) -> Measured:
    """Return measured tests whose head acceleration holds the first impact alone.

    Only tests of the headform model with such a signal and a recorded or fixed speed are changed;
    the notes of each test say what was left out.
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
            found = first_impact(time, values, speed[0] * float(np.cos(angle[0])))
            scale = units.factor("g", data.header.signals[ACCELERATION].unit)
            own[ACCELERATION] = np.stack([found.time, scale * found.acceleration], axis=1)
            notes.setdefault(name, []).extend(found.notes)
        signals[name] = own
    return replace(data, signals=signals, notes=notes)


def note_lines(data: Measured) -> list[str]:
    """Return the notes of all tests, each with the name of its test."""
    return [f"test {name}: {line}" for name, lines in data.notes.items() for line in lines]


def _is_uniform(time: np.ndarray) -> bool:
    try:
        check_uniform(time)
    except ValueError:
        return False
    return True
