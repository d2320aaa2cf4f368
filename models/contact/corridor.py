"""Stiffness corridors: lower, median and upper loading curve of a zone of a car.

A corridor coordinate from 0 (lower) over 0.5 (median) to 1 (upper) picks a curve between them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.contact.law import ForceCurve

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Corridor:
    """Lower, median and upper loading curve of a zone."""

    lower: ForceCurve
    median: ForceCurve
    upper: ForceCurve

    def curve(self, coordinate: float) -> ForceCurve:
        """Return the curve at a coordinate: 0 lower, 0.5 median, 1 upper.

        Forces at equal penetration are interpolated linearly, so the curve rises wherever the
        bounds do.

        Raises
        ------
        ValueError
            If the coordinate is not within 0 to 1.
        """
        if not 0.0 <= coordinate <= 1.0:
            raise ValueError(f"a corridor coordinate lies within 0 and 1, given {coordinate}")
        share = abs(2.0 * coordinate - 1.0)
        bound = self.lower if coordinate < 0.5 else self.upper
        knots = np.union1d(self.median.penetration, bound.penetration)
        force = (1.0 - share) * self.median.at(knots) + share * bound.at(knots)
        return ForceCurve(knots, force, self.median.unloading_ratio, self.median.damping)


def read_corridor(row: Mapping[str, Any]) -> Corridor:
    """Return the corridor of a table of a data file.

    Parameters
    ----------
    row : mapping
        ``lower``, ``median``, ``upper`` (knots ``[[penetration m, force N], ...]``),
        ``unloading_ratio`` and ``damping`` (N s/m).

    Raises
    ------
    ValueError
        If an entry is missing or a curve does not rise from (0, 0).
    """

    def curve(key: str) -> ForceCurve:
        try:
            knots = np.array(row[key], dtype=np.float64)
            return ForceCurve(
                knots[:, 0].copy(),
                knots[:, 1].copy(),
                float(row["unloading_ratio"]),
                float(row.get("damping", 0.0)),
            )
        except KeyError as error:
            raise ValueError(f"corridor: {error.args[0]} is missing") from None
        except (ValueError, IndexError, TypeError) as error:
            raise ValueError(f"corridor: {key}: {error}") from None

    return Corridor(curve("lower"), curve("median"), curve("upper"))
