"""A check: one number of ours against one reference."""

import functools
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

from matplotlib.figure import Figure

from mcstudy.text import unit

INSIDE, OUTSIDE, NOT_RUN = "inside", "OUTSIDE", "not run"


@dataclass(frozen=True)
class Check:
    """A number against a reference.

    Attributes
    ----------
    key : str
        Key of the reference.
    what : str
        Compared quantity.
    unit : str
        Its unit.
    low, high : float
        Bounds of the reference; NaN where it is open.
    source : str
        Source of the bounds.
    label : str
        found, recalled, estimated, assumed, measured or exact.
    ours : float
        Our number, NaN if not available.
    reason : str
        Why it lies outside, if it does and that is known.
    exact : bool
        Whether it is a closed form or a conservation law, which must hold.
    """

    key: str
    what: str
    unit: str
    low: float
    high: float
    source: str
    label: str
    ours: float
    reason: str
    exact: bool

    @property
    def verdict(self) -> str:
        """``inside``, ``OUTSIDE`` or ``not run``."""
        if math.isnan(self.ours):
            return NOT_RUN
        above = math.isnan(self.low) or self.ours >= self.low
        below = math.isnan(self.high) or self.ours <= self.high
        return INSIDE if above and below else OUTSIDE

    @property
    def reference(self) -> str:
        """The bounds as text."""
        low, high = f"{self.low:,.6g}", f"{self.high:,.6g}"
        if math.isnan(self.low):
            return f"at most {high}"
        if math.isnan(self.high):
            return f"at least {low}"
        return low if self.low == self.high else f"{low} to {high}"

    @property
    def cited(self) -> str:
        """The bounds with unit, source and label."""
        return f"{self.reference} {unit(self.unit)}".strip() + f" · {self.source} [{self.label}]"


@dataclass(frozen=True)
class Part:
    """A part of the validation: heading, paragraphs, checks and figures by caption."""

    heading: str
    paragraphs: Sequence[str]
    checks: Sequence[Check]
    figures: Mapping[str, Figure] = field(default_factory=dict)


@functools.cache
def references() -> dict[str, Any]:
    """Return the table of references."""
    text = files("studies.validation").joinpath("references.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def check(key: str, ours: float) -> Check:
    """Return the check of a number against the reference of that key in ``references.toml``.

    Raises
    ------
    KeyError
        If there is no such reference.
    """
    row = references()["checks"][key]
    return Check(
        key=key,
        what=row["what"],
        unit=row.get("unit", "1"),
        low=float(row.get("low", math.nan)),
        high=float(row.get("high", math.nan)),
        source=row["source"],
        label=row["label"],
        ours=float(ours),
        reason=row.get("reason", ""),
        exact=row["label"] == "exact",
    )
