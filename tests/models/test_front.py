"""The car's front as a seam: a geometry that the product does not have answers as zones do."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from models.compilation import inlined_kernel
from models.crash.front import FRONTS, patch_count, separation_of
from models.crash.surfaces import empty_contacts, shape_of
from models.multibody.model import MultibodyModel
from models.multibody.setup import build_crash
from models.pedestrian.anthropometry import SEGMENTS
from models.vehicle.zones import Zones

LEAN = 0.3
"""rad by which the wall leans back."""


class Wall(NamedTuple):
    """A plane through a point (m) of the car's frame with a normal, without borders."""

    point: NDArray[np.float64]
    normal: NDArray[np.float64]


@inlined_kernel
def one(wall):
    return 1


@inlined_kernel
def wall_separation(wall, ellipsoids, contacts, patch, i, cx, cy, cz, cosine, sine):
    n = wall.normal
    A = shape_of(contacts, i)
    ax = A[0] * n[0] + A[1] * n[1] + A[2] * n[2]
    ay = A[1] * n[0] + A[3] * n[1] + A[4] * n[2]
    az = A[2] * n[0] + A[4] * n[1] + A[5] * n[2]
    h = math.sqrt(ax * n[0] + ay * n[1] + az * n[2])
    away = (cx - wall.point[0]) * n[0] + (cy - wall.point[1]) * n[1] + (cz - wall.point[2]) * n[2]
    px, py, pz = cx - ax / h, cy - ay / h, cz - az / h
    return away - h, n[0], n[1], n[2], px, py, pz, 1.0, 0


@pytest.fixture
def wall() -> Iterator[Wall]:
    zones = FRONTS[Zones]
    FRONTS[Wall] = zones._replace(patch_count=one, separation_of=wall_separation)
    yield Wall(np.array([0.0, 0.0, 0.0]), np.array([math.cos(LEAN), 0.0, math.sin(LEAN)]))
    del FRONTS[Wall]


@numba.njit
def nearest(front, ellipsoids, contacts):
    """Return the segment that is nearest to a front, and the nine answers of the front."""
    best, found = -1, separation_of(front, ellipsoids, contacts, 0, 0, 9.0, 9.0, 9.0, 1.0, 0.0)
    for i in range(contacts.centre.shape[0]):
        x, y, z = contacts.centre[i]
        for patch in range(patch_count(front)):
            answer = separation_of(front, ellipsoids, contacts, patch, i, x, y, z, 1.0, 0.0)
            if answer[0] < found[0]:
                best, found = i, answer
    return best, found


def test_a_geometry_of_ones_own_answers_where_the_body_is_nearest(wall: Wall) -> None:
    model = MultibodyModel()
    crash = build_crash({item.name: item.nominal for item in model.inputs}, model.vehicle)
    assert crash is not None
    ellipsoids = crash.scenario.ellipsoids
    contacts = empty_contacts(len(SEGMENTS), 1, len(ellipsoids.pairs))
    rng = np.random.default_rng(3)
    contacts.centre[:] = rng.normal([0.0, 0.0, 1.0], 0.2, contacts.centre.shape)
    squares = ellipsoids.square
    for i, (a, b, c) in enumerate(squares):
        contacts.shape[i] = [a, 0.0, 0.0, b, 0.0, c]
    # Closed form: the centre's distance less the support of the ellipsoid along the normal.
    support = np.sqrt((squares * wall.normal**2).sum(axis=1))
    distance = contacts.centre @ wall.normal - support
    segment, (separation, *answers) = nearest(wall, ellipsoids, contacts)
    assert segment == int(np.argmin(distance))
    assert separation == pytest.approx(distance.min(), abs=1e-12)
    normal, point, weight, region = answers[:3], answers[3:6], answers[6], answers[7]
    np.testing.assert_allclose(normal, wall.normal)
    assert wall.normal @ point == pytest.approx(separation, abs=1e-12)
    assert (weight, region) == (1.0, 0)
