"""The mesh of a car and the distance to it, against shapes of known distance and trimesh."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from builders import Array
from numpy.typing import NDArray

from models.vehicle.profile import load_vehicle, vehicle_names
from models.vehicle.surface import store
from models.vehicle.surface.field import DistanceField, distances
from models.vehicle.surface.field_build import build_field
from models.vehicle.surface.generator import LAMP, generate_surface, laws_of_regions
from models.vehicle.surface.mesh import SurfaceMesh

CAR = "family_car_1990s"
ONE = np.zeros(1, dtype=np.int64)


def mesh_of(shape: trimesh.Trimesh) -> SurfaceMesh:
    facets = np.asarray(shape.faces, dtype=np.int64)
    return SurfaceMesh(
        np.asarray(shape.vertices, dtype=float), facets, np.zeros(len(facets), np.int64), ("body",)
    )


def field_of(name: str) -> tuple[SurfaceMesh, DistanceField]:
    mesh = generate_surface(name)
    return mesh, store.load_field(mesh, laws_of_regions(load_vehicle(name), mesh))


def near(mesh: SurfaceMesh, count: int, seed: int, reach: float = 0.06) -> Array:
    """Return points within a distance of a mesh's facets."""
    rng = np.random.default_rng(seed)
    chosen = rng.choice(len(mesh.facets), count, p=mesh.areas / mesh.areas.sum())
    weight = rng.dirichlet([1.0, 1.0, 1.0], count)
    normal = (mesh.area_vectors / mesh.areas[:, None])[chosen]
    inner = np.einsum("nk,nkj->nj", weight, mesh.corners[chosen])
    return np.asarray(inner + normal * rng.uniform(-reach, reach, count)[:, None])


@pytest.mark.parametrize("name", vehicle_names())
def test_the_generated_car_is_closed_and_has_every_zone(name: str) -> None:
    mesh, vehicle = generate_surface(name), load_vehicle(name)
    assert mesh.is_closed
    assert 22_000 < len(mesh.facets) < 27_000
    assert 4.0 < mesh.volume < 10.0
    assert len(mesh.degenerate_facets()) == 0
    assert set(mesh.names) == {zone.name for zone in vehicle.zones} | {LAMP}
    assert len(np.unique(mesh.region)) == len(mesh.names)
    # The foremost point is the frame's origin, and the left side mirrors the right one.
    assert mesh.box[1, 0] == pytest.approx(0.0, abs=0.002)
    mirrored = mesh.nodes * [1.0, -1.0, 1.0]
    order, other = (np.lexsort(np.round(nodes, 6).T) for nodes in (mesh.nodes, mirrored))
    np.testing.assert_allclose(mesh.nodes[order], mirrored[other], atol=1e-5)


def test_the_middle_of_the_car_is_the_profile_of_its_zones() -> None:
    field = field_of(CAR)[1]
    for zone in load_vehicle(CAR).zones:
        if zone.inner > 0.0:
            continue
        if zone.radius > 0.0:
            angle = np.radians([0.0, 20.0, 40.0])
            line = zone.origin + zone.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        else:
            line = zone.origin + np.linspace(0.2, 0.8, 5)[:, None] * zone.length * zone.direction
        points = np.stack([line[:, 0], np.zeros(len(line)), line[:, 1]], axis=1)
        assert np.abs(distances(field, points)[0]).max() < 0.003, zone.name


