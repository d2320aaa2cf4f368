"""Stiffness corridors: lower, median and upper loading curve of a zone of a car.

A corridor coordinate from 0 (lower) over 0.5 (median) to 1 (upper) selects a curve between them.
"""

import functools
import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from models import data
from models.contact.law import ForceCurve
from models.contact.loading import MAX_KNOTS, choose_knots, fit_loading

Array = NDArray[np.float64]


LEVEL = 0.9
"""Share of curves between the bounds of a corridor built from tests."""
MIN_CURVES = 3
METHODS = ("quantiles", "components")


@dataclass(frozen=True)
class Corridor:
    """Lower, median and upper loading curve of a zone.

    Attributes
    ----------
    lower, median, upper : ForceCurve
    """

    lower: ForceCurve
    median: ForceCurve
    upper: ForceCurve

    def __post_init__(self) -> None:
        for name, bound in (("lower", self.lower), ("upper", self.upper)):
            count = np.union1d(self.median.penetration, bound.penetration).size
            if count > MAX_KNOTS:
                raise ValueError(
                    f"median and {name} have {count} different knots, {MAX_KNOTS} are possible"
                )
        depth = np.concatenate([c.penetration for c in (self.lower, self.median, self.upper)])
        lower, median, upper = (c.at(depth) for c in (self.lower, self.median, self.upper))
        slack = 1e-9 * upper.max()
        if np.any(lower > median + slack) or np.any(median > upper + slack):
            raise ValueError("the curves cross: lower, median and upper must not change places")

    def curve(self, coordinate: float) -> ForceCurve:
        """Return the curve at a coordinate: 0 lower, 0.5 median, 1 upper.

        Forces at equal penetration are interpolated linearly, so the curve rises wherever the
        bounds rise.

        Raises
        ------
        ValueError
            If the coordinate is not within 0 to 1.
        """
        if not 0.0 <= coordinate <= 1.0:
            raise ValueError(f"a corridor coordinate lies within 0 and 1, given {coordinate}")
        share = abs(2.0 * coordinate - 1.0)
        below, above = self._halves
        knots, median, bound = below if coordinate < 0.5 else above
        force = (1.0 - share) * median + share * bound
        return ForceCurve(knots, force, self.median.unloading_ratio, self.median.damping)

    @functools.cached_property
    def _halves(self) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
        """Knots (m) of the lower and the upper half, with the median's and the bound's forces."""

        def half(bound: ForceCurve) -> tuple[Array, Array, Array]:
            knots = np.union1d(self.median.penetration, bound.penetration)
            return knots, self.median.at(knots), bound.at(knots)

        return half(self.lower), half(self.upper)


MOST_GIVEN = 16
"""Largest number of knots of a curve that is read; effects add others to it."""
STEEPEST = 1e12
"""Largest slope (N/m) of a curve that is read: steel of a cross-section of 1 m2 and a length of
0.2 m (assumed); a slip of the decimal point is steeper."""


