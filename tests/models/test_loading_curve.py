"""Least-squares loading curves: exact where they can be, rising always, few knots."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from models.contact.law import ForceCurve
from models.contact.loading import choose_knots, fit_loading

Array = NDArray[np.float64]

QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=80)
DEPTH = np.linspace(0.0, 0.05, 251)

FINITE = {"allow_nan": False, "allow_infinity": False}


@st.composite
def any_samples(draw: st.DrawFn) -> tuple[Array, Array]:
    """Return depths that rise and forces of which one is positive at least."""
    count = draw(st.integers(8, 60))
    steps = draw(st.lists(st.floats(1e-5, 1e-2), min_size=count, max_size=count))
    force = st.floats(-2e3, 2e4, **FINITE)
    forces = np.array(draw(st.lists(force, min_size=count, max_size=count)))
    forces[draw(st.integers(0, count - 1))] = draw(st.floats(10.0, 2e4))
    return np.cumsum(steps), forces


def squares(depth: Array, force: Array, places: Array) -> float:
    fitted = np.interp(depth, places, fit_loading(depth, force, places))
    return float(np.sum((force - fitted) ** 2))


@pytest.mark.parametrize(
    ("places", "forces"),
    [
        ([0.0, 0.05], [0.0, 4000.0]),
        ([0.0, 0.02, 0.05], [0.0, 3000.0, 3500.0]),
        ([0.0, 0.02, 0.05], [0.0, 500.0, 6000.0]),
        ([0.0, 0.006, 0.015, 0.03, 0.05], [0.0, 1500.0, 1800.0, 4000.0, 4100.0]),
        # Beyond the last knot the curve goes on with its last slope.
        ([0.0, 0.01, 0.03], [0.0, 2000.0, 2600.0]),
    ],
)
def test_knots_at_the_right_places_give_the_curve_exactly(places: list, forces: list) -> None:
    knots = np.array(places)
    force = ForceCurve(knots, np.array(forces), 2.0).at(DEPTH)
    np.testing.assert_allclose(fit_loading(DEPTH, force, knots), forces, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize(
    ("shares", "forces"),
    [
        ([0.0, 1.0], [0.0, 4000.0]),
        ([0.0, 0.4, 1.0], [0.0, 3000.0, 3500.0]),
        ([0.0, 0.72, 1.0], [0.0, 1000.0, 3500.0]),
        ([0.0, 0.2, 0.6, 1.0], [0.0, 2000.0, 2600.0, 5000.0]),
        ([0.0, 0.12, 0.48, 0.8, 1.0], [0.0, 1500.0, 1900.0, 2400.0, 5200.0]),
    ],
)
def test_knots_of_an_exact_curve_are_found(shares: list, forces: list) -> None:
    # The knots lie on the grid of 4 % that choose_knots searches.
    curve = ForceCurve(0.05 * np.array(shares), np.array(forces), 2.0)
    force = curve.at(DEPTH)
    places = choose_knots(DEPTH, force, 8)
    fitted = fit_loading(DEPTH, force, places)
    np.testing.assert_allclose(np.interp(DEPTH, places, fitted), force, atol=1e-5 * force.max())


def test_knots_of_a_smooth_curve_follow_it() -> None:
    force = 4000.0 * np.sqrt(DEPTH / 0.05)
    errors = []
    for most in range(2, 9):
        places = choose_knots(DEPTH, force, most)
        assert places.size <= most
        errors.append(squares(DEPTH, force, places))
    assert all(b <= a * (1.0 + 1e-9) for a, b in itertools.pairwise(errors))
    assert errors[-1] < 0.02 * errors[0]


def test_noise_gets_no_knots() -> None:
    # A straight line in white noise: two parameters a knot cost more than they win.
    counts = []
    for seed in range(20):
        noise = 30.0 * np.random.default_rng(seed).standard_normal(DEPTH.size)
        counts.append(choose_knots(DEPTH, 8e4 * DEPTH + noise, 8).size)
    assert np.mean(np.array(counts) == 2) >= 0.9
    # The fewer samples are independent, the more a knot must explain.
    bend = ForceCurve(np.array([0.0, 0.02, 0.05]), np.array([0.0, 1650.0, 4000.0]), 2.0).at(DEPTH)
    noise = 30.0 * np.random.default_rng(1).standard_normal(DEPTH.size)
    many = choose_knots(DEPTH, bend + noise, 8).size
    assert choose_knots(DEPTH, bend + noise, 8, independent_samples=5.0).size <= many


@QUIET
@given(any_samples(), st.integers(2, 8))
def test_any_samples_give_a_rising_law(samples: tuple[Array, Array], most: int) -> None:
    depth, force = samples
    places = choose_knots(depth, force, most)
    assert 2 <= places.size <= most
    assert (places[0], places[-1]) == (0.0, depth.max())
    # ForceCurve refuses what does not rise strictly from (0, 0).
    ForceCurve(places, fit_loading(depth, force, places), 2.0)


@QUIET
@given(any_samples(), st.integers(2, 8))
def test_never_worse_than_the_best_rising_straight_line(
    samples: tuple[Array, Array], most: int
) -> None:
    depth, force = samples
    slope = max(float(depth @ force) / float(depth @ depth), 1e-3 * force.max() / depth.max())
    line = float(np.sum((force - slope * depth) ** 2))
    places = choose_knots(depth, force, most)
    assert squares(depth, force, places) <= line * (1.0 + 1e-9) + 1e-6 * force.max() ** 2


@pytest.mark.parametrize("most", [-1, 0, 1, 9, 100])
def test_number_of_knots_is_checked(most: int) -> None:
    with pytest.raises(ValueError, match="2 to 8 knots"):
        choose_knots(DEPTH, 8e4 * DEPTH, most)
