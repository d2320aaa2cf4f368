"""Headform tests on the surface of facets: against the plane, symmetry, energy, what is refused."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.headform.facet_target import FacetTarget
from models.headform.model import HeadformModel
from models.registry import load_model

PLACES = st.tuples(st.floats(0.7, 2.2), st.floats(-0.7, 0.7))


@cache
def model(headform: str = "gtr_child", vehicle: str = "family_car_1990s") -> HeadformModel:
    found = load_model("headform", {"surface": "facet", "headform": headform, "vehicle": vehicle})
    assert isinstance(found, HeadformModel)
    return found


def surface(of: HeadformModel) -> FacetTarget:
    assert isinstance(of.target, FacetTarget)
    return of.target


@pytest.mark.parametrize("speed", [5.0, 9.7, 11.1])
@pytest.mark.parametrize("headform", ["eevc_child", "gtr_adult"])
def test_perpendicular_on_the_hood_it_is_the_test_on_a_plane(headform: str, speed: float) -> None:
    own = model(headform)
    point = surface(own).impact_point(1.35, 0.0)
    assert point is not None and point.region == "hood"
    elevation = math.atan2(point.normal[2], point.normal[0])
    found = own.run({"impact_speed": speed, "impact_elevation": elevation}).outputs
    plane = load_model("headform", {"headform": headform}).run({"impact_speed": speed}).outputs
    for name in ("hic15", "clip_3ms", "peak_force", "hood_intrusion", "permanent_dent",
                 "rebound_speed", "contact_duration"):  # fmt: skip
        assert found[name] == pytest.approx(plane[name], rel=0.005), name


@pytest.mark.parametrize("slope", [15.0, 30.0, 45.0])
def test_oblique_on_the_hood_it_is_the_test_on_a_plane_but_for_the_lever(slope: float) -> None:
    own = model("eevc_child")
    point = surface(own).impact_point(1.35, 0.0)
    assert point is not None
    angle = math.radians(slope)
    found = own.run(
        {"impact_elevation": math.atan2(point.normal[2], point.normal[0]) - angle, "ploughing": 0.0}
    ).outputs
    plane = load_model("headform").run({"impact_angle": angle}).outputs
    assert found["hic15"] == pytest.approx(plane["hic15"], rel=0.03)
    assert found["peak_force"] == pytest.approx(plane["peak_force"], rel=0.005)


def test_left_and_right_of_the_car_are_alike() -> None:
    rows = [(wad, y) for wad in (0.8, 1.2, 1.7, 2.0) for y in (0.2, 0.5, 0.65)]
    for wad, y in rows:
        left, right = (
            model().run({"wrap_around_distance": wad, "lateral_position": side * y}).outputs
            for side in (1.0, -1.0)
        )
        assert left["hic15"] == pytest.approx(right["hic15"], rel=0.03), (wad, y)


@settings(deadline=None)
@given(PLACES, st.floats(20.0, 90.0), st.floats(3.0, 13.0))
def test_a_headform_anywhere_loses_its_energy_to_the_contact_alone(
    place: tuple[float, float], elevation: float, speed: float
) -> None:
    run = model().run(
        {"wrap_around_distance": place[0], "lateral_position": place[1], "impact_speed": speed,
         "impact_elevation": math.radians(elevation)}
    )  # fmt: skip
    if run.status == "no_impact":
        assert all(math.isnan(value) for value in run.outputs.values())
        return
    assert run.status == "ok"
    assert abs(run.outputs["energy_residual"]) < 0.005
    assert 0.0 < run.outputs["hic15"] < 1e5
    assert run.outputs["permanent_dent"] < run.outputs["hood_intrusion"]
    force = run.histories["hood"].channels["force"]
    assert force.max() == pytest.approx(run.outputs["peak_force"])


def test_a_headform_touches_the_point_it_is_aimed_at() -> None:
    target = surface(model())
    for wad, y in ((0.9, 0.1), (1.4, -0.5), (2.0, 0.3)):
        point = target.impact_point(wad, y)
        assert point is not None
        assert np.linalg.norm(point.normal) == pytest.approx(1.0)
        away = np.linalg.norm(target.mesh.nodes - point.position, axis=1).min()
        assert away < 0.03 and point.position[1] == pytest.approx(y, abs=1e-9)
    assert target.impact_point(1.0, 0.95) is None
    assert target.impact_point(0.3, 0.0) is None
    assert model().run({"lateral_position": 0.95}).status == "no_impact"


def test_fender_and_softer_hood_act_where_they_are() -> None:
    hood = model().run({}).outputs["hic15"]
    fender = model().run({"lateral_position": 0.72}).outputs["hic15"]
    assert fender > 1.2 * hood
    soft = model().run({"hood_stiffness": 0.0}).outputs["hic15"]
    assert soft < 0.9 * hood
    # A bumper's stiffness is not felt on the hood.
    assert model().run({"bumper_stiffness": 0.0}).outputs["hic15"] == hood
    on_edge = {"wrap_around_distance": 0.75}
    edge, softer = (
        model().run({**on_edge, "edge_stiffness": value}).outputs["hic15"] for value in (0.5, 0.0)
    )
    assert softer < 0.9 * edge


def test_effects_that_a_rigid_surface_cannot_have_are_refused() -> None:
    options = {"surface": "facet"}
    with pytest.raises(ValueError, match="'hood_inertia' does not apply to surface 'facet'"):
        load_model("headform", options, {"hood_inertia": {}})
    base = load_model("headform", options).run({}).outputs
    for effect, values in {
        "hood_force_scale": {"factor": 1.5},
        "sensor_gain": {"factor": 1.1},
        "skin_compliance": {"compliance": 5e-6},
    }.items():
        assert effect in load_model("headform", options).effects
        changed = load_model("headform", options, {effect: values}).run({}).outputs
        assert changed["hic15"] != pytest.approx(base["hic15"], rel=0.01), effect


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"surface": "water"}, "surface must be one of zone, facet, fem"),
        ({"surface": "facet", "corridor": "working_curves"}, "takes the curves of a vehicle"),
        ({"surface": "facet", "vehicle": "tank"}, "no vehicle 'tank'"),
    ],
)
def test_a_surface_that_does_not_exist_is_refused(options: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        load_model("headform", options)
