"""Contact: force over penetration, unloading, damping, and what a deep dent does."""

import math

import numpy as np
import pytest
from builders import Array, law, six
from scipy.spatial.transform import Rotation

from models.compilation import kernel
from models.contact.dent import PLOUGHING, ploughing_coefficient, pressure_share
from models.contact.law import (
    FORCE,
    KNOTS,
    RECOVERY,
    SURFACE,
    ForceCurve,
    combine_curves,
    contact_force,
    interpolate_law,
)
from models.crash.surfaces import PLOUGHING as PLOUGHING_CHANNEL
from models.crash.surfaces import WORK_CHANNELS
from models.multibody.model import MultibodyModel

SURFACE_CURVE = law([[0.0, 0.0], [0.02, 1500.0], [0.05, 2500.0], [0.09, 7000.0]], 7.0, 100.0)
BODY_CURVE = law([[0.0, 0.0], [0.02, 1200.0], [0.035, 4000.0]], 4.0)
LARGEST = pytest.mark.parametrize("largest", [0.004, 0.05, 0.12])


class Law:
    """The combined law of two sides."""

    def __init__(self, surface: ForceCurve, body: ForceCurve) -> None:
        self.table = np.zeros((1, KNOTS, 4))
        self.count = combine_curves(
            surface.penetration, surface.force, surface.unloading_ratio, body.penetration,
            body.force, body.unloading_ratio, self.table[0],
        )  # fmt: skip

    def at(self, column: int, penetration: float) -> float:
        return float(interpolate_law(self.table, 0, self.count, column, penetration))

    def forces(
        self, penetration: float, largest: float | None = None, rate: float = 0.0,
        damping: float = 0.0, onset: float = 0.005,
    ) -> tuple[float, float]:  # fmt: skip
        """Return elastic and damping force, N."""
        largest = penetration if largest is None else largest
        return contact_force(self.table, 0, self.count, damping, onset, penetration, rate, largest)

    def force(self, penetration: float, largest: float | None = None, rate: float = 0.0) -> float:
        return self.forces(penetration, largest, rate)[0]


BOTH = Law(SURFACE_CURVE, BODY_CURVE)


