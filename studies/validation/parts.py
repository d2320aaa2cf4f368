"""The parts of the validation, in the order of the report, and how they are run."""

from collections.abc import Callable
from pathlib import Path

from mcstudy.execution.progress import follow
from models.registry import load_model
from studies.validation import (
    body_parts,
    dummy_head,
    edge_passage,
    ground_impact,
    head_impact,
    headform_impacts,
    hidden_speeds,
    numerics,
    standing_child,
    throw_distance,
    trunk_impacts,
)
from studies.validation.check import Part

PARTS: dict[str, Callable[[int], Part]] = {
    "headform": headform_impacts.validate,
    "throw": throw_distance.validate,
    "head-impact": head_impact.validate,
    "body-parts": body_parts.validate,
    "standing-child": standing_child.validate,
    "edge": edge_passage.validate,
    "numerics": numerics.validate,
    "speed": hidden_speeds.validate,
}
MEASURED: dict[str, Callable[[int, Path], Part]] = {
    "trunk": trunk_impacts.validate,
    "ground": ground_impact.validate,
    "dummy-head": dummy_head.validate,
}
"""The parts that read measured data."""


def part_names() -> tuple[str, ...]:
    """Return the names of all parts."""
    return (*PARTS, *MEASURED)


def run_parts(
    names: tuple[str, ...], *, measured: Path, workers: int = -1, quiet: bool = False
) -> list[Part]:
    """Run parts of the validation.

    Parameters
    ----------
    names : tuple of str
        Of ``part_names()``.
    measured : path
        Folder of real measurements, may be missing.
    workers : int
        Processes, -1 for one per core.
    quiet : bool
        No progress line.
    """
    # Compile once, before several workers would each do it.
    load_model("multibody").run({})
    parts = []
    for name in follow(names, "parts of the validation", quiet=quiet):
        if name in MEASURED:
            parts.append(MEASURED[name](workers, measured))
        else:
            parts.append(PARTS[name](workers))
    return parts
