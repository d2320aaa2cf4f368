"""Distributions against SciPy and CDC tables, dependence against its definition."""

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcstudy_tools import Array, generator, quiet
from numpy.testing import assert_allclose, assert_array_equal
from pydantic import TypeAdapter, ValidationError
from scipy import stats

from mcstudy.studyfile.distributions import Distribution, GrowthChart
from mcstudy.studyfile.input_space import (
    MAX_SCORE,
    InputSpace,
    copula_factor,
    sampling_order,
    value_at,
)
from studies.kinds import load_study
from studies.monte_carlo.schema import MonteCarloStudy

CONFIGS = Path(__file__).parents[2] / "configs"
U = np.concatenate([[1e-9, 1e-6, 1e-3], np.linspace(0.01, 0.99, 99), [1 - 1e-3, 1 - 1e-6]])
ADAPTER: TypeAdapter[Distribution] = TypeAdapter(Distribution)


def make(distribution: str, **parameters: Any) -> Distribution:
    return ADAPTER.validate_python({"distribution": distribution, **parameters})


def space(laws: Mapping[str, Distribution], *pairs: tuple[str, str, float]) -> InputSpace:
    return InputSpace(laws, {name: law.unit for name, law in laws.items()}, pairs)


@functools.cache
def paper_study() -> MonteCarloStudy:
    study = load_study(CONFIGS / "paper_study.toml")
    assert isinstance(study, MonteCarloStudy)
    return study


def chart(name: str) -> GrowthChart:
    found = paper_study().inputs[name]
    assert isinstance(found, GrowthChart)
    return found


def test_uniform_and_triangular_are_scipys() -> None:
    found = make("uniform", low=-2.0, high=5.0).quantile(U, {})
    assert_allclose(found, stats.uniform.ppf(U, loc=-2.0, scale=7.0), rtol=1e-14)
    for low, mode, high in ((0.15, 0.25, 0.40), (0.0, 0.0, 1.0), (-3.0, 2.0, 2.0)):
        found = make("triangular", low=low, mode=mode, high=high).quantile(U, {})
        law = stats.triang((mode - low) / (high - low), loc=low, scale=high - low)
        assert_allclose(found, law.ppf(U), rtol=1e-12)


@pytest.mark.parametrize(("mean", "sd", "low", "high", "atol"), [
    (42.0, 2.0, 36.0, 48.0, 1e-9), (2.8, 0.5, 1.5, 4.5, 1e-9), (0.0, 1.0, None, None, 1e-9),
    (0.0, 1.0, -0.3, None, 1e-9), (0.0, 1.0, None, 0.2, 1e-9), (0.0, 1.0, 1.0, 3.0, 1e-9),
    (0.0, 1.0, -6.0, -4.0, 1e-9), (0.0, 1.0, 7.0, 8.0, 0.0), (0.0, 1.0, 8.0, 9.0, 0.0),
    (0.0, 1.0, -9.0, -8.0, 0.0),
])  # fmt: skip
def test_normal_is_scipys_truncnorm(
    mean: float, sd: float, low: float | None, high: float | None, atol: float
) -> None:
    found = make("normal", mean=mean, sd=sd, low=low, high=high).quantile(U, {})
    a = -np.inf if low is None else (low - mean) / sd
    b = np.inf if high is None else (high - mean) / sd
    assert_allclose(found, stats.truncnorm.ppf(U, a, b, loc=mean, scale=sd), rtol=1e-9, atol=atol)


@pytest.mark.parametrize(
    ("low", "high"), [(None, None), (0.9, 1.3), (None, 1.0), (1.05, None), (-1.0, 1.1), (0.0, None)]
)
def test_the_logarithm_of_a_lognormal_is_normal(low: float | None, high: float | None) -> None:
    median, sigma = 1.02, 0.15
    found = make("lognormal", median=median, sigma=sigma, low=low, high=high).quantile(U, {})
    a = -np.inf if low is None or low <= 0.0 else np.log(low / median) / sigma
    b = np.inf if high is None else np.log(high / median) / sigma
    expected = stats.truncnorm.ppf(U, a, b, loc=np.log(median), scale=sigma)
    assert_allclose(np.log(found), expected, rtol=1e-9, atol=1e-9)
    if low is None and high is None:
        assert_allclose(found, stats.lognorm.ppf(U, sigma, scale=median), rtol=1e-12)


def test_truncated_draws_never_leave_their_bounds() -> None:
    rng = generator(0)
    u = np.array([2.0**-53, 1e-12, 1.0 - 1e-12, 1.0 - 2.0**-53])
    for _ in range(200):
        mean, sd = rng.normal(0.0, 10.0), rng.uniform(0.01, 5.0)
        low = mean + sd * rng.normal()
        high = low + sd * abs(rng.normal())
        found = make("normal", mean=mean, sd=sd, low=low, high=high).quantile(u, {})
        assert np.all((found >= low) & (found <= high))


PROBABILITIES = st.lists(st.floats(1e-12, 1.0 - 1e-12), min_size=2, max_size=20).map(
    lambda values: np.sort(np.array(values))
)


