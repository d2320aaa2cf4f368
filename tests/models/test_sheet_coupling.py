"""A body coupled to the shells at its own steps, against a headform stepped with the shells."""

import math
from functools import cache

import numpy as np
import pytest
from builders import Array

from models.crash.ellipsoids import Ellipsoids
from models.crash.facet_survey import empty_findings
from models.crash.sheet import FRESH, NOW, SLID, STEPS, WORK, booked_energy, build_sheet
from models.crash.sheet_front import SheetFront
from models.crash.sheet_motion import clear_impulses, find_candidates, follow_bodies
from models.crash.surfaces import CHANNELS, empty_contacts
from models.criteria import head_injury_criterion
from models.criteria.units import STANDARD_GRAVITY
from models.headform.facet_impact import FACET_COLUMNS, FORCE, Sphere, strike_facets
from models.headform.facet_target import moving, sphere, sphere_skin
from models.headform.fem_target import FemTarget
from models.headform.impact import SAMPLES, SUMMARY
from models.headform.model import HeadformModel
from models.headform.target import impact_axes
from models.multibody.tree import empty_loads
from models.registry import load_model
from models.shells.assembly import NODES
from models.vehicle.car import load_car
from models.vehicle.structure.cover import with_replaced
from models.vehicle.surface.generator import laws_of_regions
from models.vehicle.surface.store import load_field
from models.vehicle.surface.wrap import wrap_point

DRAFT, SPEED, MASS, RADIUS, INERTIA = 0.04, 30.0 / 3.6, 2.5, 0.065, 0.0036
WAD, SIDE, ELEVATION = 1.35, 0.6, math.radians(79.0)
FRICTION = 0.25
UNCHANGED = {"rib_depth": 1.0, "sheet_thickness": 1.0, "yield_stress": 1.0}


@cache
def stepped_together() -> tuple[float, float]:
    """Return HIC15 and the largest force of a headform that is stepped with the shells."""
    model = load_model("headform", {"surface": "fem", "element_size": DRAFT, "channel_class": 0.0})
    run = model.run({"wrap_around_distance": WAD, "lateral_position": SIDE,
                     "impact_elevation": ELEVATION})  # fmt: skip
    return run.outputs["hic15"], run.outputs["peak_force"]


@cache
def coupled(step: float) -> tuple[Array, SheetFront, Ellipsoids]:
    """Return the forces (n, 3) on a headform stepped by itself, its front and its surface."""
    model = load_model("headform", {"surface": "fem", "element_size": DRAFT})
    assert isinstance(model, HeadformModel) and isinstance(model.target, FemTarget)
    target, car = model.target, load_car("family_car_1990s")
    shells = target.structure(UNCHANGED)
    body = shells.assemble()
    mesh, zones = with_replaced(car.mesh, shells), len(car.vehicle.zones)
    rows = np.append(laws_of_regions(car.vehicle, car.mesh), zones)
    aim = wrap_point(car.mesh, WAD, SIDE)
    start = body.start[body.touched]
    outward = body.normal[int(np.argmin(np.linalg.norm(start - aim, axis=1)))]
    front = SheetFront(
        field=load_field(mesh, rows),
        dive=np.array([1.0, 0.0, 0.0, 0.0]),
        friction=np.full(zones, FRICTION),
        ploughing=np.zeros(zones),
        skin=sphere_skin(RADIUS),
        distributed=np.ones(1),
        found=empty_findings(zones + 1),
        sheet=build_sheet(body, np.array([2e9]), zones),
        spins=np.zeros((1, 3)),
    )
    heading = np.array([-math.cos(ELEVATION), 0.0, -math.sin(ELEVATION)])
    centre = aim + (RADIUS + 0.004) * outward
    ellipsoids = sphere(RADIUS, [zone.corridor.median for zone in car.vehicle.zones], None)
    # The last column is the law against the road: here that of the first zone, not used.
    ellipsoids.surface_law[0, -1] = 0
    record, summary = np.zeros((400, FACET_COLUMNS)), np.zeros(SUMMARY)
    axes = impact_axes(outward, heading)
    strike_facets(
        front, ellipsoids, Sphere(np.array([MASS]), np.array([INERTIA])),
        moving(centre, SPEED * heading), empty_loads(1), empty_contacts(1, zones, 0),
        np.zeros(CHANNELS), np.zeros((2, 3)), np.zeros(6), axes, step, 1, record, summary,
    )  # fmt: skip
    return record[: int(summary[SAMPLES]), FORCE:], front, ellipsoids


