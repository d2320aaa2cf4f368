"""Every number of a report of stiffness from headform tests."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.measurement.measured_data import Measured
from mcstudy.statistics import Estimate
from mcstudy.typed_json import Real
from models.contact.corridor import (
    Corridor,
)
from models.criteria import contact_window
from models.registry import load_model
from studies.headform_records import note_lines
from studies.stiffness_fit.fits import FittedTest, Pulse

Array = NDArray[np.float64]

COORDINATES = np.linspace(0.0, 1.0, 21)
"""Coordinates of a corridor at which HIC15 is computed."""


@dataclass(frozen=True)
class FittedLaw:
    """The law of one test, in SI units.

    Attributes
    ----------
    impact_speed, headform_mass : of the test.
    penetration, force : knots of the loading curve.
    force_low, force_high : 95 % interval of the force at the knots.
    unloading_ratio, permanent : with 95 % intervals.
    largest_penetration, largest_penetration_interval : of the test.
    residual : root mean square of the force.
    onset, offset, noise : first contact in s, offset and noise of the signal.
    measured_and_simulated : numbers of both pulses by name.
    pulse_difference : root mean square over the measured peak.
    """

    impact_speed: float
    headform_mass: float
    penetration: Sequence[float]
    force: Sequence[float]
    force_low: Sequence[Real]
    force_high: Sequence[Real]
    unloading_ratio: Estimate
    permanent: Estimate
    largest_penetration: Real
    largest_penetration_interval: tuple[Real, Real]
    residual: Real
    onset: Real
    offset: Real
    noise: Real
    measured_and_simulated: Mapping[str, tuple[Real, Real]]
    pulse_difference: Real


@dataclass(frozen=True)
class FittedCorridor:
    """The corridor of all tests, in SI units, and HIC15 along its coordinate."""

    method: str
    penetration: Sequence[float]
    lower: Sequence[float]
    median: Sequence[float]
    upper: Sequence[float]
    unloading_ratio: float
    impact_speed: float
    headform_mass: float
    coordinate: Sequence[float]
    hic15: Sequence[Real]


@dataclass(frozen=True)
class StiffnessAnalysis:
    """Every number of the report.

    Attributes
    ----------
    title, notes : of the data.
    tests : law by test.
    corridor : None where there are too few tests.
    """

    title: str
    notes: Sequence[str]
    tests: Mapping[str, FittedLaw]
    corridor: FittedCorridor | None


def describe_fits(
    data: Measured, tests: Sequence[FittedTest], corridor: Corridor | None, method: str
) -> StiffnessAnalysis:
    """Return every number of the report.

    Parameters
    ----------
    data : Measured
        Headform tests.
    tests : sequence of FittedTest
        From ``fit_tests``.
    corridor : Corridor or None
        Of the tests' curves.
    method : str
        How the corridor is built.
    """
    return StiffnessAnalysis(
        title=data.header.title,
        notes=note_lines(data),
        tests={test.name: _law(test) for test in tests},
        corridor=None if corridor is None else _corridor(tests, corridor, method),
    )


def _law(test: FittedTest) -> FittedLaw:
    fit = test.fit
    return FittedLaw(
        impact_speed=test.speed,
        headform_mass=test.mass,
        penetration=np.asarray(fit.curve.penetration).tolist(),
        force=np.asarray(fit.curve.force).tolist(),
        force_low=np.asarray(fit.force_low).tolist(),
        force_high=np.asarray(fit.force_high).tolist(),
        unloading_ratio=Estimate(**vars(fit.unloading_ratio)),
        permanent=Estimate(**vars(fit.permanent)),
        largest_penetration=fit.largest.value,
        largest_penetration_interval=(fit.largest.low, fit.largest.high),
        residual=fit.residual,
        onset=fit.loop.onset,
        offset=fit.loop.offset,
        noise=fit.loop.noise,
        measured_and_simulated=dict(test.numbers),
        pulse_difference=_pulse_difference(test.pulse),
    )


def _corridor(tests: Sequence[FittedTest], corridor: Corridor, method: str) -> FittedCorridor:
    speed = float(np.mean([test.speed for test in tests]))
    mass = float(np.mean([test.mass for test in tests]))
    return FittedCorridor(
        method=method,
        penetration=np.asarray(corridor.median.penetration).tolist(),
        lower=np.asarray(corridor.lower.force).tolist(),
        median=np.asarray(corridor.median.force).tolist(),
        upper=np.asarray(corridor.upper.force).tolist(),
        unloading_ratio=corridor.median.unloading_ratio,
        impact_speed=speed,
        headform_mass=mass,
        coordinate=COORDINATES.tolist(),
        hic15=hic_corridor(corridor, speed, mass).tolist(),
    )


def hic_corridor(corridor: Corridor, speed: float, mass: float) -> Array:
    """Return HIC15 (21,) along the coordinates of a corridor for a headform test.

    Parameters
    ----------
    corridor : Corridor
        Stiffness corridor.
    speed : float
        Impact speed in m/s.
    mass : float
        Headform mass in kg.
    """
    values = []
    for coordinate in COORDINATES:
        curve = corridor.curve(float(coordinate))
        run = load_model("headform", {"hood_curve": curve.knots}).run(
            {"impact_speed": speed, "headform_mass": mass,
             "hood_unloading_ratio": curve.unloading_ratio, "hood_damping": curve.damping}
        )  # fmt: skip
        values.append(run.outputs["hic15"])
    return np.array(values)


def _pulse_difference(pulse: Pulse) -> float:
    """Return the root mean square difference of the pulses over the measured peak."""
    first, last = contact_window(pulse.time, np.maximum(pulse.measured, 0.0))
    gap = (pulse.simulated - pulse.measured)[first : last + 1]
    return float(np.sqrt(np.mean(gap**2)) / pulse.measured.max())
