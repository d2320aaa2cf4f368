"""Distributions against scipy and CDC tables, dependence against its definition."""

import functools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from scipy import stats

from mcstudy.studyfile.distributions import Distribution, GrowthChart, sample_values
from mcstudy.studyfile.input_space import copula_factor, sampling_order
from studies.kinds import load_study
from studies.monte_carlo.schema import MonteCarloStudy

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
U = np.concatenate([[1e-9, 1e-6, 1e-3], np.linspace(0.01, 0.99, 99), [1 - 1e-3, 1 - 1e-6]])
ADAPTER: TypeAdapter[Distribution] = TypeAdapter(Distribution)
QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=150)


def make(distribution: str, **parameters: Any) -> Distribution:
    return ADAPTER.validate_python({"distribution": distribution, **parameters})


@functools.cache
def chart(name: str) -> GrowthChart:
    study = load_study(ROOT / "configs" / "paper_study.toml")
    assert isinstance(study, MonteCarloStudy)
    found = study.inputs[name]
    assert isinstance(found, GrowthChart)
    return found


# -- quantile functions ----------------------------------------------------------------------


def test_uniform_is_scipys() -> None:
    found = make("uniform", low=-2.0, high=5.0).quantile(U, {})
    np.testing.assert_allclose(found, stats.uniform.ppf(U, loc=-2.0, scale=7.0), rtol=1e-14)


@pytest.mark.parametrize(
    ("low", "mode", "high"), [(0.15, 0.25, 0.40), (0.0, 0.0, 1.0), (-3.0, 2.0, 2.0)]
)
def test_triangular_is_the_closed_form_and_scipys(low: float, mode: float, high: float) -> None:
    found = make("triangular", low=low, mode=mode, high=high).quantile(U, {})
    # Kotz and van Dorp, Beyond Beta, 2004, eq. 1.6.
    rising = low + np.sqrt(U * (high - low) * (mode - low))
    falling = high - np.sqrt((1.0 - U) * (high - low) * (high - mode))
    shape = (mode - low) / (high - low)
    expected = np.where(shape >= U, rising, falling)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(
        found, stats.triang.ppf(U, shape, loc=low, scale=high - low), rtol=1e-12
    )


