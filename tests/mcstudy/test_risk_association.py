"""Rank correlations with the AIS and proportional odds, against SciPy and statsmodels."""

import functools

import numpy as np
import pandas as pd
import pytest
from mcstudy_tools import Array, generator
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy import special, stats
from statsmodels.miscmodels.ordinal_model import OrderedModel

from mcstudy.injury import association
from mcstudy.injury.association import OrdinalFit, fit_proportional_odds, rank_correlations

Levels = NDArray[np.int64]

SLOPES = (1.2, -0.7, 0.0)
SCALE = {"speed": (40.0, 8.0), "stiffness": (1e5, 2e4), "gap": (0.05, 0.01)}


def ordinal(
    n: int, seed: int, slopes: tuple[float, ...] = SLOPES
) -> tuple[dict[str, Array], Levels]:
    """Return predictors in unlike units and the AIS of a proportional-odds model."""
    rng = generator(seed)
    z = rng.normal(size=(n, len(slopes)))
    latent = z @ np.array(slopes) + rng.logistic(size=n)
    levels = np.digitize(latent, [-0.5, 0.8, 1.6, 3.0]).astype(np.int64)
    columns = zip(SCALE.items(), z.T, strict=False)
    return {name: middle + sd * column for (name, (middle, sd)), column in columns}, levels


@pytest.mark.parametrize("seed", range(3))
def test_rank_correlations_equal_scipys(seed: int) -> None:
    predictors, levels = ordinal(80, seed)
    x = predictors["speed"]
    found = rank_correlations(x, levels, generator(1))
    assert found.keys() == {"spearman", "kendall"}
    spearman, kendall = stats.spearmanr(x, levels), stats.kendalltau(x, levels, variant="b")
    assert found["spearman"].value == pytest.approx(spearman.statistic, rel=1e-12)
    assert found["kendall"].value == pytest.approx(kendall.statistic, rel=1e-12)
    for estimate in found.values():
        assert -1.0 <= estimate.low < estimate.value < estimate.high <= 1.0


def test_rank_correlations_keep_to_ranks_signs_and_seeds() -> None:
    predictors, levels = ordinal(60, 4)
    x = predictors["speed"]
    plain, bent, turned = (
        rank_correlations(v, levels, generator(1)) for v in (x, np.exp(0.1 * x), -x)
    )
    assert bent == plain
    for name in plain:
        assert turned[name].value == pytest.approx(-plain[name].value)
        assert turned[name].low == pytest.approx(-plain[name].high)
    other = rank_correlations(x, levels, generator(2))
    assert other["spearman"].low != plain["spearman"].low


def test_a_perfect_association_is_one() -> None:
    levels = np.repeat(np.arange(5), 10)
    for estimate in rank_correlations(levels.astype(float), levels, generator(1)).values():
        assert estimate.value == pytest.approx(1.0)
        assert 0.99 < estimate.low <= estimate.high <= 1.0


@pytest.mark.slow
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
    held = dict.fromkeys(truth, 0)
    for seed in range(30):
        predictors, levels = ordinal(80, seed, (1.0,))
        found = rank_correlations(predictors["speed"], levels, generator(seed))
        for name, estimate in found.items():
            held[name] += estimate.low <= truth[name] <= estimate.high
    assert min(held.values()) >= 25


def test_intervals_are_as_wide_as_correlations_scatter_and_narrow_with_the_runs() -> None:
    # Of normal pairs Fisher's z of Spearman's coefficient has the variance 1.06 / (n - 3)
    # (E. Fieller, H. Hartley, E. Pearson, Biometrika 44, 1957); the bootstrap's scatters by 5 %.
    for n in (50, 800):
        predictors, levels = ordinal(n, 6)
        found = rank_correlations(predictors["speed"], levels, generator(1))["spearman"]
        width = np.arctanh(found.high) - np.arctanh(found.low)
        assert width == pytest.approx(2 * 1.96 * np.sqrt(1.06 / (n - 3)), rel=0.35)


@functools.cache
def fitted(n: int, seed: int) -> OrdinalFit:
    return fit_proportional_odds(*ordinal(n, seed))


