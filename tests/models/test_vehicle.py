"""The car: braking arc, stiffness corridors, dive and wrap-around distance."""

import math
from itertools import pairwise

import numpy as np
import pytest
from builders import GRAVITY, Array, quiet, turned
from hypothesis import given
from hypothesis import strategies as st

from models.contact.law import KNOTS
from models.vehicle.motion import CarMotion, braking_motion, car_state, stopping_distance
from models.vehicle.profile import (
    Vehicle,
    Zone,
    build_zones,
    hood_edge_distance,
    load_vehicle,
    static_point,
    surface_point,
    vehicle_names,
    wrap_around_distance,
)
from models.vehicle.zones import ROLL

NAMES = ("family_car_1990s", "suv_high_front")
BOTH = pytest.mark.parametrize("name", NAMES)
ZONES = [
    pytest.param(zone, id=f"{name}-{zone.name}")
    for name in NAMES
    for zone in load_vehicle(name).zones
]


def state(motion: CarMotion, time: float) -> Array:
    """Return x, y, yaw and their rates."""
    car = np.zeros(6)
    car_state(motion, time, car)
    return car


def zones_of(name: str, *zones: str) -> tuple[Vehicle, list[Zone]]:
    """Return a vehicle and some of its zones."""
    vehicle = load_vehicle(name)
    return vehicle, [vehicle.zones[vehicle.zone_index(zone)] for zone in zones]


