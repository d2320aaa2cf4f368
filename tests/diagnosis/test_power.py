"""The smallest size that would have been seen, from strengths along a cause's prior."""

import numpy as np
import pytest

from mcstudy.diagnosis.power import _crossing


def test_a_size_between_two_is_interpolated() -> None:
    found = _crossing(np.array([1.0, 2.0, 4.0]), np.array([1.0, 3.0, 9.0]), 0.0, 6.0)
    assert found == pytest.approx(3.0)


def test_below_the_smallest_the_strength_goes_with_the_size() -> None:
    assert _crossing(np.array([2.0, 4.0]), np.array([8.0, 16.0]), 0.0, 4.0) == pytest.approx(1.0)


def test_of_a_prior_about_none_the_side_above_counts() -> None:
    values = np.array([0.8, 0.9, 1.1, 1.2])
    found = _crossing(values, np.array([9.0, 1.0, 2.0, 4.0]), 1.0, 3.0)
    assert found == pytest.approx(1.15)


def test_an_effect_that_fades_away_from_none_is_followed_from_where_it_is_faintest() -> None:
    """A filter's class: 0 as stated, strong if low, nothing near the stated 1000."""
    values = np.array([50.0, 200.0, 500.0, 1000.0, 3000.0])
    strengths = np.array([90.0, 20.0, 4.0, 0.0, 1.0])
    assert _crossing(values, strengths, 0.0, 12.0) == pytest.approx(350.0)


def test_what_is_never_strong_enough_has_no_size() -> None:
    assert np.isnan(_crossing(np.array([1.0, 2.0]), np.array([0.1, 0.2]), 0.0, 3.0))