def test_the_distance_to_a_sphere_is_the_known_one() -> None:
    # An icosphere of 20,480 facets lies within 0.1 mm of its sphere of 0.2 m.
    mesh = mesh_of(trimesh.creation.icosphere(subdivisions=5, radius=0.2))
    field = build_field(mesh, ONE, 0.01)
    rng = np.random.default_rng(3)
    direction = rng.normal(size=(4000, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    radius = 0.2 + rng.uniform(-0.05, 0.05, 4000)
    found, gradient = distances(field, radius[:, None] * direction)
    # Trilinear: h^2 / 8 times the sum of the curvatures, 2 / 0.15 at most.
    np.testing.assert_allclose(found, radius - 0.2, atol=0.01**2 / 8.0 * 2.0 / 0.15 + 2e-4)
    np.testing.assert_allclose(gradient, direction, atol=0.07)
    # Beyond the grid it is a lower bound, and not a poor one.
    far = distances(field, 1.5 * direction)[0]
    assert np.all(far <= 1.3) and np.all(far > 0.8 * 1.3)


def test_a_box_is_inside_where_it_is_inside() -> None:
    field = build_field(mesh_of(trimesh.creation.box(extents=(0.4, 0.3, 0.2))), ONE, 0.01)
    # Within the grid: six cells beyond the box.
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (5000, 3)) * [0.25, 0.2, 0.15]
    away = np.abs(points) - [0.2, 0.15, 0.1]
    outside = np.linalg.norm(np.maximum(away, 0.0), axis=1)
    truth = outside + np.minimum(away.max(axis=1), 0.0)
    found = distances(field, points)[0]
    known = np.abs(truth) < 0.04
    assert np.abs(found - truth)[known].max() < 0.005
    # Swept beyond the band: first order in the spacing.
    assert np.abs(found - truth).max() < 0.015
    clear = np.abs(truth) > 0.004
    assert np.array_equal(found[clear] < 0.0, truth[clear] < 0.0)


@pytest.mark.parametrize("name", vehicle_names())
def test_the_distance_to_a_car_is_trimeshs(name: str) -> None:
    mesh, field = field_of(name)
    points = near(mesh, 3000, 5)
    other = trimesh.Trimesh(mesh.nodes, mesh.facets, process=False)
    truth = -trimesh.proximity.signed_distance(other, points)
    error = np.abs(distances(field, points)[0] - truth)
    assert np.quantile(error, 0.99) < 0.002
    assert error.max() < 0.006


def test_the_gradient_is_that_of_the_distance() -> None:
    mesh, field = field_of(CAR)
    points, step = near(mesh, 500, 6), 1e-6
    _, gradient = distances(field, points)
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        slope = distances(field, points + shift)[0] - distances(field, points - shift)[0]
        # A point beside a cell's wall sees two cells.
        assert np.quantile(np.abs(slope / (2.0 * step) - gradient[:, axis]), 0.99) < 1e-5


def test_an_inverted_or_inconsistent_mesh_has_no_inside() -> None:
    box = mesh_of(trimesh.creation.box(extents=(0.4, 0.3, 0.2)))
    opened = SurfaceMesh(box.nodes, box.facets[1:], box.region[1:], box.names)
    assert len(opened.open_edges()) == 3
    inverted = SurfaceMesh(box.nodes, box.facets[:, ::-1], box.region, box.names)
    assert inverted.is_closed and inverted.volume == pytest.approx(-0.024)
    with pytest.raises(ValueError, match="closed mesh whose facets face outwards"):
        build_field(inverted, ONE)
    flipped: NDArray[np.int64] = box.facets.copy()
    flipped[0] = flipped[0, ::-1]
    inconsistent = SurfaceMesh(box.nodes, flipped, box.region, box.names)
    assert len(inconsistent.flipped_edges()) > 0
    with pytest.raises(ValueError, match="face the same side at every edge"):
        build_field(inconsistent, ONE)


def test_nodes_are_merged_and_facets_without_area_dropped() -> None:
    box = mesh_of(trimesh.creation.box(extents=(0.4, 0.3, 0.2)))
    apart = box.corners.reshape(-1, 3)
    facets = np.concatenate([np.arange(36).reshape(-1, 3), [[0, 0, 1]]])
    joined = SurfaceMesh(apart, facets, np.zeros(13, np.int64), box.names).compact()
    assert joined.is_closed
    assert (len(joined.nodes), len(joined.facets), len(joined.region)) == (8, 12, 12)
    assert joined.volume == pytest.approx(0.024)


def test_a_field_is_kept_and_a_damaged_file_built_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "user_cache", lambda: tmp_path)
    mesh = mesh_of(trimesh.creation.box(extents=(0.4, 0.3, 0.2)))
    first = store.load_field(mesh, ONE, 0.02)
    (file,) = (tmp_path / "mcstudy" / "surfaces").iterdir()
    monkeypatch.setattr(store, "build_field", lambda *_: pytest.fail("built again"))
    for one, two in zip(first, store.load_field(mesh, ONE, 0.02), strict=True):
        np.testing.assert_array_equal(one, two)
    monkeypatch.undo()
    monkeypatch.setattr(store, "user_cache", lambda: tmp_path)
    file.write_bytes(file.read_bytes()[:100])
    np.testing.assert_array_equal(store.load_field(mesh, ONE, 0.02).distance, first.distance)


def test_a_region_without_a_law_is_named() -> None:
    box = mesh_of(trimesh.creation.box())
    with pytest.raises(ValueError, match=r"region 'body' is no zone of family_car_1990s: it has"):
        laws_of_regions(load_vehicle(CAR), box)
