"""Separation of ellipsoids from planes, rolls and each other against other ways to find it."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from builders import Array, six, turned
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from models.contact.geometry import ellipsoid_direction, roll_direction, shape_matrix
from models.crash.ellipsoids import Ellipsoids
from models.crash.surfaces import Contacts, empty_contacts
from models.crash.zone_front import zone_separation
from models.vehicle.zones import PANEL, ROLL, Zones

FOREARM = (0.028, 0.028, 0.165)
FOOT = (0.095, 0.036, 0.032)
CORNER = np.array([-0.2, 0.0, 0.6])
"""Where the zone of a test begins, or the axis of its roll lies."""


def shape_of(semi_axes: Array, turn: Rotation) -> Array:
    R = turn.as_matrix()
    return np.asarray(R @ np.diag(np.square(semi_axes)) @ R.T)


def support(shape: Array, n: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("...i,ij,...j", n, shape, n)))


def sphere_points(count: int) -> Array:
    k = np.arange(count) + 0.5
    polar, around = np.arccos(1.0 - 2.0 * k / count), np.pi * (1.0 + math.sqrt(5.0)) * k
    flat = np.stack([np.cos(around), np.sin(around)]) * np.sin(polar)
    return np.stack([*flat, np.cos(polar)], axis=1)


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


def unit(rng: np.random.Generator) -> Array:
    direction = rng.normal(size=3)
    return np.asarray(direction / np.linalg.norm(direction))


def two_ellipsoids(
    rng: np.random.Generator, low: float, high: float
) -> tuple[Array, Array, Array, float]:
    """Return shapes, distance of the centres and the smallest semi-axis of a random pair."""
    (a, turn_a), (b, turn_b) = random_ellipsoid(rng), random_ellipsoid(rng)
    d = unit(rng) * rng.uniform(low, high) * (a.max() + b.max())
    return shape_of(a, turn_a), shape_of(b, turn_b), d, float(min(a.min(), b.min()))


def separation(
    A: Array, B: Array, d: Array, start: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[float, Array]:
    x, y, z, s = ellipsoid_direction(*d, six(A), six(B), *start)
    return s, np.array([x, y, z])


def test_shape_matrix() -> None:
    semi_axes, turn = random_ellipsoid(np.random.default_rng(0))
    found = shape_matrix(np.stack([np.eye(3), turn.as_matrix()]), 1, *semi_axes**2)
    np.testing.assert_allclose(found, six(shape_of(semi_axes, turn)), rtol=1e-12)


def test_spheres_and_ellipsoids_on_a_common_axis() -> None:
    rng = np.random.default_rng(1)
    for _ in range(30):
        r, s = rng.uniform(0.02, 0.2, 2)
        d = rng.normal(0.0, 0.2, 3)
        gap, n = separation(r**2 * np.eye(3), s**2 * np.eye(3), d)
        assert gap == pytest.approx(np.linalg.norm(d) - r - s, abs=1e-12)
        np.testing.assert_allclose(n, d / np.linalg.norm(d), atol=1e-9)
    A, B = np.diag([0.1**2, 0.2**2, 0.05**2]), np.diag([0.03**2, 0.04**2, 0.1**2])
    for axis, reach in zip(np.eye(3), (0.13, 0.24, 0.15), strict=True):
        gap, n = separation(A, B, 0.4 * axis)
        assert gap == pytest.approx(0.4 - reach, abs=1e-12)
        assert n == pytest.approx(axis, abs=1e-9)
    gap, n = separation(0.1**2 * np.eye(3), 0.3**2 * np.eye(3), np.zeros(3))
    assert gap == pytest.approx(-0.4, rel=1e-12)
    assert np.linalg.norm(n) == pytest.approx(1.0, rel=1e-12)


def test_ellipsoids_against_a_search_over_all_directions() -> None:
    rng = np.random.default_rng(2)
    touching = 0
    for _ in range(75):
        A, B, d, thinnest = two_ellipsoids(rng, 0.3, 1.2)
        expected, direction = largest_gap(
            lambda n, A=A, B=B, d=d: n @ d - support(A, n) - support(B, n), DIRECTIONS
        )
        if expected < -0.5 * thinnest:
            continue  # deeper than a contact lets limbs go: several local maxima
        touching += expected < 0.0
        found, n = separation(A, B, d)
        # TOLERANCE of the last turn: its square times a semi-axis is 2e-11 m.
        assert found == pytest.approx(expected, abs=1e-10)
        np.testing.assert_allclose(n, direction, atol=1e-4)
    assert touching > 5


def test_distance_of_ellipsoids_apart_is_that_of_their_nearest_points() -> None:
    rng = np.random.default_rng(3)
    for _ in range(10):
        (a, turn_a), (b, turn_b) = random_ellipsoid(rng), random_ellipsoid(rng)
        d = unit(rng) * 1.1 * (a.max() + b.max())
        A, B = turn_a.as_matrix() * a, turn_b.as_matrix() * b

        # Points of the unit balls, mapped on the ellipsoids; in units of 0.1 m.
        def square(u: Array, d: Array = d, A: Array = A, B: Array = B) -> float:
            return float(100.0 * np.sum((d + A @ u[:3] - B @ u[3:]) ** 2))

        inside = [
            {"type": "ineq", "fun": lambda u, k=k: 1.0 - u[k : k + 3] @ u[k : k + 3]}
            for k in (0, 3)
        ]
        options = {"ftol": 1e-15, "maxiter": 500}
        nearest = minimize(square, np.zeros(6), method="SLSQP", constraints=inside, options=options)
        found, _ = separation(A @ A.T, B @ B.T, d)
        assert found == pytest.approx(0.1 * math.sqrt(nearest.fun), abs=1e-7)


def test_way_order_start_and_turn_of_the_scene() -> None:
    rng = np.random.default_rng(5)
    for _ in range(60):
        A, B, d, thinnest = two_ellipsoids(rng, 0.7, 1.2)
        gap, n = separation(A, B, d)
        # Moving along the normal changes the separation by the way.
        assert separation(A, B, d - gap * n, tuple(n))[0] == pytest.approx(0.0, abs=1e-10)
        if gap < -0.5 * thinnest:
            continue
        swapped, m = separation(B, A, -d)
        assert swapped == pytest.approx(gap, abs=1e-10)
        np.testing.assert_allclose(m, -n, atol=1e-6)
        near = Rotation.from_rotvec(rng.normal(0.0, 0.1, 3)).apply(n)
        assert separation(A, B, d, tuple(near))[0] == pytest.approx(gap, abs=1e-10)
        R = Rotation.random(random_state=rng).as_matrix()
        other, m = separation(R @ A @ R.T, R @ B @ R.T, R @ d)
        assert other == pytest.approx(gap, abs=1e-10)
        np.testing.assert_allclose(m, R @ n, atol=1e-6)


def check_slender(count: int) -> None:
    rng, residuals = np.random.default_rng(7), []
    for _ in range(count):
        a, b = np.array(FOREARM), np.array((FOREARM, FOREARM, FOOT)[rng.integers(3)])
        A, B = (shape_of(s, Rotation.random(random_state=rng)) for s in (a, b))
        d = unit(rng) * rng.uniform(0.5, 1.0) * (a.max() + b.max())
        gap, n = separation(A, B, d)
        if gap > -0.5 * 0.028:
            # At the maximum the tangential part of the gradient vanishes.
            gradient = d - A @ n / support(A, n) - B @ n / support(B, n)
            residuals.append(np.linalg.norm(gradient - n * (n @ gradient)))
    assert max(residuals) < 1e-6


def test_slender_ellipsoids() -> None:
    # The project's forearm and its neighbours at random poses, apart or touching.
    check_slender(500)


@pytest.mark.slow
def test_many_slender_ellipsoids() -> None:
    check_slender(20_000)


def test_roll_against_a_search_over_all_directions() -> None:
    rng = np.random.default_rng(8)
    for _ in range(80):
        R = turned(rng.uniform(0.0, 2.0 * np.pi))
        P = R @ np.diag((0.03 * rng.uniform(1.0, 4.0, 2)) ** 2) @ R.T
        d = rng.uniform(-0.25, 0.25, 2)
        expected, direction = largest_gap(lambda n, P=P, d=d: n @ d - support(P, n), CIRCLE)
        n1, n3, found = roll_direction(*d, P[0, 0], P[0, 1], P[1, 1])
        assert found == pytest.approx(expected, abs=1e-10)
        np.testing.assert_allclose([n1, n3], direction, atol=1e-4)
    # A limb of 163 x 29 mm whose surface is 9 mm from the roll's axis (80 mm into a bumper).
    d = np.array([0.0129325774, -0.0528278180])
    P = np.array([[0.0068590419, 0.0109232144], [0.0109232144, 0.0206880464]])
    expected, _ = largest_gap(lambda n: n @ d - support(P, n), CIRCLE)
    assert roll_direction(*d, P[0, 0], P[0, 1], P[1, 1])[2] == pytest.approx(expected, abs=1e-9)


def test_roll_against_a_sphere() -> None:
    for d1, d3, r in ((0.3, 0.4, 0.1), (-0.06, 0.08, 0.2), (0.0, -0.3, 0.3)):
        n1, n3, found = roll_direction(d1, d3, r * r, 0.0, r * r)
        distance = math.hypot(d1, d3)
        assert found == pytest.approx(distance - r, abs=1e-12)
        assert (n1, n3) == pytest.approx((d1 / distance, d3 / distance), abs=1e-9)


def one_zone(kind: int, slope: float) -> Zones:
    """Return a wide straight zone: a roll of 0.1 m about the corner, or a panel from there."""
    roll = kind == ROLL
    return Zones(
        kind=np.array([kind]), origin=CORNER[None, ::2], radius=np.array([0.1 if roll else 0.0]),
        direction=np.array([[-math.cos(slope), math.sin(slope)]]),
        length=np.array([0.0 if roll else 2.0]), arc=np.array([[-math.pi - 1.0, math.pi + 1.0]]),
        inner=np.zeros(1), bend=np.array([2.0]), joined=np.zeros((1, 1), dtype=np.bool_),
        half_width=np.array([2.0]), curvature=np.array([0.0]),
        box=np.array([[-9.0, 9.0, -9.0, 9.0]]), friction=np.array([0.3, 0.6]),
        ploughing=np.zeros(1),
    )  # fmt: skip


def one_ellipsoid(semi_axes: Array, turn: Rotation) -> tuple[Ellipsoids, Contacts]:
    none = np.zeros((1, 1), dtype=np.int64)
    ellipsoids = Ellipsoids(
        square=semi_axes[None, :] ** 2, reach=semi_axes.max(keepdims=True),
        offset=np.zeros((1, 3)), laws=np.zeros((1, 10, 4)), counts=none[0], damping=np.zeros(1),
        surface_law=none, pairs=np.zeros((0, 3), dtype=np.int64), pair_gap=np.zeros(0),
        pair_friction=0.0,
    )  # fmt: skip
    contacts = empty_contacts(1, 1, 0)
    contacts.shape[0] = six(shape_of(semi_axes, turn))
    return ellipsoids, contacts


@pytest.mark.parametrize("yaw", [0.0, 0.3])
@pytest.mark.parametrize("kind", [PANEL, ROLL])
def test_separation_from_a_zone_is_that_of_the_nearest_point(kind: int, yaw: float) -> None:
    rng = np.random.default_rng(9 + kind)
    slope = math.radians(11.0)
    normal = np.array([math.sin(slope), 0.0, math.cos(slope)])
    rearwards = np.array([-math.cos(slope), 0.0, math.sin(slope)])
    to_car = Rotation.from_rotvec([0.0, 0.0, -yaw])
    for _ in range(15):
        semi_axes, turn = random_ellipsoid(rng, 4.0 if kind == PANEL else 2.5)
        if kind == PANEL:
            away = rng.uniform(0.5, 1.5) * rearwards + rng.uniform(-0.02, 0.03) * normal
        else:
            angle = rng.uniform(-1.5, 1.5)
            normal = np.array([math.cos(angle), 0.0, math.sin(angle)])
            away = (semi_axes.max() + rng.uniform(0.02, 0.09)) * normal
        centre = CORNER + away + [0.0, rng.uniform(-0.5, 0.5), 0.0]
        found = zone_separation(
            one_zone(kind, slope), *one_ellipsoid(semi_axes, turn), 0, 0, *centre,
            math.cos(yaw), math.sin(yaw),
        )  # fmt: skip
        in_car, point = to_car * turn, np.array(found[4:7])

        def height(place: Array, normal: Array = normal) -> float:
            """Return how far a point is from the plane or from the roll."""
            if kind == PANEL:
                return float(normal @ (place - CORNER))
            return math.hypot(*(place - CORNER)[::2]) - 0.1

        def lowest(
            u: Array, semi: Array = semi_axes, turn: Rotation = in_car, centre: Array = centre
        ) -> float:
            return height(centre + turn.apply(semi * u / np.linalg.norm(u)))

        nearest = minimize(lowest, -in_car.inv().apply(normal) + 0.01, tol=1e-14)
        assert found[0] == pytest.approx(nearest.fun, abs=1e-9 if kind == PANEL else 1e-8)
        # The contact point lies on the ellipsoid.
        assert height(point) == pytest.approx(found[0], abs=1e-12 if kind == PANEL else 1e-8)
        reached = np.linalg.norm(in_car.inv().apply(point - centre) / semi_axes)
        assert reached == pytest.approx(1.0, abs=1e-12)
        if kind == PANEL:
            assert found[1:4] == pytest.approx(normal, abs=1e-12) and found[7] == 1.0
        else:
            assert found[2] == 0.0
