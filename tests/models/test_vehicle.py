"""The car: braking arc, stiffness corridors, dive and wrap-around distance."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from models.contact.law import KNOTS
from models.vehicle.motion import CarMotion, braking_motion, car_state, stopping_distance
from models.vehicle.profile import (
    Corridor,
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

Array = NDArray[np.float64]

GRAVITY = 9.80665
NAMES = ("family_car_1990s", "suv_high_front")
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


@pytest.mark.parametrize(("kmh", "friction"), [(40.0, 0.7), (45.0, 0.6), (100.0, 0.9)])
def test_car_stops_where_friction_says(kmh: float, friction: float) -> None:
    speed = kmh / 3.6
    motion = braking_motion(speed, friction, 0.0, 1.7)
    path = speed**2 / (2.0 * friction * GRAVITY)
    assert stopping_distance(motion) == pytest.approx(path, rel=1e-12)
    stop = speed / (friction * GRAVITY)
    for time in (stop, stop + 1e-9, 10.0 * stop):
        assert state(motion, time) == pytest.approx([path, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-9)
    assert state(motion, 0.5 * stop)[3] == pytest.approx(0.5 * speed, rel=1e-12)


def test_case_car_stops_after_ten_metres() -> None:
    # Data sheet, section 0: mu = 0.7 stops 42.2 km/h in 10 m (v^2 = 2 mu g s).
    assert stopping_distance(braking_motion(42.2 / 3.6, 0.7, 1.0, 1.7)) == pytest.approx(
        10.0, abs=0.02
    )


@settings(derandomize=True, deadline=None)
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
    straight = braking_motion(11.1, 0.7, 0.0, 1.7)
    for yaw_rate in (1e-9, 1e-7, 1e-6):
        gentle = braking_motion(11.1, 0.7, yaw_rate, 1.7)
        np.testing.assert_allclose(
            state(gentle, 0.8)[:2], state(straight, 0.8)[:2], atol=20.0 * yaw_rate + 1e-9
        )


def test_standing_car_does_not_move() -> None:
    motion = braking_motion(0.0, 0.7, 1.0, 1.7)
    assert stopping_distance(motion) == 0.0
    np.testing.assert_array_equal(state(motion, 1.0), 0.0)


def forces(corridor: Corridor, coordinate: float, depth: Array) -> Array:
    return corridor.curve(coordinate).at(depth)


@pytest.mark.parametrize("zone", ZONES)
def test_corridor_ends_and_middle_are_its_curves(zone: Zone) -> None:
    depth = np.linspace(0.0, 0.3, 301)
    corridor = zone.corridor
    for coordinate, curve in ((0.0, corridor.lower), (0.5, corridor.median), (1.0, corridor.upper)):
        np.testing.assert_allclose(
            forces(corridor, coordinate, depth), curve.at(depth), rtol=1e-12, atol=1e-9
        )


@pytest.mark.parametrize("zone", ZONES)
def test_force_rises_with_the_coordinate_and_the_depth(zone: Zone) -> None:
    depth = np.linspace(0.001, 0.2, 100)
    table = np.array([forces(zone.corridor, c, depth) for c in np.linspace(0.0, 1.0, 201)])
    assert (np.diff(table, axis=1) > 0.0).all()
    assert (np.diff(table, axis=0) > 0.0).all()


@pytest.mark.parametrize("zone", ZONES)
def test_curves_of_a_corridor_can_be_combined(zone: Zone) -> None:
    for coordinate in (0.0, 0.1, 0.3, 0.5, 0.8, 1.0):
        curve = zone.corridor.curve(coordinate)
        assert curve.penetration.size <= KNOTS // 2
        assert curve.unloading_ratio == zone.corridor.median.unloading_ratio
        assert curve.damping == zone.corridor.median.damping


@pytest.mark.parametrize("coordinate", [-0.01, 1.01, math.nan])
def test_coordinate_outside_the_corridor_is_refused(coordinate: float) -> None:
    corridor = load_vehicle(NAMES[0]).zones[0].corridor
    with pytest.raises(ValueError, match="corridor"):
        corridor.curve(coordinate)


def test_both_vehicles_load() -> None:
    assert set(NAMES) <= set(vehicle_names())
    for name in NAMES:
        vehicle = load_vehicle(name)
        assert vehicle.name == name
        assert vehicle.title and vehicle.source
        assert vehicle.zone_index("hood") >= 0
        assert vehicle.zone_index("spoiler") == -1
        assert vehicle.zones[vehicle.zone_index("roof")].name == "roof"
    edges = [hood_edge_distance(name) for name in NAMES]
    assert edges[1] > edges[0] + 0.2


def test_unknown_vehicle_is_refused() -> None:
    with pytest.raises(ValueError, match="family_car_1990s"):
        load_vehicle("lorry")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("degrees", [-1.0, 0.0, 2.0, 5.0])
def test_dive_turns_the_front_down_about_its_pivot(name: str, degrees: float) -> None:
    vehicle, angle = load_vehicle(name), math.radians(degrees)
    zones = build_zones(vehicle, angle, 0.3)
    for j, zone in enumerate(vehicle.zones):
        # Height after a turn about (-dive_pivot, 0).
        lever = zone.origin[0] + vehicle.dive_pivot
        height = zone.origin[1] * math.cos(angle) - lever * math.sin(angle)
        assert zones.origin[j, 1] == pytest.approx(height, abs=1e-12)
        # And back again.
        np.testing.assert_allclose(
            static_point(vehicle, angle, zones.origin[j]), zone.origin, atol=1e-12
        )
    # Lengths between zones are kept, and the foremost roll touches x = 0.
    static = np.array([zone.origin for zone in vehicle.zones])
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(zones.origin, axis=0), axis=1),
        np.linalg.norm(np.diff(static, axis=0), axis=1),
        rtol=1e-12,
    )
    rolls = zones.kind == ROLL
    assert (zones.origin[rolls, 0] + zones.radius[rolls]).max() == pytest.approx(0.0, abs=1e-12)
    assert (zones.friction == 0.3).all()


@pytest.mark.parametrize("name", NAMES)
def test_wrap_around_distance_of_known_points(name: str) -> None:
    vehicle = load_vehicle(name)
    front, j = vehicle.zone_index("bumper"), vehicle.zone_index("hood")
    bumper, hood = vehicle.zones[front], vehicle.zones[j]
    # Straight up to the foremost point of the bumper, then round its roll by the arc's length.
    nose = bumper.origin + np.array([bumper.radius, 0.0])
    assert wrap_around_distance(name, front, nose) == pytest.approx(nose[1], abs=1e-4)
    turned = bumper.origin + bumper.radius * np.array([math.cos(0.5), math.sin(0.5)])
    assert wrap_around_distance(name, front, turned) == pytest.approx(
        nose[1] + 0.5 * bumper.radius, abs=1e-4
    )
    # On the hood, which leaves the edge's roll tangentially, the tape lies on the hood.
    along = np.linspace(0.0, hood.length, 21)
    distances = [wrap_around_distance(name, j, hood.origin + s * hood.direction) for s in along]
    # The rolls are polygons of half a degree, which costs a tenth of a millimetre at the join.
    np.testing.assert_allclose(np.diff(distances), along[1], atol=2e-4)
    assert distances[0] > hood_edge_distance(name)
    # No tape is shorter than the straight line from the road under the front.
    for s, distance in zip(along, distances, strict=True):
        assert distance > float(np.linalg.norm(hood.origin + s * hood.direction)) - 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_tape_to_the_windscreen_bridges_the_cowl(name: str) -> None:
    vehicle = load_vehicle(name)
    j = vehicle.zone_index("windscreen")
    screen, hood = vehicle.zones[j], vehicle.zones[vehicle.zone_index("hood")]
    top = screen.origin + screen.length * screen.direction
    rear = hood.origin + hood.length * hood.direction
    over_hood = wrap_around_distance(name, vehicle.zone_index("hood"), rear)
    along_surface = over_hood + float(
        np.linalg.norm(screen.origin - rear) + np.linalg.norm(top - screen.origin)
    )
    assert wrap_around_distance(name, j, top) < along_surface


def test_surface_point_is_the_nearest_of_its_zone() -> None:
    zones = build_zones(load_vehicle("family_car_1990s"), 0.02, 0.3)
    for j in range(zones.radius.size):
        inside = zones.origin[j] + 0.3 * zones.length[j] * zones.direction[j] + [-0.01, -0.02]
        found = surface_point(zones, j, inside)
        if zones.kind[j] == ROLL:
            assert np.linalg.norm(found - zones.origin[j]) == pytest.approx(zones.radius[j])
        else:
            assert (found - inside) @ zones.direction[j] == pytest.approx(0.0, abs=1e-12)


def test_hood_edge_of_the_case() -> None:
    # 0.77 m = 1.35 - 0.58 m, known to the centimetre (data sheet, section 0).
    assert hood_edge_distance("family_car_1990s") == pytest.approx(0.77, abs=0.01)


@pytest.mark.parametrize("name", NAMES)
def test_zones_join(name: str) -> None:
    # The hood starts on the surface of the edge's roll, tangentially.
    vehicle = load_vehicle(name)
    edge, hood = (vehicle.zones[vehicle.zone_index(n)] for n in ("hood_edge", "hood"))
    radius = hood.origin - edge.origin
    assert np.linalg.norm(radius) == pytest.approx(edge.radius, abs=1e-3)
    assert radius @ hood.direction == pytest.approx(0.0, abs=2e-3)
    heights = [float(zone.origin[1]) for zone in vehicle.zones if zone.inner == 0.0]
    assert all(b > a for a, b in pairwise(heights))
