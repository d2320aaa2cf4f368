"""Force-penetration law: validation, series combination, unloading, damping and energy."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

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

Array = NDArray[np.float64]

SURFACE_CURVE = ForceCurve(
    np.array([0.0, 0.02, 0.05, 0.09]), np.array([0.0, 1500.0, 2500.0, 7000.0]), 7.0, 100.0
)
BODY_CURVE = ForceCurve(np.array([0.0, 0.02, 0.035]), np.array([0.0, 1200.0, 4000.0]), 4.0)


def law_of(surface: ForceCurve, body: ForceCurve) -> tuple[Array, int]:
    """Return the combined law as a table of one and its number of knots."""
    laws = np.zeros((1, KNOTS, 4))
    count = combine_curves(
        surface.penetration,
        surface.force,
        surface.unloading_ratio,
        body.penetration,
        body.force,
        body.unloading_ratio,
        laws[0],
    )
    return laws, count


def force(
    law: tuple[Array, int],
    penetration: float,
    largest: float,
    rate: float = 0.0,
    damping: float = 0.0,
    onset: float = 0.005,
) -> tuple[float, float]:
    """Return elastic and damping force, N."""
    laws, count = law
    return contact_force(laws, 0, count, damping, onset, penetration, rate, largest)


def random_curve(rng: np.random.Generator) -> ForceCurve:
    knots = rng.integers(1, KNOTS // 2)
    return ForceCurve(
        np.concatenate(([0.0], np.cumsum(rng.uniform(0.002, 0.04, knots)))),
        np.concatenate(([0.0], np.cumsum(rng.uniform(100.0, 4000.0, knots)))),
        rng.uniform(1.5, 20.0),
    )


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
        (np.linspace(0.0, 1.0, 17), np.linspace(0.0, 1.0, 17), 2.0, 0.0, "knots"),
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
    penetration: list, forces: list, ratio: float, damping: float, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        ForceCurve(np.array(penetration), np.array(forces), ratio, damping)


def test_curve_is_straight_between_knots_and_goes_on_with_its_last_slope() -> None:
    at = SURFACE_CURVE.at(np.array([[0.0, 0.01], [0.07, 0.11]]))
    # 4500 N over 40 mm is the last slope.
    np.testing.assert_allclose(at, [[0.0, 750.0], [4750.0, 9250.0]], rtol=1e-12)


def test_scaled_curve() -> None:
    scaled = SURFACE_CURVE.scaled(force=1.5, penetration=2.0)
    depth = np.linspace(0.0, 0.12, 25)
    np.testing.assert_allclose(scaled.at(2.0 * depth), 1.5 * SURFACE_CURVE.at(depth), rtol=1e-12)
    assert scaled.unloading_ratio == SURFACE_CURVE.unloading_ratio
    # N s/m: force over velocity, at equal times.
    assert scaled.damping == pytest.approx(100.0 * 1.5 / 2.0)


@pytest.mark.parametrize("seed", range(25))
def test_curves_in_series_carry_one_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    surface, body = random_curve(rng), random_curve(rng)
    laws, count = law_of(surface, body)
    knots = np.concatenate((surface.force, body.force))
    for wanted in (*knots[knots > 0.0], *rng.uniform(1.0, 2.0 * knots.max(), 10)):
        ds, db = penetration_at(surface, wanted), penetration_at(body, wanted)
        total = ds + db
        recovery = ds / surface.unloading_ratio + db / body.unloading_ratio
        for column, expected in ((FORCE, wanted), (RECOVERY, recovery), (SURFACE, ds)):
            found = interpolate_law(laws, 0, count, column, total)
            assert found == pytest.approx(expected, rel=1e-9)


def test_series_is_softer_than_either_side_and_symmetric() -> None:
    law, swapped = law_of(SURFACE_CURVE, BODY_CURVE), law_of(BODY_CURVE, SURFACE_CURVE)
    for depth in np.linspace(0.002, 0.2, 40):
        elastic = force(law, depth, depth)[0]
        weaker = min(float(c.at(np.array(depth))) for c in (SURFACE_CURVE, BODY_CURVE))
        assert 0.0 < elastic < weaker
        assert force(swapped, depth, depth)[0] == pytest.approx(elastic, rel=1e-12)


def test_equal_knot_forces_on_both_sides() -> None:
    law = law_of(BODY_CURVE, BODY_CURVE)
    for depth in (0.01, 0.02, 0.035, 0.06):
        assert force(law, 2.0 * depth, 2.0 * depth)[0] == pytest.approx(
            float(BODY_CURVE.at(np.array(depth))), rel=1e-12
        )


def test_knot_forces_that_differ_by_rounding() -> None:
    one = ForceCurve(np.array([0.0, 0.02]), np.array([0.0, 3000.0]), 4.0)
    other = ForceCurve(np.array([0.0, 0.02]), np.array([0.0, np.nextafter(3000.0, 4000.0)]), 4.0)
    law = law_of(one, other)
    assert force(law, 0.06, 0.06)[0] == pytest.approx(4500.0, rel=1e-9)


@pytest.mark.parametrize("largest", [0.004, 0.03, 0.08, 0.15])
def test_unloading_line_of_one_material(largest: float) -> None:
    # Both sides of equal ratio r: slope r F / d, permanent part d (1 - 1 / r) (module docstring).
    ratio = 5.0
    surface = ForceCurve(SURFACE_CURVE.penetration, SURFACE_CURVE.force, ratio)
    law = law_of(surface, ForceCurve(BODY_CURVE.penetration, BODY_CURVE.force, ratio))
    top = force(law, largest, largest)[0]
    for share in (0.99, 0.9, 0.82):
        expected = top - ratio * top / largest * (largest - share * largest)
        assert force(law, share * largest, largest)[0] == pytest.approx(expected, rel=1e-9)
    permanent = largest * (1.0 - 1.0 / ratio)
    assert force(law, permanent * (1.0 + 1e-9), largest)[0] == pytest.approx(0.0, abs=1e-4)
    for share in (0.999, 0.5, 0.0):
        assert force(law, share * permanent, largest)[0] == 0.0


@pytest.mark.parametrize("largest", [0.01, 0.05, 0.12])
def test_recoveries_of_both_sides_add(largest: float) -> None:
    law = law_of(SURFACE_CURVE, BODY_CURVE)
    top = force(law, largest, largest)[0]
    recovery = penetration_at(SURFACE_CURVE, top) / 7.0 + penetration_at(BODY_CURVE, top) / 4.0
    half = force(law, largest - 0.5 * recovery, largest)[0]
    assert half == pytest.approx(0.5 * top, rel=1e-9)
    assert force(law, largest - 1.001 * recovery, largest)[0] == 0.0


def test_reloading_follows_the_line_and_then_the_curve() -> None:
    law = law_of(SURFACE_CURVE, BODY_CURVE)
    largest = 0.05
    line = [force(law, d, largest)[0] for d in (0.046, 0.048)]
    slope = (line[1] - line[0]) / 0.002
    # The line ends on the loading curve, without a jump, and the curve goes on as if never left.
    top = force(law, largest, largest)[0]
    assert line[1] + slope * 0.002 == pytest.approx(top, rel=1e-9)
    assert force(law, largest - 1e-12, largest)[0] == pytest.approx(top, rel=1e-6)
    first = force(law, 0.06, 0.06)[0]
    laws, count = law
    assert first == pytest.approx(interpolate_law(laws, 0, count, FORCE, 0.06), rel=1e-12)
    # The direction of motion does not matter to the elastic part.
    assert force(law, 0.048, largest, rate=-2.0)[0] == force(law, 0.048, largest, rate=2.0)[0]


def test_damping_acts_in_loading_only_and_fades_in() -> None:
    law = law_of(SURFACE_CURVE, BODY_CURVE)
    assert force(law, 0.02, 0.02, rate=3.0, damping=100.0)[1] == pytest.approx(300.0)
    assert force(law, 0.015, 0.02, rate=3.0, damping=100.0)[1] == pytest.approx(300.0)
    for rate in (0.0, -3.0):
        assert force(law, 0.02, 0.02, rate=rate, damping=100.0)[1] == 0.0
    assert force(law, 0.001, 0.001, rate=3.0, damping=100.0)[1] == pytest.approx(60.0)
    assert force(law, 0.001, 0.001, rate=3.0, damping=100.0, onset=0.0)[1] == pytest.approx(300.0)
    assert force(law, 0.02, 0.02, rate=3.0)[1] == 0.0


@pytest.mark.parametrize("largest", [0.01, 0.05, 0.12])
def test_energy_loss_is_the_area_between_the_branches(largest: float) -> None:
    law = law_of(SURFACE_CURVE, BODY_CURVE)
    depth = np.linspace(0.0, largest, 20001)
    loading = np.trapezoid([force(law, d, d)[0] for d in depth], depth)
    unloading = np.trapezoid([force(law, d, largest)[0] for d in depth], depth)
    # The branches in closed form: the two curves' own areas and the triangle under the line.
    top = force(law, largest, largest)[0]
    stored, recovery = 0.0, 0.0
    for curve in (SURFACE_CURVE, BODY_CURVE):
        own = penetration_at(curve, top)
        knots = np.append(curve.penetration[curve.penetration < own], own)
        stored += np.trapezoid(curve.at(knots), knots)
        recovery += own / curve.unloading_ratio
    assert loading == pytest.approx(stored, rel=1e-6)
    assert unloading == pytest.approx(0.5 * top * recovery, rel=1e-6)


def test_rebound_of_a_head_from_a_rigid_surface() -> None:
    # A linear curve returns 1 / ratio of the energy: the head's 11 is the restitution 0.3 that
    # data/pedestrians/tissue.toml states.
    head = ForceCurve(np.array([0.0, 0.005]), np.array([0.0, 1e4]), 11.0)
    rigid = ForceCurve(np.array([0.0, 1e-6]), np.array([0.0, 1e5]), 1.0 + 1e-9)
    law = law_of(rigid, head)
    mass, velocity, depth, largest, step = 3.26, 3.0, 0.0, 0.0, 1e-7
    acceleration = 0.0
    while depth >= 0.0 and (velocity > 0.0 or acceleration < 0.0 or depth == 0.0):
        velocity += 0.5 * step * acceleration
        depth += step * velocity
        largest = max(largest, depth)
        acceleration = -force(law, depth, largest)[0] / mass
        velocity += 0.5 * step * acceleration
    assert -velocity / 3.0 == pytest.approx(math.sqrt(1.0 / 11.0), rel=1e-3)
    assert -velocity / 3.0 == pytest.approx(0.3, abs=0.005)
