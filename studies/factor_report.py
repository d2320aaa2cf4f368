"""What reports of studies that exchange factors have in common."""

from collections.abc import Mapping
from typing import Any

from mcstudy.figures import style
from mcstudy.figures.failures import draw_failures
from mcstudy.report import Table


def failure_map(analysis: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figure of where runs failed, if any did."""
    failed = analysis["failures"]
    return {"failures": draw_failures(failed["map"])} if failed["runs"] else {}


def failures_said(analysis: Mapping[str, Any]) -> list[str]:
    """Say how many runs failed, and where."""
    failed = analysis["failures"]
    if not failed["runs"]:
        return ["No run failed."]
    lines = [
        f"{failed['runs']:,} of {analysis['runs']:,} runs failed ({100.0 * failed['share']:.2g} %),"
        f" in {failed['blocks']:,} blocks of runs that belong together. A block with a failed run "
        "is left out whole."
    ]
    if failed["where"]:
        where = ", ".join(
            f"{style.words(name)} {'high' if rank > 0.5 else 'low'} (mean rank {rank:.2f})"
            for name, rank in failed["where"].items()
        )
        lines.append(f"Failed runs lie where: {where}.")
    else:
        lines.append("Failed runs are spread over all inputs as the others are.")
    return lines


def groups_said(analysis: Mapping[str, Any]) -> str:
    """Say which inputs make up which factor."""
    if not analysis["groups"]:
        return "Every input is a factor of its own."
    text = "; ".join(
        f"{group}: {', '.join(style.words(name) for name in names)}"
        for group, names in analysis["groups"].items()
    )
    return f"Factors that are groups of inputs: {text}."


def status_table(analysis: Mapping[str, Any]) -> Table:
    """Return how the runs ended."""
    rows = [[status, f"{count:,}"] for status, count in analysis["status"].items()]
    return Table("How the runs ended.", ["status", "runs"], rows)
