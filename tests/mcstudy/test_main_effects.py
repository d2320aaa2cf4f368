"""Main effects: conditional means that are known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mcstudy.sensitivity.main_effects import BINS, main_effect

Array = NDArray[np.float64]

KEYS = ("x", "mean", "error", "low", "high")


def test_a_noisy_parabola_has_the_parabola_as_its_mean() -> None:
    # y = x^2 + e with x in (0, 1): the mean over a sixteenth (l, h) is (l^2 + l h + h^2) / 3, the
    # scatter of e is 0.3 of 500 runs a bin.
    rng = np.random.default_rng(1)
    x = rng.random(8000)
    found = main_effect(x, x**2 + 0.3 * rng.normal(size=8000))
    borders = np.linspace(0.0, 1.0, 17)
    low, high = borders[:-1], borders[1:]
    expected = (low**2 + low * high + high**2) / 3.0
    np.testing.assert_allclose(found["x"], 0.5 * (low + high), atol=0.015)
    np.testing.assert_allclose(found["mean"], expected, atol=4.5 * 0.3 / np.sqrt(500.0))
    np.testing.assert_allclose(found["error"], 0.3 / np.sqrt(500.0), rtol=0.2)
    # 5 % and 95 % of a normal are 1.645 standard deviations away.
    np.testing.assert_allclose(found["high"] - found["low"], 2.0 * 1.645 * 0.3, rtol=0.15)


def test_the_mean_lies_within_two_standard_errors_as_often_as_it_should() -> None:
    # Student's t of 25 values a bin: P(|t| < 2) = 0.943 with 24 degrees of freedom. 1,600 means
    # scatter by 0.006.
    inside = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        found = main_effect(rng.random(400), rng.normal(5.0, 2.0, size=400))
        inside.append(np.abs(found["mean"] - 5.0) < 2.0 * found["error"])
    assert np.mean(inside) == pytest.approx(0.943, abs=0.024)


def test_bins_hold_equal_counts_of_known_values() -> None:
    # 160 whole numbers: sixteen bins of ten; of 0 ... 9 the mean and median are 4.5, the standard
    # deviation is sqrt(110 / 12) and the quantiles are 0.45 and 8.55.
    x = np.arange(160.0)
    found = main_effect(x, 3.0 * x)
    starts = 10.0 * np.arange(16)
    np.testing.assert_allclose(found["x"], starts + 4.5)
    np.testing.assert_allclose(found["mean"], 3.0 * (starts + 4.5))
    np.testing.assert_allclose(found["error"], 3.0 * np.sqrt(110.0 / 12.0) / np.sqrt(10.0))
    np.testing.assert_allclose(found["low"], 3.0 * (starts + 0.45))
    np.testing.assert_allclose(found["high"], 3.0 * (starts + 8.55))


@pytest.mark.parametrize(
    ("n", "bins"), [(2, 1), (7, 1), (8, 1), (15, 1), (16, 2), (80, 10), (127, 15), (128, 16),
                    (10_000, 16)],
)  # fmt: skip
def test_a_bin_holds_eight_runs_or_more(n: int, bins: int) -> None:
    assert BINS == 16
    found = main_effect(np.arange(float(n)), np.arange(float(n)) % 7.0)
    assert tuple(found) == KEYS
    for key in KEYS:
        assert found[key].shape == (bins,)
        assert np.isfinite(found[key]).all()


@pytest.mark.parametrize("n", [0, 1])
@pytest.mark.parametrize("missing", [0, 5])
def test_without_two_values_there_is_nothing_to_say(n: int, missing: int) -> None:
    outputs = np.concatenate([np.ones(n), np.full(missing, np.nan)])
    found = main_effect(np.arange(float(n + missing)), outputs)
    assert tuple(found) == KEYS
    assert all(found[key].size == 0 for key in KEYS)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_runs_without_a_value_are_left_out(bad: float) -> None:
    rng = np.random.default_rng(2)
    x, y = rng.random((2, 300))
    holed = y.copy()
    gone = rng.random(300) < 0.2
    holed[gone] = bad
    found, expected = main_effect(x, holed), main_effect(x[~gone], y[~gone])
    for key in KEYS:
        np.testing.assert_array_equal(found[key], expected[key])


def test_the_order_of_runs_does_not_matter() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.random((2, 300))
    order = rng.permutation(300)
    found, shuffled = main_effect(x, y), main_effect(x[order], y[order])
    for key in KEYS:
        np.testing.assert_allclose(found[key], shuffled[key], rtol=1e-12)


def test_a_constant_output_has_a_flat_effect() -> None:
    found = main_effect(np.random.default_rng(4).random(200), np.full(200, 2.5))
    for key, value in (("mean", 2.5), ("error", 0.0), ("low", 2.5), ("high", 2.5)):
        np.testing.assert_allclose(found[key], value, atol=1e-12)
    assert np.all(np.diff(found["x"]) > 0.0)
