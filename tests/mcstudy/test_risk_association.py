"""Rank correlations with the AIS and proportional odds, against SciPy and statsmodels."""

import functools

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from scipy import special, stats
from statsmodels.miscmodels.ordinal_model import OrderedModel

from mcstudy.injury import association
from mcstudy.injury.association import (
    OrdinalFit,
    fit_proportional_odds,
    rank_correlations,
)

Array = NDArray[np.float64]
Levels = NDArray[np.int64]


def generator(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def ordinal(
    n: int, seed: int, slopes: tuple[float, ...] = (1.2, -0.7, 0.0)
) -> tuple[dict[str, Array], Levels]:
    """Return predictors in unlike units and the AIS of a proportional-odds model."""
    rng = generator(seed)
    z = rng.normal(size=(n, len(slopes)))
    latent = z @ np.array(slopes) + rng.logistic(size=n)
    levels = np.digitize(latent, [-0.5, 0.8, 1.6, 3.0]).astype(np.int64)
    names = ("speed", "stiffness", "gap", "mass")[: len(slopes)]
    scale = {"speed": (40.0, 8.0), "stiffness": (1e5, 2e4), "gap": (0.05, 0.01), "mass": (3.0, 1.0)}
    return {name: scale[name][0] + scale[name][1] * z[:, k] for k, name in enumerate(names)}, levels


def standardised(predictors: dict[str, Array]) -> pd.DataFrame:
    return pd.DataFrame({k: (v - v.mean()) / v.std() for k, v in predictors.items()})


# -- rank correlations -----------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_rank_correlations_equal_scipys(seed: int) -> None:
    predictors, levels = ordinal(80, seed)
    found = rank_correlations(predictors["speed"], levels, generator(1))
    assert set(found) == {"spearman", "kendall"}
    x = predictors["speed"]
    assert found["spearman"].value == pytest.approx(stats.spearmanr(x, levels).statistic, rel=1e-12)
    assert found["kendall"].value == pytest.approx(
        stats.kendalltau(x, levels, variant="b").statistic, rel=1e-12
    )
    for estimate in found.values():
        assert -1.0 <= estimate.low < estimate.value < estimate.high <= 1.0


def test_rank_correlations_keep_to_ranks_and_signs() -> None:
    predictors, levels = ordinal(60, 4)
    x = predictors["speed"]
    plain = rank_correlations(x, levels, generator(1))
    bent = rank_correlations(np.exp(0.1 * x), levels, generator(1))
    turned = rank_correlations(-x, levels, generator(1))
    for name in plain:
        assert bent[name] == plain[name]
        assert turned[name].value == pytest.approx(-plain[name].value)
        assert turned[name].low == pytest.approx(-plain[name].high)


def test_rank_correlations_are_reproducible() -> None:
    predictors, levels = ordinal(60, 5)
    a, b, c = (rank_correlations(predictors["gap"], levels, generator(s)) for s in (1, 1, 2))
    assert a == b
    assert a["spearman"].low != c["spearman"].low


def test_a_perfect_association_is_one() -> None:
    levels = np.repeat(np.arange(5), 10)
    found = rank_correlations(levels.astype(float), levels, generator(1))
    for estimate in found.values():
        assert estimate.value == pytest.approx(1.0)
        assert estimate.low > 0.99
        assert estimate.high <= 1.0


def test_intervals_of_rank_correlations_cover(monkeypatch: pytest.MonkeyPatch) -> None:
    # The truth from 200,000 runs; of 30 sets at 0.95 at least 25 hold it with probability 0.997.
    # Fewer resamples than in the studies: the deviation then scatters by 9 %.
    monkeypatch.setattr(association, "RESAMPLES", 60)
    predictors, levels = ordinal(200_000, 100, (1.0,))
    x = predictors["speed"]
    truth = {
        "spearman": float(stats.spearmanr(x, levels).statistic),
        "kendall": float(stats.kendalltau(x, levels).statistic),
    }
    held: dict[str, list[bool]] = {"spearman": [], "kendall": []}
    for seed in range(30):
        predictors, levels = ordinal(80, seed, (1.0,))
        found = rank_correlations(predictors["speed"], levels, generator(seed))
        for name, estimate in found.items():
            held[name].append(estimate.low <= truth[name] <= estimate.high)
    for name, flags in held.items():
        assert sum(flags) >= 25, name


def test_more_runs_narrow_the_interval() -> None:
    widths = []
    for n in (50, 800):
        predictors, levels = ordinal(n, 6)
        found = rank_correlations(predictors["speed"], levels, generator(1))["spearman"]
        widths.append(found.high - found.low)
    # Four times as narrow; the bootstrap's deviation scatters by 5 %.
    assert widths[0] / widths[1] == pytest.approx(4.0, rel=0.35)


# -- proportional odds -----------------------------------------------------------------------


@functools.cache
def fitted(n: int, seed: int) -> OrdinalFit:
    return fit_proportional_odds(*ordinal(n, seed))


@pytest.mark.parametrize(("n", "seed"), [(60, 0), (150, 1), (600, 2)])
def test_proportional_odds_equal_statsmodels(n: int, seed: int) -> None:
    predictors, levels = ordinal(n, seed)
    ours = fitted(n, seed)
    codes = pd.Series(pd.Categorical(levels, ordered=True))
    model = OrderedModel(codes, standardised(predictors), distr="logit")
    theirs = model.fit(method="bfgs", disp=False, maxiter=500, gtol=1e-6)
    assert ours.log_likelihood == pytest.approx(float(theirs.llf), abs=1e-6)
    np.testing.assert_allclose(ours.slopes, theirs.params.iloc[:3], atol=1e-4)
    np.testing.assert_allclose(ours.errors, theirs.bse.iloc[:3], atol=1e-3)
    cuts = model.transform_threshold_params(theirs.params.to_numpy())[1:-1]
    np.testing.assert_allclose(ours.cuts, cuts, atol=1e-3)
    assert ours.names == ("speed", "stiffness", "gap")


def test_the_likelihood_without_predictors_is_that_of_the_shares() -> None:
    _, levels = ordinal(150, 1)
    counts = np.bincount(levels)
    expected = float(special.xlogy(counts, counts / counts.sum()).sum())
    found = fitted(150, 1)
    assert found.null_log_likelihood == pytest.approx(expected, abs=1e-9)
    assert found.log_likelihood > found.null_log_likelihood


def test_the_slopes_find_the_truth_with_its_sign() -> None:
    # The slopes of ``ordinal`` within four standard errors.
    found = fitted(1500, 3)
    assert np.all(np.abs(found.slopes - [1.2, -0.7, 0.0]) < 4.0 * found.errors)
    assert np.all(found.errors < 0.1)
    assert np.all(np.diff(found.cuts) > 0.0)


def test_two_levels_are_a_logistic_regression() -> None:
    # Of one yes-or-no predictor by hand: the slope is the logarithm of the cross ratio, its squared
    # error the sum of the reciprocal counts (J. Woolf 1955), here per standard deviation.
    yes = np.repeat([0.0, 0.0, 1.0, 1.0], [30, 10, 15, 25])
    levels = np.repeat([0, 3, 0, 3], [30, 10, 15, 25])
    found = fit_proportional_odds({"belted": yes}, levels)
    sd = yes.std()
    assert found.slopes[0] / sd == pytest.approx(np.log(30 * 25 / (10 * 15)), abs=1e-5)
    error = np.sqrt(1 / 30 + 1 / 10 + 1 / 15 + 1 / 25)
    assert found.errors[0] / sd == pytest.approx(error, rel=1e-4)
    assert found.cuts.shape == (1,)


def test_the_units_of_predictors_do_not_count() -> None:
    predictors, levels = ordinal(150, 1)
    other = fit_proportional_odds({k: 5.0 - 1e3 * v for k, v in predictors.items()}, levels)
    np.testing.assert_allclose(other.slopes, -fitted(150, 1).slopes, atol=1e-5)
    np.testing.assert_allclose(other.errors, fitted(150, 1).errors, rtol=1e-4)


def test_levels_count_by_their_order_only() -> None:
    predictors, levels = ordinal(150, 1)
    apart = fit_proportional_odds(predictors, np.array([0, 1, 3, 5, 6])[levels])
    np.testing.assert_allclose(apart.slopes, fitted(150, 1).slopes, atol=1e-9)


def test_levels_turned_round_turn_the_slopes() -> None:
    # P(AIS > k) = expit(s z - c): the logistic distribution is symmetric.
    predictors, levels = ordinal(150, 1)
    turned = fit_proportional_odds(predictors, levels.max() - levels)
    np.testing.assert_allclose(turned.slopes, -fitted(150, 1).slopes, atol=1e-5)
    np.testing.assert_allclose(turned.cuts, -fitted(150, 1).cuts[::-1], atol=1e-4)


def test_odds_ratios_are_exponentials_of_slopes() -> None:
    found = fitted(150, 1)
    for k, name in enumerate(found.names):
        ratio = found.odds_ratio(name)
        assert ratio.value == pytest.approx(np.exp(found.slopes[k]), rel=1e-12)
        assert np.log(ratio.high / ratio.value) == pytest.approx(
            1.959964 * found.errors[k], rel=1e-6
        )
        assert np.log(ratio.value / ratio.low) == pytest.approx(
            1.959964 * found.errors[k], rel=1e-6
        )
    with pytest.raises(ValueError, match="no predictor"):
        found.odds_ratio("speed_of_light")


# -- refusals --------------------------------------------------------------------------------


def test_a_predictor_that_does_not_vary_is_refused() -> None:
    predictors, levels = ordinal(60, 0)
    with pytest.raises(ValueError, match="gap does not vary"):
        fit_proportional_odds(predictors | {"gap": np.full(60, 2.0)}, levels)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_constant_that_is_no_sum_of_powers_of_two_is_refused() -> None:
    predictors, levels = ordinal(150, 0)
    constant = np.full(150, 0.1)
    assert constant.std() > 0.0
    with pytest.raises(ValueError, match="gap does not vary"):
        fit_proportional_odds(predictors | {"gap": constant}, levels)


def test_one_level_alone_is_refused() -> None:
    predictors, _ = ordinal(60, 0)
    with pytest.raises(ValueError, match="all outcomes are AIS 3"):
        fit_proportional_odds(predictors, np.full(60, 3))


def test_predictors_that_repeat_each_other_are_refused() -> None:
    predictors, levels = ordinal(60, 0)
    double = predictors | {"twice": 2.0 * predictors["speed"] - 3.0}
    with pytest.raises(ValueError, match="predictors repeat each other"):
        fit_proportional_odds(double, levels)


def test_a_predictor_that_tells_the_levels_without_error_is_refused() -> None:
    # Complete separation: the likelihood has no maximum (A. Albert, J. Anderson, Biometrika 71,
    # 1984), as for risk curves.
    x = generator(0).normal(size=150)
    with pytest.raises(ValueError, match="separat"):
        fit_proportional_odds({"speed": x}, (x > 0.0).astype(np.int64))
