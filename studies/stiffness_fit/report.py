"""Figures and report of stiffness from headform tests."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mcstudy.figures import stiffness as pictures
from mcstudy.measurement.measured_data import Measured
from mcstudy.report import Section, Table, render
from mcstudy.statistics import Estimate
from mcstudy.text import interval, number
from models.contact.corridor import (
    MIN_CURVES,
    Corridor,
)
from models.headform.identification import CHANNEL_CLASS
from studies.stiffness_fit.analysis import COORDINATES, StiffnessAnalysis
from studies.stiffness_fit.fits import FittedTest


def draw(
    tests: Sequence[FittedTest], corridor: Corridor | None, analysis: StiffnessAnalysis
) -> dict[str, Any]:
    """Return the figures by file name.

    Parameters
    ----------
    tests : sequence of FittedTest
        From ``fit_tests``.
    corridor : Corridor or None
        Of the tests' curves.
    analysis : StiffnessAnalysis
        Every number of the report.
    """
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
    entry = analysis.corridor
    if corridor is not None and entry is not None:
        figures["corridor"] = pictures.draw_corridor(
            {name: (getattr(corridor, name).penetration, getattr(corridor, name).force)
             for name in ("lower", "median", "upper")},
            [(t.fit.curve.penetration, t.fit.curve.force) for t in tests],
            COORDINATES,
            {f"{3.6 * entry.impact_speed:.0f} km/h, {entry.headform_mass:.2g} kg":
             np.asarray(entry.hic15)},
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


def summary_table(analysis: StiffnessAnalysis) -> Table:
    """Return the fitted laws of an analysis as a table."""
    rows = [
        [name, number(3.6 * law.impact_speed), number(law.headform_mass),
         str(len(law.penetration)),
         interval(Estimate(law.largest_penetration, *law.largest_penetration_interval).times(1e3)),
         interval(law.permanent.times(1e3)), interval(law.unloading_ratio), number(law.residual)]
        for name, law in analysis.tests.items()
    ]  # fmt: skip
    head = ["test", "speed [km/h]", "mass [kg]", "knots", "largest penetration [mm]",
            "permanent [mm]", "unloading ratio [–]", "residual [N]"]  # fmt: skip
    return Table("Fitted laws, with 95 % intervals.", head, rows)


def write_report(
    data: Measured,
    tests: Sequence[FittedTest],
    analysis: StiffnessAnalysis,
    figures: Mapping[str, Any],
    zone: str,
) -> str:
    """Return the report's HTML.

    Parameters
    ----------
    data : Measured
        Headform tests.
    tests : sequence of FittedTest
        From ``fit_tests``.
    analysis : StiffnessAnalysis
        Every number of the report.
    figures : mapping
        From ``draw``.
    zone : str
        Name of the corridor's zone.
    """
    names = list(tests[0].numbers)
    back = [
        [test.name, *(f"{number(m)} / {number(s)}" for m, s in test.numbers.values()),
         f"{100.0 * analysis.tests[test.name].pulse_difference:.1f} %"]
        for test in tests
    ]  # fmt: skip
    worst = max(law.pulse_difference for law in analysis.tests.values())
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
    if (entry := analysis.corridor) is not None:
        low, middle, high = (entry.hic15[k] for k in (0, len(COORDINATES) // 2, -1))
        sections.append(
            Section(
                "Stiffness corridor and resulting HIC15",
                (
                    f"From the curves of {len(tests)} tests by {entry.method}: bounds hold nine "
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
    if analysis.notes:
        sections.append(Section("Notes on the data", analysis.notes))
    subtitle = f"Stiffness from {len(tests)} headform tests in {data.source}"
    return render(data.header.title, subtitle, sections)
