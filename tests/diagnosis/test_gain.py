"""Scores of held-out tests against closed forms, and the Gaussian process against a dense one."""

from functools import cache

import numpy as np
import pytest
from linear_tests import BUMP, make_problem
from scipy import stats

from mcstudy.diagnosis import gain
from mcstudy.diagnosis.base_model import fit_base
from mcstudy.diagnosis.discrepancy import fit_discrepancy
from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.gain import Gain, measure_gain
from mcstudy.diagnosis.layout import Layout
from mcstudy.diagnosis.model_selection import rank_causes
from mcstudy.diagnosis.problem import Problem
from mcstudy.diagnosis.repeatability import settle
from mcstudy.diagnosis.templates import smooth_discrepancy
from studies.diagnosis.words import gain_words

PEAK = {"peak": ("g", "head_acceleration", lambda _t, v: float(v.max()))}


def test_crps_of_a_normal_sample() -> None:
    # Closed form of Gneiting and Raftery for N(0, 1) at y.
    rng = np.random.default_rng(0)
    draws = rng.standard_normal(40_000)
    for y in (0.0, 1.3):
        exact = y * (2 * stats.norm.cdf(y) - 1) + 2 * stats.norm.pdf(y) - 1 / np.sqrt(np.pi)
        assert gain._crps(draws, y) == pytest.approx(exact, abs=0.01)


def test_log_score_is_the_density_of_the_whole_pulse() -> None:
    rng = np.random.default_rng(1)
    factor, off = rng.standard_normal((30, 4)), rng.standard_normal(30)
    exact = stats.multivariate_normal(cov=np.eye(30) + factor @ factor.T).logpdf(off)
    ours = gain._log_density(off, factor) - 15.0 * np.log(2.0 * np.pi)
    assert ours == pytest.approx(exact, rel=1e-9)


@cache
def fits(bump: float, seed: int) -> tuple[Problem, tuple[Layout, ...], Fit, Fit]:
    problem = make_problem(seed, bump=bump, tests=16)
    layouts, base = fit_base(problem)
    base = settle(problem, layouts, base)
    best = rank_causes(problem, layouts, base, [BUMP], 1, 5)[0]
    return problem, layouts, base, best.fitted


def named(gains: list[Gain], score: str, region: str = "inside") -> Gain:
    return next(g for g in gains if g.score == score and g.region == region)


def test_an_effect_that_is_there_gains_and_one_that_is_not_does_not() -> None:
    gains = measure_gain(*fits(1.0, 11), PEAK, seed=0)
    for region in ("inside", "above", "below"):
        assert named(gains, "log_score", region).difference.low > 0.0
    assert named(gains, "rmse_head_acceleration").difference.low > 0.0
    # The process predicts what the base model misses.
    found = named(gains, "log_score")
    assert found.base < found.gaussian_process < found.extended
    assert gains == measure_gain(*fits(1.0, 11), PEAK, seed=0)
    nothing = named(measure_gain(*fits(0.0, 12), PEAK, seed=0), "log_score")
    assert nothing.difference.value < 2.0


def test_the_process_is_that_of_dense_regression() -> None:
    problem, layouts, base, _ = fits(1.0, 11)
    shapes = smooth_discrepancy(layouts, base)
    process = fit_discrepancy(base, layouts, shapes, base.scatter)
    means, roots = process.predict(layouts)
    # At the tests themselves the prediction is the posterior mean.
    own = process.mean.reshape(len(problem.tests), process.shapes)
    np.testing.assert_allclose(np.array(means), own, atol=1e-3 * np.abs(own).max())
    # And its spread is that of the posterior.
    variance = np.diag(process.covariance).reshape(own.shape)
    spread = np.array([np.sum(root**2, axis=1) for root in roots])
    np.testing.assert_allclose(spread, variance, rtol=0.05, atol=1e-6)


@pytest.mark.parametrize(
    ("low", "value", "high", "said"),
    [
        (0.1, 0.2, 0.3, "20 % better (CRPS, 10 to 30 %)"),
        (-0.3, -0.2, -0.1, "20 % worse (CRPS, 10 to 30 %)"),
        (-0.1, 0.2, 0.3, "20 % better (CRPS, -10 to 30 %: consistent with zero)"),
    ],
)
def test_a_gain_is_said_as_it_is(low: float, value: float, high: float, said: str) -> None:
    entry = {
        "score": "crps_hic15", "region": "inside", "base": 1.0,
        "relative": {"low": low, "value": value, "high": high},
    }  # fmt: skip
    assert said in gain_words([entry])[0]
