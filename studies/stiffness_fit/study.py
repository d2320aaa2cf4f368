"""Stiffness from headform tests: fits, corridor, files and report."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from mcstudy.errors import UserError
from mcstudy.execution.results import ANALYSIS, ResultsFolder
from mcstudy.figures import style
from mcstudy.measurement.measured_data import load_measured
from models.contact.corridor import (
    METHODS,
    MIN_CURVES,
    build_corridor,
    corridor_text,
)
from studies.headform_records import keep_first_impacts
from studies.stiffness_fit.analysis import StiffnessAnalysis, describe_fits
from studies.stiffness_fit.fits import FittedTest, fit_tests
from studies.stiffness_fit.report import draw, write_report


def fit_stiffness_of(
    folder: Path,
    out: ResultsFolder,
    *,
    zone: str = "hood",
    method: str = "quantiles",
    knots: int = 6,
    channels: Sequence[str] = (),
    quiet: bool = False,
) -> StiffnessAnalysis:
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
        analysis = describe_fits(data, tests, corridor, method)
        out.write_json(ANALYSIS, analysis)
        out.write_text("curves.csv", _curve_table(tests).to_csv(index=False))
        if corridor is not None:
            source = f"{len(tests)} headform tests: {data.header.title} ({method})"
            out.write_text(
                "corridor.toml", corridor_text(corridor, zone, data.header.title, source)
            )
        figures = draw(tests, corridor, analysis)
        style.save(figures, out.path / "figures")
        out.write_text("report.html", write_report(data, tests, analysis, figures, zone))
    return out.read_analysis(StiffnessAnalysis)


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
