"""Separation of ellipsoids from planes, rolls and each other against other ways to find it."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from models.contact.geometry import ellipsoid_direction, roll_direction, shape_matrix
from models.crash.car_contact import zone_separation
from models.crash.ellipsoids import Ellipsoids
from models.crash.surfaces import Contacts, empty_contacts
from models.vehicle.zones import PANEL, ROLL, Zones

Array = NDArray[np.float64]

FOREARM = (0.028, 0.028, 0.165)
FOOT = (0.095, 0.036, 0.032)


def six(matrix: Array) -> tuple[float, ...]:
    """Return xx, xy, xz, yy, yz, zz."""
    return tuple(float(matrix[i, j]) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))


def shape_of(semi_axes: Array, turn: Rotation) -> Array:
    R = turn.as_matrix()
    return np.asarray(R @ np.diag(np.square(semi_axes)) @ R.T)


def support(shape: Array, n: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("...i,ij,...j", n, shape, n)))


def sphere_points(count: int) -> Array:
    k = np.arange(count) + 0.5
    polar, around = np.arccos(1.0 - 2.0 * k / count), np.pi * (1.0 + math.sqrt(5.0)) * k
    return np.stack(
        [np.cos(around) * np.sin(polar), np.sin(around) * np.sin(polar), np.cos(polar)], axis=1
    )


DIRECTIONS = sphere_points(4000)
CIRCLE = np.stack([f(np.linspace(0.0, 2.0 * np.pi, 2001)[:-1]) for f in (np.cos, np.sin)], axis=1)


def largest_gap(gap: Callable[[Array], Array], directions: Array) -> tuple[float, Array]:
    """Return the largest gap over unit directions and where: dense sampling, then zooming."""
    n = directions[np.argmax(gap(directions))]
    reach = 0.06
    for _ in range(30):
        tangents = np.linalg.svd(n[None, :])[2][1:]
        offsets = np.linspace(-reach, reach, 9)
        mesh = np.stack(np.meshgrid(*[offsets] * len(tangents)), axis=-1).reshape(-1, len(tangents))
        near = n + mesh @ tangents
        near /= np.linalg.norm(near, axis=1, keepdims=True)
        n = near[np.argmax(gap(near))]
        reach *= 0.5
    return float(gap(n[None, :])[0]), n


def random_ellipsoid(rng: np.random.Generator, slenderness: float = 4.0) -> tuple[Array, Rotation]:
    semi_axes = rng.uniform(0.03, 0.05) * rng.uniform(1.0, slenderness, 3)
    return semi_axes, Rotation.random(random_state=rng)


def two_ellipsoids(
    rng: np.random.Generator, low: float, high: float
) -> tuple[Array, Array, Array, float]:
    """Return shapes, distance of the centres and the smallest semi-axis of a random pair."""
    (a, turn_a), (b, turn_b) = random_ellipsoid(rng), random_ellipsoid(rng)
    direction = rng.normal(size=3)
    d = direction / np.linalg.norm(direction) * rng.uniform(low, high) * (a.max() + b.max())
    return shape_of(a, turn_a), shape_of(b, turn_b), d, float(min(a.min(), b.min()))


def separation(
    A: Array, B: Array, d: Array, start: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[float, Array]:
    x, y, z, s = ellipsoid_direction(*d, six(A), six(B), *start)
    return s, np.array([x, y, z])


def test_shape_matrix() -> None:
    rng = np.random.default_rng(0)
    semi_axes, turn = random_ellipsoid(rng)
    rotations = np.stack([np.eye(3), turn.as_matrix()])
    found = shape_matrix(rotations, 1, *semi_axes**2)
    np.testing.assert_allclose(found, six(shape_of(semi_axes, turn)), rtol=1e-12)


def test_spheres() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        r, s = rng.uniform(0.02, 0.2, 2)
        d = rng.normal(0.0, 0.2, 3)
        gap, n = separation(r**2 * np.eye(3), s**2 * np.eye(3), d)
        assert gap == pytest.approx(np.linalg.norm(d) - r - s, abs=1e-12)
        np.testing.assert_allclose(n, d / np.linalg.norm(d), atol=1e-9)


def test_concentric_spheres_have_a_separation() -> None:
    gap, n = separation(0.1**2 * np.eye(3), 0.3**2 * np.eye(3), np.zeros(3))
    assert gap == pytest.approx(-0.4, rel=1e-12)
    assert np.linalg.norm(n) == pytest.approx(1.0, rel=1e-12)


def test_ellipsoids_on_a_common_axis() -> None:
    A, B = np.diag([0.1**2, 0.2**2, 0.05**2]), np.diag([0.03**2, 0.04**2, 0.1**2])
    for axis, reach in enumerate((0.13, 0.24, 0.15)):
        d = 0.4 * np.eye(3)[axis]
        gap, n = separation(A, B, d)
        assert gap == pytest.approx(0.4 - reach, abs=1e-12)
        assert n == pytest.approx(np.eye(3)[axis], abs=1e-9)


def test_ellipsoids_against_a_search_over_all_directions() -> None:
    rng = np.random.default_rng(2)
    touching = 0
    for _ in range(150):
        A, B, d, thinnest = two_ellipsoids(rng, 0.3, 1.2)

        def gap(n: Array, A: Array = A, B: Array = B, d: Array = d) -> Array:
            return np.asarray(n @ d - support(A, n) - support(B, n))

        expected, direction = largest_gap(gap, DIRECTIONS)
        if expected < -0.5 * thinnest:
            continue  # deeper than a contact lets limbs go: several local maxima
        touching += expected < 0.0
        found, n = separation(A, B, d)
        # TOLERANCE of the last turn: its square times a semi-axis is 2e-11 m.
        assert found == pytest.approx(expected, abs=1e-10)
        np.testing.assert_allclose(n, direction, atol=1e-4)
    assert touching > 10


def test_distance_of_ellipsoids_apart_is_that_of_their_nearest_points() -> None:
    rng = np.random.default_rng(3)
    for _ in range(15):
        (a, turn_a), (b, turn_b) = random_ellipsoid(rng), random_ellipsoid(rng)
        direction = rng.normal(size=3)
        d = direction / np.linalg.norm(direction) * 1.1 * (a.max() + b.max())

        # Points of the unit balls, mapped on the ellipsoids; in units of 0.1 m.
        def points(
            u: Array,
            d: Array = d,
            a: Array = a,
            b: Array = b,
            turn_a: Rotation = turn_a,
            turn_b: Rotation = turn_b,
        ) -> Array:
            return np.asarray(10.0 * (d + turn_a.apply(a * u[:3]) - turn_b.apply(b * u[3:])))

        result = minimize(
            lambda u, points=points: float(points(u) @ points(u)),
            np.zeros(6),
            method="SLSQP",
            constraints=[
                {"type": "ineq", "fun": lambda u: 1.0 - u[:3] @ u[:3]},
                {"type": "ineq", "fun": lambda u: 1.0 - u[3:] @ u[3:]},
            ],
            options={"ftol": 1e-15, "maxiter": 500},
        )
        distance = 0.1 * math.sqrt(result.fun)
        found, _ = separation(shape_of(a, turn_a), shape_of(b, turn_b), d)
        assert found == pytest.approx(distance, abs=1e-7)


def test_moving_along_the_normal_changes_the_separation_by_the_way() -> None:
    rng = np.random.default_rng(4)
    for _ in range(100):
        A, B, d, _ = two_ellipsoids(rng, 0.7, 1.2)
        gap, n = separation(A, B, d)
        touching, _ = separation(A, B, d - gap * n, tuple(n))
        assert touching == pytest.approx(0.0, abs=1e-10)


def test_order_and_start_of_the_search_do_not_matter() -> None:
    rng = np.random.default_rng(5)
    for _ in range(100):
        A, B, d, thinnest = two_ellipsoids(rng, 0.5, 1.2)
        gap, n = separation(A, B, d)
        if gap < -0.5 * thinnest:
            continue
        swapped, m = separation(B, A, -d)
        assert swapped == pytest.approx(gap, abs=1e-10)
        np.testing.assert_allclose(m, -n, atol=1e-6)
        near = Rotation.from_rotvec(rng.normal(0.0, 0.1, 3)).apply(n)
        assert separation(A, B, d, tuple(near))[0] == pytest.approx(gap, abs=1e-10)


def test_turning_the_scene_turns_the_normal() -> None:
    rng = np.random.default_rng(6)
    for _ in range(50):
        A, B, d, _ = two_ellipsoids(rng, 0.8, 1.2)
        R = Rotation.random(random_state=rng).as_matrix()
        gap, n = separation(A, B, d)
        turned, m = separation(R @ A @ R.T, R @ B @ R.T, R @ d)
        assert turned == pytest.approx(gap, abs=1e-10)
        np.testing.assert_allclose(m, R @ n, atol=1e-6)


def test_slender_ellipsoids() -> None:
    # The project's forearm and its neighbours at random poses, apart or touching.
    rng = np.random.default_rng(7)
    semi_axes = [np.array(s) for s in (FOREARM, FOREARM, FOOT)]
    residuals = []
    for _ in range(5000):
        a, b = semi_axes[0], semi_axes[rng.integers(3)]
        A, B = (shape_of(s, Rotation.random(random_state=rng)) for s in (a, b))
        direction = rng.normal(size=3)
        d = direction / np.linalg.norm(direction) * rng.uniform(0.5, 1.0) * (a.max() + b.max())
        gap, n = separation(A, B, d)
        if gap > -0.5 * 0.028:
            # At the maximum the tangential part of the gradient vanishes.
            gradient = d - A @ n / support(A, n) - B @ n / support(B, n)
            residuals.append(np.linalg.norm(gradient - n * (n @ gradient)))
    assert max(residuals) < 1e-6


def test_roll_against_a_search_over_all_directions() -> None:
    rng = np.random.default_rng(8)
    for _ in range(200):
        semi_axes, angle = 0.03 * rng.uniform(1.0, 4.0, 2), rng.uniform(0.0, 2.0 * np.pi)
        R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        P = R @ np.diag(semi_axes**2) @ R.T
        d = rng.uniform(-0.25, 0.25, 2)
        expected, direction = largest_gap(lambda n, P=P, d=d: n @ d - support(P, n), CIRCLE)
        n1, n3, found = roll_direction(*d, P[0, 0], P[0, 1], P[1, 1])
        assert found == pytest.approx(expected, abs=1e-10)
        np.testing.assert_allclose([n1, n3], direction, atol=1e-4)


def test_roll_against_a_sphere() -> None:
    for d1, d3, r in ((0.3, 0.4, 0.1), (-0.06, 0.08, 0.2), (0.0, -0.3, 0.3)):
        n1, n3, found = roll_direction(d1, d3, r * r, 0.0, r * r)
        distance = math.hypot(d1, d3)
        assert found == pytest.approx(distance - r, abs=1e-12)
        assert (n1, n3) == pytest.approx((d1 / distance, d3 / distance), abs=1e-9)


def test_roll_deep_in_a_slender_limb() -> None:
    # A limb of 163 x 29 mm whose surface is 9 mm from the roll's axis (80 mm into a bumper).
    d, P = np.array([0.0129325774, -0.0528278180]), np.zeros((2, 2))
    P[0] = 0.0068590419, 0.0109232144
    P[1] = 0.0109232144, 0.0206880464
    expected, _ = largest_gap(lambda n: n @ d - support(P, n), CIRCLE)
    assert roll_direction(*d, P[0, 0], P[0, 1], P[1, 1])[2] == pytest.approx(expected, abs=1e-9)


def one_zone(kind: int, slope: float) -> Zones:
    """Return a wide straight zone: a roll of 0.1 m at (-0.2, 0.6) or a panel from there."""
    return Zones(
        kind=np.array([kind]),
        origin=np.array([[-0.2, 0.6]]),
        radius=np.array([0.1 if kind == ROLL else 0.0]),
        direction=np.array([[-math.cos(slope), math.sin(slope)]]),
        length=np.array([0.0 if kind == ROLL else 2.0]),
        arc=np.array([[-math.pi - 1.0, math.pi + 1.0]]),
        inner=np.zeros(1),
        bend=np.array([2.0]),
        joined=np.zeros((1, 1), dtype=np.bool_),
        half_width=np.array([2.0]),
        curvature=np.array([0.0]),
        box=np.array([[-9.0, 9.0, -9.0, 9.0]]),
        friction=np.array([0.3, 0.6]),
        ploughing=np.zeros(1),
    )


def one_ellipsoid(semi_axes: Array, turn: Rotation) -> tuple[Ellipsoids, Contacts]:
    none = np.zeros((1, 1), dtype=np.int64)
    ellipsoids = Ellipsoids(
        square=semi_axes[None, :] ** 2,
        reach=semi_axes.max(keepdims=True),
        offset=np.zeros((1, 3)),
        laws=np.zeros((1, 10, 4)),
        counts=none[0],
        damping=np.zeros(1),
        surface_law=none,
        pairs=np.zeros((0, 3), dtype=np.int64),
        pair_gap=np.zeros(0),
        pair_friction=0.0,
    )
    contacts = empty_contacts(1, 1, 0)
    shape = turn.as_matrix() @ np.diag(semi_axes**2) @ turn.as_matrix().T
    contacts.shape[0] = shape[np.triu_indices(3)]
    return ellipsoids, contacts


@pytest.mark.parametrize("yaw", [0.0, 0.3])
def test_panel_separation_is_that_of_the_lowest_point(yaw: float) -> None:
    rng = np.random.default_rng(9)
    slope = math.radians(11.0)
    normal = np.array([math.sin(slope), 0.0, math.cos(slope)])
    to_car = Rotation.from_rotvec([0.0, 0.0, -yaw])
    for _ in range(50):
        semi_axes, turn = random_ellipsoid(rng)
        ellipsoids, contacts = one_ellipsoid(semi_axes, turn)
        foot = np.array([-0.2, 0.0, 0.6]) + rng.uniform(0.5, 1.5) * np.array(
            [-math.cos(slope), 0.0, math.sin(slope)]
        )
        centre = foot + [0.0, rng.uniform(-0.5, 0.5), 0.0] + rng.uniform(-0.02, 0.03) * normal
        found = zone_separation(
            one_zone(PANEL, slope),
            ellipsoids,
            contacts,
            0,
            0,
            *centre,
            math.cos(yaw),
            math.sin(yaw),
        )
        # Lowest of the surface points centre + R (a u), by optimisation over u.
        in_car = to_car * turn
        lowest = minimize(
            lambda u, semi=semi_axes, turn=in_car, centre=centre: float(
                normal @ (centre + turn.apply(semi * u / np.linalg.norm(u)) - [-0.2, 0.0, 0.6])
            ),
            -in_car.inv().apply(normal) + 0.01,
            tol=1e-14,
        )
        assert found[0] == pytest.approx(lowest.fun, abs=1e-9)
        assert found[1:4] == pytest.approx(normal, abs=1e-12)
        point = np.array(found[4:7])
        assert normal @ (point - [-0.2, 0.0, 0.6]) == pytest.approx(found[0], abs=1e-12)
        on_surface = in_car.inv().apply(point - centre) / semi_axes
        assert np.linalg.norm(on_surface) == pytest.approx(1.0, abs=1e-12)
        assert found[7] == 1.0


@pytest.mark.parametrize("yaw", [0.0, 0.3])
def test_roll_separation_is_that_of_the_nearest_point(yaw: float) -> None:
    rng = np.random.default_rng(10)
    to_car = Rotation.from_rotvec([0.0, 0.0, -yaw])
    for _ in range(30):
        semi_axes, turn = random_ellipsoid(rng, slenderness=2.5)
        ellipsoids, contacts = one_ellipsoid(semi_axes, turn)
        angle = rng.uniform(-1.5, 1.5)
        away = np.array([math.cos(angle), 0.0, math.sin(angle)])
        distance = semi_axes.max() + rng.uniform(0.02, 0.09)
        centre = np.array([-0.2, rng.uniform(-0.5, 0.5), 0.6]) + distance * away
        found = zone_separation(
            one_zone(ROLL, 0.0), ellipsoids, contacts, 0, 0, *centre, math.cos(yaw), math.sin(yaw)
        )
        in_car = to_car * turn

        def from_axis(
            u: Array, semi: Array = semi_axes, turn: Rotation = in_car, centre: Array = centre
        ) -> float:
            x, _, z = centre + turn.apply(semi * u / np.linalg.norm(u)) - [-0.2, 0.0, 0.6]
            return math.hypot(x, z)

        nearest = minimize(from_axis, -in_car.inv().apply(away), tol=1e-14)
        assert found[0] == pytest.approx(nearest.fun - 0.1, abs=1e-8)
        # The normal points from the axis to the contact point, which lies on the ellipsoid.
        point = np.array(found[4:7])
        assert math.hypot(point[0] + 0.2, point[2] - 0.6) - 0.1 == pytest.approx(found[0], abs=1e-8)
        reached = np.linalg.norm(in_car.inv().apply(point - centre) / semi_axes)
        assert reached == pytest.approx(1.0, abs=1e-12)
        assert found[2] == 0.0
