"""AIS outcomes: weights, levels that lack, several mechanisms, drawn levels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from mcstudy.injury.ais import (
    LEVELS,
    Mechanism,
    combine,
    distribution,
    draw_ais,
    exceedance,
    mix,
)
from mcstudy.injury.functions import risk_function

Array = NDArray[np.float64]

QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=60)

HIC = np.array([0.0, 200.0, 700.0, 1510.0, 3000.0])
ADULTS = np.full(HIC.size, 40.0)
OUTPUTS = {
    "hic15": HIC,
    "bric": np.array([0.0, 0.3, 0.7, 1.2, 2.0]),
    "head_angular_acceleration": np.array([0.0, 1500.0, 4000.0, 9000.0, 20_000.0]),
    "head_angular_velocity": np.array([0.0, 20.0, 45.0, 70.0, 120.0]),
}
BLOW = Mechanism(
    "blow",
    [(risk_function("nhtsa_lognormal"), 3.0), (risk_function("prasad_mertz"), 1.0)],
)
TURN = Mechanism(
    "rotation", [(risk_function("ommaya"), 1.0), (risk_function("bric_takhounts"), 1.0)]
)


def falling(seed: int, n: int = 40) -> Array:
    """Return probabilities (n, 6) that fall with the level."""
    return np.sort(np.random.default_rng(seed).random((n, 6)), axis=1)[:, ::-1]


# -- one function ----------------------------------------------------------------------------


def test_exceedance_has_the_functions_risk_and_nan_where_it_has_none() -> None:
    function = risk_function("nhtsa_lognormal")
    found = exceedance(function, HIC, ADULTS)
    assert found.shape == (5, 6)
    for level in LEVELS:
        if level in (2, 3, 4):
            np.testing.assert_array_equal(found[:, level - 1], function.risk(level, HIC, ADULTS))
        else:
            assert np.isnan(found[:, level - 1]).all()


def test_a_blow_that_did_not_happen_is_no_risk() -> None:
    found = exceedance(risk_function("mertz_normal"), np.array([np.nan, 1434.0]), ADULTS[:2])
    np.testing.assert_allclose(found[:, 3], [0.0, 0.5])
    mixed = mix(BLOW, {"hic15": np.array([np.nan, 1000.0])}, ADULTS[:2])
    np.testing.assert_array_equal(mixed[0], 0.0)
    assert np.all(mixed[1] > 0.0)


# -- mix -------------------------------------------------------------------------------------


def test_mix_weights_the_functions_that_have_a_level() -> None:
    # At HIC 3000 the one function that has AIS5 puts it above the mean of both at AIS4: see below.
    x = HIC[:4]
    found = mix(BLOW, {"hic15": x}, ADULTS[:4])
    lognormal, logistic = (function for function, _ in BLOW.functions)
    for level in (2, 3, 4):
        expected = 0.75 * lognormal.risk(level, x) + 0.25 * logistic.risk(level, x)
        np.testing.assert_allclose(found[:, level - 1], expected, rtol=1e-12)
    # Levels that only one of them has are its own.
    for level in (5, 6):
        np.testing.assert_allclose(found[:, level - 1], logistic.risk(level, x), rtol=1e-12)


def test_a_worse_level_that_only_one_function_has_is_no_more_than_the_milder_one() -> None:
    # AIS5 of Prasad and Mertz at HIC 3000 is above the mean of both functions at AIS4.
    found = mix(BLOW, {"hic15": HIC[4:]}, ADULTS[4:])[0]
    lognormal, logistic = (function for function, _ in BLOW.functions)
    means = [
        0.75 * float(lognormal.risk(level, HIC[4])) + 0.25 * float(logistic.risk(level, HIC[4]))
        for level in (2, 3, 4)
    ]
    worse = float(logistic.risk(5, HIC[4]))
    assert means[2] < worse
    np.testing.assert_allclose(found[1:4], means, rtol=1e-12)
    assert found[4] == found[3]


def test_weights_count_by_their_ratio_only() -> None:
    scaled = Mechanism("blow", [(function, 7.0 * weight) for function, weight in BLOW.functions])
    np.testing.assert_allclose(mix(scaled, OUTPUTS, ADULTS), mix(BLOW, OUTPUTS, ADULTS), rtol=1e-12)


def test_below_the_lowest_known_level_risk_is_its_and_above_the_highest_none() -> None:
    found = mix(Mechanism("blow", [(risk_function("mertz_normal"), 2.0)]), OUTPUTS, ADULTS)
    own = risk_function("mertz_normal").risk(4, HIC)
    for level in (1, 2, 3, 4):
        np.testing.assert_allclose(found[:, level - 1], own, rtol=1e-12)
    np.testing.assert_array_equal(found[:, 4:], 0.0)


def test_every_run_has_its_own_age() -> None:
    ages = np.array([3.0, 40.0])
    found = mix(BLOW, {"hic15": np.array([700.0, 700.0])}, ages)
    child = mix(BLOW, {"hic15": np.array([700.0])}, ages[:1])
    np.testing.assert_array_equal(found[:1], child)
    assert np.all(found[0] > found[1])


@QUIET
@given(
    weights=st.lists(st.floats(0.01, 10.0), min_size=4, max_size=4),
    hic=st.floats(1e-3, 10_000.0),
    age=st.floats(0.0, 90.0),
)
def test_mixed_risks_never_rise_with_the_level_and_lie_within_0_and_1(
    weights: list[float], hic: float, age: float
) -> None:
    # Curves of two levels of a publication cross at HIC 3250 and above; the mix must not.
    names = ("nhtsa_lognormal", "prasad_mertz", "mertz_normal", "ncap_logistic")
    pairs = [(risk_function(name), w) for name, w in zip(names, weights, strict=True)]
    found = mix(Mechanism("blow", pairs), {"hic15": np.array([hic])}, np.array([age]))
    assert np.all((found >= 0.0) & (found <= 1.0))
    assert np.all(np.diff(found, axis=1) <= 0.0)


@QUIET
@given(weight=st.floats(0.0, 1.0), k=st.integers(0, 4))
def test_a_mix_lies_between_its_functions(weight: float, k: int) -> None:
    w = min(max(weight, 1e-6), 1.0 - 1e-6)
    a, b = (function for function, _ in BLOW.functions)
    found = mix(Mechanism("blow", [(a, w), (b, 1.0 - w)]), OUTPUTS, ADULTS)[k]
    for level in (2, 3, 4):
        ends = [float(f.risk(level, HIC[k])) for f in (a, b)]
        assert min(ends) - 1e-12 <= found[level - 1] <= max(ends) + 1e-12


# -- combine ---------------------------------------------------------------------------------


def test_combine_takes_the_larger_or_the_complement_of_the_product() -> None:
    a, b = falling(1), falling(2)
    np.testing.assert_array_equal(combine([a, b]), np.maximum(a, b))
    np.testing.assert_allclose(combine([a, b], "independent"), a + b - a * b, rtol=1e-12)


@pytest.mark.parametrize("together", ["dependent", "independent"])
def test_one_mechanism_alone_is_itself(together: str) -> None:
    a = falling(3)
    np.testing.assert_allclose(combine([a], together), a, rtol=1e-12)


@QUIET
@given(seeds=st.lists(st.integers(0, 10_000), min_size=1, max_size=4))
def test_dependent_is_the_lower_bound_and_independent_the_upper(seeds: list[int]) -> None:
    # Frechet: max p_k <= P(any) for every dependence; independence is at most the sum.
    parts = [falling(seed, 8) for seed in seeds]
    low, high = combine(parts, "dependent"), combine(parts, "independent")
    assert np.all(low <= high + 1e-15)
    assert np.all(high <= np.minimum(np.sum(parts, axis=0), 1.0) + 1e-12)
    for found in (low, high):
        assert np.all((found >= 0.0) & (found <= 1.0))
        assert np.all(np.diff(found, axis=1) <= 1e-15)


def test_the_order_of_mechanisms_does_not_count() -> None:
    a, b, c = falling(1), falling(2), falling(3)
    for together in ("dependent", "independent"):
        np.testing.assert_allclose(
            combine([a, b, c], together),
            combine([c, a, b], together),
            rtol=1e-12,
        )


# -- distribution ----------------------------------------------------------------------------


def test_distribution_by_hand() -> None:
    exceeding = np.array([[0.9, 0.7, 0.4, 0.4, 0.1, 0.0]])
    expected = [[0.1, 0.2, 0.3, 0.0, 0.3, 0.1, 0.0]]
    np.testing.assert_allclose(distribution(exceeding), expected, atol=1e-15)
    np.testing.assert_allclose(distribution(exceeding[0]), expected[0], atol=1e-15)


@QUIET
@given(hic=st.floats(1e-3, 10_000.0), bric=st.floats(0.0, 5.0), age=st.floats(0.0, 90.0))
def test_a_distribution_sums_to_one_and_is_not_negative(
    hic: float, bric: float, age: float
) -> None:
    outputs = {
        "hic15": np.array([hic]),
        "bric": np.array([bric]),
        "head_angular_acceleration": np.array([5000.0 * bric]),
    }
    parts = [mix(mechanism, outputs, np.array([age])) for mechanism in (BLOW, TURN)]
    for together in ("dependent", "independent"):
        shares = distribution(combine(parts, together))
        assert shares.shape == (1, 7)
        assert np.all(shares >= -1e-15)
        assert float(shares.sum()) == pytest.approx(1.0, abs=1e-12)


# -- draw_ais --------------------------------------------------------------------------------


def test_drawn_levels_have_the_frequencies_of_the_distribution() -> None:
    exceeding = np.array([0.9, 0.7, 0.4, 0.3, 0.1, 0.02])
    n = 40_000
    uniforms = np.random.default_rng(5).random(n)
    drawn = draw_ais(np.tile(exceeding, (n, 1)), uniforms)
    counts = np.bincount(drawn, minlength=7)
    assert counts.size == 7
    assert stats.chisquare(counts, n * distribution(exceeding)).pvalue > 1e-3


def test_draws_of_an_evenly_spaced_uniform_are_exact() -> None:
    exceeding = np.array([0.9, 0.7, 0.4, 0.3, 0.1, 0.0])
    n = 1000
    drawn = draw_ais(np.tile(exceeding, (n, 1)), (np.arange(n) + 0.5) / n)
    np.testing.assert_allclose(np.bincount(drawn, minlength=7) / n, distribution(exceeding))


def test_certain_and_impossible_levels_are_drawn_as_such() -> None:
    edges = np.array([0.0, 0.5, 1.0 - 2.0**-53])
    np.testing.assert_array_equal(draw_ais(np.ones((3, 6)), edges), 6)
    np.testing.assert_array_equal(draw_ais(np.zeros((3, 6)), edges), 0)


@QUIET
@given(seed=st.integers(0, 100_000), lift=st.floats(0.0, 1.0))
def test_a_scenario_of_higher_risk_never_gives_a_lower_ais_with_the_same_uniforms(
    seed: int, lift: float
) -> None:
    low = falling(seed)
    high = low + lift * (1.0 - low)
    uniforms = np.random.default_rng(seed + 1).random(low.shape[0])
    assert np.all(draw_ais(high, uniforms) >= draw_ais(low, uniforms))
