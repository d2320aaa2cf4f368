"""The parts of the validation, in the order of the report, and how they are run."""

from collections.abc import Callable
from pathlib import Path

from mcstudy.progress import follow
from models.registry import load_model
from studies.validation import (
    body_parts,
    dummy_head,
    head_impact,
    headform_impacts,
    numerics,
    standing_child,
    throw_distance,
)
from studies.validation.check import Part

PARTS: dict[str, Callable[[int], Part]] = {
    "headform": headform_impacts.validate,
    "throw": throw_distance.validate,
    "head-impact": head_impact.validate,
    "body-parts": body_parts.validate,
    "standing-child": standing_child.validate,
    "numerics": numerics.validate,
}
DUMMY = "dummy-head"
"""The part that reads measured data."""


def part_names() -> tuple[str, ...]:
    """Return the names of all parts."""
    return (*PARTS, DUMMY)


def run_parts(
    names: tuple[str, ...], *, measured: Path, workers: int = -1, quiet: bool = False
) -> list[Part]:
    """Run parts of the validation.

    Parameters
    ----------
    names : of ``part_names()``. measured : folder of real measurements, may be missing.
    workers : processes, -1 for one a core. quiet : show no progress.
    """
    # Compile once, before several workers would each do it.
    load_model("multibody").run({})
    parts = []
    for name in follow(names, "parts of the validation", quiet=quiet):
        if name == DUMMY:
            parts.append(dummy_head.validate(workers, measured))
        else:
            parts.append(PARTS[name](workers))
    return parts
