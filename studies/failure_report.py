"""Status of the runs of a study and location of the failures, for every report."""

from typing import Any

from mcstudy.figures import style
from mcstudy.figures.failures import draw_failures
from mcstudy.report import Table
from studies.runs import RunEnds


def failure_map(analysis: RunEnds) -> dict[str, Any]:
    """Return the figure of the location of failed runs, if any."""
    failed = analysis.failures
    return {"failures": draw_failures(failed.map)} if failed.runs else {}


def failures_said(analysis: RunEnds, blocks: str = "") -> list[str]:
    """Return sentences on how many runs failed, and where.

    Parameters
    ----------
    analysis : RunEnds
        Analysis of a study.
    blocks : str
        Name of the blocks of runs, if there are any.
    """
    failed = analysis.failures
    if not failed.runs:
        return ["No run failed."]
    lost = f"{failed.runs:,} of {analysis.runs:,} runs failed ({100.0 * failed.share:.2g} %)"
    if blocks:
        lost += f", in {failed.blocks:,} {blocks}, which are excluded"
    lines = [f"{lost}."]
    if failed.where:
        words = {"low": "low", "high": "high", "ends": "low or high", "middle": "in the middle"}
        where = ", ".join(
            f"{style.words(name)} {words[entry.place]} (mean rank {entry.mean_rank:.2f})"
            for name, entry in failed.where.items()
        )
        lines.append(f"Failures concentrate at: {where}.")
    else:
        lines.append("Failures are spread over all inputs like the other runs.")
    return lines


def status_table(analysis: RunEnds) -> Table:
    """Return the table of run statuses."""
    rows = [
        [row.ending, row.status.replace("_", " "), f"{row.runs:,}", row.reason]
        for row in analysis.endings
    ]
    return Table("Status of the runs.", ["end", "status", "runs", "most frequent reason"], rows)
