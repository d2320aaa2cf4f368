"""Fits of headform tests, and the simulation of each test with its own curve."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.errors import UserError
from mcstudy.execution.progress import follow
from mcstudy.measurement.measured_data import Measured
from models.criteria import clip_level, contact_window, filter_cfc, head_injury_criterion
from models.criteria.filters import settling_time
from models.headform.identification import CHANNEL_CLASS, StiffnessFit, fit_stiffness
from models.protocol import OK
from models.registry import load_model

Array = NDArray[np.float64]

STEEPEST_ANGLE = 0.2
"""rad from the perpendicular up to which a test counts as perpendicular (assumed; cos = 0.98)."""


@dataclass(frozen=True)
class Pulse:
    """A measured pulse and the simulated one: time (s after first contact) and g."""

    time: Array
    measured: Array
    simulated: Array


@dataclass(frozen=True)
class FittedTest:
    """A test: name, speed (m/s), mass (kg), fit, pulses, and numbers of both pulses by name."""

    name: str
    speed: float
    mass: float
    fit: StiffnessFit
    pulse: Pulse
    numbers: Mapping[str, tuple[float, float]]


def fit_tests(data: Measured, *, knots: int = 6, quiet: bool = True) -> list[FittedTest]:
    """Fit every test of a set of headform tests and simulate it again with the fitted curve.

    Parameters
    ----------
    data : Measured
        Perpendicular headform tests.
    knots : int
        Maximum number of knots of a curve.
    quiet : bool
        No progress line.

    Raises
    ------
    UserError
        If the data are not of perpendicular headform tests, or a signal cannot be used; the
        message names the test.
    """
    if data.header.model != "headform":
        raise UserError(
            f"{data.source}: model is {data.header.model!r}; stiffness comes from 'headform' tests"
        )
    fitted = []
    names = [str(name) for name in data.tests["test"]]
    for row, name in enumerate(follow(names, "tests fitted", quiet=quiet)):
        try:
            # Absurd tests give non-finite numbers, which are reported without warnings.
            with np.errstate(all="ignore"):
                fitted.append(_fit_test(data, row, name, knots))
        except ValueError as error:
            raise UserError(f"{data.source}: test {name}: {error}") from None
    return fitted


def _fit_test(data: Measured, row: int, name: str, knots: int) -> FittedTest:
    speed, speed_sd = _needed(data, "impact_speed", row, "m/s")
    mass, mass_sd = _needed(data, "headform_mass", row, "kg")
    angle = data.input_value("impact_angle", row, "rad") or (0.0, 0.0)
    if abs(angle[0]) > STEEPEST_ANGLE:
        raise ValueError(
            f"impact_angle is {np.degrees(angle[0]):.0f} deg from the perpendicular: the headform "
            "turns and slides, and its acceleration gives no penetration"
        )
    time, values = data.signal(name, "head_acceleration", "g")
    header = data.header.signals["head_acceleration"]
    scale = header.sd * units.factor(header.unit, "g")
    fit = fit_stiffness(
        time, values, speed * np.cos(angle[0]), mass, channel_class=header.channel_class,
        noise=scale, speed_sd=speed_sd, mass_sd=mass_sd, knots=knots, seed=row,
    )  # fmt: skip
    if header.channel_class == 0.0:
        values = filter_cfc(values, 1.0 / float(np.diff(time).mean()), CHANNEL_CLASS)
    values = values - fit.loop.offset
    curve = fit.curve
    model = load_model(
        "headform",
        {"hood_curve": curve.knots,
         "channel_class": header.channel_class or CHANNEL_CLASS},
    )  # fmt: skip
    run = model.run(
        {"impact_speed": speed * float(np.cos(angle[0])), "headform_mass": mass,
         "hood_unloading_ratio": curve.unloading_ratio}
    )  # fmt: skip
    if run.status != OK:
        raise ValueError(f"the fitted curve cannot be simulated ({run.status})")
    head = run.histories["head"]
    since = time - fit.loop.onset
    rim = max(0.002, settling_time(header.channel_class or CHANNEL_CLASS))
    shown = (since > -rim) & (since < 1.6 * fit.loop.time[-1] + rim)
    # Signed: a filtered signal undershoots after the contact.
    felt = head.channels["acceleration_normal"]
    simulated = np.interp(since, head.time, felt, left=0.0, right=0.0)
    pulse = Pulse(since[shown], values[shown], simulated[shown])
    both = (_pulse_numbers(pulse.time, p) for p in (pulse.measured, pulse.simulated))
    measured, ours = both
    return FittedTest(
        name, speed, mass, fit, pulse, {key: (measured[key], ours[key]) for key in measured}
    )


def _needed(data: Measured, name: str, row: int, unit: str) -> tuple[float, float]:
    value = data.input_value(name, row, unit)
    if value is None or not value[0] > 0.0:
        raise ValueError(f"{name} must be recorded or fixed, and positive")
    return value


def _pulse_numbers(time: Array, acceleration: Array) -> dict[str, float]:
    """Return peak, 3 ms level, HIC15 and duration of a pulse."""
    positive = np.maximum(acceleration, 0.0)
    first, last = contact_window(time, positive)
    return {
        "peak [g]": float(positive.max()),
        "3 ms [g]": clip_level(time, positive),
        "HIC15 [–]": head_injury_criterion(time, positive, 0.015)[0],
        "duration [ms]": 1e3 * float(time[last] - time[first]),
    }
