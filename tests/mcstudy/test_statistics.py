"""Intervals: closed forms where there are some, coverage by simulation where not."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize, stats

from mcstudy import statistics
from mcstudy.sampling import designs
from mcstudy.statistics import Estimate

Array = NDArray[np.float64]


def coverage(truth: float, estimate: Callable[[int], Estimate], trials: int) -> float:
    """Return the share of seeded trials whose interval holds the true value."""
    found = [estimate(seed) for seed in range(trials)]
    return float(np.mean([e.low <= truth <= e.high for e in found]))


def latin_hypercube(seed: int, count: int = 10, size: int = 40) -> tuple[Array, NDArray[np.int64]]:
    """Return (n, 3) uniforms and their replicates."""
    u = designs.draw("latin-hypercube", count * size, size, 3, seed)
    return u, np.arange(count * size) // size


def response(u: Array) -> Array:
    """Return a + b c: of mean 0.75, not additive, so that replicates differ."""
    return np.asarray(u[:, 0] + u[:, 1] * u[:, 2])


# -- quantiles -------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [50, 200, 1000, 2000])
@pytest.mark.parametrize("p", [0.25, 0.5, 0.75, 0.95])
def test_order_statistics_cover_as_the_binomial_law_says(n: int, p: float) -> None:
    # Of 0, 1, ..., n - 1 the ends of the interval are the ranks themselves. A quantile lies
    # between ranks l and h when l < B <= h samples are below it (David and Nagaraja 2003, 7.1).
    found = statistics.quantile(np.arange(float(n)), p)
    law = stats.binom(n, p)
    if np.isnan(found.high):
        assert law.pmf(n) > 0.025
        return
    covered = law.cdf(found.high) - law.cdf(found.low)
    assert 0.95 <= covered <= 0.99
    # Neither side misses more than 2.5 %, and one rank less would.
    assert law.cdf(found.low) <= 0.025 < law.cdf(found.low + 1)
    assert law.sf(found.high) <= 0.025 < law.sf(found.high - 1)


def test_order_statistic_intervals_do_not_depend_on_the_order_of_samples() -> None:
    values = np.random.default_rng(0).normal(size=100)
    assert statistics.quantile(values, 0.25) == statistics.quantile(np.sort(values), 0.25)


@pytest.mark.parametrize("p", [0.05, 0.5, 0.95])
def test_quantile_intervals_of_independent_samples_cover(p: float) -> None:
    def estimate(seed: int) -> Estimate:
        return statistics.quantile(np.random.default_rng(seed).exponential(size=200), p)

    assert 0.90 <= coverage(-np.log(1.0 - p), estimate, 1000) <= 0.98


@pytest.mark.parametrize(("confidence", "least"), [(0.90, 59), (0.95, 72)])
def test_wilks_least_number_of_samples_for_a_bound_on_the_95_percent_quantile(
    monkeypatch: pytest.MonkeyPatch, confidence: float, least: int
) -> None:
    # Wilks 1941: P(max of n > q95) = 1 - 0.95^n. 59 samples give a one-sided 95 % bound, the
    # upper end of a two-sided 90 % interval; 72 that of a two-sided 95 % one.
    monkeypatch.setattr(statistics, "CONFIDENCE", confidence)
    one_sided = 0.5 + confidence / 2.0
    assert 1.0 - 0.95**least >= one_sided > 1.0 - 0.95 ** (least - 1)
    assert np.isnan(statistics.quantile(np.arange(least - 1.0), 0.95).high)
    assert statistics.quantile(np.arange(float(least)), 0.95).high == least - 1
    assert np.isnan(statistics.quantile(np.arange(least - 1.0), 0.05).low)
    assert statistics.quantile(np.arange(float(least)), 0.05).low == 0.0


def test_quantile_between_replicates_covers() -> None:
    # P(a + b c <= t) = 3 t^2 / 4 - t^2 ln(t) / 2 for t below 1.
    median = optimize.brentq(lambda t: 0.75 * t**2 - 0.5 * t**2 * np.log(t) - 0.5, 0.1, 1.0)

    def estimate(seed: int) -> Estimate:
        u, groups = latin_hypercube(seed)
        return statistics.quantile(response(u), 0.5, groups)

    assert 0.90 <= coverage(median, estimate, 300) <= 0.98


# -- probabilities ---------------------------------------------------------------------------


@pytest.mark.parametrize(("k", "n"), [(0, 10), (3, 10), (10, 10), (17, 200), (1, 2000)])
def test_probability_has_wilsons_interval(k: int, n: int) -> None:
    hits = np.arange(n) < k
    z2 = stats.norm.ppf(0.975) ** 2
    # Wilson 1927.
    middle = (k + z2 / 2.0) / (n + z2)
    reach = np.sqrt(z2 * (k * (n - k) / n + z2 / 4.0)) / (n + z2)
    found = statistics.probability(hits)
    assert found.value == k / n
    assert found.low == pytest.approx(middle - reach, abs=1e-12)
    assert found.high == pytest.approx(middle + reach, abs=1e-12)


@functools.cache
def wilson(n: int) -> list[Estimate]:
    """Return the estimates for 0, 1, ..., n hits of n."""
    return [statistics.probability(np.arange(n) < k) for k in range(n + 1)]


@pytest.mark.parametrize("p", [0.02, 0.1, 0.3, 0.5, 0.8])
def test_wilson_intervals_cover(p: float) -> None:
    found = wilson(200)
    inside = np.array([e.low <= p <= e.high for e in found])
    assert 0.90 <= stats.binom.pmf(np.arange(201), 200, p)[inside].sum() <= 0.98
    hits = np.random.default_rng(7).binomial(200, p, size=2000)
    assert 0.90 <= inside[hits].mean() <= 0.98


def test_probability_between_replicates_covers() -> None:
    # P(a + b > 1.5) = 1/8.
    def estimate(seed: int) -> Estimate:
        u, groups = latin_hypercube(seed, size=100)
        return statistics.probability(u[:, 0] + u[:, 1] > 1.5, groups)

    assert 0.90 <= coverage(0.125, estimate, 300) <= 0.98


def test_probability_of_an_event_that_never_happened_falls_back_on_wilson() -> None:
    hits, groups = np.zeros(400, dtype=bool), np.arange(400) // 40
    assert statistics.probability(hits, groups) == statistics.probability(hits)
    assert statistics.probability(~hits, groups) == statistics.probability(~hits)


def test_probability_intervals_stay_between_nought_and_one() -> None:
    hits, groups = np.zeros(400, dtype=bool), np.arange(400) // 40
    hits[:3] = True
    found = statistics.probability(hits, groups)
    assert found.low == 0.0
    assert found.value == 3 / 400
    assert statistics.probability(~hits, groups).high == 1.0


# -- means and standard deviations -----------------------------------------------------------


def test_mean_has_students_interval() -> None:
    values = np.array([9.1, 10.4, 8.7, 11.0, 10.2])
    found = statistics.mean(values)
    expected = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert found.value == pytest.approx(9.88)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))


def test_mean_between_replicates_is_students_interval_of_their_means() -> None:
    values = np.random.default_rng(4).normal(size=60)
    groups = np.arange(60) // 12
    expected = statistics.mean(values.reshape(5, 12).mean(axis=1))
    found = statistics.mean(values, groups)
    assert found.value == pytest.approx(values.mean(), rel=1e-12)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))


def test_t_intervals_between_replicates_cover() -> None:
    def estimate(seed: int) -> Estimate:
        u, groups = latin_hypercube(seed)
        return statistics.mean(response(u), groups)

    assert 0.90 <= coverage(0.75, estimate, 400) <= 0.98


def test_mean_intervals_of_independent_samples_cover() -> None:
    def estimate(seed: int) -> Estimate:
        return statistics.mean(np.random.default_rng(seed).normal(5.0, 2.0, size=30))

    assert 0.90 <= coverage(5.0, estimate, 1000) <= 0.98


def test_replicates_of_latin_hypercubes_give_the_shorter_honest_interval() -> None:
    u, groups = latin_hypercube(1)
    additive = u[:, 0] + u[:, 1]
    between, independent = statistics.mean(additive, groups), statistics.mean(additive)
    assert between.high - between.low < 0.2 * (independent.high - independent.low)


@pytest.mark.parametrize("law", [stats.norm(3.0, 2.0), stats.uniform(0.0, 1.0), stats.logistic()])
def test_standard_deviation_intervals_cover(law: Any) -> None:
    def estimate(seed: int) -> Estimate:
        values = law.rvs(size=300, random_state=np.random.default_rng(seed))
        return statistics.standard_deviation(values)

    assert 0.90 <= coverage(float(law.std()), estimate, 1000) <= 0.98


def test_standard_deviation_of_few_or_equal_values_has_no_interval() -> None:
    two = statistics.standard_deviation(np.array([1.0, 2.0]))
    assert two.value == pytest.approx(np.sqrt(0.5))
    equal = statistics.standard_deviation(np.full(10, 3.0))
    assert equal.value == 0.0
    for found in (two, equal):
        assert np.isnan(found.low)
        assert np.isnan(found.high)


def test_one_replicate_has_no_interval() -> None:
    values, groups = np.arange(20.0), np.zeros(20, dtype=np.int64)
    for found in (
        statistics.mean(values, groups),
        statistics.standard_deviation(values, groups),
        statistics.quantile(values, 0.5, groups),
    ):
        assert np.isfinite(found.value)
        assert np.isnan(found.low)
        assert np.isnan(found.high)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_replicates_of_one_sample_have_a_mean() -> None:
    values = np.arange(10.0)
    assert statistics.mean(values, np.arange(10)).value == pytest.approx(4.5)


def test_mean_of_unequal_replicates_is_the_mean_of_the_samples() -> None:
    values = np.array([1.0, 2.0, 3.0, 4.0, np.nan, np.nan, 8.0, 9.0])
    described: Any = statistics.describe(values, np.arange(8) // 4)
    assert described["mean"]["value"] == pytest.approx(np.nanmean(values))


# -- describe and convergence ----------------------------------------------------------------


def test_describe_counts_what_is_undefined_and_describes_the_rest() -> None:
    values = np.concatenate([np.arange(101.0), [np.nan, np.inf, -np.inf]])
    found: Any = statistics.describe(values)
    assert found["n"] == 101
    assert found["undefined"] == 3
    assert found["mean"]["value"] == pytest.approx(50.0)
    assert found["sd"]["value"] == pytest.approx(np.sqrt(101 * 102 / 12))
    assert list(found["quantiles"]) == ["0.05", "0.25", "0.5", "0.75", "0.95"]
    for name, estimate in found["quantiles"].items():
        assert estimate["value"] == pytest.approx(100.0 * float(name))
        assert estimate["low"] < estimate["value"] < estimate["high"]


def test_describe_leaves_undefined_values_out_of_their_replicates() -> None:
    rng = np.random.default_rng(5)
    values, groups = rng.normal(size=80), np.arange(80) // 20
    holed = np.concatenate([values, np.full(4, np.nan)])
    found = statistics.describe(holed, np.concatenate([groups, np.arange(4)]))
    assert found == statistics.describe(values, groups) | {"undefined": 4}


@pytest.mark.parametrize("values", [[], [np.nan, np.nan], [3.0], [3.0, np.nan]])
def test_describe_of_fewer_than_two_values_only_counts(values: list[float]) -> None:
    found = statistics.describe(np.array(values, dtype=float))
    defined = int(np.isfinite(values).sum())
    assert found == {"n": defined, "undefined": len(values) - defined}


def test_convergence_doubles_the_finite_values() -> None:
    values = np.concatenate([np.arange(800.0), np.full(10, np.nan)])
    found = statistics.convergence(values, lambda part: float(part.mean()))
    assert [(entry["n"], entry["value"]) for entry in found] == [
        (100, 49.5), (200, 99.5), (400, 199.5), (800, 399.5),
    ]  # fmt: skip
    assert [entry["n"] for entry in statistics.convergence(np.arange(20.0), np.sum)] == [10, 20]


# -- values that do not vary, and values of any size ------------------------------------------


@pytest.mark.parametrize(
    ("values", "truth"),
    [
        ([], False), ([3.0], False), ([3.0, np.nan], False), ([0.0, 0.0], False),
        ([700.1, 700.1 * (1.0 + 1e-15)], False), ([-700.1, 700.1], True),
        ([1e9, 1e9 + 0.1], True), ([1e-300, 2e-300], True), ([-1.7e308, 1.7e308], True),
    ],
)  # fmt: skip
def test_values_vary_where_they_differ_by_more_than_rounding(
    values: list[float], truth: bool
) -> None:
    assert statistics.varies(np.array(values, dtype=float)) is truth


def test_a_constant_has_no_spread_and_no_interval() -> None:
    values = 700.1 * (1.0 + 1e-15 * np.arange(20.0))
    found: Any = statistics.describe(values, np.arange(20) // 5)
    assert found["sd"]["value"] == 0.0
    for estimate in (found["mean"], found["sd"], *found["quantiles"].values()):
        assert np.isnan([estimate["low"], estimate["high"]]).all()
    assert found["quantiles"]["0.5"]["value"] == pytest.approx(700.1)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("exponent", [-900, 900])
def test_a_power_of_two_changes_no_digit(exponent: int) -> None:
    values, groups = np.random.default_rng(3).normal(5.0, 1.0, 80), np.arange(80) // 20
    plain: Any = statistics.describe(values, groups)
    scaled: Any = statistics.describe(np.ldexp(values, exponent), groups)
    for key in ("mean", "sd"):
        for side in ("value", "low", "high"):
            assert scaled[key][side] == np.ldexp(plain[key][side], exponent)