@pytest.mark.parametrize(("kmh", "friction"), [(40.0, 0.7), (100.0, 0.9)])
def test_car_stops_where_friction_says(kmh: float, friction: float) -> None:
    speed = kmh / 3.6
    motion = braking_motion(speed, friction, 0.0, 1.7)
    path, stop = speed**2 / (2.0 * friction * GRAVITY), speed / (friction * GRAVITY)
    assert stopping_distance(motion) == pytest.approx(path, rel=1e-12)
    for time in (stop, stop + 1e-9, 10.0 * stop):
        assert state(motion, time) == pytest.approx([path, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-9)
    assert state(motion, 0.5 * stop)[3] == pytest.approx(0.5 * speed, rel=1e-12)
    # Data sheet, section 0: mu = 0.7 stops 42.2 km/h in 10 m (v^2 = 2 mu g s).
    case = stopping_distance(braking_motion(42.2 / 3.6, 0.7, 1.0, 1.7))
    assert case == pytest.approx(10.0, abs=0.02)
    standing = braking_motion(0.0, 0.7, 1.0, 1.7)
    assert stopping_distance(standing) == 0.0 and not state(standing, 1.0).any()


@quiet(60)
@given(
    st.floats(1.0, 30.0),
    st.floats(0.2, 1.2),
    st.one_of(st.just(0.0), st.floats(0.01, 3.0), st.floats(-3.0, -0.01)),
    st.floats(0.02, 0.98),
)
def test_velocities_are_the_rates_of_the_position(
    speed: float, friction: float, yaw_rate: float, share: float
) -> None:
    motion = braking_motion(speed, friction, yaw_rate, 1.7)
    time, step = share * speed / motion.deceleration, 1e-4
    rate = (state(motion, time + step)[:3] - state(motion, time - step)[:3]) / (2.0 * step)
    # Third derivatives, up to speed times yaw rate^2 or three decelerations times yaw rate.
    bound = step**2 * (speed * yaw_rate**2 + 40.0 * abs(yaw_rate)) * (1.0 + 1.7 * abs(yaw_rate))
    np.testing.assert_allclose(state(motion, time)[3:], rate, atol=bound + 1e-9)


@pytest.mark.parametrize("yaw_rate", [1.0, -0.4, 2.5])
def test_pivot_moves_on_a_circle_along_the_axis(yaw_rate: float) -> None:
    speed, pivot = 11.1, 1.7
    motion = braking_motion(speed, 0.7, yaw_rate, pivot)
    assert state(motion, 0.0) == pytest.approx(
        [0.0, 0.0, 0.0, speed, yaw_rate * pivot, yaw_rate], abs=1e-12
    )
    radius = speed / yaw_rate
    for time in (0.1, 0.5, 1.0, 5.0):
        x, y, yaw, vx, vy, rate = state(motion, time)
        along, left = np.array([math.cos(yaw), math.sin(yaw)]), [-math.sin(yaw), math.cos(yaw)]
        point = np.array([x, y]) - pivot * along
        # Centre of the circle: beside where the pivot was at impact.
        assert np.linalg.norm(point - [-pivot, radius]) == pytest.approx(abs(radius), rel=1e-12)
        velocity = np.array([vx, vy]) - rate * pivot * np.array(left)
        assert velocity @ left == pytest.approx(0.0, abs=1e-12)
        assert velocity @ along == pytest.approx(rate * radius, abs=1e-12)


def test_straight_line_is_the_limit_of_the_arc() -> None:
    straight = state(braking_motion(11.1, 0.7, 0.0, 1.7), 0.8)[:2]
    for yaw_rate in (1e-9, 1e-7, 1e-6):
        gentle = state(braking_motion(11.1, 0.7, yaw_rate, 1.7), 0.8)[:2]
        np.testing.assert_allclose(gentle, straight, atol=20.0 * yaw_rate + 1e-9)


@pytest.mark.parametrize("zone", ZONES)
def test_corridor_of_a_zone(zone: Zone) -> None:
    corridor, depth = zone.corridor, np.linspace(0.001, 0.3, 150)
    curves = [corridor.curve(c) for c in np.linspace(0.0, 1.0, 51)]
    for k, bound in ((0, corridor.lower), (25, corridor.median), (50, corridor.upper)):
        np.testing.assert_allclose(curves[k].at(depth), bound.at(depth), rtol=1e-12, atol=1e-9)
    table = np.array([curve.at(depth) for curve in curves])
    assert (np.diff(table, axis=1) > 0.0).all() and (np.diff(table, axis=0) > 0.0).all()
    for curve in curves:
        assert curve.penetration.size <= KNOTS // 2
        assert curve.unloading_ratio == corridor.median.unloading_ratio
        assert curve.damping == corridor.median.damping


@BOTH
def test_a_vehicle_has_the_zones_of_a_head_impact_and_they_join(name: str) -> None:
    vehicle, (edge, hood) = zones_of(name, "hood_edge", "hood")
    assert name in vehicle_names() and vehicle.name == name
    assert vehicle.title and vehicle.source
    names = {zone.name for zone in vehicle.zones}
    assert names >= {"hood", "hood_edge", "bumper", "fender_side", "windscreen", "roof"}
    assert all(vehicle.zones[vehicle.zone_index(zone)].name == zone for zone in names)
    assert vehicle.zone_index("spoiler") == -1
    # The hood starts on the surface of the edge's roll, tangentially.
    radius = hood.origin - edge.origin
    assert np.linalg.norm(radius) == pytest.approx(edge.radius, abs=1e-3)
    assert radius @ hood.direction == pytest.approx(0.0, abs=2e-3)
    heights = [float(zone.origin[1]) for zone in vehicle.zones if zone.inner == 0.0]
    assert all(b > a for a, b in pairwise(heights))


def test_hood_edge_of_the_case_and_unknown_vehicles() -> None:
    # 0.77 m = 1.35 - 0.58 m, known to the centimetre (data sheet, section 0).
    edges = [hood_edge_distance(name) for name in NAMES]
    assert edges[0] == pytest.approx(0.77, abs=0.01)
    assert edges[1] > edges[0] + 0.2
    with pytest.raises(ValueError, match="family_car_1990s"):
        load_vehicle("lorry")


@BOTH
@pytest.mark.parametrize("degrees", [-1.0, 0.0, 5.0])
def test_dive_turns_the_front_down_about_its_pivot(name: str, degrees: float) -> None:
    vehicle, angle = load_vehicle(name), math.radians(degrees)
    zones = build_zones(vehicle, angle, 0.3)
    origins = np.array([zone.origin for zone in vehicle.zones])
    # A turn about (-dive_pivot, 0); lengths between zones are kept, and back again.
    pivot = np.array([-vehicle.dive_pivot, 0.0])
    found = (origins - pivot) @ turned(-angle).T + pivot
    np.testing.assert_allclose(zones.origin[:, 1], found[:, 1], atol=1e-12)
    np.testing.assert_allclose(np.ptp(zones.origin[:, 0] - found[:, 0]), 0.0, atol=1e-12)
    for dived, origin in zip(zones.origin, origins, strict=True):
        np.testing.assert_allclose(static_point(vehicle, angle, dived), origin, atol=1e-12)
    # The foremost roll touches x = 0.
    rolls = zones.kind == ROLL
    assert (zones.origin[rolls, 0] + zones.radius[rolls]).max() == pytest.approx(0.0, abs=1e-12)
    assert (zones.friction == 0.3).all()


@BOTH
def test_wrap_around_distance_of_known_points(name: str) -> None:
    vehicle, (bumper, hood, screen) = zones_of(name, "bumper", "hood", "windscreen")
    front, j, k = (vehicle.zone_index(zone) for zone in ("bumper", "hood", "windscreen"))
    # Straight up to the foremost point of the bumper, then round its roll by the arc's length.
    nose = bumper.origin + np.array([bumper.radius, 0.0])
    assert wrap_around_distance(name, front, nose) == pytest.approx(nose[1], abs=1e-4)
    above = bumper.origin + bumper.radius * np.array([math.cos(0.5), math.sin(0.5)])
    distance = wrap_around_distance(name, front, above)
    assert distance == pytest.approx(nose[1] + 0.5 * bumper.radius, abs=1e-4)
    # On the hood, which leaves the edge's roll tangentially, the tape lies on the hood.
    along = np.linspace(0.0, hood.length, 21)
    points = hood.origin + along[:, None] * hood.direction
    distances = np.array([wrap_around_distance(name, j, point) for point in points])
    # The rolls are polygons of half a degree, which costs a tenth of a millimetre at the join.
    np.testing.assert_allclose(np.diff(distances), along[1], atol=2e-4)
    assert distances[0] > hood_edge_distance(name)
    # No tape is shorter than the straight line from the road under the front.
    assert (distances > np.linalg.norm(points, axis=1) - 1e-9).all()
    # The tape to the windscreen bridges the cowl.
    top, rear = screen.origin + screen.length * screen.direction, points[-1]
    way = np.linalg.norm(screen.origin - rear) + np.linalg.norm(top - screen.origin)
    assert wrap_around_distance(name, k, top) < distances[-1] + float(way)


def test_surface_point_is_the_nearest_of_its_zone() -> None:
    zones = build_zones(load_vehicle("family_car_1990s"), 0.02, 0.3)
    for j in range(zones.radius.size):
        inside = zones.origin[j] + 0.3 * zones.length[j] * zones.direction[j] + [-0.01, -0.02]
        found = surface_point(zones, j, inside)
        if zones.kind[j] == ROLL:
            assert np.linalg.norm(found - zones.origin[j]) == pytest.approx(zones.radius[j])
        else:
            assert (found - inside) @ zones.direction[j] == pytest.approx(0.0, abs=1e-12)
