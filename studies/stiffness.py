"""Stiffness from headform tests: a curve per test, the corridor of all, and the resulting HIC."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.errors import UserError
from mcstudy.execution.progress import follow
from mcstudy.execution.results import ResultsFolder
from mcstudy.figures import stiffness as pictures
from mcstudy.figures import style
from mcstudy.measurement.measured_data import Measured, load_measured
from mcstudy.report import Section, Table, render
from mcstudy.text import interval, number
from models.contact.corridor import (
    METHODS,
    MIN_CURVES,
    Corridor,
    build_corridor,
    corridor_text,
)
from models.criteria import clip_level, contact_window, filter_cfc, head_injury_criterion
from models.criteria.filters import settling_time
from models.headform.identification import CHANNEL_CLASS, StiffnessFit, fit_stiffness
from models.protocol import OK
from models.registry import load_model
from studies.headform_records import keep_first_impacts, note_lines

Array = NDArray[np.float64]

STEEPEST_ANGLE = 0.2
"""rad from the perpendicular up to which a test counts as perpendicular (assumed; cos = 0.98)."""
COORDINATES = np.linspace(0.0, 1.0, 21)


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


def fit_stiffness_of(
    folder: Path,
    out: ResultsFolder,
    *,
    zone: str = "hood",
    method: str = "quantiles",
    knots: int = 6,
    channels: Sequence[str] = (),
    quiet: bool = False,
) -> dict[str, Any]:
    """Fit a folder of tests and write curves, corridor, figures and report.

    Parameters
    ----------
    folder : path
        Measured data or ISO-MME tests.
    out : ResultsFolder
        Results folder.
    zone : str
        Name of the zone in the corridor file.
    method : str
        ``quantiles`` or ``components``: how the corridor is built.
    knots : int
        Maximum number of knots of a curve.
    channels : sequence of str
        Channels to take from ISO-MME tests; see ``mcstudy.measurement.isomme.head_acceleration``.
    quiet : bool
        No progress line.

    Returns
    -------
    dict
        The analysis, as in ``analysis.json``.

    Raises
    ------
    UserError
        If data or options are wrong.
    """
    if method not in METHODS:
        raise UserError(f"--method must be one of {', '.join(METHODS)}, given {method!r}")
    if not 2 <= knots <= 8:
        raise UserError(f"--knots must lie within 2 and 8, given {knots}")
    data = keep_first_impacts(load_measured(folder, channels))
    tests = fit_tests(data, knots=knots, quiet=quiet)
    corridor = None
    if len(tests) >= MIN_CURVES:
        corridor = build_corridor([test.fit.curve for test in tests], method)
    with out.open_for_writing():
        analysis = _analysis(data, tests, corridor, method)
        out.write_json("analysis.json", analysis)
        out.write_text("curves.csv", _curve_table(tests).to_csv(index=False))
        if corridor is not None:
            source = f"{len(tests)} headform tests: {data.header.title} ({method})"
            out.write_text(
                "corridor.toml", corridor_text(corridor, zone, data.header.title, source)
            )
        figures = _draw(tests, corridor, analysis)
        style.save(figures, out.path / "figures")
        out.write_text("report.html", _report(data, tests, analysis, figures, zone))
    return out.read_json("analysis.json")


def _analysis(
    data: Measured, tests: list[FittedTest], corridor: Corridor | None, method: str
) -> dict[str, Any]:
    table: dict[str, Any] = {
        "title": data.header.title,
        "notes": note_lines(data),
        "tests": {},
        "corridor": None,
    }
    for test in tests:
        fit = test.fit
        table["tests"][test.name] = {
            "impact_speed": test.speed,
            "headform_mass": test.mass,
            "penetration": fit.curve.penetration,
            "force": fit.curve.force,
            "force_low": fit.force_low,
            "force_high": fit.force_high,
            "unloading_ratio": vars(fit.unloading_ratio),
            "permanent": vars(fit.permanent),
            "largest_penetration": fit.largest.value,
            "largest_penetration_interval": [fit.largest.low, fit.largest.high],
            "residual": fit.residual,
            "onset": fit.loop.onset,
            "offset": fit.loop.offset,
            "noise": fit.loop.noise,
            "measured_and_simulated": dict(test.numbers),
            "pulse_difference": _pulse_difference(test.pulse),
        }
    if corridor is not None:
        speed = float(np.mean([test.speed for test in tests]))
        mass = float(np.mean([test.mass for test in tests]))
        table["corridor"] = {
            "method": method,
            "penetration": corridor.median.penetration,
            "lower": corridor.lower.force,
            "median": corridor.median.force,
            "upper": corridor.upper.force,
            "unloading_ratio": corridor.median.unloading_ratio,
            "impact_speed": speed,
            "headform_mass": mass,
            "coordinate": COORDINATES,
            "hic15": hic_corridor(corridor, speed, mass),
        }
    return table


def _pulse_difference(pulse: Pulse) -> float:
    """Return the root mean square difference of the pulses over the measured peak."""
    first, last = contact_window(pulse.time, np.maximum(pulse.measured, 0.0))
    gap = (pulse.simulated - pulse.measured)[first : last + 1]
    return float(np.sqrt(np.mean(gap**2)) / pulse.measured.max())


def _curve_table(tests: list[FittedTest]) -> pd.DataFrame:
    rows = [
        {"test": test.name, "penetration_m": d, "force_N": f, "low_N": low, "high_N": high}
        for test in tests
        for d, f, low, high in zip(
            test.fit.curve.penetration, test.fit.curve.force,
            test.fit.force_low, test.fit.force_high, strict=True,
        )
    ]  # fmt: skip
    return pd.DataFrame(rows)


def _draw(
    tests: list[FittedTest], corridor: Corridor | None, analysis: Mapping[str, Any]
) -> dict[str, Any]:
    fits = [
        pictures.FittedLoop(
            test.name, test.fit.loop.penetration, test.fit.loop.force,
            test.fit.curve.penetration, test.fit.curve.force,
            test.fit.force_low, test.fit.force_high, test.fit.permanent.value,
        )
        for test in tests
    ]  # fmt: skip
    figures = {
        "force_penetration": pictures.draw_fits(fits),
        "residuals": pictures.draw_residuals(fits),
        "pulses": pictures.draw_pulses(
            {t.name: (t.pulse.time, t.pulse.measured, t.pulse.simulated) for t in tests}
        ),
    }
    if corridor is not None:
        entry = analysis["corridor"]
        figures["corridor"] = pictures.draw_corridor(
            {name: (getattr(corridor, name).penetration, getattr(corridor, name).force)
             for name in ("lower", "median", "upper")},
            [(t.fit.curve.penetration, t.fit.curve.force) for t in tests],
            COORDINATES,
            {f"{3.6 * entry['impact_speed']:.0f} km/h, {entry['headform_mass']:.2g} kg":
             np.asarray(entry["hic15"])},
        )  # fmt: skip
    return figures


def _filter_words(data: Measured) -> list[str]:
    """Return a note on the fit of signals of a low channel class, and on their HIC."""
    name = data.header.signals["head_acceleration"].filter
    if not 0.0 < data.header.signals["head_acceleration"].channel_class < CHANNEL_CLASS:
        return []
    return [
        f"The signals have passed {name}, which rounds flanks and peaks. Each law is therefore the "
        "one whose simulated acceleration, filtered alike, is the measured one; the grey loops "
        "include its estimate of what the filter removed. Peak, 3 ms level and HIC15 below are "
        f"those of the {name} signals, measured and simulated, and lower than with CFC1000."
    ]


def summary_table(analysis: Mapping[str, Any]) -> Table:
    """Return the fitted laws of an analysis as a table."""
    rows = [
        [name, number(3.6 * e["impact_speed"]), number(e["headform_mass"]),
         str(len(e["penetration"])),
         interval({"value": 1e3 * e["largest_penetration"],
                   **dict(zip(("low", "high"), (1e3 * b for b in e["largest_penetration_interval"]),
                              strict=True))}),
         interval({key: 1e3 * value for key, value in e["permanent"].items()}),
         interval(e["unloading_ratio"]), number(e["residual"])]
        for name, e in analysis["tests"].items()
    ]  # fmt: skip
    head = ["test", "speed [km/h]", "mass [kg]", "knots", "largest penetration [mm]",
            "permanent [mm]", "unloading ratio [–]", "residual [N]"]  # fmt: skip
    return Table("Fitted laws, with 95 % intervals.", head, rows)


def _report(
    data: Measured,
    tests: list[FittedTest],
    analysis: Mapping[str, Any],
    figures: Mapping[str, Any],
    zone: str,
) -> str:
    names = list(tests[0].numbers)
    back = [
        [test.name, *(f"{number(m)} / {number(s)}" for m, s in test.numbers.values()),
         f"{100.0 * analysis['tests'][test.name]['pulse_difference']:.1f} %"]
        for test in tests
    ]  # fmt: skip
    worst = max(entry["pulse_difference"] for entry in analysis["tests"].values())
    sections = [
        Section(
            "Fit",
            (
                "The headform is assumed to be rigid and not to rotate. Its filtered acceleration, "
                "integrated twice from first contact, gives penetration; times its mass, force. "
                "Knots and unloading line are fitted by least squares; intervals are 95 % and "
                "include noise, speed and mass uncertainty, and the misfit of the curve.",
                *_filter_words(data),
            ),
            [summary_table(analysis)],
            {"Measured loops (grey), fitted curves with 95 % intervals at the knots, and unloading "
             "lines (dashed).": figures["force_penetration"],
             "Residuals of the fitted loading curves.": figures["residuals"]},
        ),
        Section(
            "Forward check",
            (
                "Each test simulated with its own fitted curve. The pulses differ by "
                f"{100.0 * worst:.1f} % of the peak (root mean square) at worst.",
            ),
            [Table("Measured / simulated.", ["test", *names, "pulse difference"], back)],
            {"Measured and simulated pulses.": figures["pulses"]},
        ),
    ]  # fmt: skip
    if "corridor" in figures:
        entry = analysis["corridor"]
        low, middle, high = (entry["hic15"][k] for k in (0, len(COORDINATES) // 2, -1))
        sections.append(
            Section(
                "Stiffness corridor and resulting HIC15",
                (
                    f"From the curves of {len(tests)} tests by {entry['method']}: bounds hold nine "
                    f"curves in ten. HIC15 of the headform test goes from {number(low)} over "
                    f"{number(middle)} to {number(high)} along it. The corridor is in "
                    f"corridor.toml, zone {zone!r}: give its path as option 'corridor' of the "
                    "headform model, or copy it into a vehicle file.",
                ),
                (),
                {"Stiffness corridor, and the resulting HIC15 corridor.":
                 figures["corridor"]},
            )
        )  # fmt: skip
    else:
        sections.append(Section("Corridor", (f"A corridor needs {MIN_CURVES} tests or more.",)))
    if analysis["notes"]:
        sections.append(Section("Notes on the data", analysis["notes"]))
    subtitle = f"Stiffness from {len(tests)} headform tests in {data.source}"
    return render(data.header.title, subtitle, sections)
