"""Contact with facets: flat surfaces against the law, borders without jumps, two walls at once."""

import math
from functools import cache
from typing import NamedTuple

import numba
import numpy as np
import pytest
import trimesh
from builders import Array
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from models.crash.facet_front import FacetFront
from models.crash.facet_survey import empty_findings
from models.crash.front import patch_count, pressure_point, separation_of, survey
from models.crash.surfaces import empty_contacts
from models.multibody.model import MultibodyModel
from models.multibody.setup import Crash, build_crash
from models.multibody.tree import empty_motion
from models.pedestrian.anthropometry import HEAD, SEGMENTS
from models.pedestrian.skin import build_skin, icosphere
from models.registry import load_model
from models.vehicle.surface.field import DistanceField
from models.vehicle.surface.field_build import build_field
from models.vehicle.surface.mesh import SurfaceMesh

RADIUS = 0.08
TOP = 0.3
"""Height (m) of the box that is the car."""
COUNT = len(SEGMENTS)
MODEL = MultibodyModel()


def surface(shape: trimesh.Trimesh, borders: tuple[float, ...] = ()) -> DistanceField:
    """Return the field of a shape whose facets change their region at some x."""
    for _ in range(4):
        shape = shape.subdivide()
    facets = np.asarray(shape.faces, dtype=np.int64)
    nodes = np.asarray(shape.vertices, dtype=float)
    region = np.searchsorted(np.array(borders), nodes[facets].mean(axis=1)[:, 0])
    names = tuple(f"region {k}" for k in range(len(borders) + 1))
    mesh = SurfaceMesh(nodes, facets, region.astype(np.int64), names).compact()
    return build_field(mesh, np.arange(len(names), dtype=np.int64), 0.015)


@cache
def flat() -> DistanceField:
    """Return a box of a height of ``TOP`` with a border between two regions at x = 0."""
    box = trimesh.creation.box(extents=(0.96, 0.96, 2.0 * TOP))
    return surface(box, (0.0,))


@cache
def corner() -> DistanceField:
    """Return a floor of a height of ``TOP`` and a wall whose face is at x = 0.3, a region each."""
    line = [(-0.6, -0.3), (0.6, -0.3), (0.6, 0.9), (0.3, 0.9), (0.3, TOP), (-0.6, TOP)]
    order = [(0, 1, 4), (0, 4, 5), (1, 2, 4), (2, 3, 4)]
    n = len(line)
    nodes = [(x, y, z) for y in (-0.6, 0.6) for x, z in line]
    facets = [face for a, b, c in order for face in ((a, b, c), (c + n, b + n, a + n))]
    for k in range(n):
        q = (k + 1) % n
        facets += [(k, k + n, q), (q, k + n, q + n)]
    shape = trimesh.Trimesh(nodes, facets, process=False)
    if shape.volume < 0.0:
        shape.invert()
    return surface(shape, (0.29,))


@cache
def crash() -> Crash:
    found = build_crash({item.name: item.nominal for item in MODEL.inputs}, MODEL.vehicle)
    assert found is not None
    return found


class Found(NamedTuple):
    """Of every region: separation, weight, normal (3) and centre of pressure (3)."""

    separation: Array
    weight: Array
    normal: Array
    point: Array


@numba.njit
def _ask(front, ellipsoids, motion, contacts, i, out):
    x, y, z = contacts.centre[i]
    survey(front, ellipsoids, motion, i, x, y, z, 1.0, 0.0)
    for j in range(patch_count(front)):
        away, nx, ny, nz, px, py, pz, weight, _ = separation_of(
            front, ellipsoids, contacts, j, i, x, y, z, 1.0, 0.0
        )
        out[j, 0], out[j, 1], out[j, 2], out[j, 3], out[j, 4] = away, weight, nx, ny, nz
        if weight > 0.0:
            out[j, 5], out[j, 6], out[j, 7] = pressure_point(
                front, j, 0.0, 0.0, px, py, pz, x, y, z
            )


def touch(
    field: DistanceField,
    centre: tuple[float, float, float],
    semi_axes: tuple[float, float, float] = (RADIUS,) * 3,
    turn: Rotation | None = None,
) -> Found:
    """Return what a front of facets says of an ellipsoid in a place."""
    body = crash().scenario.body
    semi = body.semi_axes.copy()
    semi[HEAD] = semi_axes
    regions = int(field.region.max()) + 1
    front = FacetFront(
        field, np.array([1.0, 0.0, 0.0, 0.0]), np.full(regions, 0.5), np.zeros(regions),
        build_skin(semi, [3] * COUNT), np.ones(1),
        empty_findings(regions),
    )  # fmt: skip
    ellipsoids = crash().scenario.ellipsoids._replace(
        square=semi**2, reach=semi.max(axis=1), offset=np.zeros((COUNT, 3))
    )
    R = (turn or Rotation.identity()).as_matrix()
    motion, contacts = empty_motion(COUNT), empty_contacts(COUNT, regions, 1)
    motion.rotation[HEAD] = R
    contacts.centre[HEAD] = centre
    contacts.shape[HEAD] = (R @ np.diag(np.square(semi_axes)) @ R.T)[np.triu_indices(3)]
    out = np.zeros((regions, 8))
    _ask(front, ellipsoids, motion, contacts, HEAD, out)
    return Found(out[:, 0], out[:, 1], out[:, 2:5], out[:, 5:8])