@pytest.mark.parametrize(
    ("mean", "sd", "low", "high"),
    [
        (42.0, 2.0, 36.0, 48.0),
        (2.8, 0.5, 1.5, 4.5),
        (0.0, 1.0, None, None),
        (0.0, 1.0, -0.3, None),
        (0.0, 1.0, None, 0.2),
        (0.0, 1.0, 1.0, 3.0),
        (0.0, 1.0, -6.0, -4.0),
    ],
)
def test_normal_is_scipys_truncnorm(
    mean: float, sd: float, low: float | None, high: float | None
) -> None:
    found = make("normal", mean=mean, sd=sd, low=low, high=high).quantile(U, {})
    a = -np.inf if low is None else (low - mean) / sd
    b = np.inf if high is None else (high - mean) / sd
    np.testing.assert_allclose(
        found, stats.truncnorm.ppf(U, a, b, loc=mean, scale=sd), rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize(
    ("low", "high"), [(None, None), (0.9, 1.3), (None, 1.0), (1.05, None), (-1.0, 1.1), (0.0, None)]
)
def test_the_logarithm_of_a_lognormal_is_a_truncated_normal(
    low: float | None, high: float | None
) -> None:
    median, sigma = 1.02, 0.15
    found = make("lognormal", median=median, sigma=sigma, low=low, high=high).quantile(U, {})
    a = -np.inf if low is None or low <= 0.0 else np.log(low / median) / sigma
    b = np.inf if high is None else np.log(high / median) / sigma
    expected = stats.truncnorm.ppf(U, a, b, loc=np.log(median), scale=sigma)
    np.testing.assert_allclose(np.log(found), expected, rtol=1e-9, atol=1e-9)
    if low is None and high is None:
        np.testing.assert_allclose(found, stats.lognorm.ppf(U, sigma, scale=median), rtol=1e-12)


@pytest.mark.parametrize("low", [7.0, 8.0])
def test_normal_truncated_far_above_its_mean_is_scipys_too(low: float) -> None:
    found = make("normal", mean=0.0, sd=1.0, low=low, high=low + 1.0).quantile(U, {})
    np.testing.assert_allclose(found, stats.truncnorm.ppf(U, low, low + 1.0), rtol=1e-9)


def test_normal_truncated_far_below_its_mean_is_scipys_too() -> None:
    found = make("normal", mean=0.0, sd=1.0, low=-9.0, high=-8.0).quantile(U, {})
    np.testing.assert_allclose(found, stats.truncnorm.ppf(U, -9.0, -8.0), rtol=1e-9)


def test_truncated_draws_never_leave_their_bounds() -> None:
    rng = np.random.default_rng(0)
    u = np.array([2.0**-53, 1e-12, 1.0 - 1e-12, 1.0 - 2.0**-53])
    outside = []
    for _ in range(200):
        mean, sd = rng.normal(0.0, 10.0), rng.uniform(0.01, 5.0)
        low = mean + sd * rng.normal()
        high = low + sd * abs(rng.normal())
        found = make("normal", mean=mean, sd=sd, low=low, high=high).quantile(u, {})
        outside.append(bool((found < low).any() or (found > high).any()))
    assert sum(outside) == 0


# -- monotone and bounded --------------------------------------------------------------------

PROBABILITIES = st.lists(st.floats(1e-12, 1.0 - 1e-12), min_size=2, max_size=20).map(
    lambda values: np.sort(np.array(values))
)
VALUES = st.floats(-1e3, 1e3)
WIDTHS = st.floats(1e-3, 1e3)


@QUIET
@given(u=PROBABILITIES, low=VALUES, width=WIDTHS, share=st.floats(0.0, 1.0))
def test_bounded_distributions_rise_within_their_bounds(
    u: Array, low: float, width: float, share: float
) -> None:
    high = low + width
    mode = min(max(low + share * width, low), high)
    for found in (
        make("uniform", low=low, high=high).quantile(u, {}),
        make("triangular", low=low, mode=mode, high=high).quantile(u, {}),
    ):
        assert np.all(np.diff(found) >= 0.0)
        assert np.all((found >= low) & (found <= high))


@QUIET
@given(u=PROBABILITIES, mean=VALUES, sd=WIDTHS, a=st.floats(-5.0, 4.9), width=st.floats(0.1, 5.0))
def test_truncated_normal_rises_within_its_bounds(
    u: Array, mean: float, sd: float, a: float, width: float
) -> None:
    b = min(a + width, 5.0)
    low, high = mean + a * sd, mean + b * sd
    found = make("normal", mean=mean, sd=sd, low=low, high=high).quantile(u, {})
    # A probability carries half an ulp of 1 at most; over the density at 5 sd that is 1e-10 sd.
    reach = 1e-10 * sd + 4.0 * np.spacing(abs(mean) + 5.0 * sd)
    assert np.all(np.diff(found) >= 0.0)
    assert np.all((found >= low - reach) & (found <= high + reach))


@QUIET
@given(u=PROBABILITIES, median=st.floats(1e-2, 1e3), sigma=st.floats(0.01, 1.0))
def test_lognormal_rises_and_is_positive(u: Array, median: float, sigma: float) -> None:
    found = make("lognormal", median=median, sigma=sigma).quantile(u, {})
    assert np.all(np.diff(found) >= 0.0)
    assert np.all(found > 0.0)
    assert make("lognormal", median=median, sigma=sigma).quantile(
        np.array([0.5]), {}
    ) == pytest.approx(median, rel=1e-12)


@QUIET
@given(u=PROBABILITIES, age=st.floats(84.5, 95.5))
def test_growth_charts_rise_with_probability(u: Array, age: float) -> None:
    u = np.clip(u, 1e-6, 1.0 - 1e-6)
    for name in ("stature", "body_mass"):
        found = chart(name).quantile(u, {"age": np.full(u.size, age)})
        assert np.all(np.diff(found) >= 0.0)


# -- growth charts ---------------------------------------------------------------------------

# CDC 2000 growth charts, statage and wtage, boys: 5, 50 and 95 % to a tenth of a cm and kg.
PERCENTILES = [
    ("stature", 84.5, (113.2, 122.0, 131.0)),
    ("stature", 90.5, (116.1, 125.1, 134.5)),
    ("stature", 95.5, (118.4, 127.6, 137.3)),
    ("body_mass", 84.5, (18.7, 23.2, 30.9)),
    ("body_mass", 90.5, (19.7, 24.4, 33.0)),
    ("body_mass", 95.5, (20.5, 25.5, 34.9)),
]


@pytest.mark.parametrize(("name", "age", "expected"), PERCENTILES)
def test_growth_charts_give_the_cdc_percentiles(
    name: str, age: float, expected: tuple[float, float, float]
) -> None:
    found = chart(name).quantile(np.array([0.05, 0.5, 0.95]), {"age": np.full(3, age)})
    np.testing.assert_array_equal(np.round(found, 1), expected)


def test_growth_chart_medians_are_interpolated_between_ages() -> None:
    stature = chart("stature")
    found = stature.quantile(np.array([0.5]), {"age": np.array([87.5])})
    assert found[0] == pytest.approx(0.5 * (122.0305 + 125.1259), rel=1e-12)


def test_growth_chart_without_skewness_is_lognormal() -> None:
    flat = make(
        "growth-chart", age="age", at=[0.0, 1.0], L=[0.0, 0.0], M=[20.0, 20.0], S=[0.1, 0.1]
    )
    found = flat.quantile(U, {"age": np.full(U.size, 0.5)})
    np.testing.assert_allclose(found, stats.lognorm.ppf(U, 0.1, scale=20.0), rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"at": [84.5, 84.5]}, "at must rise"),
        ({"at": [95.5, 84.5]}, "at must rise"),
        ({"L": [1.0]}, "equal length"),
        ({"at": [84.5], "L": [1.0], "M": [1.0], "S": [1.0]}, "at least 2"),
        ({"M": [122.0, -1.0]}, "greater than 0"),
    ],
)
def test_growth_charts_that_are_none_are_refused(changes: dict[str, Any], message: str) -> None:
    good: dict[str, Any] = {
        "age": "age", "at": [84.5, 95.5], "L": [1.0, 1.0], "M": [122.0, 127.0], "S": [0.04, 0.04],
    }  # fmt: skip
    make("growth-chart", **good)
    with pytest.raises(ValidationError, match=message):
        make("growth-chart", **(good | changes))


