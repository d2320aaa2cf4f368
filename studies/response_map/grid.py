"""The points of a map: values of its axes, and where they lie on a car's surface."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.errors import UserError
from mcstudy.studyfile.schema import Value
from mcstudy.studyfile.study_inputs import fixed_values
from models.headform.facet_target import FacetTarget, ImpactPoint
from models.headform.model import HeadformModel
from models.protocol import Model
from studies.response_map.schema import MapStudy

Array = NDArray[np.float64]

PLACE = ("wrap_around_distance", "lateral_position")
"""Axes that are places on a car's surface."""
SIDE = 1.0
"""Tangent of a surface's slope across the car beyond which a point lies on its side (45 deg, side
reference line of EEVC WG17 and Euro NCAP [recalled])."""


@dataclass(frozen=True)
class MapPoint:
    """A point of a map.

    Attributes
    ----------
    coordinates : tuple of float
        Values of the axes and of the panel, in their units.
    place : ImpactPoint or None
        Where it lies on the surface.
    """

    coordinates: tuple[float, ...]
    place: ImpactPoint | None = None


def surface_of(study: MapStudy, model: Model) -> FacetTarget | None:
    """Return the surface whose places are the axes of a map, or None."""
    if not isinstance(model, HeadformModel) or not isinstance(model.target, FacetTarget):
        return None
    return model.target if set(study.axes) == set(PLACE) else None


def map_points(study: MapStudy, model: Model) -> list[MapPoint]:
    """Return the points of a map, the last axis varying fastest.

    Points of a car's surface outside the regions chosen, beside it or on its sides are left out.

    Raises
    ------
    UserError
        If an axis does not fit the model, a region is unknown, or no point is left.
    """
    for table, axes in (("axes", study.axes), ("panels", study.panels)):
        for name, axis in axes.items():
            for value in (axis.numbers[0], axis.numbers[-1]):
                try:
                    fixed_values({name: Value(value=value, unit=axis.unit)}, model)
                except UserError as error:
                    raise UserError(str(error).replace("fixed.", f"{table}.", 1)) from None
    axes = {**study.panels, **study.axes}
    values = [axis.numbers for axis in axes.values()]
    surface = surface_of(study, model)
    if surface is None:
        if study.points.regions is not None:
            raise UserError(
                "points.regions: the map's axes are no places on a surface; they are for a "
                f'headform with surface = "facet" over {" and ".join(PLACE)}'
            )
        return [MapPoint(point) for point in itertools.product(*values)]
    known = surface.mesh.names
    for name in study.points.regions or []:
        if name not in known:
            raise UserError(
                f"points.regions: the surface has no region {name!r}; it has {', '.join(known)}"
            )
    wanted = study.points.regions or known
    scale = [units.factor(axes[name].unit, "m") for name in PLACE]
    rows = [list(axes).index(name) for name in PLACE]
    found = []
    for point in itertools.product(*values):
        place = surface.impact_point(*(s * point[row] for s, row in zip(scale, rows, strict=True)))
        if place is None or place.region not in wanted:
            continue
        if abs(place.normal[1]) <= SIDE * place.normal[2]:
            found.append(MapPoint(point, place))
    if not found:
        raise UserError("axes: no point lies on the regions chosen")
    return found


def map_columns(
    study: MapStudy, model: Model, points: list[MapPoint], draws: dict[str, Array]
) -> dict[str, Array]:
    """Return the values of every input of the model for all points of the first draw, and so on.

    Parameters
    ----------
    study : MapStudy
    model : Model
    points : list of MapPoint
        p of them.
    draws : dict
        (n,) values of every input, by name.

    Returns
    -------
    dict
        (n p,) values by name, in the model's units.
    """
    n = len(next(iter(draws.values())))
    columns = {name: np.repeat(values, len(points)) for name, values in draws.items()}
    unit = {item.name: item.unit for item in model.inputs}
    for k, (name, axis) in enumerate({**study.panels, **study.axes}.items()):
        factor = units.factor(axis.unit, unit[name])
        columns[name] = np.tile([factor * point.coordinates[k] for point in points], n)
    return columns