@pytest.mark.parametrize("depth", [0.0005, 0.002, 0.01, 0.03, 0.06])
def test_a_sphere_in_a_flat_surface_is_as_deep_as_it_is(depth: float) -> None:
    found = touch(flat(), (-0.25, 0.03, TOP + RADIUS - depth))
    # The law is taken at this depth with this weight: the force is that of the ellipsoid model.
    assert -found.separation[0] == pytest.approx(depth, rel=0.01, abs=1e-5)
    assert found.weight.tolist() == pytest.approx([1.0, 0.0])
    np.testing.assert_allclose(found.normal[0], [0.0, 0.0, 1.0], atol=1e-3)
    # The mean height of a cap under a pressure that grows with depth is a third of it.
    if 0.005 < depth < 0.05:
        np.testing.assert_allclose(found.point[0, :2], [-0.25, 0.03], atol=2e-3)
        height = found.point[0, 2] - (TOP - depth)
        assert height == pytest.approx(depth / 3.0, rel=0.1)


@given(st.integers(0, 10_000), st.floats(0.001, 0.05))
def test_an_ellipsoid_in_any_orientation_is_as_deep_as_it_is(seed: int, depth: float) -> None:
    rng = np.random.default_rng(seed)
    semi = tuple(rng.uniform(0.04, 0.16, 3).tolist())
    turn = Rotation.random(random_state=seed)
    support = math.sqrt(float(np.square(turn.as_matrix().T[:, 2]) @ np.square(semi)))
    found = touch(flat(), (-0.22, 0.0, TOP + support - depth), semi, turn)
    assert -found.separation[0] == pytest.approx(depth, rel=0.02, abs=2e-4)
    np.testing.assert_allclose(found.normal[0], [0.0, 0.0, 1.0], atol=0.01)


def test_nothing_jumps_where_a_sphere_slides_from_one_region_to_the_next() -> None:
    depth, places = 0.03, np.linspace(-0.15, 0.15, 121)
    found = [touch(flat(), (x, 0.0, TOP + RADIUS - depth)) for x in places]
    weight = np.array([entry.weight for entry in found])
    # Shared out, no more and no less, at one depth and in one direction.
    np.testing.assert_allclose(weight.sum(axis=1), 1.0, rtol=1e-9)
    for entry in found:
        touched = entry.weight > 0.0
        np.testing.assert_allclose(-entry.separation[touched], depth, rtol=0.01)
        np.testing.assert_allclose(entry.normal[touched, 2], 1.0, atol=1e-3)
    assert weight[0].tolist() == [1.0, 0.0] and weight[-1].tolist() == [0.0, 1.0]
    # The patch is 13 cm wide: a step of 2.5 mm moves a few per cent of the load.
    assert np.abs(np.diff(weight[:, 1])).max() < 0.08
    assert weight[60, 1] == pytest.approx(0.5, abs=0.03)


def test_a_floor_and_a_wall_carry_a_force_each() -> None:
    deep, shallow = 0.02, 0.008
    found = touch(corner(), (0.3 - RADIUS + deep, 0.0, TOP + RADIUS - shallow))
    np.testing.assert_allclose(found.weight, [1.0, 1.0], atol=0.02)
    np.testing.assert_allclose(-found.separation, [shallow, deep], rtol=0.05)
    np.testing.assert_allclose(found.normal, [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]], atol=0.05)


def test_a_segment_clear_of_the_car_touches_nothing() -> None:
    for centre in ((0.0, 0.0, TOP + RADIUS + 1e-4), (0.0, 0.0, 2.0), (3.0, 0.0, 0.1)):
        assert touch(flat(), centre).weight.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("subdivisions", [0, 1, 2, 3])
def test_an_icosphere_is_closed_and_even(subdivisions: int) -> None:
    nodes, facets = icosphere(subdivisions)
    assert len(nodes) == 10 * 4**subdivisions + 2
    shape = trimesh.Trimesh(nodes, facets, process=False)
    assert shape.is_watertight and shape.is_winding_consistent
    assert shape.volume == pytest.approx(4.0 / 3.0 * math.pi, rel=0.6 / 3.5**subdivisions)
    np.testing.assert_allclose(np.linalg.norm(nodes, axis=1), 1.0)


def test_the_skin_has_the_area_of_the_ellipsoids() -> None:
    body = crash().scenario.body
    skin = build_skin(body.semi_axes, [2] * (COUNT - 1) + [3])
    assert len(skin.point) == 162 * (COUNT - 1) + 642
    first = skin.first_point[skin.first_cluster]
    for k in range(COUNT):
        own = slice(first[k], first[k + 1])
        a, b, c = body.semi_axes[k]
        # K. Thomsen's formula, within 1.1 %.
        area = (
            4
            * math.pi
            * (((a * b) ** 1.6075 + (a * c) ** 1.6075 + (b * c) ** 1.6075) / 3) ** (1 / 1.6075)
        )
        assert skin.area[own].sum() == pytest.approx(area, rel=0.04)
        # A force that is the same everywhere on a closed surface is none.
        net = skin.area[own] @ skin.normal[own]
        np.testing.assert_allclose(net, 0.0, atol=1e-3 * area)
        place = np.square(skin.point[own] / body.semi_axes[k]).sum(axis=1)
        np.testing.assert_allclose(place, 1.0)
    for c in range(len(skin.radius)):
        own = slice(skin.first_point[c], skin.first_point[c + 1])
        away = np.linalg.norm(skin.point[own] - skin.centre[c], axis=1)
        assert away.max() <= skin.radius[c] * (1.0 + 1e-12)


def test_the_nominal_crash_balances_its_energy_and_converges() -> None:
    found = [load_model("facet", {"tick": tick}).run({}).outputs for tick in (1e-4, 2.5e-5)]
    assert all(abs(outputs["energy_residual"]) < 0.01 for outputs in found)
    assert found[0]["hic15"] == pytest.approx(found[1]["hic15"], rel=0.03)
    assert found[0]["wad"] == pytest.approx(found[1]["wad"], abs=0.01)
