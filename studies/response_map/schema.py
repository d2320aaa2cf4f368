"""The study file of a map."""

import itertools
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, FiniteFloat, model_validator

from mcstudy.studyfile.distributions import Distribution, Unit
from mcstudy.studyfile.schema import (
    LARGEST_DESIGN,
    Design,
    OutputReport,
    SampledStudy,
    StudyTable,
)

LARGEST_AXIS = 1000
"""Values that an axis may have."""
LAST = 1e-9
"""Share of a step by which the last value of an axis may be missed."""


class Axis(StudyTable):
    """Values of an input: a list, or the first and the last one and the step between them."""

    unit: Unit = "1"
    values: Annotated[list[FiniteFloat], Field(min_length=1)] | None = None
    first: FiniteFloat | None = None
    last: FiniteFloat | None = None
    step: Annotated[FiniteFloat, Field(gt=0.0)] | None = None

    @model_validator(mode="after")
    def _complete(self) -> "Axis":
        ends = (self.first, self.last, self.step)
        if (self.values is None) == (None in ends) or (self.values and ends != (None,) * 3):
            raise ValueError("give either values, or first, last and step")
        numbers = self.numbers
        if not 0 < len(numbers) <= LARGEST_AXIS:
            raise ValueError(f"has {len(numbers)} values; an axis has 1 to {LARGEST_AXIS}")
        if any(b <= a for a, b in itertools.pairwise(numbers)):
            raise ValueError("values must rise")
        return self

    @property
    def numbers(self) -> list[float]:
        """The values, in the axis's unit."""
        if self.values is not None:
            return list(self.values)
        assert self.first is not None
        assert self.last is not None
        assert self.step is not None
        count = int(np.floor((self.last - self.first) / self.step + 1.0 + LAST))
        # Rounded: the sum of steps of 0.1 is no decimal number.
        return [round(self.first + k * self.step, 12) for k in range(min(count, LARGEST_AXIS + 1))]


class Points(StudyTable):
    """``[points]``: the points of a car's surface that are struck, by region."""

    regions: Annotated[list[str], Field(min_length=1)] | None = None


class MapReport(OutputReport):
    """``[report]`` of a map: outputs, and the limits between the bands of their colours."""

    limits: dict[str, Annotated[list[FiniteFloat], Field(min_length=1, max_length=6)]] = {}

    @model_validator(mode="after")
    def _rising(self) -> "MapReport":
        for name, values in self.limits.items():
            if any(b <= a for a, b in itertools.pairwise(values)):
                raise ValueError(f"limits.{name}: values must rise")
        return self


class MapStudy(SampledStudy):
    """``kind = "map"``: outputs over two inputs, at every point over draws of the others."""

    kind: Literal["map"]
    axes: Annotated[dict[str, Axis], Field(min_length=2, max_length=2)]
    panels: Annotated[dict[str, Axis], Field(max_length=1)] = {}
    points: Points = Points()
    design: Design = Design(method="monte-carlo", n=1)
    inputs: dict[str, Distribution] = {}
    report: MapReport = MapReport()

    @model_validator(mode="after")
    def _given_once(self) -> "MapStudy":
        grid = [*self.axes, *self.panels]
        for name in grid:
            if grid.count(name) > 1:
                raise ValueError(f"panels.{name}: is an axis as well")
            for table, taken in (("inputs", self.inputs), ("fixed", self.fixed)):
                if name in taken:
                    raise ValueError(f"{table}.{name}: is given by the map's grid")
        if not self.inputs and self.design.n > 1:
            raise ValueError("design: without [inputs] every run of a point is the same; leave it")
        size = self.design.n
        for axis in (*self.axes.values(), *self.panels.values()):
            size *= len(axis.numbers)
        if size > LARGEST_DESIGN:
            raise ValueError(f"the map has {size:,} runs; {LARGEST_DESIGN:,} are the most")
        return self

    def design_topics(self) -> dict[str, Any]:
        """Return the parts of the design that affect the values of a run, by topic."""
        return {
            "kind": self.kind,
            "design.method": self.design.method,
            "design.replicate_size": self.design.size,
            "axes": {name: [axis.unit, axis.numbers] for name, axis in self.axes.items()},
            "panels": {name: [axis.unit, axis.numbers] for name, axis in self.panels.items()},
            "points": self.points.regions or [],
        }
