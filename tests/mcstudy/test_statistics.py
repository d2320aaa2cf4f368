"""Intervals: closed forms where there are some, coverage by simulation where not."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mcstudy_tools import Array, generator
from numpy.typing import NDArray
from scipy import optimize, stats

from mcstudy import statistics
from mcstudy.sampling import designs
from mcstudy.statistics import Distribution, Estimate

Groups = NDArray[np.int64]


def groups_of(n: int, size: int) -> Groups:
    return np.arange(n) // size


def latin_hypercube(seed: int, size: int = 40) -> tuple[Array, Groups]:
    """Return (n, 3) uniforms of ten replicates, and these."""
    u = designs.draw("latin-hypercube", 10 * size, size, 3, seed)
    return u, groups_of(10 * size, size)


def no_interval(found: Estimate) -> bool:
    return bool(np.isnan([found.low, found.high]).all())


@pytest.mark.parametrize("n", [50, 200, 1000, 2000])
@pytest.mark.parametrize("p", [0.25, 0.5, 0.75, 0.95])
def test_order_statistics_cover_as_the_binomial_law_says(n: int, p: float) -> None:
    # Of 0, 1, ..., n - 1 the ends of the interval are the ranks themselves. A quantile lies
    # between ranks l and h when l < B <= h samples are below it (David and Nagaraja 2003, 7.1).
    found = statistics.quantile(generator(0).permutation(n).astype(float), p)
    law = stats.binom(n, p)
    if np.isnan(found.high):
        assert law.pmf(n) > 0.025
        return
    assert 0.95 <= law.cdf(found.high) - law.cdf(found.low) <= 0.99
    # Neither side misses more than 2.5 %, and one rank less would.
    assert law.cdf(found.low) <= 0.025 < law.cdf(found.low + 1)
    assert law.sf(found.high) <= 0.025 < law.sf(found.high - 1)
    assert found.value == pytest.approx(p * (n - 1))


@pytest.mark.parametrize(("confidence", "least"), [(0.90, 59), (0.95, 72)])
def test_wilks_least_number_of_samples_for_a_bound_on_the_95_percent_quantile(
    monkeypatch: pytest.MonkeyPatch, confidence: float, least: int
) -> None:
    # Wilks 1941: P(max of n > q95) = 1 - 0.95^n. 59 samples give a one-sided 95 % bound, the
    # upper end of a two-sided 90 % interval; 72 that of a two-sided 95 % one.
    monkeypatch.setattr(statistics, "CONFIDENCE", confidence)
    assert 1.0 - 0.95**least >= 0.5 + confidence / 2.0 > 1.0 - 0.95 ** (least - 1)
    few, enough = np.arange(least - 1.0), np.arange(float(least))
    assert np.isnan(statistics.quantile(few, 0.95).high)
    assert statistics.quantile(enough, 0.95).high == least - 1
    assert np.isnan(statistics.quantile(few, 0.05).low)
    assert statistics.quantile(enough, 0.05).low == 0.0


@pytest.mark.parametrize(("k", "n"), [(0, 10), (3, 10), (10, 10), (17, 200), (1, 2000)])
def test_probability_has_wilsons_interval(k: int, n: int) -> None:
    z2 = stats.norm.ppf(0.975) ** 2
    # Wilson 1927.
    middle = (k + z2 / 2.0) / (n + z2)
    reach = np.sqrt(z2 * (k * (n - k) / n + z2 / 4.0)) / (n + z2)
    found = statistics.probability(np.arange(n) < k)
    assert found.value == k / n
    assert (found.low, found.high) == pytest.approx((middle - reach, middle + reach), abs=1e-12)


def test_probabilities_between_replicates_keep_to_0_and_1_and_fall_back_on_wilson() -> None:
    hits, groups = np.zeros(400, dtype=bool), groups_of(400, 40)
    assert statistics.probability(hits, groups) == statistics.probability(hits)
    assert statistics.probability(~hits, groups) == statistics.probability(~hits)
    hits[:3] = True
    found = statistics.probability(hits, groups)
    assert (found.value, found.low) == (3 / 400, 0.0)
    assert statistics.probability(~hits, groups).high == 1.0


def test_means_have_students_interval_of_samples_or_of_replicates() -> None:
    values = np.array([9.1, 10.4, 8.7, 11.0, 10.2])
    expected = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    found = statistics.mean(values)
    assert found.value == pytest.approx(9.88)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))
    spread = np.concatenate([values - 1.0, values, values + 1.0]).reshape(3, 5).T.ravel()
    between = statistics.mean(spread, groups_of(15, 3))
    assert between.value == pytest.approx(9.88)
    assert (between.low, between.high) == pytest.approx((found.low, found.high))


MEDIAN = optimize.brentq(lambda t: 0.75 * t**2 - 0.5 * t**2 * np.log(t) - 0.5, 0.1, 1.0)
"""Of a + b c: P(a + b c <= t) = 3 t^2 / 4 - t^2 ln(t) / 2 for t below 1; its mean is 3/4."""


def response(u: Array) -> Array:
    """Return a + b c, not additive, so that replicates differ."""
    return np.asarray(u[:, 0] + u[:, 1] * u[:, 2])


def replicated(measure: Callable[..., Estimate], size: int = 40) -> Callable[[int], Estimate]:
    return lambda seed: measure(*latin_hypercube(seed, size))


def deviation_of(law: Any) -> Callable[[int], Estimate]:
    return lambda seed: statistics.standard_deviation(
        law.rvs(size=300, random_state=generator(seed))
    )


@pytest.mark.parametrize("trials", [60, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("truth", "estimate"), [
    (0.75, replicated(lambda u, g: statistics.mean(response(u), g))),
    (MEDIAN, replicated(lambda u, g: statistics.quantile(response(u), 0.5, g))),
    (0.125, replicated(lambda u, g: statistics.probability(u[:, 0] + u[:, 1] > 1.5, g), 100)),
    (2.0, deviation_of(stats.norm(3.0, 2.0))),
    (stats.uniform.std(), deviation_of(stats.uniform)),
    (stats.logistic.std(), deviation_of(stats.logistic)),
], ids=["mean", "median", "probability", "sd normal", "sd uniform", "sd logistic"])  # fmt: skip
def test_intervals_cover(truth: float, estimate: Callable[[int], Estimate], trials: int) -> None:
    found = [estimate(seed) for seed in range(trials)]
    more = max(1.0, np.sqrt(300 / trials))
    rate = np.mean([e.low <= truth <= e.high for e in found])
    assert 0.95 - 0.05 * more <= rate <= 0.95 + 0.03 * more


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_what_gives_no_spread_has_a_value_and_no_interval() -> None:
    two, equal = (statistics.standard_deviation(v) for v in (np.array([1.0, 2.0]), np.full(9, 3.0)))
    assert (two.value, equal.value) == (pytest.approx(np.sqrt(0.5)), 0.0)
    values, one = np.arange(20.0), np.zeros(20, dtype=np.int64)
    alone = [
        statistics.mean(values, one),
        statistics.standard_deviation(values, one),
        statistics.quantile(values, 0.5, one),
    ]
    assert all(np.isfinite(found.value) for found in alone)
    assert all(no_interval(found) for found in (two, equal, *alone))
    assert statistics.mean(values, np.arange(20)).value == pytest.approx(9.5)


def described(values: Array, replicate: NDArray[np.int64] | None = None) -> Distribution:
    found = statistics.describe(values, replicate=replicate)
    assert isinstance(found, Distribution)
    return found


def test_describe_counts_what_is_undefined_and_describes_the_rest() -> None:
    values = np.concatenate([np.arange(101.0), [np.nan, np.inf, -np.inf]])
    found = described(values)
    assert (found.n, found.undefined) == (101, 3)
    assert found.mean.value == pytest.approx(50.0)
    assert found.sd.value == pytest.approx(np.sqrt(101 * 102 / 12))
    assert list(found.quantiles) == ["0.05", "0.25", "0.5", "0.75", "0.95"]
    for name, estimate in found.quantiles.items():
        assert estimate.value == pytest.approx(100.0 * float(name))
        assert estimate.low < estimate.value < estimate.high


def test_describe_leaves_undefined_values_out_of_their_replicates() -> None:
    values, groups = generator(5).normal(size=80), groups_of(80, 20)
    holed = np.concatenate([values, np.full(4, np.nan)])
    found = described(holed, np.concatenate([groups, np.arange(4)]))
    assert found == replace(described(values, groups), undefined=4)
    # The mean of unequal replicates is that of the samples.
    values = np.array([1.0, 2.0, 3.0, 4.0, np.nan, np.nan, 8.0, 9.0])
    unequal = described(values, groups_of(8, 4))
    assert unequal.mean.value == pytest.approx(np.nanmean(values))


@pytest.mark.parametrize("values", [[], [np.nan, np.nan], [3.0], [3.0, np.nan]])
def test_describe_of_fewer_than_two_values_only_counts(values: list[float]) -> None:
    defined = int(np.isfinite(values).sum())
    expected = statistics.TooFew("m", defined, len(values) - defined)
    assert statistics.describe(np.array(values, dtype=float), "m") == expected


def test_convergence_doubles_the_finite_values() -> None:
    values = np.concatenate([np.arange(800.0), np.full(10, np.nan)])
    found = statistics.convergence(values, lambda part: float(part.mean()))
    assert [(entry.n, entry.value) for entry in found] == [
        (100, 49.5), (200, 99.5), (400, 199.5), (800, 399.5),
    ]  # fmt: skip
    assert [entry.n for entry in statistics.convergence(np.arange(20.0), np.sum)] == [10, 20]


@pytest.mark.parametrize(
    ("values", "truth"),
    [
        ([], False), ([3.0], False), ([3.0, np.nan], False), ([0.0, 0.0], False),
        ([700.1, 700.1 * (1.0 + 1e-15)], False), ([-700.1, 700.1], True),
        ([1e9, 1e9 + 0.1], True), ([1e-300, 2e-300], True), ([-1.7e308, 1.7e308], True),
    ],
)  # fmt: skip
def test_values_vary_if_they_differ_by_more_than_rounding(values: list[float], truth: bool) -> None:
    assert statistics.varies(np.array(values, dtype=float)) is truth


def test_a_constant_has_no_spread_and_no_interval() -> None:
    values = 700.1 * (1.0 + 1e-15 * np.arange(20.0))
    found = described(values, groups_of(20, 5))
    assert found.sd.value == 0.0
    for estimate in (found.mean, found.sd, *found.quantiles.values()):
        assert np.isnan([estimate.low, estimate.high]).all()
    assert found.quantiles["0.5"].value == pytest.approx(700.1)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("exponent", [-900, 900])
def test_a_power_of_two_changes_no_digit(exponent: int) -> None:
    values, groups = generator(3).normal(5.0, 1.0, 80), groups_of(80, 20)
    plain = described(values, groups)
    scaled = described(np.ldexp(values, exponent), groups)
    for key in ("mean", "sd"):
        for side in ("value", "low", "high"):
            one, other = (getattr(getattr(found, key), side) for found in (scaled, plain))
            assert one == np.ldexp(other, exponent)
