"""The hood of finite elements: its mesh, a headform against it, what is refused."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

from models.protocol import Model
from models.registry import load_model
from models.shells.explicit import build_shells, stable_step
from models.shells.hood_mesh import INNER, OUTER, build_hood
from models.vehicle.profile import load_vehicle
from models.vehicle.surface.car import load_car
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


@pytest.mark.parametrize("size", [0.04, 0.025, 0.02, 0.0125])
def test_edges_of_the_ribs_are_grid_lines_at_every_size(size: float) -> None:
    hood = build_hood(CAR, size)
    inner = hood.sheet == INNER
    outer = hood.position[hood.sheet == OUTER]
    # Depth below the outer sheet at the same place in plan.
    place = {tuple(np.round(p, 6)): k for k, p in enumerate(hood.plan[hood.sheet == OUTER])}
    rows = [place[tuple(np.round(p, 6))] for p in hood.plan[inner]]
    depth = (outer[rows] - hood.position[inner]) @ hood.normal
    assert depth.min() > -1e-12 and depth.max() == pytest.approx(0.025)
    # The bottoms and flanges of the middle rib are flat, whatever the size.
    middle = np.abs(hood.plan[inner][:, 1]) < 0.021
    long = (hood.plan[inner][:, 0] > 0.2) & (hood.plan[inner][:, 0] < 0.4)
    np.testing.assert_allclose(depth[middle & long], 0.025)
    assert len(hood.ties.first) > 100
    np.testing.assert_allclose(
        hood.position[hood.ties.first], hood.position[hood.ties.second], atol=1e-12
    )


def test_the_mesh_faces_up_lies_on_the_car_and_weighs_what_a_hood_does() -> None:
    hood = build_hood(CAR, 0.02)
    nodes, shells = build_shells(
        hood.position, hood.elements, hood.thickness, hood.material, hood.materials
    )
    assert 4500 < len(hood.elements) < 6500
    assert 12.0 < nodes.mass.sum() < 17.0
    assert (shells.frame[:, 2] @ hood.normal > 0.4).all()
    assert 1e-6 < stable_step(shells, hood.materials) < 4e-6
    near = (np.abs(hood.plan[:, 1]) < 0.6) & (hood.plan[:, 0] > 0.02) & (hood.sheet == OUTER)
    away, _ = distances(load_car(CAR.name).field(), hood.position[near])
    assert np.abs(away).max() < 0.008
    mirrored = hood.plan * np.array([1.0, -1.0])
    known = {tuple(row) for row in np.round(np.column_stack([hood.plan, hood.sheet]), 6).tolist()}
    other = {tuple(row) for row in np.round(np.column_stack([mirrored, hood.sheet]), 6).tolist()}
    assert {tuple(abs(v) for v in row) for row in known} == {
        tuple(abs(v) for v in row) for row in other
    }


def test_the_energy_of_a_hit_is_all_booked_and_the_hood_keeps_a_dent() -> None:
    found = outputs(lateral_position=0.6)
    assert abs(found["energy_residual"]) < 0.01
    assert 0.0 < found["permanent_dent"] < found["hood_intrusion"] < 0.08
    assert 400.0 < found["hic15"] < 3000.0
    assert found["rebound_speed"] < 6.0


def test_left_and_right_are_alike() -> None:
    right = outputs(lateral_position=-0.6)
    for name in ("hic15", "clip_3ms", "hood_intrusion"):
        assert outputs(lateral_position=0.6)[name] == pytest.approx(right[name], rel=0.01), name


def test_thinner_sheets_and_flatter_ribs_are_softer() -> None:
    base = outputs(lateral_position=0.6)
    for change in ({"sheet_thickness": 0.8}, {"rib_depth": 0.5}, {"yield_stress": 0.6}):
        found = outputs(lateral_position=0.6, **change)
        assert found["hic15"] < 0.97 * base["hic15"], change
        assert found["hood_intrusion"] > base["hood_intrusion"], change


def test_a_faster_headform_is_hurt_more() -> None:
    slow, fast = (outputs(lateral_position=0.6, impact_speed=v) for v in (6.0, 8.333333333333334))
    exponent = math.log(fast["hic15"] / slow["hic15"]) / math.log(8.333333333333334 / 6.0)
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
