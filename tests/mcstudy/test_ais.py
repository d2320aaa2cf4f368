"""AIS outcomes: weights, levels that lack, several mechanisms, drawn levels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcstudy_tools import Array, generator, quiet
from numpy.testing import assert_allclose, assert_array_equal
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

HIC = np.array([0.0, 200.0, 700.0, 1510.0, 3000.0])
ADULTS = np.full(HIC.size, 40.0)
LOGNORMAL, LOGISTIC = risk_function("nhtsa_lognormal"), risk_function("prasad_mertz")
"""Of AIS2+ to AIS4+, and of all six levels."""
BLOW = Mechanism("blow", [(LOGNORMAL, 3.0), (LOGISTIC, 1.0)])
TURN = Mechanism(
    "rotation", [(risk_function("ommaya"), 1.0), (risk_function("bric_takhounts"), 1.0)]
)
together = pytest.mark.parametrize("together", ["dependent", "independent"])


def falling(seed: int, n: int = 40) -> Array:
    """Return probabilities (n, 6) that fall with the level."""
    return np.sort(generator(seed).random((n, 6)), axis=1)[:, ::-1]


def test_exceedance_has_the_functions_risk_and_nan_where_it_has_none() -> None:
    found = exceedance(LOGNORMAL, HIC, ADULTS)
    assert found.shape == (5, 6)
    for level in LEVELS:
        own = LOGNORMAL.risk(level, HIC, ADULTS) if level in (2, 3, 4) else np.full(5, np.nan)
        assert_array_equal(found[:, level - 1], own)


def test_a_blow_that_did_not_happen_is_no_risk() -> None:
    found = exceedance(risk_function("mertz_normal"), np.array([np.nan, 1434.0]), ADULTS[:2])
    assert_allclose(found[:, 3], [0.0, 0.5])
    mixed = mix(BLOW, {"hic15": np.array([np.nan, 1000.0])}, ADULTS[:2])
    assert_array_equal(mixed[0], 0.0)
    assert np.all(mixed[1] > 0.0)


def test_mix_weights_the_functions_that_have_a_level() -> None:
    found = mix(BLOW, {"hic15": HIC}, ADULTS)
    for level in (2, 3, 4):
        expected = 0.75 * LOGNORMAL.risk(level, HIC) + 0.25 * LOGISTIC.risk(level, HIC)
        assert_allclose(found[:, level - 1], expected, rtol=1e-12)
    # Levels that only one of them has are its own, but no more than the milder one: AIS5 of Prasad
    # and Mertz at HIC 3000 is above the mean of both functions at AIS4.
    for level in (5, 6):
        own = LOGISTIC.risk(level, HIC)
        assert_allclose(found[:4, level - 1], own[:4], rtol=1e-12)
    assert LOGISTIC.risk(5, HIC)[4] > found[4, 3] == found[4, 4]
    scaled = Mechanism("blow", [(function, 7.0 * weight) for function, weight in BLOW.functions])
    assert_allclose(mix(scaled, {"hic15": HIC}, ADULTS), found, rtol=1e-12)


def test_below_the_lowest_known_level_risk_is_its_and_above_the_highest_none() -> None:
    mertz = risk_function("mertz_normal")
    found = mix(Mechanism("blow", [(mertz, 2.0)]), {"hic15": HIC}, ADULTS)
    assert_allclose(found[:, :4], np.tile(mertz.risk(4, HIC)[:, None], 4), rtol=1e-12)
    assert_array_equal(found[:, 4:], 0.0)


def test_every_run_has_its_own_age() -> None:
    found = mix(BLOW, {"hic15": np.array([700.0, 700.0])}, np.array([3.0, 40.0]))
    assert_array_equal(found[:1], mix(BLOW, {"hic15": np.array([700.0])}, np.array([3.0])))
    assert np.all(found[0] > found[1])


@quiet(60)
@given(
    weights=st.lists(st.floats(0.01, 10.0), min_size=4, max_size=4),
    hic=st.floats(1e-3, 10_000.0),
    bric=st.floats(0.0, 5.0),
    age=st.floats(0.0, 90.0),
)
def test_risks_never_rise_with_the_level_and_their_distribution_sums_to_one(
    weights: list[float], hic: float, bric: float, age: float
) -> None:
    # Curves of two levels of a publication cross at HIC 3250 and above; the mix must not.
    names = ("nhtsa_lognormal", "prasad_mertz", "mertz_normal", "ncap_logistic")
    pairs = [(risk_function(name), w) for name, w in zip(names, weights, strict=True)]
    outputs = {"hic15": np.array([hic]), "bric": np.array([bric]),
               "head_angular_acceleration": np.array([5000.0 * bric])}  # fmt: skip
    parts = [mix(m, outputs, np.array([age])) for m in (Mechanism("blow", pairs), BLOW, TURN)]
    for found in parts:
        assert np.all((found >= 0.0) & (found <= 1.0))
        assert np.all(np.diff(found, axis=1) <= 0.0)
    for way in ("dependent", "independent"):
        shares = distribution(combine(parts, way))
        assert shares.shape == (1, 7)
        assert np.all(shares >= -1e-15)
        assert float(shares.sum()) == pytest.approx(1.0, abs=1e-12)


@together
def test_combine_takes_the_larger_or_the_complement_of_the_product(together: str) -> None:
    a, b, c = falling(1), falling(2), falling(3)
    pair = np.maximum(a, b) if together == "dependent" else a + b - a * b
    assert_allclose(combine([a, b], together), pair, rtol=1e-12)
    assert_allclose(combine([a], together), a, rtol=1e-12)
    assert_allclose(combine([a, b, c], together), combine([c, a, b], together), rtol=1e-12)
    assert_array_equal(combine([a, b]), np.maximum(a, b))


@quiet(60)
@given(seeds=st.lists(st.integers(0, 10_000), min_size=1, max_size=4))
def test_dependent_is_the_lower_bound_and_independent_the_upper(seeds: list[int]) -> None:
    # Frechet: max p_k <= P(any) for every dependence; independence is at most the sum.
    parts = [falling(seed, 8) for seed in seeds]
    low, high = combine(parts, "dependent"), combine(parts, "independent")
    assert np.all(low <= high + 1e-15)
    assert np.all(high <= np.minimum(np.sum(parts, axis=0), 1.0) + 1e-12)
    assert np.all(np.diff(high, axis=1) <= 1e-15)


def test_distribution_by_hand() -> None:
    exceeding = np.array([[0.9, 0.7, 0.4, 0.4, 0.1, 0.0]])
    expected = [[0.1, 0.2, 0.3, 0.0, 0.3, 0.1, 0.0]]
    assert_allclose(distribution(exceeding), expected, atol=1e-15)
    assert_allclose(distribution(exceeding[0]), expected[0], atol=1e-15)


def test_drawn_levels_have_the_frequencies_of_the_distribution() -> None:
    exceeding = np.array([0.9, 0.7, 0.4, 0.3, 0.1, 0.02])
    drawn = draw_ais(np.tile(exceeding, (40_000, 1)), generator(5).random(40_000))
    counts = np.bincount(drawn, minlength=7)
    assert stats.chisquare(counts, 40_000 * distribution(exceeding)).pvalue > 1e-3
    # Of an evenly spaced uniform they are exact.
    drawn = draw_ais(np.tile(exceeding, (1000, 1)), (np.arange(1000) + 0.5) / 1000)
    assert_allclose(np.bincount(drawn, minlength=7) / 1000, distribution(exceeding))
    edges = np.array([0.0, 0.5, 1.0 - 2.0**-53])
    assert_array_equal(draw_ais(np.ones((3, 6)), edges), 6)
    assert_array_equal(draw_ais(np.zeros((3, 6)), edges), 0)


@quiet(60)
@given(seed=st.integers(0, 100_000), lift=st.floats(0.0, 1.0))
def test_a_higher_risk_never_draws_a_lower_ais_of_the_same_uniforms(seed: int, lift: float) -> None:
    low, uniforms = falling(seed), generator(seed + 1).random(40)
    assert np.all(draw_ais(low + lift * (1.0 - low), uniforms) >= draw_ais(low, uniforms))
