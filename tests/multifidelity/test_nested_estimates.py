"""Multi-fidelity estimates against models whose moments and correlations are known.

The models are powers of one uniform variable (the monomials of Gorodetsky and others, 2020): their
means, covariances and quantiles are closed forms.
"""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import optimize, stats

from mcstudy.multifidelity.allocation import (
    ACV,
    ALONE,
    MFMC,
    allocate,
    mfmc_ratios,
    predicted_variance,
)
from mcstudy.multifidelity.estimators import (
    NestedRuns,
    estimate_average,
    estimate_exceedance,
    estimate_mean,
    estimate_quantile,
    estimate_sd,
    nested_mean,
)
from mcstudy.statistics import Estimate

Array = np.ndarray
POWERS = (5, 3, 1)
COSTS = np.array([1.0, 0.05, 0.002])
REPLICATES = 10


def covariance(powers: tuple[int, ...]) -> Array:
    return np.array([[1 / (i + j + 1) - 1 / ((i + 1) * (j + 1)) for j in powers] for i in powers])


def runs_of(seed: int, method: str, powers: tuple[int, ...], counts: tuple[int, ...]) -> NestedRuns:
    x = np.random.default_rng(seed).random(max(counts))
    values = tuple(x[:n] ** power for power, n in zip(powers, counts, strict=True))
    return NestedRuns(method, values, REPLICATES)


def test_the_closed_form_is_the_optimum_of_its_variance() -> None:
    c = covariance(POWERS)
    ratios = mfmc_ratios(c, COSTS)
    assert ratios is not None

    def loss(logs: Array) -> float:
        r = np.append(1.0, np.exp(logs))
        return float(COSTS @ r) * predicted_variance(MFMC, c, r.tolist())

    best = optimize.minimize(loss, np.log(ratios[1:]) + 0.5, method="Nelder-Mead").x
    assert np.exp(best) == pytest.approx(ratios[1:], rel=1e-2)


def test_a_budget_is_spent_and_helps() -> None:
    found = allocate(covariance(POWERS), COSTS, 100.0, multiple=REPLICATES)
    assert found.method == MFMC
    assert found.models == (0, 1, 2)
    assert 90.0 < found.cost <= 100.0
    assert all(n % REPLICATES == 0 for n in found.runs)
    assert sorted(found.runs) == list(found.runs)
    assert found.variance < 0.2 * found.variance_alone


def test_a_cheap_model_of_no_use_is_left_out() -> None:
    unrelated = np.diag([1.0, 1.0])
    assert allocate(unrelated, np.array([1.0, 0.01]), 100.0).method == ALONE
    dear = np.array([[1.0, 0.3], [0.3, 1.0]])
    assert allocate(dear, np.array([1.0, 0.9]), 100.0).method == ALONE


def test_the_condition_on_costs_and_correlations_is_checked() -> None:
    """A second model that costs nearly as much as the dear one and knows hardly more."""
    c = np.array([[1.0, 0.9, 0.89], [0.9, 1.0, 0.8], [0.89, 0.8, 1.0]])
    costs = np.array([1.0, 0.8, 1e-3])
    assert mfmc_ratios(c, costs) is None
    assert allocate(c, costs, 100.0).models == (0, 2)


def test_control_variates_join_models_that_complement_each_other() -> None:
    """Two cheap models at one price, each with a part of the dear one's variance."""
    c = np.array([[1.0, 0.7, 0.65], [0.7, 1.0, 0.05], [0.65, 0.05, 1.0]])
    costs = np.array([1.0, 1e-3, 1e-3])
    found = allocate(c, costs, 100.0, multiple=REPLICATES)
    assert found.method == ACV
    assert found.models == (0, 1, 2)
    single = min(
        allocate(c[np.ix_(pair, pair)], costs[list(pair)], 100.0, multiple=REPLICATES).variance
        for pair in ([0, 1], [0, 2])
    )
    assert found.variance < 0.5 * single
    # As predicted, also in fact.
    root = np.linalg.cholesky(c)
    means = []
    for seed in range(1500):
        z = np.random.default_rng(seed).standard_normal((found.runs[-1], 3)) @ root.T
        means.append(nested_mean(ACV, [z[:n, k] for k, n in enumerate(found.runs)]))
    assert np.var(means) == pytest.approx(found.variance, rel=0.1)
    assert np.mean(means) == pytest.approx(0.0, abs=4.0 * np.sqrt(found.variance / 1500))


