"""Speed of the distance field beside trimesh's and of a facet crash beside the ellipsoid model's.

Run with ``make benchmark``; no assertion here is timed. The ratios are printed at the end.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import trimesh

from models.protocol import Model
from models.registry import load_model
from models.vehicle.car import load_car
from models.vehicle.surface.field import distances

NAME = "family_car_1990s"
POINTS = 100_000
medians: dict[str, float] = {}


@pytest.fixture(scope="module", autouse=True)
def ratio() -> Iterator[None]:
    yield
    if {"field", "trimesh"} <= set(medians):
        ours, theirs = 1e9 * medians["field"] / POINTS, 1e9 * medians["trimesh"] / 1000
        print(f"\ndistance and gradient: {ours:.0f} ns a point, trimesh {theirs:.0f} ns")
    if {"facet", "multibody"} <= set(medians):
        print(f"facet crash over ellipsoid crash: {medians['facet'] / medians['multibody']:.2f}")


def near_the_front() -> Any:
    """Return points within 60 mm of the car's front in the order of a path over it."""
    mesh = load_car(NAME).mesh
    on = mesh.corners.mean(axis=1)
    on = on[on[:, 0] > -2.0]
    rng = np.random.default_rng(3)
    chosen = np.sort(rng.integers(0, len(on), POINTS))
    return on[chosen] + rng.uniform(-0.035, 0.035, (POINTS, 3))


def test_distance_to_a_car(benchmark: Any) -> None:
    field, points = load_car(NAME).field(), near_the_front()
    distances(field, points)
    benchmark(distances, field, points)
    medians["field"] = float(benchmark.stats.stats.median) if benchmark.stats else float("nan")


def test_distance_to_a_car_by_trimesh(benchmark: Any) -> None:
    mesh = load_car(NAME).mesh
    query = trimesh.proximity.ProximityQuery(trimesh.Trimesh(mesh.nodes, mesh.facets))
    points = near_the_front()[:: POINTS // 1000]
    query.signed_distance(points[:10])
    benchmark.pedantic(query.signed_distance, (points,), rounds=3)
    medians["trimesh"] = float(benchmark.stats.stats.median) if benchmark.stats else float("nan")


@pytest.mark.parametrize("name", ["multibody", "facet"])
def test_the_nominal_crash(benchmark: Any, name: str) -> None:
    model: Model = load_model(name)
    rows = np.array([[item.nominal for item in model.inputs]])
    model.run_batch(rows)
    benchmark(model.run_batch, rows)
    medians[name] = float(benchmark.stats.stats.median) if benchmark.stats else float("nan")
