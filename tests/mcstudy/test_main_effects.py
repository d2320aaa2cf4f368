"""Main effects: conditional means that are known."""

import numpy as np
import pytest
from mcstudy_tools import generator
from numpy.testing import assert_allclose

from mcstudy.sensitivity.main_effects import BINS, main_effect

KEYS = ("x", "mean", "error", "low", "high")


def test_a_noisy_parabola_has_the_parabola_as_its_mean() -> None:
    # y = x^2 + e with x in (0, 1): the mean over a sixteenth (l, h) is (l^2 + l h + h^2) / 3, the
    # scatter of e is 0.3 of 500 runs a bin.
    rng = generator(1)
    x = rng.random(8000)
    found = main_effect(x, x**2 + 0.3 * rng.normal(size=8000))
    low, high = np.arange(16) / 16.0, np.arange(1, 17) / 16.0
    expected = (low**2 + low * high + high**2) / 3.0
    assert_allclose(found.x, 0.5 * (low + high), atol=0.015)
    assert_allclose(found.mean, expected, atol=4.5 * 0.3 / np.sqrt(500.0))
    assert_allclose(found.error, 0.3 / np.sqrt(500.0), rtol=0.2)
    # 5 % and 95 % of a normal are 1.645 standard deviations away.
    assert_allclose(np.subtract(found.high, found.low), 2.0 * 1.645 * 0.3, rtol=0.15)


def test_bins_hold_equal_counts_of_known_values_in_any_order() -> None:
    # 160 whole numbers: sixteen bins of ten; of 0 ... 9 the mean and median are 4.5, the standard
    # deviation is sqrt(110 / 12) and the quantiles are 0.45 and 8.55.
    x = generator(3).permutation(160).astype(float)
    found = main_effect(x, 3.0 * x)
    starts = 10.0 * np.arange(16)
    assert_allclose(found.x, starts + 4.5)
    assert_allclose(found.mean, 3.0 * (starts + 4.5))
    assert_allclose(found.error, 3.0 * np.sqrt(110.0 / 12.0) / np.sqrt(10.0))
    assert_allclose(found.low, 3.0 * (starts + 0.45))
    assert_allclose(found.high, 3.0 * (starts + 8.55))


@pytest.mark.parametrize(
    ("n", "bins"), [(2, 1), (7, 1), (8, 1), (15, 1), (16, 2), (80, 10), (127, 15), (128, 16),
                    (10_000, 16)],
)  # fmt: skip
def test_a_bin_holds_eight_runs_or_more(n: int, bins: int) -> None:
    assert BINS == 16
    found = main_effect(np.arange(float(n)), np.arange(float(n)) % 7.0)
    for key in KEYS:
        assert len(getattr(found, key)) == bins
        assert np.isfinite(getattr(found, key)).all()


def test_runs_without_a_value_are_left_out_and_two_must_be_left() -> None:
    rng = generator(2)
    x, y = rng.random((2, 300))
    gone, holed = rng.random(300) < 0.2, y.copy()
    holed[gone] = rng.choice([np.nan, np.inf, -np.inf], gone.sum())
    found, expected = main_effect(x, holed), main_effect(x[~gone], y[~gone])
    assert found == expected
    for n in (0, 1):
        nothing = main_effect(np.arange(n + 5.0), np.append(np.ones(n), np.full(5, np.nan)))
        assert all(len(getattr(nothing, key)) == 0 for key in KEYS)
    flat = main_effect(x, np.full(300, 2.5))
    for key, value in (("mean", 2.5), ("error", 0.0), ("low", 2.5), ("high", 2.5)):
        assert_allclose(getattr(flat, key), value, atol=1e-12)
