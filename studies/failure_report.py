"""How the runs of a study ended, and where they failed, as every report says it."""

from collections.abc import Mapping
from typing import Any

from mcstudy.figures import style
from mcstudy.figures.failures import draw_failures
from mcstudy.report import Table


def failure_map(analysis: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figure of where runs failed, if any did."""
    failed = analysis["failures"]
    return {"failures": draw_failures(failed["map"])} if failed["runs"] else {}


def failures_said(analysis: Mapping[str, Any], blocks: str = "") -> list[str]:
    """Say how many runs failed, and where.

    Parameters
    ----------
    analysis : mapping
        Of a study.
    blocks : str
        What its runs that belong together are called, if there are any.
    """
    failed = analysis["failures"]
    if not failed["runs"]:
        return ["No run failed."]
    lost = (
        f"{failed['runs']:,} of {analysis['runs']:,} runs failed ({100.0 * failed['share']:.2g} %)"
    )
    if blocks:
        lost += f", in {failed['blocks']:,} {blocks}, which are left out whole"
    lines = [f"{lost}."]
    if failed["where"]:
        words = {"low": "low", "high": "high", "ends": "low or high", "middle": "in the middle"}
        where = ", ".join(
            f"{style.words(name)} {words[entry['place']]} (mean rank {entry['mean_rank']:.2f})"
            for name, entry in failed["where"].items()
        )
        lines.append(f"Failed runs lie where: {where}.")
    else:
        lines.append("Failed runs are spread over all inputs as the others are.")
    return lines


def status_table(analysis: Mapping[str, Any]) -> Table:
    """Return how the runs ended."""
    rows = [
        [row["ending"], row["status"].replace("_", " "), f"{row['runs']:,}", row["reason"]]
        for row in analysis["endings"]
    ]
    return Table("How the runs ended.", ["end", "status", "runs", "most frequent reason"], rows)