@pytest.mark.parametrize(
    ("step", "within"),
    [pytest.param(5e-5, 0.015, marks=pytest.mark.slow), (1e-4, 0.02)],
)
def test_exchange_at_the_bodys_steps_gives_the_same_head_injury(step: float, within: float) -> None:
    force, front, _ = coupled(step)
    g = np.linalg.norm(force, axis=1) / (MASS * STANDARD_GRAVITY)
    hic = head_injury_criterion(step * np.arange(len(g)), g, 0.015)[0]
    expected, _ = stepped_together()
    assert hic == pytest.approx(expected, rel=within)
    # The sheet's steps are many to one of the body.
    assert front.sheet.clock[STEPS] > 15 * np.count_nonzero(g) * step / 5e-5


def test_the_sheet_books_the_work_of_the_body() -> None:
    force, front, _ = coupled(1e-4)
    account = front.sheet.account
    assert account[WORK] == pytest.approx(booked_energy(front.sheet), rel=0.01)
    assert account[SLID] >= 0.0
    # What the body lost: its momentum along the normal, by the forces on it.
    lost = 1e-4 * force[:, 0].sum()
    assert MASS * SPEED < lost < 2.0 * MASS * SPEED


def test_panels_that_nothing_touches_stay_exactly_at_rest() -> None:
    _, front, _ = coupled(1e-4)
    body, state = front.sheet.body, front.sheet.state
    panels = load_model("headform", {"surface": "fem", "element_size": DRAFT})
    assert isinstance(panels, HeadformModel) and isinstance(panels.target, FemTarget)
    names = [panel.name for panel in panels.target.structure(UNCHANGED).panels]
    assert state[names.index("hood")] != FRESH
    for name in ("bumper", "grille", "fender right", "windscreen edge"):
        k = names.index(name)
        assert state[k] == FRESH, name
        own = slice(*body.first[NODES, k : k + 2])
        np.testing.assert_array_equal(body.nodes.position[own], body.start[own])
    assert [names[k] for k in np.flatnonzero(body.awake)] == ["hood"]


def test_a_hood_free_of_loads_is_put_to_rest_and_a_blow_wakes_it() -> None:
    # A front of its own: it goes on moving.
    _, front, ellipsoids = coupled.__wrapped__(1e-4)
    sheet, time = front.sheet, float(front.sheet.clock[NOW])
    below = sheet.present.copy()

    def go_on(steps: int) -> None:
        nonlocal time
        for _ in range(steps):
            time += 1e-4
            clear_impulses(sheet)
            find_candidates(sheet, front.skin.reach)
            follow_bodies(sheet, ellipsoids, front.friction, front.spins, time)
            sheet.clock[NOW] = time
            sheet.past[:] = sheet.present

    sheet.present[:, 2] += 1.0
    sheet.past[:] = sheet.present
    go_on(500)
    hood = slice(0, int(sheet.body.first[NODES, 1]))
    assert not sheet.body.awake.any()
    assert not sheet.body.nodes.velocity[hood].any()
    # What moved when it was stopped stays booked.
    assert sheet.account[WORK] == pytest.approx(booked_energy(sheet), rel=0.01)
    shape = sheet.body.nodes.position.copy()
    go_on(50)
    np.testing.assert_array_equal(sheet.body.nodes.position, shape)
    sheet.present[:] = below
    sheet.present[:, 2] -= 0.03
    sheet.past[:] = sheet.present
    go_on(3)
    assert sheet.body.awake[0]