@quiet(80)
@given(
    u=PROBABILITIES, low=st.floats(-1e3, 1e3), width=st.floats(1e-3, 1e3), share=st.floats(0.0, 1.0)
)
def test_bounded_laws_rise_within_bounds(u: Array, low: float, width: float, share: float) -> None:
    high = low + width
    mode = min(max(low + share * width, low), high)
    for law in (make("uniform", low=low, high=high),
                make("triangular", low=low, mode=mode, high=high)):  # fmt: skip
        found = law.quantile(u, {})
        assert np.all(np.diff(found) >= 0.0)
        assert np.all((found >= low) & (found <= high))


@quiet(80)
@given(
    u=PROBABILITIES, mean=st.floats(-1e3, 1e3), sd=st.floats(1e-3, 1e3), a=st.floats(-5.0, 4.9),
    width=st.floats(0.1, 5.0), median=st.floats(1e-2, 1e3), sigma=st.floats(0.01, 1.0),
)  # fmt: skip
def test_normal_and_lognormal_rise_within_their_bounds(
    u: Array, mean: float, sd: float, a: float, width: float, median: float, sigma: float
) -> None:
    low, high = mean + a * sd, mean + min(a + width, 5.0) * sd
    found = make("normal", mean=mean, sd=sd, low=low, high=high).quantile(u, {})
    # A probability carries half an ulp of 1 at most; over the density at 5 sd that is 1e-10 sd.
    reach = 1e-10 * sd + 4.0 * np.spacing(abs(mean) + 5.0 * sd)
    assert np.all(np.diff(found) >= 0.0)
    assert np.all((found >= low - reach) & (found <= high + reach))
    found = make("lognormal", median=median, sigma=sigma).quantile(np.append(u, 0.5), {})
    assert np.all(np.diff(found[:-1]) >= 0.0)
    assert np.all(found > 0.0)
    assert found[-1] == pytest.approx(median, rel=1e-12)


@pytest.mark.parametrize(("name", "age", "expected"), [
    # CDC 2000 growth charts, statage and wtage, boys: 5, 50 and 95 % to a tenth of a cm and kg.
    ("stature", 84.5, (113.2, 122.0, 131.0)), ("stature", 90.5, (116.1, 125.1, 134.5)),
    ("stature", 95.5, (118.4, 127.6, 137.3)), ("body_mass", 84.5, (18.7, 23.2, 30.9)),
    ("body_mass", 90.5, (19.7, 24.4, 33.0)), ("body_mass", 95.5, (20.5, 25.5, 34.9)),
])  # fmt: skip
def test_growth_charts_give_the_cdc_percentiles_and_rise_with_probability(
    name: str, age: float, expected: tuple[float, float, float]
) -> None:
    found = chart(name).quantile(np.array([0.05, 0.5, 0.95]), {"age": np.full(3, age)})
    assert_array_equal(np.round(found, 1), expected)
    u = np.clip(U, 1e-6, 1.0 - 1e-6)
    assert np.all(np.diff(chart(name).quantile(u, {"age": np.full(u.size, age)})) >= 0.0)


def test_growth_charts_are_interpolated_between_ages_and_lognormal_without_skewness() -> None:
    found = chart("stature").quantile(np.array([0.5]), {"age": np.array([87.5])})
    assert found[0] == pytest.approx(0.5 * (122.0305 + 125.1259), rel=1e-12)
    flat = make(
        "growth-chart", age="age", at=[0.0, 1.0], L=[0.0, 0.0], M=[20.0, 20.0], S=[0.1, 0.1]
    )
    found = flat.quantile(U, {"age": np.full(U.size, 0.5)})
    assert_allclose(found, stats.lognorm.ppf(U, 0.1, scale=20.0), rtol=1e-12)


@pytest.mark.parametrize(("changes", "message"), [
    ({"at": [84.5, 84.5]}, "at must rise"), ({"at": [95.5, 84.5]}, "at must rise"),
    ({"L": [1.0]}, "equal length"), ({"M": [122.0, -1.0]}, "greater than 0"),
    ({"at": [84.5], "L": [1.0], "M": [1.0], "S": [1.0]}, "at least 2"),
])  # fmt: skip
def test_growth_charts_that_are_none_are_refused(changes: dict[str, Any], message: str) -> None:
    good: dict[str, Any] = {
        "age": "age", "at": [84.5, 95.5], "L": [1.0, 1.0], "M": [122.0, 127.0], "S": [0.04, 0.04],
    }  # fmt: skip
    make("growth-chart", **good)
    with pytest.raises(ValidationError, match=message):
        make("growth-chart", **(good | changes))


def normal_scores(values: Array, law: GrowthChart, age: Array) -> Array:
    """Return z of the LMS method: ((x / M)^L - 1) / (L S), Cole and Green 1992, eq. 2."""
    L, M, S = (np.interp(age, law.at, p) for p in (law.L, law.M, law.S))
    return np.asarray(((values / M) ** L - 1.0) / (L * S))