def read_curve(knots: Any, unloading_ratio: float, damping: float = 0.0) -> ForceCurve:
    """Return a loading curve from its knots.

    Parameters
    ----------
    knots : sequence of pairs
        Penetration (m) and force (N), from (0, 0).
    unloading_ratio : float
        Unloading slope over secant slope.
    damping : float
        N s/m.

    Raises
    ------
    ValueError
        If these are no pairs, no loading curve, or one that is steeper than any structure.
    """
    table = np.array(knots, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != 2:
        raise ValueError("must be a list of pairs [penetration m, force N]")
    if len(table) > MOST_GIVEN:
        raise ValueError(f"a loading curve takes 2 to {MOST_GIVEN} knots, given {len(table)}")
    curve = ForceCurve(table[:, 0].copy(), table[:, 1].copy(), unloading_ratio, damping)
    steep = np.diff(curve.force) > STEEPEST * np.diff(curve.penetration)
    if steep.any():
        k = int(steep.argmax())
        raise ValueError(
            f"a loading curve rises by {STEEPEST:g} N/m at most, given {knots[k]} to {knots[k + 1]}"
        )
    return curve


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
            return read_curve(
                row[key], float(row["unloading_ratio"]), float(row.get("damping", 0.0))
            )
        except KeyError as error:
            raise ValueError(f"corridor: {error.args[0]} is missing") from None
        except (ValueError, IndexError, TypeError) as error:
            raise ValueError(f"corridor: {key}: {error}") from None

    return Corridor(curve("lower"), curve("median"), curve("upper"))


def load_corridors(name: str) -> dict[str, Corridor]:
    """Return the corridors of a data file by zone.

    Parameters
    ----------
    name : str
        A file of the data folder ``corridors``, or the path of a corridor file (``.toml``).

    Raises
    ------
    ValueError
        If the file does not exist or its content is invalid.
    """
    if not isinstance(name, str):
        raise ValueError(f"corridor must be a name or the path of a file, given {name!r}")
    try:
        if name.endswith(".toml"):
            table = tomllib.loads(Path(name).read_text(encoding="utf-8-sig"))
        elif name in data.names("corridors"):
            table = data.load(f"corridors/{name}.toml")
        else:
            known = ", ".join(data.names("corridors"))
            raise ValueError(f"choose one of {known}, or give the path of a .toml file")
        zones = table.get("zones")
        if not isinstance(zones, dict) or not all(isinstance(row, dict) for row in zones.values()):
            raise ValueError("has no tables [zones.<name>]")
        return {zone: read_corridor(row) for zone, row in zones.items()}
    except (OSError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise ValueError(f"corridor {name!r}: {error}") from None


def build_corridor(curves: Sequence[ForceCurve], method: str = "quantiles") -> Corridor:
    """Return the corridor of a set of measured curves.

    Parameters
    ----------
    curves : sequence of ForceCurve
        Three or more.
    method : {"quantiles", "components"}
        Pointwise quantiles of the forces at equal penetration; or the mean of the logarithms of the
        forces plus and minus the normal quantile times the first principal component, which makes
        the car as a whole stiffer or softer.

    Raises
    ------
    ValueError
        If there are fewer than three curves or the method is unknown.

    Notes
    -----
    The bounds are the 5 and 95 % quantiles. Curves are compared up to the median of their largest
    penetrations; a shorter curve is extrapolated linearly.
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, given {method!r}")
    if len(curves) < MIN_CURVES:
        raise ValueError(f"a corridor takes {MIN_CURVES} or more curves, given {len(curves)}")
    end = float(np.median([curve.penetration[-1] for curve in curves]))
    grid = np.linspace(0.0, end, 201)[1:]
    forces = np.array([curve.at(grid) for curve in curves])
    tail = 0.5 * (1.0 - LEVEL)
    if method == "quantiles":
        bounds = np.quantile(forces, [tail, 0.5, 1.0 - tail], axis=0)
    else:
        logs = np.log(forces)
        mean = logs.mean(axis=0)
        _, size, shapes = np.linalg.svd(logs - mean, full_matrices=False)
        reach = special.ndtri(1.0 - tail) * size[0] / np.sqrt(len(curves) - 1.0) * shapes[0]
        reach *= np.sign(reach.sum()) or 1.0
        # The exponential of a sum of components need not rise; a force law must.
        bounds = np.maximum.accumulate(np.exp(mean + np.array([[-1.0], [0.0], [1.0]]) * reach), 1)
        # Where the component changes sign, the bounds swap.
        bounds = np.sort(bounds, axis=0)
    depth = np.concatenate([[0.0], grid])
    forces = np.pad(bounds, ((0, 0), (1, 0)))
    knots = choose_knots(depth, forces[1], MAX_KNOTS)
    ratio = float(np.median([curve.unloading_ratio for curve in curves]))
    # After least squares the bounds may cross within rounding.
    fitted = np.sort([fit_loading(depth, f, knots) for f in forces], axis=0)
    return Corridor(*(ForceCurve(knots, f, ratio) for f in fitted))


def corridor_text(corridor: Corridor, zone: str, title: str, source: str) -> str:
    """Return a corridor file with one zone, which ``load_corridors`` can read.

    Parameters
    ----------
    corridor : Corridor
    zone : str
        Name of the zone.
    title, source : str
        Written into the file.

    Returns
    -------
    str
        TOML text.
    """

    def knots(curve: ForceCurve) -> str:
        pairs = zip(curve.penetration, curve.force, strict=True)
        return "[" + ", ".join(f"[{d:.6g}, {f:.6g}]" for d, f in pairs) + "]"

    return "\n".join(
        [
            "# Stiffness corridor: [penetration m, force N] at the lower, median and upper bound.",
            "",
            f"title = {_quoted(title)}",
            f"source = {_quoted(source)}",
            "",
            f"[zones.{_quoted(zone)}]",
            f"unloading_ratio = {corridor.median.unloading_ratio:.6g}",
            f"damping = {corridor.median.damping:.6g}",
            f"lower = {knots(corridor.lower)}",
            f"median = {knots(corridor.median)}",
            f"upper = {knots(corridor.upper)}",
            "",
        ]
    )


def _quoted(text: str) -> str:
    """Return a TOML basic string: JSON quoting, except for characters that TOML writes as is."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")