@pytest.mark.parametrize("powers", [(5, 1), (5, 3, 1)])
def test_the_variance_is_the_predicted_one(powers: tuple[int, ...]) -> None:
    costs = COSTS[[POWERS.index(p) for p in powers]]
    found = allocate(covariance(powers), costs, 100.0, multiple=REPLICATES)
    chosen = tuple(powers[k] for k in found.models)
    means = [
        nested_mean(found.method, runs_of(seed, found.method, chosen, found.runs).values)
        for seed in range(1500)
    ]
    assert np.var(means) == pytest.approx(found.variance, rel=0.1)
    assert np.mean(means) == pytest.approx(1 / 6, abs=4.0 * np.sqrt(found.variance / 1500))


STATISTICS: dict[str, tuple[Callable[[NestedRuns], Estimate], float]] = {
    "mean": (estimate_mean, 1 / 6),
    "sd": (estimate_sd, float(np.sqrt(1 / 11 - 1 / 36))),
    "exceedance": (lambda runs: estimate_exceedance(runs, 0.5), 1.0 - 0.5**0.2),
    "90 % quantile": (lambda runs: estimate_quantile(runs, 0.9), 0.9**5),
    "risk": (
        lambda runs: estimate_average(runs, lambda y: stats.norm.cdf((y - 0.4) / 0.1)),
        float(np.mean(stats.norm.cdf((((np.arange(100_000) + 0.5) / 1e5) ** 5 - 0.4) / 0.1))),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", STATISTICS)
def test_intervals_cover_the_truth(name: str) -> None:
    statistic, truth = STATISTICS[name]
    found = allocate(covariance(POWERS), COSTS, 150.0, multiple=REPLICATES)
    chosen = tuple(POWERS[k] for k in found.models)
    count = 200
    covered = values = 0.0
    for seed in range(count):
        estimate = statistic(runs_of(seed, found.method, chosen, found.runs))
        # An end beyond the largest run is open.
        covered += not (estimate.low > truth or estimate.high < truth)
        values += estimate.value
    assert 0.92 <= covered / count <= 0.985
    assert values / count == pytest.approx(truth, rel=0.02)


def test_the_same_budget_gives_narrower_intervals_than_the_dear_model_alone() -> None:
    found = allocate(covariance(POWERS), COSTS, 100.0, multiple=REPLICATES)
    chosen = tuple(POWERS[k] for k in found.models)
    widths = []
    for seed in range(40):
        several = estimate_mean(runs_of(seed, found.method, chosen, found.runs))
        alone = estimate_mean(runs_of(seed, found.method, (5,), (100,)))
        widths.append((several.high - several.low) / (alone.high - alone.low))
    predicted = np.sqrt(found.variance / found.variance_alone)
    assert np.median(widths) == pytest.approx(predicted, rel=0.2)


def test_runs_without_a_value_are_left_out_of_the_mean_of_the_others() -> None:
    """The mean of x^5 over x above 0.3, which the cheap model sees at 0.25."""
    means = []
    for seed in range(300):
        x = np.random.default_rng(seed).random(2000)
        dear = np.where(x > 0.3, x**5, np.nan)[:200]
        cheap = np.where(x > 0.25, x**4, np.nan)
        means.append(estimate_mean(NestedRuns(MFMC, (dear, cheap), REPLICATES)).value)
    truth = (1.0 - 0.3**6) / 6.0 / 0.7
    assert np.mean(means) == pytest.approx(truth, rel=0.01)


@pytest.mark.parametrize(
    ("variance", "budget", "message"),
    [(0.0, 100.0, "does not vary"), (1.0, 3.0, "pays for 3 runs")],
)
def test_what_cannot_be_allotted_is_refused(variance: float, budget: float, message: str) -> None:
    c = np.array([[variance, 0.0], [0.0, 1.0]])
    with pytest.raises(ValueError, match=message):
        allocate(c, np.array([1.0, 0.1]), budget, multiple=REPLICATES)
