"""Agreement of two methods against closed forms and SciPy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from mcstudy.agreement import breaking_inputs, compare, split_variance, without_rounding

QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=50)
N = 4000


def parts(n: int, size: int = 200) -> np.ndarray:
    return np.arange(n) // size


def pair(seed: int, rho: float, bias: float, scale: float, n: int = N) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    one, noise = rng.normal(size=(2, n))
    return one, bias + scale * (rho * one + math.sqrt(1.0 - rho**2) * noise)


def test_a_bivariate_normal_has_its_known_agreement() -> None:
    rho, bias, scale = 0.8, 0.5, 1.5
    one, two = pair(1, rho, bias, scale)
    found = compare(one, two, parts(N))
    spread = math.sqrt(1.0 + scale**2 - 2.0 * rho * scale)
    concordance = 2.0 * rho * scale / (1.0 + scale**2 + bias**2)
    middle = 0.25 * (1.0 + scale**2 + 2.0 * rho * scale)
    for estimate, truth in (
        (found.correlation, rho),
        (found.rank_correlation, 6.0 / math.pi * math.asin(0.5 * rho)),
        (found.concordance, concordance),
        (found.bias, bias),
        (found.spread, spread),
        (found.lower, bias - 1.959964 * spread),
        (found.upper, bias + 1.959964 * spread),
        (found.slope, 0.5 * (scale**2 - 1.0) / middle),
    ):
        assert estimate.low < estimate.value < estimate.high
        assert estimate.value == pytest.approx(truth, abs=2.0 * (estimate.high - estimate.low))
    assert found.outside == pytest.approx(0.05, abs=0.015)
    assert found.pairs == N


def test_coefficients_are_those_of_scipy() -> None:
    one, two = pair(2, 0.6, 3.0, 0.7, 300)
    found = compare(one, two, parts(300, 30))
    assert found.correlation.value == pytest.approx(stats.pearsonr(one, two)[0], rel=1e-12)
    assert found.rank_correlation.value == pytest.approx(stats.spearmanr(one, two)[0], rel=1e-12)


@pytest.mark.parametrize("statistic", ["bias", "rank_correlation"])
def test_intervals_cover_the_truth_as_often_as_they_say(statistic: str) -> None:
    truth = {"bias": 0.3, "rank_correlation": 6.0 / math.pi * math.asin(0.35)}[statistic]
    hits = 0
    for seed in range(200):
        found = getattr(compare(*pair(seed, 0.7, 0.3, 1.0, 400), parts(400, 40)), statistic)
        hits += found.low <= truth <= found.high
    # 95 % of 200, within four standard deviations; parts of 40 bias a rank correlation slightly.
    assert hits >= 178


def test_equal_methods_agree_wholly() -> None:
    one, _ = pair(3, 0.5, 0.0, 1.0)
    found = compare(one, one, parts(N))
    assert found.rank_correlation.value == pytest.approx(1.0)
    assert found.concordance.value == pytest.approx(1.0)
    assert (found.bias.value, found.spread.value, found.outside) == (0.0, 0.0, 0.0)


def test_too_few_pairs_are_refused() -> None:
    with pytest.raises(ValueError, match="three pairs"):
        compare(np.zeros(2), np.zeros(2), np.zeros(2, dtype=np.int64))


def test_a_shift_is_the_methods_and_a_common_answer_the_inputs() -> None:
    x = np.random.default_rng(4).normal(size=N)
    shifts = np.array([-1.0, 0.0, 1.0])
    split = split_variance(2.0 * x[:, None] + shifts, parts(N))
    of_method, of_inputs = 2.0 / 3.0, 4.0
    assert split.method.value == pytest.approx(of_method / (of_method + of_inputs), rel=0.06)
    assert split.together.value == pytest.approx(0.0, abs=1e-12)
    assert split.total == pytest.approx(of_method + of_inputs, rel=0.06)


def test_what_methods_answer_oppositely_is_both_together() -> None:
    x = np.random.default_rng(5).normal(size=N)
    split = split_variance(np.stack([x, -x], axis=1), parts(N))
    assert split.together.value == pytest.approx(1.0, abs=1e-3)
    assert split.inputs.value == pytest.approx(0.0, abs=1e-12)


def test_the_share_of_the_method_is_not_biased_by_few_inputs() -> None:
    # No shift, only interaction: without the correction the method's share would be 1/n.
    rng = np.random.default_rng(6)
    found = []
    for _ in range(2000):
        x = rng.normal(size=5)
        values = np.stack([x, -x], axis=1)
        means = values.mean(axis=0)
        found.append(float(np.var(means)) - float(values.var(axis=1).mean() - np.var(means)) / 4.0)
    assert np.mean(found) == pytest.approx(0.0, abs=0.02)


@QUIET
@given(
    seed=st.integers(0, 10**6),
    methods=st.integers(2, 4),
    shift=st.floats(-1e3, 1e3),
    scale=st.floats(0.01, 100.0),
)
def test_shares_sum_to_one_and_know_no_units(
    seed: int, methods: int, shift: float, scale: float
) -> None:
    values = np.random.default_rng(seed).normal(size=(60, methods)) + np.arange(methods)
    split = split_variance(values, parts(60, 6))
    moved = split_variance(shift + scale * values, parts(60, 6))
    shares = [getattr(split, key).value for key in ("method", "inputs", "together")]
    assert sum(shares) == pytest.approx(1.0)
    assert min(shares) >= 0.0
    for key in ("method", "inputs", "together"):
        one, other = getattr(split, key), getattr(moved, key)
        assert other.value == pytest.approx(one.value, rel=1e-6, abs=1e-9)


def test_the_input_that_breaks_the_correlation_is_found() -> None:
    rng = np.random.default_rng(7)
    x = rng.random((1500, 4))
    one = x[:, 0] + x[:, 1] + 0.05 * rng.normal(size=1500)
    two = x[:, 0] - x[:, 1] + 0.05 * rng.normal(size=1500)
    gains, noise = breaking_inputs(one, two, x, seed=1)
    assert int(np.argmax(gains)) == 1
    assert gains[1] > 0.5
    assert max(gains[2], gains[3]) < 3.0 * noise < 0.1


def test_nothing_breaks_what_agrees() -> None:
    rng = np.random.default_rng(8)
    x = rng.random((600, 3))
    gains, noise = breaking_inputs(x[:, 0], 2.0 * x[:, 0] + 1.0, x, seed=1)
    np.testing.assert_allclose(gains, 0.0, atol=1e-12)
    assert noise == pytest.approx(0.0, abs=1e-12)


@pytest.mark.filterwarnings("error")
def test_a_constant_has_no_rank_correlation_and_no_shares() -> None:
    x = np.random.default_rng(9).random((60, 2))
    flat = 700.1 * (1.0 + 1e-15 * np.arange(60.0))
    found = compare(flat, x[:, 0], parts(60, 6))
    for name in ("correlation", "rank_correlation"):
        assert np.isnan(getattr(found, name).value)
    gains, noise = breaking_inputs(flat, x[:, 0], x, seed=1)
    assert np.isnan([*gains, noise]).all()
    split = split_variance(np.stack([flat, flat], axis=1), parts(60, 6))
    assert np.isnan(split.inputs.value)
    assert split.total == 0.0
    apart = split_variance(np.stack([flat, 2.0 * flat], axis=1), parts(60, 6))
    assert apart.method.value == pytest.approx(1.0)


@pytest.mark.filterwarnings("error")
def test_agreement_knows_no_size() -> None:
    one, two = pair(3, 0.5, 0.2, 1.0, 60)
    plain = compare(one, two, parts(60, 6))
    huge = compare(np.ldexp(one, 900), np.ldexp(two, 900), parts(60, 6))
    assert huge.rank_correlation == plain.rank_correlation
    assert huge.upper.value == np.ldexp(plain.upper.value, 900)


def test_methods_that_rounding_alone_tells_apart_are_equal() -> None:
    one = np.arange(1.0, 9.0)
    assert without_rounding(one, one * (1.0 + 1e-15)) is one
    other = one.copy()
    other[3] += 1e-6
    assert without_rounding(one, other) is other
