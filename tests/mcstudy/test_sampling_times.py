"""Times as files print them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcstudy_tools import generator, quiet
from numpy.testing import assert_allclose, assert_array_equal

from mcstudy.measurement.sampling_times import regular_times


@quiet(60)
@given(
    rate=st.sampled_from([12_800.0, 25_600.0, 51_200.0, 65_536.0, 20_000.0 / 3.0, 44_100.0]),
    digits=st.integers(5, 9), start=st.floats(-2.0, 2.0), count=st.integers(20, 3000),
)  # fmt: skip
def test_rounded_times_are_uniform(rate: float, digits: int, start: float, count: int) -> None:
    true = start + np.arange(count) / rate
    found = regular_times(np.round(true, digits))
    if 10.0**-digits < 1.0 / rate:
        steps = np.diff(found)
        assert np.ptp(steps) < 1e-6 * steps.mean()
        assert_allclose(found, true, atol=0.7 * 10.0**-digits)


@quiet(60)
@given(
    rate=st.sampled_from([10_000.0, 12_800.0, 51_200.0, 65_536.0, 20_000.0 / 3.0]),
    digits=st.integers(4, 9), count=st.integers(12, 4000), share=st.floats(0.0, 1.0),
)  # fmt: skip
def test_a_lost_sample_is_no_rounding(rate: float, digits: int, count: int, share: float) -> None:
    whole = np.round(np.arange(count) / rate, digits)
    time = np.delete(whole, 2 + int(share * (count - 4)))
    if np.all(np.diff(time) > 0.0):
        assert_array_equal(regular_times(time), time)


@pytest.mark.parametrize("count", [12, 20, 33])
def test_few_times_leave_the_grid_uncertain(count: int) -> None:
    # Of twenty times the line through them lies up to 0.6 units away from one.
    time = np.round(1.0 + np.arange(count) / 25_600.0, 9)
    assert np.ptp(np.diff(regular_times(time))) < 1e-12


def test_exact_times_stay_to_the_last_bit() -> None:
    time = np.arange(-50, 500) / 1e4
    assert_array_equal(regular_times(time), time)


@pytest.mark.parametrize("digits", [6, 15])
def test_times_that_are_not_uniform_stay_as_they_are(digits: int) -> None:
    jitter = generator().uniform(-2e-5, 2e-5, 300)
    time = np.round(np.arange(300) * 1e-4 + jitter, digits)
    assert_array_equal(regular_times(time), time)
