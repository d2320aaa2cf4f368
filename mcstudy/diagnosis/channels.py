"""Channels that are no independent evidence, because they were computed from another one.

A force that is mass times acceleration, or a penetration that is its double integral, repeats the
accelerometer. Two sensors never agree within a fraction of their noise; a computed channel does.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from mcstudy.diagnosis.problem import Signal, Test

Array = NDArray[np.float64]

TOO_WELL = 0.3
"""Share of the noise of both sensors below which two channels agree too well."""
TOO_CLOSE = 0.1
"""The same for a penetration, whose computed copy has hardly any noise."""
ACCELERATION = "head_acceleration"


def computed_channels(
    tests: Sequence[Test], *, mass: str, speed: str, gravity: float
) -> Mapping[str, str]:
    """Return the signals computed from the head acceleration, with the formula.

    Parameters
    ----------
    tests : sequence of Test
    mass, speed : str
        Names of the inputs that hold mass (kg) and impact speed (m/s).
    gravity : float
        m/s2 of one g.
    """
    found = {}
    for name in {signal.name for test in tests for signal in test.signals} - {ACCELERATION}:
        pairs = []
        for test in tests:
            by_name = {signal.name: signal for signal in test.signals}
            if name in by_name and ACCELERATION in by_name and mass in test.inputs:
                pairs.append((test, by_name[ACCELERATION], by_name[name]))
        if not pairs:
            continue
        if name.endswith("_force"):
            if all(_is_mass_times(a, f, test.inputs[mass], gravity) for test, a, f in pairs):
                found[name] = "mass times the head acceleration"
        elif name.endswith("_penetration") and all(
            _is_integral(a, x, test.inputs.get(speed, 0.0), gravity) for test, a, x in pairs
        ):
            found[name] = "the double integral of the head acceleration"
    return found


def _is_mass_times(acceleration: Signal, force: Signal, mass: float, gravity: float) -> bool:
    felt = mass * gravity * np.interp(force.time, acceleration.time, acceleration.values)
    # The mass of the computation need not be the recorded one.
    square = float(felt @ felt)
    factor = float(force.values @ felt) / square if square > 0.0 else 0.0
    left = float(np.std(force.values - factor * felt))
    noise = float(np.hypot(force.sd, mass * gravity * acceleration.sd))
    return left < TOO_WELL * noise


def _is_integral(acceleration: Signal, depth: Signal, speed: float, gravity: float) -> bool:
    time = acceleration.time
    rate = -gravity * cumulative_trapezoid(acceleration.values, time, initial=0)
    way = cumulative_trapezoid(rate, time, initial=0)
    twin = np.interp(depth.time, time, way)
    inside = depth.values > 0.05 * depth.values.max()
    # An unknown start and initial speed of the integration add a straight line.
    basis = np.stack([np.ones(depth.time.size), depth.time], axis=1)[inside]
    rest = (depth.values - twin)[inside]
    line = np.linalg.lstsq(basis, rest, rcond=None)[0]
    left = float(np.std(rest - basis @ line))
    return left < TOO_CLOSE * max(depth.sd, 1e-3 * abs(speed) * float(np.ptp(time)))
