"""Every number of a map's report, from the table of runs."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy import statistics
from mcstudy.statistics import Estimate
from mcstudy.studyfile.study_outputs import report_outputs
from mcstudy.typed_json import Real
from models.protocol import Model
from studies.response_map.grid import MapPoint, map_points
from studies.response_map.schema import MapStudy
from studies.runs import RunEnds, check_failure_rate

NOTHING = Estimate(float("nan"), float("nan"), float("nan"))


@dataclass(frozen=True)
class GridPoint:
    """A point of a map.

    Attributes
    ----------
    coordinates : values of the panel, if there are panels, and of the axes, in their units.
    region : region of the surface, empty if the axes are no places.
    position : x, y, z on the surface in m, empty if the axes are no places.
    """

    coordinates: Sequence[float]
    region: str
    position: Sequence[float]


@dataclass(frozen=True)
class Cell:
    """An output at a point, over the draws of the other inputs.

    Attributes
    ----------
    n : number of runs with a value.
    median : with its interval; of one run the value itself.
    low, high : 5 % and 95 % quantile.
    above : probability above each limit of the output.
    """

    n: int
    median: Estimate
    low: Real
    high: Real
    above: Sequence[Estimate]


@dataclass(frozen=True)
class Band:
    """The share of a panel's points in a band of an output.

    Attributes
    ----------
    low, high : limits of the band, NaN if it is open there.
    share : mean over the draws, with its interval.
    lowest, highest : 5 % and 95 % quantile over the draws.
    """

    low: Real
    high: Real
    share: Estimate
    lowest: Real
    highest: Real


@dataclass(frozen=True)
class MappedOutput:
    """An output over the points.

    Attributes
    ----------
    unit : of the output.
    limits : between its bands, in its unit.
    cells : one a point.
    bands : shares of the points, by value of the panel ("" without panels); none without limits.
    """

    unit: str
    limits: Sequence[float]
    cells: Sequence[Cell]
    bands: Mapping[str, Sequence[Band]]


@dataclass(frozen=True)
class MapAnalysis(RunEnds):
    """Every number of a map's report.

    Attributes
    ----------
    axes : units by name of the panel's input, if there are panels, and of the axes.
    draws : number of draws at every point.
    points : points of the map.
    outputs : reported outputs by name.
    """

    axes: Mapping[str, str]
    draws: int
    points: Sequence[GridPoint]
    outputs: Mapping[str, MappedOutput]


@dataclass(frozen=True)
class _Described:
    """The study as ``RunEnds`` describes it: its grid counts among the inputs."""

    kind: str
    inputs: Mapping[str, object]
    max_failure_rate: float


def analyse(study: MapStudy, model: Model, runs: pd.DataFrame) -> MapAnalysis:
    """Return every number that the report prints.

    Parameters
    ----------
    study : MapStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Runs of whole draws, one after the other.

    Raises
    ------
    StudyError
        If more runs failed than the study allows.
    """
    axes = {**study.panels, **study.axes}
    points = map_points(study, model)
    described = _Described(study.kind, {**axes, **study.inputs}, study.max_failure_rate)
    ended, complete = check_failure_rate(described, model, runs)
    draws = len(runs) // len(points)
    # Samples of a design with replicates are not independent.
    groups = None
    if study.design.size > 1:
        groups = runs["replicate"].to_numpy(dtype=np.int64).reshape(draws, -1)[:, 0]
    unit = {item.name: item.unit for item in model.outputs}
    outputs = {}
    for name in report_outputs(study, model):
        values = np.where(complete, runs[name].to_numpy(dtype=float), np.nan)
        table = values.reshape(draws, len(points))
        limits = study.report.limits.get(name, [])
        outputs[name] = MappedOutput(
            unit=unit[name],
            limits=limits,
            cells=[_cell(column, limits, groups) for column in table.T],
            bands=_bands(study, points, table, limits, groups) if limits else {},
        )
    return MapAnalysis(
        **vars(ended),
        axes={name: axis.unit for name, axis in axes.items()},
        draws=draws,
        points=[_grid_point(point) for point in points],
        outputs=outputs,
    )


def _grid_point(point: MapPoint) -> GridPoint:
    place = point.place
    if place is None:
        return GridPoint(list(point.coordinates), "", [])
    return GridPoint(list(point.coordinates), place.region, place.position.tolist())


def _cell(
    values: NDArray[np.float64], limits: Sequence[float], groups: NDArray[np.int64] | None
) -> Cell:
    """Return an output at a point from its values (n,), NaN where a run has none."""
    held = np.isfinite(values)
    part = values[held]
    own = None if groups is None else groups[held]
    if not part.size:
        return Cell(0, NOTHING, np.nan, np.nan, [NOTHING for _ in limits])
    if part.size == 1:
        one = float(part[0])
        above = [Estimate(float(one > limit), np.nan, np.nan) for limit in limits]
        return Cell(1, Estimate(one, np.nan, np.nan), np.nan, np.nan, above)
    low, high = np.quantile(part, [0.05, 0.95]).tolist()
    return Cell(
        int(part.size),
        statistics.quantile(part, 0.5, own),
        low,
        high,
        [statistics.probability(part > limit, own) for limit in limits],
    )


def _bands(
    study: MapStudy,
    points: Sequence[MapPoint],
    table: NDArray[np.float64],
    limits: Sequence[float],
    groups: NDArray[np.int64] | None,
) -> dict[str, list[Band]]:
    """Return the shares of the points (n draws, p points) in the bands, panel by panel."""
    found = {}
    edges = [-np.inf, *limits, np.inf]
    for label, own in panels_of(study, points).items():
        part = table[:, own]
        valid = np.isfinite(part).sum(axis=1)
        kept = valid > 0
        part, valid = part[kept], valid[kept]
        held = None if groups is None else groups[kept]
        bands = []
        for low, high in itertools.pairwise(edges):
            shares = ((part > low) & (part <= high)).sum(axis=1) / valid
            ends = np.quantile(shares, [0.05, 0.95]) if len(shares) > 1 else (np.nan, np.nan)
            bands.append(
                Band(
                    low=low if np.isfinite(low) else np.nan,
                    high=high if np.isfinite(high) else np.nan,
                    share=statistics.mean(shares, held) if len(shares) else NOTHING,
                    lowest=float(ends[0]),
                    highest=float(ends[1]),
                )
            )
        found[label] = bands
    return found


def panels_of(study: MapStudy, points: Sequence[MapPoint]) -> dict[str, NDArray[np.int64]]:
    """Return the rows of the points by the value of their panel, "" if there are no panels."""
    if not study.panels:
        return {"": np.arange(len(points))}
    first = np.array([point.coordinates[0] for point in points])
    (axis,) = study.panels.values()
    return {f"{value:g}": np.flatnonzero(first == value) for value in axis.numbers}
