"""The hood of finite elements: its mesh, a headform against it, what is refused."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from models.protocol import Model
from models.registry import load_model
from models.shells.assembly import NODES
from models.vehicle.car import load_car
from models.vehicle.profile import load_vehicle
from models.vehicle.structure.build import build_structure
from models.vehicle.structure.panel import Panel
from models.vehicle.surface.field import distances

CAR = load_vehicle("family_car_1990s")
DRAFT = 0.04
PERPENDICULAR = math.radians(79.0)
"""Elevation at which a headform meets the hood along its normal."""


@cache
def model(**effects: Any) -> Model:
    return load_model("headform", {"surface": "fem", "element_size": DRAFT})


@cache
def outputs(**inputs: float) -> dict[str, float]:
    run = model().run({"impact_elevation": PERPENDICULAR, **inputs})
    assert run.status in ("ok", "hourglass")
    return dict(run.outputs)


def hood_of(size: float) -> Panel:
    return build_structure(CAR, size, only=("hood",)).panels[0]


@pytest.mark.parametrize("size", [0.04, 0.025, 0.02, 0.0125])
def test_edges_of_the_ribs_are_grid_lines_at_every_size(size: float) -> None:
    hood = hood_of(size)
    outer, inner = (np.unique(hood.elements[hood.outer == flag]) for flag in (True, False))
    # Depth below the outer sheet: nodes of both sheets lie on one line along the hood's normal.
    normal = hood.gaps.normal[0]
    flat = np.eye(3) - np.outer(normal, normal)
    away, nearest = cKDTree(hood.position[outer] @ flat).query(hood.position[inner] @ flat)
    assert away.max() < 1e-9
    depth = (hood.position[outer][nearest] - hood.position[inner]) @ normal
    assert depth.min() > -1e-12 and depth.max() == pytest.approx(0.025)
    # The bottom of the middle rib is flat, whatever the size.
    place = hood.position[inner]
    middle = (np.abs(place[:, 1]) < 0.021) & (place[:, 0] < -0.4) & (place[:, 0] > -0.6)
    np.testing.assert_allclose(depth[middle], 0.025)
    assert len(hood.ties.first) > 100
    np.testing.assert_allclose(
        hood.position[hood.ties.first], hood.position[hood.ties.second], atol=1e-12
    )


def test_the_panels_face_out_lie_on_the_car_and_weigh_what_they_do() -> None:
    structure = build_structure(CAR, 0.02)
    body = structure.assemble()
    first = body.first[NODES]
    mass = {
        panel.name: body.nodes.mass[first[k] : first[k + 1]].sum()
        for k, panel in enumerate(structure.panels)
    }
    assert 12.0 < mass["hood"] < 17.0
    assert 1.0 < mass["bumper"] + mass["lower bumper"] < 4.0
    assert 6500 < structure.element_count < 8500
    assert 1e-6 < body.step < 4e-6
    away, gradient = distances(load_car(CAR.name).field(), body.start[body.touched])
    assert np.quantile(np.abs(away), 0.99) < 0.006 and np.abs(away).max() < 0.025
    facing = np.einsum("tk,tk->t", body.normal, gradient) / np.linalg.norm(gradient, axis=1)
    assert np.quantile(facing, 0.01) > 0.8
    # The area that bodies can touch is that of the outer elements, and both sides are alike.
    corners = [p.position[p.elements[p.outer]] for p in structure.panels]
    sides = np.concatenate(corners)
    across = np.cross(sides[:, 2] - sides[:, 0], sides[:, 3] - sides[:, 1])
    assert body.area.sum() == pytest.approx(0.5 * np.linalg.norm(across, axis=1).sum(), rel=1e-3)
    left = body.start[:, 1] > 1e-9
    assert np.count_nonzero(left) == np.count_nonzero(body.start[:, 1] < -1e-9)


def test_finer_elements_are_the_number_of_the_papers_car() -> None:
    assert 27_000 < build_structure(CAR, 0.01).element_count < 37_000


def test_the_energy_of_a_hit_is_all_booked_and_the_hood_keeps_a_dent() -> None:
    found = outputs(lateral_position=0.6)
    assert abs(found["energy_residual"]) < 0.01
    assert 0.0 < found["permanent_dent"] < found["hood_intrusion"] < 0.08
    assert 400.0 < found["hic15"] < 3000.0
    assert found["rebound_speed"] < 6.0


@pytest.mark.slow
def test_left_and_right_are_alike() -> None:
    right = outputs(lateral_position=-0.6)
    for name in ("hic15", "clip_3ms", "hood_intrusion"):
        assert outputs(lateral_position=0.6)[name] == pytest.approx(right[name], rel=0.01), name


@pytest.mark.parametrize(
    "change",
    [
        pytest.param({"sheet_thickness": 0.8}, marks=pytest.mark.slow),
        pytest.param({"yield_stress": 0.6}, marks=pytest.mark.slow),
        {"rib_depth": 0.5},
    ],
)
def test_thinner_sheets_and_flatter_ribs_are_softer(change: dict[str, float]) -> None:
    base, found = outputs(lateral_position=0.6), outputs(lateral_position=0.6, **change)
    assert found["hic15"] < 0.97 * base["hic15"]
    assert found["hood_intrusion"] > base["hood_intrusion"]


def test_a_faster_headform_is_hurt_more() -> None:
    slow, fast = outputs(lateral_position=0.6, impact_speed=6.0), outputs(lateral_position=0.6)
    exponent = math.log(fast["hic15"] / slow["hic15"]) / math.log(30.0 / 3.6 / 6.0)
    # A prototype of other hands: 1.9 to 2.5 between 20 and 45 km/h.
    assert 1.2 < exponent < 3.2


def test_beside_the_hood_there_is_no_impact() -> None:
    assert model().run({"wrap_around_distance": 2.2}).status == "no_impact"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"hood_curve": [[0.0, 0.0], [0.1, 1e4]]}, "sheets of its own"),
        ({"skin": "vinyl"}, "sheets of its own"),
        ({"element_size": 0.001}, "element_size must lie within"),
        ({"vehicle": "suv_high_front"}, "has no finite elements"),
    ],
)
def test_options_that_do_not_fit_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        load_model("headform", {"surface": "fem", **options})
    with pytest.raises(ValueError, match="does not apply to surface 'fem'"):
        load_model("headform", {"surface": "fem"}, {"hood_yield": {}})
