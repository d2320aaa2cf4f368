"""The validation report: one table of all checks, and the parts with their figures."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.figures import style
from mcstudy.report import Section, Table, render
from mcstudy.text import quantity
from studies.validation.check import INSIDE, NOT_RUN, OUTSIDE, Check, Part
from studies.validation.parts import part_names, run_parts

HEAD = ["what", "ours", "reference", "verdict"]


def validate(
    folder: ResultsFolder,
    *,
    measured: Path,
    only: Sequence[str] = (),
    workers: int = -1,
    quiet: bool = False,
) -> dict[str, Any]:
    """Run the validation and write its folder.

    Parameters
    ----------
    folder : ResultsFolder
        Results folder.
    measured : path
        Folder of real measurements; checks that need it are skipped without it.
    only : sequence of str
        Names of parts, all by default.
    workers : int
        Processes, -1 for one per core.
    quiet : bool
        No progress line.

    Returns
    -------
    dict
        The analysis, as in ``analysis.json``.

    Raises
    ------
    UserError
        If a part is unknown.
    """
    unknown = sorted(set(only) - set(part_names()))
    if unknown:
        known = ", ".join(part_names())
        raise UserError(f"--only {unknown[0]}: no such part; it is one of {known}")
    names = tuple(name for name in part_names() if not only or name in only)
    with folder.open_for_writing():
        parts = run_parts(names, measured=measured, workers=workers, quiet=quiet)
        folder.write_json("analysis.json", _analysis(names, parts))
        figures = {
            f"{name}_{k + 1}": figure
            for name, part in zip(names, parts, strict=True)
            for k, figure in enumerate(part.figures.values())
        }
        style.save(figures, folder.path / "figures")
        folder.write_text("report.html", _report(parts))
    return folder.read_json("analysis.json")


def check_exact(analysis: dict[str, Any]) -> None:
    """Raise ``StudyError`` if a closed form or a conservation law is missed or has no number.

    References of other kinds stay in the table as misses.
    """
    missed = [c["what"] for c in analysis["checks"] if c["exact"] and c["verdict"] != INSIDE]
    if missed:
        raise StudyError(f"{len(missed)} exact checks are missed, first: {missed[0]}")


def table_of(analysis: dict[str, Any]) -> Table:
    """Return all checks of an analysis as a table of text."""
    rows = [
        [c["what"], quantity(c["ours"], c["unit"]), c["cited"], c["verdict"]]
        for c in analysis["checks"]
    ]
    return Table("Validation", HEAD, rows)


def _analysis(names: Sequence[str], parts: Sequence[Part]) -> dict[str, Any]:
    checks = [
        {
            "part": name,
            "key": c.key,
            "what": c.what,
            "ours": c.ours,
            "low": c.low,
            "high": c.high,
            "reference": c.reference,
            "unit": c.unit,
            "verdict": c.verdict,
            "source": c.source,
            "cited": c.cited,
            "label": c.label,
            "exact": c.exact,
            "reason": c.reason if c.verdict == OUTSIDE else "",
        }
        for name, part in zip(names, parts, strict=True)
        for c in part.checks
    ]
    verdicts = [c["verdict"] for c in checks]
    return {
        "counts": {word: verdicts.count(word) for word in (INSIDE, OUTSIDE, NOT_RUN)},
        "checks": checks,
        "text": {
            name: list(part.paragraphs) for name, part in zip(names, parts, strict=True)
        },
    }  # fmt: skip


def _report(parts: Sequence[Part]) -> str:
    checks = [c for part in parts for c in part.checks]
    counts = {word: sum(c.verdict == word for c in checks) for word in (INSIDE, OUTSIDE, NOT_RUN)}
    missed = [c for c in checks if c.verdict == OUTSIDE]
    summary = (
        f"{counts[INSIDE]} of {len(checks)} checks lie inside their reference, {counts[OUTSIDE]} "
        f"outside, {counts[NOT_RUN]} were not run."
    )
    labels = (
        "Labels: found was read in its source; recalled and estimated were not, and are "
        "weaker; assumed is our own choice; measured is based on data at hand; exact is a "
        "closed form, a conservation law or a requirement of the numerics. Calibrated to "
        "references of this table were the curves of chest, abdomen and hip (the hub tests and "
        "the donors'), and the nominal case to the five numbers of the paper that the README "
        "names; nothing else."
    )
    sections = [
        Section(
            "Summary",
            (summary, labels),
            [Table("Checks outside their reference.", ["what", "ours", "reference", "why"],
                   [[c.what, quantity(c.ours, c.unit), c.cited,
                     c.reason or "unexplained"] for c in missed])],
        )
    ]  # fmt: skip
    sections += [
        Section(
            part.heading,
            part.paragraphs,
            [Table("Checks.", HEAD, [_row(c) for c in part.checks])],
            part.figures,
        )
        for part in parts
    ]
    return render("Validation", "Comparison of the models with references", sections)


def _row(c: Check) -> list[str]:
    return [c.what, quantity(c.ours, c.unit), c.cited, c.verdict]