# -- dependence ------------------------------------------------------------------------------


def normal_scores(values: Array, law: GrowthChart, age: Array) -> Array:
    """Return z of the LMS method: ((x / M)^L - 1) / (L S), Cole and Green 1992, eq. 2."""
    L, M, S = (np.interp(age, law.at, p) for p in (law.L, law.M, law.S))
    return np.asarray(((values / M) ** L - 1.0) / (L * S))


def test_stature_and_body_mass_of_the_paper_study_correlate_as_measured() -> None:
    study = load_study(ROOT / "configs" / "paper_study.toml")
    assert isinstance(study, MonteCarloStudy)
    n, names = 20000, list(study.inputs)
    uniforms = np.random.default_rng(1).random((n, len(names)))
    factor = copula_factor(names, study.dependence.correlations)
    values = sample_values(uniforms, study.inputs, factor)
    scores = {
        name: normal_scores(values[name], chart(name), values["age"])
        for name in ("stature", "body_mass")
    }
    found = np.corrcoef(scores["stature"], scores["body_mass"])[0, 1]
    # Standard error of a correlation: (1 - rho^2) / sqrt(n).
    assert abs(found - 0.723) < 3.0 * (1.0 - 0.723**2) / np.sqrt(n)
    for score in scores.values():
        assert stats.kstest(score, "norm").pvalue > 0.01
    head = study.inputs["head_mass"]
    grid = np.linspace(0.05, 0.95, 19)
    share = [np.mean(values["head_mass"] <= q) for q in head.quantile(grid, {})]
    np.testing.assert_allclose(share, grid, atol=3.0 * np.sqrt(0.25 / n))
    assert abs(np.corrcoef(scores["stature"], values["impact_speed"])[0, 1]) < 3.0 / np.sqrt(n)


