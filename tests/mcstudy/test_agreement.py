"""Agreement of two methods against closed forms and SciPy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcstudy_tools import Array, generator, quiet
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy import stats

from mcstudy.agreement import compare, sources_of_disagreement, split_variance, without_rounding

N = 4000
SHARES = ("method", "inputs", "together")


def parts(n: int, size: int = 200) -> NDArray[np.int64]:
    return np.arange(n) // size


def pair(seed: int, rho: float, bias: float, scale: float, n: int = N) -> tuple[Array, Array]:
    one, noise = generator(seed).normal(size=(2, n))
    return one, bias + scale * (rho * one + math.sqrt(1.0 - rho**2) * noise)


def test_a_bivariate_normal_has_its_known_agreement() -> None:
    rho, bias, scale = 0.8, 0.5, 1.5
    found = compare(*pair(1, rho, bias, scale), parts(N))
    spread = math.sqrt(1.0 + scale**2 - 2.0 * rho * scale)
    for estimate, truth in (
        (found.correlation, rho),
        (found.rank_correlation, 6.0 / math.pi * math.asin(0.5 * rho)),
        (found.concordance, 2.0 * rho * scale / (1.0 + scale**2 + bias**2)),
        (found.bias, bias),
        (found.spread, spread),
        (found.lower, bias - 1.959964 * spread),
        (found.upper, bias + 1.959964 * spread),
        (found.slope, 0.5 * (scale**2 - 1.0) / (0.25 * (1.0 + scale**2 + 2.0 * rho * scale))),
    ):
        assert estimate.low < estimate.value < estimate.high
        assert estimate.value == pytest.approx(truth, abs=2.0 * (estimate.high - estimate.low))
    assert found.outside == pytest.approx(0.05, abs=0.015)
    assert found.pairs == N


def test_coefficients_are_those_of_scipy_and_know_no_size() -> None:
    one, two = pair(2, 0.6, 3.0, 0.7, 300)
    found = compare(one, two, parts(300, 30))
    assert found.correlation.value == pytest.approx(stats.pearsonr(one, two)[0], rel=1e-12)
    assert found.rank_correlation.value == pytest.approx(stats.spearmanr(one, two)[0], rel=1e-12)
    huge = compare(np.ldexp(one, 900), np.ldexp(two, 900), parts(300, 30))
    assert huge.rank_correlation == found.rank_correlation
    assert huge.upper.value == np.ldexp(found.upper.value, 900)


@pytest.mark.parametrize("seeds", [30, pytest.param(200, marks=pytest.mark.slow)])
def test_intervals_cover_the_truth_as_often_as_they_say(seeds: int) -> None:
    truths, hits = {"bias": 0.3, "rank_correlation": 6.0 / math.pi * math.asin(0.35)}, []
    for seed in range(seeds):
        found = compare(*pair(seed, 0.7, 0.3, 1.0, 400), parts(400, 40))
        estimates = [(getattr(found, name), truth) for name, truth in truths.items()]
        hits.append([e.low <= truth <= e.high for e, truth in estimates])
    # 95 %, within four standard deviations; parts of 40 bias a rank correlation slightly.
    assert np.all(np.mean(hits, axis=0) >= 0.95 - 0.06 * math.sqrt(200 / seeds))


def test_equal_methods_agree_wholly() -> None:
    one, _ = pair(3, 0.5, 0.0, 1.0)
    found = compare(one, one, parts(N))
    assert found.rank_correlation.value == pytest.approx(1.0)
    assert found.concordance.value == pytest.approx(1.0)
    assert (found.bias.value, found.spread.value, found.outside) == (0.0, 0.0, 0.0)
    # Those that rounding alone tells apart are equal.
    assert without_rounding(one, one * (1.0 + 1e-15)) is one
    other = one + 1e-6 * (np.arange(N) == 3)
    assert without_rounding(one, other) is other
    with pytest.raises(ValueError, match="three pairs"):
        compare(np.zeros(2), np.zeros(2), parts(2))


def test_a_shift_is_the_methods_and_a_common_answer_the_inputs() -> None:
    x = generator(4).normal(size=N)
    split = split_variance(2.0 * x[:, None] + np.array([-1.0, 0.0, 1.0]), parts(N))
    of_method, of_inputs = 2.0 / 3.0, 4.0
    assert split.method.value == pytest.approx(of_method / (of_method + of_inputs), rel=0.06)
    assert split.together.value == pytest.approx(0.0, abs=1e-12)
    assert split.total == pytest.approx(of_method + of_inputs, rel=0.06)
    # What methods answer oppositely is both together.
    split = split_variance(np.stack([x, -x], axis=1), parts(N))
    assert split.together.value == pytest.approx(1.0, abs=1e-3)
    assert split.inputs.value == pytest.approx(0.0, abs=1e-12)


def test_the_variances_are_right_on_average_however_few_the_inputs() -> None:
    # Y = x and 4 - x with x standard normal: variance 4 of the method, 1 of both together. Of five
    # inputs the methods' means scatter by 1/5, which is not the methods'. Pairs of x and -x take
    # out what is linear in x: 400 sets leave 0.02 and 0.045.
    found = []
    for x in generator(6).normal(size=(200, 5)):
        for signed in (x, -x):
            split = split_variance(np.stack([signed, 4.0 - signed], axis=1), parts(5))
            found.append([split.total * getattr(split, name).value for name in SHARES])
    of_method, of_inputs, together = np.mean(found, axis=0)
    assert of_method == pytest.approx(4.0, abs=0.06)
    assert of_inputs == pytest.approx(0.0, abs=1e-12)
    assert together == pytest.approx(1.0, abs=0.14)


@quiet(20)
@given(
    seed=st.integers(0, 10**6),
    methods=st.integers(2, 4),
    shift=st.floats(-1e3, 1e3),
    scale=st.floats(0.01, 100.0),
)
def test_shares_sum_to_one_in_any_unit(seed: int, methods: int, shift: float, scale: float) -> None:
    values = generator(seed).normal(size=(60, methods)) + np.arange(methods)
    plain, moved = (split_variance(v, parts(60, 6)) for v in (values, shift + scale * values))
    shares = [getattr(plain, key).value for key in SHARES]
    assert sum(shares) == pytest.approx(1.0)
    assert min(shares) >= 0.0
    assert_allclose([getattr(moved, k).value for k in SHARES], shares, rtol=1e-6, atol=1e-9)


def test_the_input_that_breaks_the_correlation_is_found() -> None:
    rng = generator(7)
    x = rng.random((1500, 4))
    one, two = (x[:, 0] + sign * x[:, 1] + 0.05 * rng.normal(size=1500) for sign in (1.0, -1.0))
    gains, noise = sources_of_disagreement(one, two, x, seed=1)
    assert int(np.argmax(gains)) == 1
    assert gains[1] > 0.5
    assert max(gains[2], gains[3]) < 3.0 * noise < 0.1
    gains, noise = sources_of_disagreement(x[:, 0], 2.0 * x[:, 0] + 1.0, x, seed=1)
    assert_allclose([*gains, noise], 0.0, atol=1e-12)


@pytest.mark.filterwarnings("error")
def test_a_constant_has_no_rank_correlation_and_no_shares() -> None:
    x = generator(9).random((60, 2))
    flat = 700.1 * (1.0 + 1e-15 * np.arange(60.0))
    found = compare(flat, x[:, 0], parts(60, 6))
    assert np.isnan([found.correlation.value, found.rank_correlation.value]).all()
    gains, noise = sources_of_disagreement(flat, x[:, 0], x, seed=1)
    assert np.isnan([*gains, noise]).all()
    split = split_variance(np.stack([flat, flat], axis=1), parts(60, 6))
    assert np.isnan(split.inputs.value)
    assert split.total == 0.0
    apart = split_variance(np.stack([flat, 2.0 * flat], axis=1), parts(60, 6))
    assert apart.method.value == pytest.approx(1.0)
