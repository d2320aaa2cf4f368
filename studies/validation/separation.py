"""The state in which a body leaves the car, and Searle's bounds from there.

Searle's relation (J. Searle, SAE 831622, 1983; 930659, 1993 [recalled]) is about a body that leaves
at a speed v under an angle, flies, lands and slides with friction mu to rest, s away and H lower::

    v (cos a + mu sin a) = sqrt(2 mu g (s - mu H))

so that v lies between ``sqrt(2 mu g (s - mu H) / (1 + mu^2))`` and ``sqrt(2 mu g (s - mu H))`` for
any upward angle: bodies that leave falling are outside its bounds, not outside its relation. It
does not cover the motion on the car, nor does it equate v with the car's speed.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.execution.evaluator import Evaluator
from mcstudy.execution.workers import parallel_backend
from models.protocol import OK, Model, complete_inputs
from models.registry import load_model
from models.vehicle.profile import load_vehicle
from studies.throw_formulae import searle

Array = NDArray[np.float64]

VEHICLE = "family_car_1990s"
"""The car of the model's default."""
TOUCH = 1.0
"""N of the car's forces on the body above which they are in contact (assumed)."""


COLUMNS = ("along", "up", "fall", "way", "friction")
NO_SEPARATION = "no_separation"
"""Status of a run that never leaves the car, or lands before it does."""


def separations(cases: Sequence[Mapping[str, float]], *, workers: int = -1) -> pd.DataFrame:
    """Return the separation of runs from the car and the way to rest.

    Columns: ``along``, ``up`` (m/s) of the centre of gravity, ``fall`` and ``way`` (m) from there
    to rest, ``friction``. Runs that never leave the car, or land before they do, are left out.

    Parameters
    ----------
    cases : sequence of mapping
        Inputs that differ from nominal.
    workers : int
        Processes, -1 for one per core.
    """
    model = load_model("multibody")
    names = [item.name for item in model.inputs]
    rows = np.array([[complete_inputs(model, case)[name] for name in names] for case in cases])
    evaluator = Evaluator(_separate, names, COLUMNS)
    with parallel_backend(workers):
        batch = evaluator.evaluate(rows)
    left = np.array(batch.status) == OK
    return pd.DataFrame(batch.outputs[left], columns=COLUMNS)


def _separate(
    names: Sequence[str], rows: Array, started: Callable[[int], None]
) -> tuple[Array, list[str]]:
    """Return how rows leave the car, and whether they do."""
    model = load_model("multibody")
    outputs, status = np.full((len(rows), len(COLUMNS)), np.nan), []
    for k, row in enumerate(rows.tolist()):
        started(k)
        found = _separation(model, dict(zip(names, row, strict=True)))
        status.append(NO_SEPARATION if found is None else OK)
        if found is not None:
            outputs[k] = found
    return outputs, status


def _separation(model: Model, inputs: Mapping[str, float]) -> tuple[float, ...] | None:
    """Return how a run leaves the car, in the order of ``COLUMNS``, or None."""
    zones = [f"contact_force_{zone.name}" for zone in load_vehicle(VEHICLE).zones]
    centre = [f"centre_of_gravity_{axis}" for axis in "xyz"]
    run = model.observe(inputs, [*zones, "contact_force_road", *centre])
    force = run.histories["contact_force"]
    car = sum(force.channels[name.removeprefix("contact_force_")] for name in zones)
    touched = np.flatnonzero(np.asarray(car) > TOUCH)
    place = np.stack([run.histories["centre_of_gravity"].channels[axis] for axis in "xyz"])
    landed = np.flatnonzero(force.channels["road"] > TOUCH)
    if not touched.size or not run.end_reason.startswith("rest_on_road"):
        return None
    k = int(touched[-1]) + 1
    first = landed[landed > touched[0]]
    # Feet may touch the road from the start; what counts is the body's weight on it later.
    if k + 1 >= place.shape[1] or (first.size and k > first[-1]):
        return None
    rate = (place[:, k + 1] - place[:, k]) * _rate(force.time)
    way = float(np.hypot(*(place[:2, -1] - place[:2, k])))
    return (
        float(np.hypot(rate[0], rate[1])),
        float(rate[2]),
        float(place[2, k] - place[2, -1]),
        way,
        float(run.inputs["friction_body_road"]),
    )


def _rate(time: Array) -> float:
    return 1.0 / float(time[1] - time[0])


def _searle_of(table: pd.DataFrame) -> tuple[Array, Array]:
    """Return Searle's bounds (m/s) for the ways of runs, each less the effect of its fall."""
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
