"""Distances that are measured with a tape on the car after an accident."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.crash.scenario import Scenario
from models.vehicle.profile import (
    hood_edge_distance,
    static_point,
    surface_point,
    wrap_around_distance,
    wrap_around_path,
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tape:
    """Distances measured with a tape on the car.

    Attributes
    ----------
    wrap_around : float
        Wrap-around distance of the head's first contact, m.
    leading_edge : float
        Wrap-around distance of the hood's leading edge, m.
    path : (k, 3) array
        Corners of the tape from the road to the head's first contact, static car, m.
    """

    wrap_around: float
    leading_edge: float
    path: Array


def tape_on_zones(scenario: Scenario, zone: int, point: Array) -> Tape:
    """Return what a tape over the zones in side view measures.

    Parameters
    ----------
    scenario : Scenario
    zone : int
        Row of the zone that the head struck.
    point : (3,) array
        Deepest point of the head at first contact, frame of the diving car, m.
    """
    vehicle = scenario.vehicle
    surface = surface_point(scenario.zones, zone, point[[0, 2]])
    static = static_point(vehicle, scenario.dive_angle, surface)
    path = wrap_around_path(vehicle.name, zone, static)
    return Tape(
        wrap_around_distance(vehicle.name, zone, static),
        hood_edge_distance(vehicle.name),
        path_at(path, float(point[1])),
    )


def path_at(path: Array, y: float) -> Array:
    """Return a path (k, 3) from its x and z (k, 2) and its lateral station, m."""
    return np.stack([path[:, 0], np.full(len(path), y), path[:, 1]], axis=1)


Measured = Callable[[Scenario, int, Array], Tape]
"""What measures distances on a car; see ``tape_on_zones``."""