def test_uncorrelated_inputs_keep_their_uniforms_to_the_last_bit() -> None:
    laws = {name: make("uniform", low=0.0, high=1.0) for name in "abcd"}
    uniforms = np.random.default_rng(2).random((500, 4))
    free = sample_values(uniforms, laws, copula_factor(list(laws), []))
    for k, name in enumerate(laws):
        np.testing.assert_array_equal(free[name], uniforms[:, k])
    tied = sample_values(uniforms, laws, copula_factor(list(laws), [("b", "d", 0.9)]))
    for k, name in enumerate("abc"):
        np.testing.assert_array_equal(tied[name], uniforms[:, k])
    assert not np.array_equal(tied["d"], uniforms[:, 3])
    assert stats.kstest(tied["d"], "uniform").pvalue > 0.01
    scores = stats.norm.ppf(uniforms[:, 1]), stats.norm.ppf(tied["d"])
    assert np.corrcoef(*scores)[0, 1] == pytest.approx(0.9, abs=3.0 * 0.19 / np.sqrt(500))


def test_copula_factor_is_a_root_of_the_correlation_matrix() -> None:
    factor = copula_factor(["a", "b", "c"], [("c", "a", 0.5), ("b", "c", -0.3)])
    expected = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, -0.3], [0.5, -0.3, 1.0]])
    np.testing.assert_allclose(factor @ factor.T, expected, atol=1e-15)
    np.testing.assert_array_equal(factor, np.tril(factor))


@pytest.mark.parametrize(
    ("correlations", "message"),
    [
        ([("a", "b", 0.9), ("b", "c", 0.9), ("a", "c", -0.9)], "contradict"),
        ([("a", "nobody", 0.5)], "'nobody' is not a sampled input"),
        ([("a", "b", 0.5), ("b", "a", 0.5)], "repeated"),
        ([("a", "a", 0.5)], "of one input"),
        ([("a", "b", 1.0)], "not within -1 and 1"),
        ([("a", "b", -1.2)], "not within -1 and 1"),
        ([("a", "b", float("nan"))], "not within -1 and 1"),
    ],
)
def test_impossible_correlations_are_refused(
    correlations: list[tuple[str, str, float]], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        copula_factor(["a", "b", "c"], correlations)


# -- order of sampling -----------------------------------------------------------------------


def growth(age: str) -> Distribution:
    return make("growth-chart", age=age, at=[0.0, 9.0], L=[1.0, 1.0], M=[1.0, 1.9], S=[0.1, 0.1])


def test_parents_are_sampled_first_wherever_the_file_has_them() -> None:
    laws = {"stature": growth("age"), "speed": make("uniform", low=0.0, high=1.0),
            "age": make("uniform", low=0.0, high=9.0)}  # fmt: skip
    order = sampling_order(laws)
    assert sorted(order) == sorted(laws)
    assert order.index("age") < order.index("stature")
    uniforms = np.full((1, 3), 0.5)
    values = sample_values(uniforms, laws, copula_factor(list(laws), []))
    assert values["age"][0] == pytest.approx(4.5)
    assert values["stature"][0] == pytest.approx(1.45)


@pytest.mark.parametrize(
    ("laws", "named"),
    [
        ({"stature": growth("age")}, "inputs.stature depends on age"),
        ({"a": growth("a")}, "inputs.a depends on a"),
        ({"a": growth("b"), "b": growth("a")}, "inputs.a depends on b"),
    ],
)
def test_missing_parents_and_cycles_are_named(laws: dict[str, Distribution], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        sampling_order(laws)
