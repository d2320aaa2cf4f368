"""The state in which a body leaves the car, and Searle's bounds from there.

Searle's relation (J. Searle, SAE 831622, 1983; 930659, 1993 [recalled]) is about a body that leaves
at a speed v under an angle, flies, lands and slides with friction mu to rest, s away and H lower::

    v (cos a + mu sin a) = sqrt(2 mu g (s - mu H))

so that v lies between ``sqrt(2 mu g (s - mu H) / (1 + mu^2))`` and ``sqrt(2 mu g (s - mu H))`` for
any upward angle: bodies that leave falling are outside its bounds, not outside its relation. It
says nothing about the way on the car, nor that v is the car's speed.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import NDArray

from models.criteria.units import STANDARD_GRAVITY
from models.registry import load_model
from models.vehicle.profile import load_vehicle
from studies.validation.sweep import CHUNK

Array = NDArray[np.float64]

VEHICLE = "family_car_1990s"
"""The car of the model's default."""
TOUCH = 1.0
"""N of the car's forces on the body above which they are in contact (assumed)."""


def separations(cases: Sequence[Mapping[str, float]], *, workers: int = -1) -> pd.DataFrame:
    """Return how runs leave the car and what follows.

    Columns: ``along``, ``up`` (m/s) of the centre of gravity, ``fall`` and ``way`` (m) from there
    to rest, ``friction``. Runs that never leave the car, or land before they do, are left out.

    Parameters
    ----------
    cases : inputs that differ from nominal. workers : processes, -1 for one a core.
    """
    parts = [list(cases[k : k + CHUNK]) for k in range(0, len(cases), CHUNK)]
    found = Parallel(n_jobs=workers)(delayed(_separate)(part) for part in parts)
    rows = [row for part in found for row in part]
    return pd.DataFrame(rows, columns=["along", "up", "fall", "way", "friction"])


def _separate(cases: Sequence[Mapping[str, float]]) -> list[tuple[float, ...]]:
    model = load_model("multibody")
    zones = [f"contact_force_{zone.name}" for zone in load_vehicle(VEHICLE).zones]
    centre = [f"centre_of_gravity_{axis}" for axis in "xyz"]
    rows: list[tuple[float, ...]] = []
    for case in cases:
        run = model.observe(case, [*zones, "contact_force_road", *centre])
        force = run.histories["contact_force"]
        car = sum(force.channels[name.removeprefix("contact_force_")] for name in zones)
        touched = np.flatnonzero(np.asarray(car) > TOUCH)
        place = np.stack([run.histories["centre_of_gravity"].channels[axis] for axis in "xyz"])
        landed = np.flatnonzero(force.channels["road"] > TOUCH)
        if not touched.size or not run.end_reason.startswith("rest_on_road"):
            continue
        k = int(touched[-1]) + 1
        first = landed[landed > touched[0]]
        # Feet may touch the road from the start; what counts is the body's weight on it later.
        if k + 1 >= place.shape[1] or (first.size and k > first[-1]):
            continue
        rate = (place[:, k + 1] - place[:, k]) * _rate(force.time)
        way = float(np.hypot(*(place[:2, -1] - place[:2, k])))
        rows.append(
            (
                float(np.hypot(rate[0], rate[1])),
                float(rate[2]),
                float(place[2, k] - place[2, -1]),
                way,
                float(run.inputs["friction_body_road"]),
            )
        )
    return rows


def _rate(time: Array) -> float:
    return 1.0 / float(time[1] - time[0])


def searle(distance: Array, friction: Array | float) -> tuple[Array, Array]:
    """Return Searle's lowest and highest speed (m/s) for a throw distance (m)."""
    highest = np.sqrt(2.0 * friction * STANDARD_GRAVITY * distance)
    return highest / np.sqrt(1.0 + np.square(friction)), highest


def _searle_of(table: pd.DataFrame) -> tuple[Array, Array]:
    """Return Searle's bounds (m/s) for the ways of runs, each less what its fall is worth."""
    mu = table["friction"].to_numpy()
    reach = table["way"].to_numpy() - mu * table["fall"].to_numpy()
    return searle(np.maximum(reach, 0.0), mu)


def share_within_searle(table: pd.DataFrame) -> float:
    """Return the share within Searle's bounds of runs that leave the car upwards (NaN: none)."""
    rising = table[table["up"] >= 0.0]
    if rising.empty:
        return math.nan
    speed = np.hypot(rising["along"].to_numpy(), rising["up"].to_numpy())
    lowest, highest = _searle_of(rising)
    return float(np.mean((lowest <= speed) & (speed <= highest)))


def median_searle_ratio(table: pd.DataFrame) -> float:
    """Return the median speed by Searle's relation, each run at its own angle, over its speed."""
    own = table["along"].to_numpy() + table["friction"].to_numpy() * table["up"].to_numpy()
    return float(np.median(_searle_of(table)[1] / own))
