"""Tolerance by age: anchors, continuity, refusals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcstudy.injury.scaling import (
    ADULT_BRAIN,
    BRAIN_AGES,
    BRAIN_MASSES,
    HIC_AGES,
    HIC_FACTORS,
    tolerance_factor,
)

QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=80)
SCALINGS = ("none", "hic", "brain_acceleration", "brain_rate")


@pytest.mark.parametrize(
    ("age", "factor"), [(0.0, 0.49), (1.0, 0.45), (1.5, 0.53), (3.0, 0.71), (6.0, 0.98)]
)
def test_hic_has_the_factors_of_the_q_dummies(age: float, factor: float) -> None:
    # shared/reference/injury.md 2.1: EEVC, Q0 .49, Q1 .45, Q1.5 .53, Q3 .71, Q6 .98.
    assert float(tolerance_factor("hic", age)) == pytest.approx(factor, rel=1e-12)


def test_hic_of_a_child_of_seven_is_hardly_below_the_adults() -> None:
    # shared/reference/injury.md 2.1: "For a 7-year-old 0.98 to 1.0".
    assert 0.98 <= float(tolerance_factor("hic", 7.0)) <= 1.0


@pytest.mark.parametrize("scaling", SCALINGS)
def test_an_adult_has_the_adults_tolerance(scaling: str) -> None:
    np.testing.assert_array_equal(tolerance_factor(scaling, np.array([18.0, 40.0, 129.9])), 1.0)


def test_hic_is_the_adults_from_ten_years_on() -> None:
    np.testing.assert_array_equal(tolerance_factor("hic", np.linspace(10.0, 129.0, 50)), 1.0)
    assert float(tolerance_factor("hic", 9.9)) < 1.0


@pytest.mark.parametrize(("age", "mass"), [(3.0, 1.10), (7.0, 1.25), (12.5, 1.325), (18.0, 1.40)])
def test_brain_goes_with_powers_of_the_mass(age: float, mass: float) -> None:
    # shared/reference/injury.md 2.3: alpha (M_a / M_c)^(2/3), omega (M_a / M_c)^(1/3), the adult's
    # 1.4 kg; 12.5 years is half-way between 7 and 18.
    ratio = 1.40 / mass
    assert float(tolerance_factor("brain_acceleration", age)) == pytest.approx(ratio ** (2 / 3))
    assert float(tolerance_factor("brain_rate", age)) == pytest.approx(ratio ** (1 / 3))


def test_a_child_of_seven_is_within_the_sheets_range_of_brain_masses() -> None:
    # shared/reference/injury.md 2.3: 1.20 to 1.30 kg give 4,990 to 4,730 rad/s2 and 52.6 to 51.3
    # rad/s.
    assert 4730.0 < 4500.0 * float(tolerance_factor("brain_acceleration", 7.0)) < 4990.0
    assert 51.3 < 50.0 * float(tolerance_factor("brain_rate", 7.0)) < 52.6
    assert 1.20 <= float(np.interp(7.0, BRAIN_AGES, BRAIN_MASSES)) <= 1.30


@QUIET
@given(age=st.floats(0.0, 129.0))
def test_acceleration_is_the_square_of_the_rate_and_never_below_the_adults(age: float) -> None:
    rate = float(tolerance_factor("brain_rate", age))
    assert float(tolerance_factor("brain_acceleration", age)) == pytest.approx(rate**2)
    assert rate >= 1.0


@QUIET
@given(scaling=st.sampled_from(SCALINGS), age=st.floats(0.0, 129.0), step=st.floats(0.0, 0.01))
def test_tolerance_is_continuous(scaling: str, age: float, step: float) -> None:
    # The steepest line is that from 0.45 at 1 to 0.53 at 1.5 years: 0.16 a year.
    a, b = (float(tolerance_factor(scaling, x)) for x in (age, age + step))
    assert abs(a - b) <= 0.161 * step + 1e-12


@QUIET
@given(age=st.floats(0.0, 129.0))
def test_hic_lies_between_the_anchors(age: float) -> None:
    assert min(HIC_FACTORS) <= float(tolerance_factor("hic", age)) <= 1.0


@pytest.mark.parametrize(("scaling", "rises"), [("hic", True), ("brain_rate", False)])
def test_tolerance_goes_one_way_from_the_first_birthday_on(scaling: str, rises: bool) -> None:
    change = np.diff(tolerance_factor(scaling, np.linspace(1.0, 100.0, 500)))
    assert np.all(change >= 0.0) if rises else np.all(change <= 0.0)


def test_no_scaling_is_one_at_every_age() -> None:
    np.testing.assert_array_equal(tolerance_factor("none", np.linspace(0.0, 129.0, 20)), 1.0)


def test_ages_of_runs_give_a_factor_each() -> None:
    ages = np.array([3.0, 40.0, 7.0])
    for scaling in SCALINGS:
        found = tolerance_factor(scaling, ages)
        assert found.shape == (3,)
        np.testing.assert_array_equal(found, [float(tolerance_factor(scaling, a)) for a in ages])


@pytest.mark.parametrize("scaling", SCALINGS)
@pytest.mark.parametrize("age", [-1e-9, -5.0, 130.0, 1e6, np.nan, np.inf, -np.inf])
def test_ages_that_are_none_are_refused(scaling: str, age: float) -> None:
    with pytest.raises(ValueError, match="age must be between 0 and 130 years"):
        tolerance_factor(scaling, age)
    with pytest.raises(ValueError, match="age must be between 0 and 130 years"):
        tolerance_factor(scaling, np.array([20.0, age]))


def test_an_unknown_scaling_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match="unknown scaling 'mass', choose from none, hic"):
        tolerance_factor("mass", 7.0)


def test_anchors_are_in_order() -> None:
    assert list(HIC_AGES) == sorted(set(HIC_AGES))
    assert list(BRAIN_AGES) == sorted(set(BRAIN_AGES))
    assert BRAIN_MASSES[-1] == ADULT_BRAIN
