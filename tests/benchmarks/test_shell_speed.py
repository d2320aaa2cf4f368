"""Speed of the shells: the hood of the family car under a push, in million element steps a second.

Run with ``make benchmark``; no assertion here is timed. Small meshes run in the ordinary tests.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from models.shells.settling import settle
from models.vehicle.profile import load_vehicle
from models.vehicle.structure.build import build_structure

STEPS = 200
speed: dict[float, float] = {}


@pytest.fixture(scope="module", autouse=True)
def ratio() -> Iterator[None]:
    yield
    for size, rate in speed.items():
        print(f"\nhood at {1e3 * size:g} mm: {1e-6 * rate:.1f} million element steps a second")


@pytest.mark.parametrize("size", [0.04, 0.02])
def test_steps_of_a_hood(benchmark: Any, size: float) -> None:
    structure = build_structure(load_vehicle("family_car_1990s"), size, only=("hood",))
    body = structure.assemble()
    body.awake[:] = True
    # The middle moves down at 8 m/s: it yields, as under a headform.
    near = np.linalg.norm(body.start - np.median(body.start, axis=0), axis=1) < 0.1
    body.nodes.velocity[near, 2] = -8.0
    settle(body, body.step, 1)
    benchmark.pedantic(settle, (body, body.step, STEPS), rounds=3)
    if benchmark.stats:
        speed[size] = structure.element_count * STEPS / float(benchmark.stats.stats.median)
    assert np.isfinite(body.nodes.position).all()
