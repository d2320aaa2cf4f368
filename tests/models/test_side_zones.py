"""Sides of the fenders beside the hood: whose curve a head meets, borders, mirror, distances."""

import functools
import math
from dataclasses import dataclass

import numpy as np
import pytest
from builders import Array, quiet
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from models.contact.law import ForceCurve
from models.crash.car_contact import ENTRY_DEPTH, apply_car_contacts
from models.crash.scenario import Scenario, build_scenario
from models.crash.surfaces import Contacts, empty_contacts
from models.crash.zone_front import BORDER, zone_separation
from models.multibody.model import MultibodyModel
from models.multibody.setup import build_tree
from models.multibody.tree import empty_loads, empty_motion
from models.pedestrian.anthropometry import HEAD, SEGMENTS
from models.pedestrian.tissue import build_tissue
from models.protocol import Run
from models.vehicle.profile import (
    Vehicle,
    load_vehicle,
    surface_point,
    vehicle_names,
    wrap_around_distance,
)

VEHICLES = vehicle_names()
EACH = pytest.mark.parametrize("name", VEHICLES)


@dataclass(frozen=True)
class Front:
    """A car front and a child's head over it; the other segments are far ahead."""

    vehicle: Vehicle
    scenario: Scenario

    def row(self, zone: str) -> int:
        return self.vehicle.zone_index(zone)

    def contacts(self) -> Contacts:
        found = empty_contacts(
            len(SEGMENTS), len(self.vehicle.zones), len(self.scenario.ellipsoids.pairs)
        )
        found.centre[:] = [9.0, 0.0, 9.0]
        found.shape[:, [0, 3, 5]] = self.scenario.ellipsoids.square
        return found

    def centre(self, y: float, depth: float, along: float) -> Array:
        """Return where an upright head's centre is that is ``depth`` m in the hood at y."""
        zones, hood = self.scenario.zones, self.row("hood")
        direction = zones.direction[hood]
        normal = np.array([-direction[1], direction[0]]) * np.sign(direction[0])
        square = self.scenario.ellipsoids.square[HEAD]
        reach = math.sqrt(square[0] * normal[0] ** 2 + square[2] * normal[1] ** 2)
        x, z = (
            zones.origin[hood] + along * zones.length[hood] * direction + (reach - depth) * normal
        )
        return np.array([x - 0.5 * zones.curvature[hood] * y**2, y, z])

    def sides(self, centre: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return what a head meets of the hood and of the fender's side."""
        zones, ellipsoids = self.scenario.zones, self.scenario.ellipsoids
        hood, side = (
            zone_separation(
                zones, ellipsoids, self.contacts(), self.row(zone), HEAD, *centre, 1.0, 0.0
            )
            for zone in ("hood", "fender_side")
        )
        return tuple(map(float, hood)), tuple(map(float, side))

    def press(self, contacts: Contacts, centre: Array) -> dict[str, float]:
        """Return the force (N) of each zone on a head at rest at a point, keeping ``contacts``."""
        contacts.centre[HEAD] = centre
        contacts.zone_force[:] = 0.0
        motion = empty_motion(len(SEGMENTS))
        motion.centre[:] = contacts.centre
        apply_car_contacts(
            self.scenario.zones, self.scenario.ellipsoids, np.zeros(6), motion,
            empty_loads(len(SEGMENTS)), contacts, build_tree(self.scenario.body), np.zeros(7), 0.0,
        )  # fmt: skip
        force = contacts.segment_force[HEAD]
        return {zone.name: float(force[j]) for j, zone in enumerate(self.vehicle.zones)}


@functools.cache
def front(name: str) -> Front:
    values = {item.name: item.nominal for item in MultibodyModel().inputs}
    vehicle = load_vehicle(name)
    scenario = build_scenario(values | {"lateral_offset": 0.0}, vehicle)
    return Front(vehicle, scenario)


def in_series(one: ForceCurve, other: ForceCurve, depth: float) -> float:
    """Return the force (N) at which two curves share a depth."""

    def depth_of(curve: ForceCurve, force: float) -> float:
        last = np.diff(curve.penetration)[-1] / np.diff(curve.force)[-1]
        beyond = max(force - curve.force[-1], 0.0) * last
        return float(np.interp(force, curve.force, curve.penetration) + beyond)

    def gap(force: float) -> float:
        return depth_of(one, force) + depth_of(other, force) - depth

    return float(brentq(gap, 0.0, 1e6, xtol=1e-9, rtol=1e-14))


@EACH
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("side", [False, True])
def test_a_head_meets_the_curve_of_its_zone(name: str, sign: float, side: bool) -> None:
    car, zone = front(name), "fender_side" if side else "hood"
    entry = car.vehicle.zones[car.row(zone)]
    middle = 0.5 * (entry.inner + entry.half_width) if entry.inner else 0.4 * entry.half_width
    tissue, contacts = build_tissue(car.scenario.body)["head"], car.contacts()
    for depth in (0.005, 0.012, 0.025):
        centre = car.centre(sign * middle, depth, 0.5)
        penetration = -car.sides(centre)[side][0]
        forces = car.press(contacts, centre)
        expected = in_series(entry.corridor.curve(0.5), tissue, penetration)
        assert penetration == pytest.approx(depth, abs=1e-3)
        assert forces[zone] == pytest.approx(expected, rel=1e-9)
        assert sum(forces.values()) == forces[zone]


@quiet(60)
@given(
    name=st.sampled_from(VEHICLES),
    away=st.floats(-0.6 * BORDER, 0.6 * BORDER),
    sign=st.sampled_from([-1.0, 1.0]),
    depth=st.floats(0.0, 0.06),
    along=st.floats(0.25, 0.75),
)
def test_across_the_border_the_weights_make_one_contact(
    name: str, away: float, sign: float, depth: float, along: float
) -> None:
    car = front(name)
    border = car.vehicle.zones[car.row("hood")].half_width
    hood, side = car.sides(car.centre(sign * (border + away), min(depth, 0.01 + (away < 0)), along))
    assert hood[7] + side[7] == pytest.approx(1.0, abs=1e-9)
    if away <= 0.0:
        assert hood[:7] == side[:7]
        # The lowest point of the head lies a little further in than its centre.
        assert hood[7] >= 0.5


@EACH
def test_across_the_border_nothing_jumps(name: str) -> None:
    # One contact's worth of force all the way from the hood's to the fender's, never more or less.
    car = front(name)
    border, contacts = car.vehicle.zones[car.row("hood")].half_width, car.contacts()
    ways = np.linspace(border - 0.8 * BORDER, border + 0.8 * BORDER, 161)
    forces = [car.press(contacts, car.centre(y, 0.02, 0.5)) for y in ways]
    total = np.array([sum(entry.values()) for entry in forces])
    soft, stiff = forces[0]["hood"], forces[-1]["fender_side"]
    assert (total[0], total[-1]) == (soft, stiff)
    assert stiff > 1.4 * soft
    # Linear in between: a step of 0.4 mm is a hundredth of the border.
    assert np.abs(np.diff(total)).max() < 1.2 * (stiff - soft) * (ways[1] - ways[0]) / BORDER


def pressed_in(car: Front, y: float, along: float) -> tuple[Contacts, float, float]:
    """Return the contacts of a head pressed in deeply, the depth and the hood's force there."""
    contacts, depth = car.contacts(), ENTRY_DEPTH + 0.01
    for share in np.linspace(0.1, 1.0, 10):
        car.press(contacts, car.centre(y, share * depth, along))
    hood = car.vehicle.zones[car.row("hood")].corridor.curve(0.5)
    return contacts, depth, in_series(hood, build_tissue(car.scenario.body)["head"], depth)


@pytest.mark.parametrize("way", [1, -1])
def test_a_deep_head_is_handed_from_hood_to_fender(way: int) -> None:
    car = front("family_car_1990s")
    border = car.vehicle.zones[car.row("hood")].half_width
    ways = np.linspace(border - 0.06, border + 0.06, 61)[::way]
    contacts, depth, force = pressed_in(car, ways[0], 0.5)
    for y in ways:
        assert sum(car.press(contacts, car.centre(y, depth, 0.5)).values()) > 0.9 * force


@EACH
def test_a_deep_head_is_handed_from_edge_to_hood(name: str) -> None:
    car = front(name)
    ways = np.linspace(-0.04, 0.10, 36) / car.vehicle.zones[car.row("hood")].length
    contacts, depth, force = pressed_in(car, 0.0, ways[0])
    forces = [car.press(contacts, car.centre(0.0, depth, along)) for along in ways]
    assert forces[0]["hood_edge"] > 0.9 * force
    # Past the border the hood alone holds it.
    behind = [entry["hood"] for entry in forces if entry["hood_edge"] == 0.0][5:]
    assert len(behind) > 10
    assert min(behind) > 0.9 * force


@quiet(60)
@given(
    name=st.sampled_from(VEHICLES),
    y=st.floats(0.0, 0.85),
    depth=st.floats(0.0, 0.029),
    along=st.floats(-0.05, 1.05),
)
def test_left_and_right_are_mirror_images(name: str, y: float, depth: float, along: float) -> None:
    car = front(name)
    left, right = (car.centre(sign * y, depth, along) for sign in (1.0, -1.0))
    forces = car.press(car.contacts(), left)
    assert forces == pytest.approx(car.press(car.contacts(), right), rel=1e-12, abs=1e-9)
    mirror = np.array([1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
    for here, there in zip(car.sides(left), car.sides(right), strict=True):
        np.testing.assert_allclose(mirror * here, there, rtol=1e-12, atol=1e-12)


@EACH
def test_side_by_side_in_one_plane(name: str) -> None:
    car = front(name)
    rows = hood, side = car.row("hood"), car.row("fender_side")
    inner, outer = (car.vehicle.zones[row] for row in rows)
    # The gap between hood and fender lies within the side's strip.
    assert inner.inner == 0.0 and outer.inner == inner.half_width
    assert outer.inner < car.vehicle.hood_side < outer.half_width
    for attribute in ("origin", "direction", "length", "curvature"):
        np.testing.assert_array_equal(getattr(inner, attribute), getattr(outer, attribute))
    # The wrap-around distance does not ask whose point it is.
    for share in np.linspace(0.0, 1.0, 11):
        point = inner.origin + share * inner.length * inner.direction
        assert wrap_around_distance(name, hood, point) == wrap_around_distance(name, side, point)
    for point in ([-0.5, 0.9], [-1.0, 0.8]):
        found = [surface_point(car.scenario.zones, row, np.array(point)) for row in rows]
        np.testing.assert_array_equal(*found)
    # The files say that the side is 1.5, 1.75 and 2 times as stiff, to the digits printed there.
    depth = np.linspace(1e-3, 0.12, 120)
    for bound, factor in (("lower", 1.5), ("median", 1.75), ("upper", 2.0)):
        one, other = (getattr(zone.corridor, bound).at(depth) for zone in (inner, outer))
        np.testing.assert_allclose(other / one, factor, rtol=1e-4)


def mirrored(inputs: dict[str, float]) -> dict[str, float]:
    """Return the inputs of the crash in a mirror along the car."""
    turned = {k: -inputs[k] for k in ("facing_angle", "lateral_offset", "yaw_rate")}
    return inputs | turned | {"gait_phase": (inputs["gait_phase"] + 0.5) % 1.0}


CRASHES = (
    {},
    {"impact_speed": 9.0, "gait_phase": 0.1, "facing_angle": 1.9, "lateral_offset": 0.3,
     "yaw_rate": -0.7},
    {"impact_speed": 13.0, "gait_phase": 0.8, "facing_angle": -1.2, "lateral_offset": 0.65},
    {"stature": 1.35, "body_mass": 30.0, "lateral_offset": -0.5, "yaw_rate": 1.8},
)  # fmt: skip


@pytest.mark.parametrize("changes", CRASHES, ids=range(len(CRASHES)))
def test_a_crash_and_its_mirror_image_are_one(changes: dict[str, float]) -> None:
    model = MultibodyModel()
    inputs = {item.name: item.nominal for item in model.inputs} | changes
    one, other = model.run(inputs), model.run(mirrored(inputs))
    assert one.status == other.status == "ok"
    # Steps are whole ticks: the head meets the car at the same one.
    assert other.outputs["head_impact_time"] == one.outputs["head_impact_time"]
    # The normal of a contact is found to its last Newton turn, 1e-7, in either; contacts multiply
    # such differences some times over. Measured: 4e-9 at worst in ten crashes.
    for name in ("head_impact_speed", "head_impact_angle", "wad", "hic15", "clip_3ms",
                 "head_fender_distance", "hood_intrusion", "launch_speed"):  # fmt: skip
        assert other.outputs[name] == pytest.approx(one.outputs[name], rel=1e-7), name
    assert one.scene is not None and other.scene is not None
    contact = _first_contact(one), _first_contact(other)
    assert contact[0][1] == pytest.approx(-contact[1][1], abs=1e-7)
    assert contact[0][0] == pytest.approx(contact[1][0], abs=1e-7)


def _first_contact(run: Run) -> tuple[float, float]:
    """Return where the head's centre is in the car's frame at the frame after head impact."""
    scene = run.scene
    assert scene is not None
    k = int(np.searchsorted(scene.time, run.outputs["head_impact_time"]))
    x, y, yaw = scene.car[k]
    dx, dy = scene.centre[k, HEAD, :2] - [x, y]
    return (
        math.cos(yaw) * dx + math.sin(yaw) * dy,
        -math.sin(yaw) * dx + math.cos(yaw) * dy,
    )


@pytest.mark.parametrize("offset", [-0.752, -0.5, 0.0, 0.4])
def test_fender_distance_is_measured_from_the_gap(offset: float) -> None:
    run = MultibodyModel().run({"lateral_offset": offset})
    assert run.status == "ok"
    side = load_vehicle("family_car_1990s").hood_side
    _, y = _first_contact(run)
    # Contact point and centre of an upright head are a few millimetres apart; a tilted one's up to
    # half its breadth; 2 ms of travel at 5 m/s.
    assert run.outputs["head_fender_distance"] == pytest.approx(side - abs(y), abs=0.03)
    assert run.outputs["head_fender_distance"] <= side
