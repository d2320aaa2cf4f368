"""Force of a car on one segment that is held and moved over its front."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.compilation import kernel
from models.crash.car_contact import apply_car_contacts
from models.crash.surfaces import CHANNELS, empty_contacts, update_surfaces
from models.multibody.setup import Crash
from models.multibody.tree import empty_loads, empty_motion
from models.rotation import axis_rotation, matrix_of

Array = NDArray[np.float64]

FAR = 50.0
"""Place (m ahead of the car) of the segments that are not looked at."""


@kernel
def _press(front, ellipsoids, car, motion, loads, contacts, tree, power):
    update_surfaces(ellipsoids, motion, contacts)
    apply_car_contacts(front, ellipsoids, car, motion, loads, contacts, tree, power, 0.0)


def force_along(crash: Crash, front: Any, segment: int, places: Array) -> Array:
    """Return the force of the car on a segment that lies across it, at rest in every place.

    Largest penetrations are forgotten between the places: every place is a first loading.

    Parameters
    ----------
    crash : Crash
        Gives the body and its contact laws.
    front : named tuple
        Geometry of the car's front, one of the types of ``models.crash.front``.
    segment : int
        Row of the segment, whose long axis is turned across the car.
    places : (n, 3) array
        Ellipsoid centre in the car's frame, m.

    Returns
    -------
    (n, 3) array
        N, in the car's frame.
    """
    count = len(crash.tree.mass)
    ellipsoids = crash.scenario.ellipsoids
    zones, pairs = len(crash.scenario.vehicle.zones), len(ellipsoids.pairs)
    motion, loads = empty_motion(count), empty_loads(count)
    motion.rotation[:] = np.eye(3)
    # A quarter turn about x lays the long axis z across the car.
    turn = np.array(matrix_of(axis_rotation(0, 0.5 * np.pi)))
    motion.rotation[segment] = turn
    motion.centre[:] = [FAR, 0.0, FAR]
    offset = turn @ ellipsoids.offset[segment]
    found = np.empty((len(places), 3))
    for k, place in enumerate(places):
        contacts = empty_contacts(count, zones, pairs)
        contacts.engaged[:] = True
        motion.centre[segment] = place - offset
        loads.force[:] = 0.0
        _press(
            front, ellipsoids, np.zeros(6), motion, loads, contacts, crash.tree,
            np.zeros(CHANNELS),
        )  # fmt: skip
        found[k] = contacts.car_force[segment]
    return found