@pytest.mark.parametrize(("n", "seed"), [(60, 0), (150, 1), (600, 2)])
def test_proportional_odds_equal_statsmodels(n: int, seed: int) -> None:
    predictors, levels = ordinal(n, seed)
    ours = fitted(n, seed)
    codes = pd.Series(pd.Categorical(levels, ordered=True))
    z = pd.DataFrame({k: (v - v.mean()) / v.std() for k, v in predictors.items()})
    model = OrderedModel(codes, z, distr="logit")
    theirs = model.fit(method="bfgs", disp=False, maxiter=500, gtol=1e-6)
    assert ours.log_likelihood == pytest.approx(float(theirs.llf), abs=1e-6)
    assert_allclose(ours.slopes, theirs.params.iloc[:3], atol=1e-4)
    assert_allclose(ours.errors, theirs.bse.iloc[:3], atol=1e-3)
    cuts = model.transform_threshold_params(theirs.params.to_numpy())[1:-1]
    assert_allclose(ours.cuts, cuts, atol=1e-3)
    assert ours.names == ("speed", "stiffness", "gap")


def test_the_likelihood_without_predictors_is_that_of_the_shares() -> None:
    counts = np.bincount(ordinal(150, 1)[1])
    expected = float(special.xlogy(counts, counts / counts.sum()).sum())
    found = fitted(150, 1)
    assert found.null_log_likelihood == pytest.approx(expected, abs=1e-9)
    assert found.log_likelihood > found.null_log_likelihood


def test_two_levels_are_a_logistic_regression() -> None:
    # Of one yes-or-no predictor by hand: the slope is the logarithm of the cross ratio, its squared
    # error the sum of the reciprocal counts (J. Woolf 1955), here per standard deviation.
    yes = np.repeat([0.0, 0.0, 1.0, 1.0], [30, 10, 15, 25])
    found = fit_proportional_odds({"belted": yes}, np.repeat([0, 3, 0, 3], [30, 10, 15, 25]))
    slope, error = found.slopes[0] / yes.std(), found.errors[0] / yes.std()
    assert slope == pytest.approx(np.log(30 * 25 / (10 * 15)), abs=1e-5)
    assert error == pytest.approx(np.sqrt(1 / 30 + 1 / 10 + 1 / 15 + 1 / 25), rel=1e-4)
    assert found.cuts.shape == (1,)


def test_units_of_predictors_and_names_of_levels_do_not_count() -> None:
    predictors, levels = ordinal(150, 1)
    plain = fitted(150, 1)
    other = fit_proportional_odds({k: 5.0 - 1e3 * v for k, v in predictors.items()}, levels)
    assert_allclose(other.slopes, -plain.slopes, atol=1e-5)
    assert_allclose(other.errors, plain.errors, rtol=1e-4)
    apart = fit_proportional_odds(predictors, np.array([0, 1, 3, 5, 6])[levels])
    assert_allclose(apart.slopes, plain.slopes, atol=1e-9)
    # P(AIS > k) = expit(s z - c): the logistic distribution is symmetric.
    turned = fit_proportional_odds(predictors, levels.max() - levels)
    assert_allclose(turned.slopes, -plain.slopes, atol=1e-5)
    assert_allclose(turned.cuts, -plain.cuts[::-1], atol=1e-4)


def test_odds_ratios_are_exponentials_of_slopes() -> None:
    found = fitted(150, 1)
    for name, slope, error in zip(found.names, found.slopes, found.errors, strict=True):
        ratio = found.odds_ratio(name)
        ends = np.log([ratio.low, ratio.value, ratio.high])
        assert_allclose(ends, slope + 1.959964 * error * np.array([-1.0, 0.0, 1.0]), rtol=1e-6)
    with pytest.raises(ValueError, match="no predictor"):
        found.odds_ratio("speed_of_light")


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_what_gives_no_slopes_is_refused() -> None:
    predictors, levels = ordinal(150, 0)
    # The standard deviation of 0.1 is not nought: its mean rounds.
    for constant in (2.0, 0.1):
        with pytest.raises(ValueError, match="gap does not vary"):
            fit_proportional_odds(predictors | {"gap": np.full(150, constant)}, levels)
    with pytest.raises(ValueError, match="all outcomes are AIS 3"):
        fit_proportional_odds(predictors, np.full(150, 3))
    with pytest.raises(ValueError, match="predictors repeat each other"):
        fit_proportional_odds(predictors | {"twice": 2.0 * predictors["speed"] - 3.0}, levels)
    # Complete separation: the likelihood has no maximum (A. Albert, J. Anderson, Biometrika 71,
    # 1984), as for risk curves.
    x = generator(0).normal(size=150)
    with pytest.raises(ValueError, match="separat"):
        fit_proportional_odds({"speed": x}, (x > 0.0).astype(np.int64))
