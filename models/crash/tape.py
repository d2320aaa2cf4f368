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
    """

    wrap_around: float
    leading_edge: float


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
    return Tape(wrap_around_distance(vehicle.name, zone, static), hood_edge_distance(vehicle.name))


Measured = Callable[[Scenario, int, Array], Tape]
"""What measures distances on a car; see ``tape_on_zones``."""