def test_stature_and_body_mass_of_the_paper_study_correlate_as_measured() -> None:
    study, n = paper_study(), 20_000
    inputs = space(study.inputs, *study.dependence.correlations)
    values = inputs.transform(generator(1).random((n, len(inputs.names))))
    stature, body_mass = (
        normal_scores(values[name], chart(name), values["age"]) for name in ("stature", "body_mass")
    )
    # Standard error of a correlation: (1 - rho^2) / sqrt(n).
    found = np.corrcoef(stature, body_mass)[0, 1]
    assert abs(found - 0.723) < 3.0 * (1.0 - 0.723**2) / np.sqrt(n)
    for score in (stature, body_mass):
        assert stats.kstest(score, "norm").pvalue > 0.01
    grid = np.linspace(0.05, 0.95, 19)
    quantiles = study.inputs["head_mass"].quantile(grid, {})
    share = [np.mean(values["head_mass"] <= q) for q in quantiles]
    assert_allclose(share, grid, atol=3.0 * np.sqrt(0.25 / n))
    assert abs(np.corrcoef(stature, values["impact_speed"])[0, 1]) < 3.0 / np.sqrt(n)


def test_uncorrelated_inputs_keep_their_uniforms_to_the_last_bit() -> None:
    laws = {name: make("uniform", low=0.0, high=1.0) for name in "abcd"}
    uniforms = generator(2).random((500, 4))
    dependent = space(laws, ("b", "d", 0.9))
    free, tied = space(laws).transform(uniforms), dependent.transform(uniforms)
    assert_array_equal(np.column_stack([free[name] for name in "abcd"]), uniforms)
    assert_array_equal(np.column_stack([tied[name] for name in "abc"]), uniforms[:, :3])
    assert not np.array_equal(tied["d"], uniforms[:, 3])
    assert stats.kstest(tied["d"], "uniform").pvalue > 0.01
    scores = stats.norm.ppf(uniforms[:, 1]), stats.norm.ppf(tied["d"])
    assert np.corrcoef(*scores)[0, 1] == pytest.approx(0.9, abs=3.0 * 0.19 / np.sqrt(500))
    # Normal scores are the uniforms of their probabilities, and are held far out.
    for inputs, values in ((space(laws), free), (dependent, tied)):
        found = inputs.from_normal(stats.norm.ppf(uniforms))
        assert inputs.names == tuple(found) == tuple("abcd")
        for name in "abcd":
            assert_allclose(found[name], values[name], rtol=1e-9)


def test_values_are_in_the_units_asked_for_and_scores_far_out_are_held() -> None:
    law = {"speed": make("normal", mean=36.0, sd=3.6, unit="km/h")}
    inputs = InputSpace(law, {"speed": "m/s"})
    assert value_at(inputs, 2.0) == pytest.approx(12.0)
    assert value_at(inputs, 99.0) == value_at(inputs, MAX_SCORE) == pytest.approx(18.0, rel=0.01)
    with pytest.raises(ValueError, match="measures"):
        InputSpace(law, {"speed": "kg"})


def test_copula_factor_is_a_root_of_the_correlation_matrix() -> None:
    factor = copula_factor(["a", "b", "c"], [("c", "a", 0.5), ("b", "c", -0.3)])
    expected = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, -0.3], [0.5, -0.3, 1.0]])
    assert_allclose(factor @ factor.T, expected, atol=1e-15)
    assert_array_equal(factor, np.tril(factor))


@pytest.mark.parametrize(("correlations", "message"), [
    ([("a", "b", 0.9), ("b", "c", 0.9), ("a", "c", -0.9)], "contradict"),
    ([("a", "nobody", 0.5)], "'nobody' is not a sampled input"),
    ([("a", "b", 0.5), ("b", "a", 0.5)], "repeated"), ([("a", "a", 0.5)], "of one input"),
    *(([("a", "b", bad)], "not within -1 and 1") for bad in (1.0, -1.2, float("nan"))),
])  # fmt: skip
def test_impossible_pairs_are_refused(
    correlations: list[tuple[str, str, float]], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        copula_factor(["a", "b", "c"], correlations)


def growth(age: str) -> Distribution:
    return make("growth-chart", age=age, at=[0.0, 9.0], L=[1.0, 1.0], M=[1.0, 1.9], S=[0.1, 0.1])


def test_parents_are_sampled_first_wherever_the_file_has_them() -> None:
    laws = {"stature": growth("age"), "speed": make("uniform", low=0.0, high=1.0),
            "age": make("uniform", low=0.0, high=9.0)}  # fmt: skip
    order = sampling_order(laws)
    assert sorted(order) == sorted(laws)
    assert order.index("age") < order.index("stature")
    values = space(laws).transform(np.full((1, 3), 0.5))
    assert (values["age"][0], values["stature"][0]) == pytest.approx((4.5, 1.45))


@pytest.mark.parametrize(("laws", "named"), [
    ({"stature": growth("age")}, "inputs.stature depends on age"),
    ({"a": growth("a")}, "inputs.a depends on a"),
    ({"a": growth("b"), "b": growth("a")}, "inputs.a depends on b"),
])  # fmt: skip
def test_missing_parents_and_cycles_are_named(laws: dict[str, Distribution], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        sampling_order(laws)
