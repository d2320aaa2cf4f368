"""Tolerance by age: anchors, continuity, refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcstudy_tools import quiet
from numpy.testing import assert_array_equal

from mcstudy.injury.scaling import (
    ADULT_BRAIN,
    BRAIN_AGES,
    BRAIN_MASSES,
    HIC_AGES,
    HIC_FACTORS,
    tolerance_factor,
)

SCALINGS = ("none", "hic", "brain_acceleration", "brain_rate")


def at(scaling: str, age: float) -> float:
    return float(tolerance_factor(scaling, age))


def test_hic_has_the_factors_of_the_q_dummies() -> None:
    # shared/reference/injury.md 2.1: EEVC, Q0 .49, Q1 .45, Q1.5 .53, Q3 .71, Q6 .98; "for a
    # 7-year-old 0.98 to 1.0"; the adult's from ten years on.
    for age, factor in ((0.0, 0.49), (1.0, 0.45), (1.5, 0.53), (3.0, 0.71), (6.0, 0.98)):
        assert at("hic", age) == pytest.approx(factor, rel=1e-12)
    assert 0.98 <= at("hic", 7.0) <= at("hic", 9.9) < 1.0
    assert_array_equal(tolerance_factor("hic", np.linspace(10.0, 129.0, 50)), 1.0)


@pytest.mark.parametrize(("age", "mass"), [(3.0, 1.10), (7.0, 1.25), (12.5, 1.325), (18.0, 1.40)])
def test_brain_goes_with_powers_of_the_mass(age: float, mass: float) -> None:
    # shared/reference/injury.md 2.3: alpha (M_a / M_c)^(2/3), omega (M_a / M_c)^(1/3), the adult's
    # 1.4 kg; 12.5 years is half-way between 7 and 18.
    assert at("brain_acceleration", age) == pytest.approx((1.40 / mass) ** (2 / 3))
    assert at("brain_rate", age) == pytest.approx((1.40 / mass) ** (1 / 3))


@pytest.mark.parametrize("scaling", SCALINGS)
def test_an_adult_has_the_adults_tolerance_and_every_run_its_own(scaling: str) -> None:
    assert_array_equal(tolerance_factor(scaling, np.array([18.0, 40.0, 129.9])), 1.0)
    ages = np.array([3.0, 40.0, 7.0])
    assert_array_equal(tolerance_factor(scaling, ages), [at(scaling, age) for age in ages])
    if scaling == "none":
        assert_array_equal(tolerance_factor(scaling, ages), 1.0)


@quiet(80)
@given(scaling=st.sampled_from(SCALINGS), age=st.floats(0.0, 129.0), step=st.floats(0.0, 0.01))
def test_tolerance_is_continuous_and_goes_one_way_from_the_first_birthday_on(
    scaling: str, age: float, step: float
) -> None:
    # The steepest line is that from 0.45 at 1 to 0.53 at 1.5 years: 0.16 a year.
    a, b = at(scaling, age), at(scaling, age + step)
    assert abs(a - b) <= 0.161 * step + 1e-12
    if scaling == "hic":
        assert min(HIC_FACTORS) <= a <= 1.0
        assert a <= b or age < 1.0
    else:
        assert a >= b >= 1.0
    assert at("brain_acceleration", age) == pytest.approx(at("brain_rate", age) ** 2)


@pytest.mark.parametrize("scaling", SCALINGS)
@pytest.mark.parametrize("age", [-1e-9, 130.0, np.nan, np.inf, -np.inf])
def test_ages_that_are_none_are_refused(scaling: str, age: float) -> None:
    for ages in (age, np.array([20.0, age])):
        with pytest.raises(ValueError, match="age must be between 0 and 130 years"):
            tolerance_factor(scaling, ages)
    with pytest.raises(ValueError, match="unknown scaling 'mass', choose from none, hic"):
        tolerance_factor("mass", 7.0)


def test_anchors_are_in_order() -> None:
    assert list(HIC_AGES) == sorted(set(HIC_AGES))
    assert list(BRAIN_AGES) == sorted(set(BRAIN_AGES))
    assert BRAIN_MASSES[-1] == ADULT_BRAIN