def random_curve(rng: np.random.Generator) -> ForceCurve:
    knots = rng.integers(1, KNOTS // 2)
    steps = [rng.uniform(0.002, 0.04, knots), rng.uniform(100.0, 4000.0, knots)]
    return law(np.cumsum([[0.0, 0.0], *np.transpose(steps)], axis=0), rng.uniform(1.5, 20.0))


def penetration_at(curve: ForceCurve, wanted: float) -> float:
    """Return the penetration of one curve at a force, by bisection."""
    low, high = 0.0, 10.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if curve.at(np.array(middle)) < wanted else (low, middle)
    return 0.5 * (low + high)


@pytest.mark.parametrize(
    ("penetration", "forces", "ratio", "damping", "message"),
    [
        ([0.0], [0.0], 2.0, 0.0, "knots"),
        ([0.0, 0.1, 0.2], [0.0, 1.0], 2.0, 0.0, "knots"),
        (np.linspace(0.0, 1.0, 33), np.linspace(0.0, 1.0, 33), 2.0, 0.0, "knots"),
        ([[0.0, 1.0]], [[0.0, 1.0]], 2.0, 0.0, "knots"),
        ([0.01, 0.1], [0.0, 1.0], 2.0, 0.0, r"\(0, 0\)"),
        ([0.0, 0.1], [5.0, 10.0], 2.0, 0.0, r"\(0, 0\)"),
        ([0.0, 0.1, 0.1], [0.0, 1.0, 2.0], 2.0, 0.0, "rises strictly"),
        ([0.0, 0.1, 0.2], [0.0, 2.0, 2.0], 2.0, 0.0, "rises strictly"),
        ([0.0, 0.1, 0.2], [0.0, 2.0, 1.0], 2.0, 0.0, "rises strictly"),
        ([0.0, 0.1], [0.0, 1.0], 1.0, 0.0, "unloading_ratio"),
        ([0.0, 0.1], [0.0, 1.0], 2.0, -1.0, "damping"),
    ],
)
def test_curve_that_is_no_law_is_refused(
    penetration: Array, forces: Array, ratio: float, damping: float, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        ForceCurve(np.array(penetration), np.array(forces), ratio, damping)


def test_curve_is_straight_between_knots_goes_on_with_its_last_slope_and_scales() -> None:
    at = SURFACE_CURVE.at(np.array([[0.0, 0.01], [0.07, 0.11]]))
    # 4500 N over 40 mm is the last slope.
    np.testing.assert_allclose(at, [[0.0, 750.0], [4750.0, 9250.0]], rtol=1e-12)
    scaled, depth = SURFACE_CURVE.scaled(force=1.5, penetration=2.0), np.linspace(0.0, 0.12, 25)
    np.testing.assert_allclose(scaled.at(2.0 * depth), 1.5 * SURFACE_CURVE.at(depth), rtol=1e-12)
    assert scaled.unloading_ratio == SURFACE_CURVE.unloading_ratio
    # N s/m: force over velocity, at equal times.
    assert scaled.damping == pytest.approx(100.0 * 1.5 / 2.0)


@pytest.mark.parametrize("seed", range(8))
def test_curves_in_series_carry_one_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    surface, body = random_curve(rng), random_curve(rng)
    both, knots = Law(surface, body), np.concatenate((surface.force, body.force))
    for wanted in (*knots[knots > 0.0], *rng.uniform(1.0, 2.0 * knots.max(), 10)):
        ds, db = penetration_at(surface, wanted), penetration_at(body, wanted)
        recovery = ds / surface.unloading_ratio + db / body.unloading_ratio
        for column, expected in ((FORCE, wanted), (RECOVERY, recovery), (SURFACE, ds)):
            assert both.at(column, ds + db) == pytest.approx(expected, rel=1e-9)


def test_series_is_softer_than_either_side_and_symmetric() -> None:
    swapped = Law(BODY_CURVE, SURFACE_CURVE)
    for depth in np.linspace(0.002, 0.2, 40):
        weaker = min(float(c.at(np.array(depth))) for c in (SURFACE_CURVE, BODY_CURVE))
        assert 0.0 < BOTH.force(depth) < weaker
        assert swapped.force(depth) == pytest.approx(BOTH.force(depth), rel=1e-12)


def test_knot_forces_that_are_equal_or_differ_by_rounding() -> None:
    even = Law(BODY_CURVE, BODY_CURVE)
    for depth in (0.01, 0.02, 0.035, 0.06):
        expected = float(BODY_CURVE.at(np.array(depth)))
        assert even.force(2.0 * depth) == pytest.approx(expected, rel=1e-12)
    one, other = (law([[0.0, 0.0], [0.02, f]], 4.0) for f in (3000.0, np.nextafter(3000.0, 4000.0)))
    assert Law(one, other).force(0.06) == pytest.approx(4500.0, rel=1e-9)


@LARGEST
def test_unloading_line_of_one_material(largest: float) -> None:
    # Both sides of equal ratio r: slope r F / d, permanent part d (1 - 1 / r) (module docstring).
    ratio = 5.0
    both = Law(*(ForceCurve(c.penetration, c.force, ratio) for c in (SURFACE_CURVE, BODY_CURVE)))
    top = both.force(largest)
    for share in (0.99, 0.9, 0.82):
        expected = top * (1.0 - ratio * (1.0 - share))
        assert both.force(share * largest, largest) == pytest.approx(expected, rel=1e-9)
    permanent = largest * (1.0 - 1.0 / ratio)
    assert both.force(permanent * (1.0 + 1e-9), largest) == pytest.approx(0.0, abs=1e-4)
    for share in (0.999, 0.5, 0.0):
        assert both.force(share * permanent, largest) == 0.0


@LARGEST
def test_recoveries_of_both_sides_add_and_the_loss_lies_between_the_branches(
    largest: float,
) -> None:
    top, stored, recovery = BOTH.force(largest), 0.0, 0.0
    for curve in (SURFACE_CURVE, BODY_CURVE):
        own = penetration_at(curve, top)
        knots = np.append(curve.penetration[curve.penetration < own], own)
        stored += np.trapezoid(curve.at(knots), knots)
        recovery += own / curve.unloading_ratio
    half = BOTH.force(largest - 0.5 * recovery, largest)
    assert half == pytest.approx(0.5 * top, rel=1e-9)
    assert BOTH.force(largest - 1.001 * recovery, largest) == 0.0
    # The branches in closed form: the two curves' own areas and the triangle under the line.
    depth = np.linspace(0.0, largest, 20001)
    loading = np.trapezoid([BOTH.force(d) for d in depth], depth)
    unloading = np.trapezoid([BOTH.force(d, largest) for d in depth], depth)
    assert loading == pytest.approx(stored, rel=1e-6)
    assert unloading == pytest.approx(0.5 * top * recovery, rel=1e-6)


def test_reloading_follows_the_line_and_then_the_curve() -> None:
    largest = 0.05
    line = [BOTH.force(d, largest) for d in (0.046, 0.048)]
    # The line ends on the loading curve, without a jump, and the curve goes on as if never left.
    top = BOTH.force(largest)
    assert 2.0 * line[1] - line[0] == pytest.approx(top, rel=1e-9)
    assert BOTH.force(largest - 1e-12, largest) == pytest.approx(top, rel=1e-6)
    assert BOTH.force(0.06) == pytest.approx(BOTH.at(FORCE, 0.06), rel=1e-12)
    # The direction of motion does not matter to the elastic part.
    assert BOTH.force(0.048, largest, rate=-2.0) == BOTH.force(0.048, largest, rate=2.0)


@pytest.mark.parametrize(
    ("depth", "rate", "damping", "onset", "expected"),
    [
        (0.02, 3.0, 100.0, 0.005, 300.0),
        (0.015, 3.0, 100.0, 0.005, 300.0),
        (0.02, 0.0, 100.0, 0.005, 0.0),  # in loading only
        (0.02, -3.0, 100.0, 0.005, 0.0),
        (0.001, 3.0, 100.0, 0.005, 60.0),  # it fades in
        (0.001, 3.0, 100.0, 0.0, 300.0),
        (0.02, 3.0, 0.0, 0.005, 0.0),
    ],
)
def test_damping_acts_in_loading_only_and_fades_in(
    depth: float, rate: float, damping: float, onset: float, expected: float
) -> None:
    found = BOTH.forces(depth, max(depth, 0.02), rate, damping, onset)[1]
    assert found == pytest.approx(expected)


def test_rebound_of_a_head_from_a_rigid_surface() -> None:
    # A linear curve returns 1 / ratio of the energy: the head's 11 is the restitution 0.3 that
    # data/pedestrians/tissue.toml states.
    head, rigid = law([[0.0, 0.0], [0.005, 1e4]], 11.0), law([[0.0, 0.0], [1e-6, 1e5]], 1.0 + 1e-9)
    both, mass, velocity, depth, largest, step = Law(rigid, head), 3.26, 3.0, 0.0, 0.0, 1e-6
    acceleration = 0.0
    while depth >= 0.0 and (velocity > 0.0 or acceleration < 0.0 or depth == 0.0):
        velocity += 0.5 * step * acceleration
        depth += step * velocity
        largest = max(largest, depth)
        acceleration = -both.force(depth, largest) / mass
        velocity += 0.5 * step * acceleration
    assert -velocity / 3.0 == pytest.approx(math.sqrt(1.0 / 11.0), rel=1e-3)
    assert -velocity / 3.0 == pytest.approx(0.3, abs=0.005)


@kernel
def _share(flesh, dent, support):
    return pressure_share(flesh, dent, support)


@kernel
def _coefficient(A, support, dent, tx, ty, tz):
    return ploughing_coefficient(A, support, dent, tx, ty, tz)


def ploughing(A: Array, support: float, dent: float, slip: Array) -> float:
    return float(_coefficient(six(A), support, dent, *map(float, slip)))


@pytest.mark.parametrize("depth", [0.0005, 0.01])
def test_pressure_and_groove_of_a_sphere(depth: float) -> None:
    radius = 0.09
    a = math.sqrt(2.0 * radius * depth - depth**2)
    x, y = np.meshgrid(*[np.linspace(-a, a, 2001)] * 2)
    inside = x**2 + y**2 <= a**2
    height = radius - np.sqrt(radius**2 - x[inside] ** 2 - y[inside] ** 2)
    # An even pressure acts at half the dent; a shallow cap is a paraboloid to depth over radius.
    share = _share(0.0, depth, radius) * radius
    assert share == pytest.approx(height.mean(), rel=2.0 * depth / radius)
    # The groove over the loaded half.
    loaded = (2.0 * a / 2000.0) ** 2 * np.count_nonzero(x[inside] > 0.0)
    across = np.linspace(-a, a, 4001)
    groove = np.trapezoid(np.sqrt(radius**2 - across**2) - (radius - depth), across)
    ours = ploughing(np.eye(3) * radius**2, radius, depth, np.array([1.0, 0.0, 0.0]))
    assert ours == pytest.approx(groove / loaded, rel=2.0 * depth / radius + 1e-3)


def test_flattened_flesh_lies_in_the_plane_of_contact() -> None:
    assert _share(0.012, 0.0, 0.04) == pytest.approx(0.3)
    # Never beyond the centre.
    assert _share(0.06, 0.05, 0.04) == 1.0


def test_a_body_ploughs_by_its_curvature_along_the_slip_within_its_width() -> None:
    # At the pole of an ellipsoid the radius of curvature along an axis a is a^2 / c.
    squares, depth = np.square([0.16, 0.05, 0.04]), 0.003
    turn = Rotation.random(random_state=3).as_matrix()
    for axis in (0, 1):
        found = ploughing(turn @ np.diag(squares) @ turn.T, 0.04, depth, turn[:, axis])
        expected = PLOUGHING * math.sqrt(2.0 * depth * 0.04 / squares[axis])
        assert found == pytest.approx(expected, rel=1e-12)
    deep = ploughing(np.eye(3) * 0.01, 0.1, 0.5, np.array([0.0, 1.0, 0.0]))
    assert deep == pytest.approx(PLOUGHING)


def test_panels_plough_and_rolls_do_not() -> None:
    model, name = MultibodyModel(), WORK_CHANNELS[PLOUGHING_CHANNEL]
    assert name == "ploughing"
    panels = {zone.name for zone in model.vehicle.zones if zone.ploughing > 0.0}
    assert panels == {"hood", "fender_side", "windscreen"}
    run, without = model.run({}), model.run({"ploughing": 0.0})
    # It takes the body along with the car, and the balance of energy holds it.
    assert run.histories["work"].channels[name][0] > 5.0
    assert without.histories["work"].channels[name][0] == 0.0
    assert run.outputs["launch_speed"] > without.outputs["launch_speed"]
    assert abs(run.outputs["energy_residual"]) < 5e-3
    # The windscreen takes an adult along.
    adult = {"age": 30.0, "stature": 1.74, "body_mass": 75.7, "head_mass": 4.54,
             "running_speed": 1.4, "yaw_rate": 0.0, "lateral_offset": 0.0}  # fmt: skip
    launched = [
        [model.run({**adult, "ploughing": p, "gait_phase": g}).outputs["launch_speed"]
         for g in (0.0, 0.3, 0.6)]
        for p in (0.0, 1.0)
    ]  # fmt: skip
    assert np.mean(launched[1]) > 1.05 * np.mean(launched[0])
