"""The kernel posterior against a conjugate Gaussian case, and what must not change it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mcstudy.posterior.calibration import calibrate, calibrate_thirds, leave_out
from mcstudy.posterior.contours import find_families
from mcstudy.posterior.evidence import Bank, Item, simulate_evidence
from mcstudy.posterior.inference import Posterior
from mcstudy.posterior.joint_coverage import measure_joint_coverage
from mcstudy.posterior.kernel import weighted_quantile
from mcstudy.posterior.prior_check import check_prior
from mcstudy.posterior.ratio import Proposition, measure_ratio
from mcstudy.posterior.weights import density_of, reweight, tilt
from mcstudy.statistics import crps

MEAN, SD = 50.0, 10.0


def bank_of(n: int, seed: int = 0) -> Bank:
    """Speed N(50, 10); outputs speed + N(0, 5) and half of it + N(0, 3); one more input."""
    z = stats.norm.ppf(stats.qmc.Sobol(4, seed=seed).random(n))
    speed = MEAN + SD * z[:, 0]
    return Bank(
        {
            "speed": speed,
            "first": speed + 5.0 * z[:, 1],
            "second": 0.5 * speed + 3.0 * z[:, 2],
            "other": z[:, 3],
        }
    )


def exact(items: list[Item]) -> tuple[float, float]:
    """Return mean and standard deviation of the speed given the items, by hand."""
    slope, own = {"first": 1.0, "second": 0.5}, {"first": 5.0, "second": 3.0}
    precision, moment = SD**-2, MEAN * SD**-2
    for item in items:
        variance = own[item.name] ** 2 + item.sd**2 + item.absolute**2
        precision += slope[item.name] ** 2 / variance
        moment += slope[item.name] * float(item.value or 0.0) / variance
    return moment / precision, precision**-0.5


def items_at(first: float, second: float) -> list[Item]:
    return [Item("first", first, 4.0), Item("second", second, 2.0)]


@pytest.mark.parametrize(("first", "second"), [(52.0, 24.0), (63.0, 33.0), (38.0, 20.0)])
def test_mean_sd_and_ratios_of_a_conjugate_case(first: float, second: float) -> None:
    items = items_at(first, second)
    mean, sd = exact(items)
    posterior = Posterior(bank_of(4096, 3), items, "speed", seed=1)
    draws = posterior.given()
    found = float(draws.weights @ draws.values)
    assert abs(found - mean) < 0.1 * sd
    assert np.sqrt(draws.weights @ (draws.values - found) ** 2) == pytest.approx(sd, rel=0.05)
    assert draws.quantile(0.05) == pytest.approx(mean - 1.645 * sd, abs=0.15 * sd)
    for share in (0.1, 0.5, 0.9):
        limit = mean + sd * stats.norm.ppf(1.0 - share)
        prior = stats.norm.sf((limit - MEAN) / SD)
        true = share / (1.0 - share) * (1.0 - prior) / prior
        ratio = measure_ratio(posterior, Proposition("fast", "speed", low=limit), draws)
        assert ratio.resolved
        assert ratio.prior == pytest.approx(prior, abs=2e-3)
        assert ratio.ratio.value == pytest.approx(true, rel=0.1)
        assert ratio.ratio.low < true < ratio.ratio.high


def test_ratios_of_thirty_to_one_either_way() -> None:
    errors = []
    for seed in range(4):
        items = items_at(52.0, 24.0)
        mean, sd = exact(items)
        posterior = Posterior(bank_of(4096, seed), items, "speed", seed=seed)
        for share in (1.0 / 31.0, 30.0 / 31.0):
            limit = mean + sd * stats.norm.ppf(1.0 - share)
            prior = stats.norm.sf((limit - MEAN) / SD)
            true = share / (1.0 - share) * (1.0 - prior) / prior
            proposition = Proposition("fast", "speed", low=limit)
            found = measure_ratio(posterior, proposition, posterior.given()).ratio.value
            errors.append(np.log(found / true))
    assert np.sqrt(np.mean(np.square(errors))) < 0.1


def test_calibration_of_a_right_posterior_and_of_one_that_ignores_the_model_error() -> None:
    posterior = Posterior(bank_of(2048), items_at(52.0, 24.0), "speed")
    left = leave_out(posterior, count=1000)
    whole = calibrate(left, "all")
    assert whole.runs == 1000
    assert 0.875 <= whole.coverage["0.9"] <= 0.925
    assert whole.chi_square[1] > 0.001
    assert whole.kolmogorov[1] > 0.001
    _, sd = exact(items_at(0.0, 0.0))
    assert whole.width == pytest.approx(2.0 * 1.645 * sd, rel=0.05)
    # The mean score of a normal forecast that is right is its sd over the root of pi.
    assert whole.score == pytest.approx(sd / np.sqrt(np.pi), rel=0.07)
    assert [part.runs for part in calibrate_thirds(left)] == pytest.approx([333, 333, 333], abs=1)
    assert all(part.chi_square[0] < 36.2 for part in calibrate_thirds(left))
    assert measure_joint_coverage(posterior, ["other"])[1] > 0.001
    # Ranks in intervals that are half as wide are not uniform.
    narrow = replace(left, ranks=stats.norm.cdf(2.0 * stats.norm.ppf(left.ranks)))
    assert calibrate(narrow, "all").chi_square[1] < 1e-6
    assert calibrate(narrow, "all").coverage["0.9"] < 0.75


def test_crps_of_weighted_draws_against_its_definition() -> None:
    rng = np.random.default_rng(4)
    values, weights = rng.normal(size=40), rng.dirichlet(np.ones(40))
    grid = np.linspace(-6.0, 6.0, 200_001)
    below = np.array([weights[values <= x].sum() for x in np.sort(values)])
    steps = np.concatenate([[0.0], below])[np.searchsorted(np.sort(values), grid, side="right")]
    by_hand = np.sum((steps - (grid >= 0.3)) ** 2) * (grid[1] - grid[0])
    assert crps(values, weights, 0.3) == pytest.approx(by_hand, abs=1e-3)


def spread_of(items: list[Item]) -> tuple[float, float]:
    draws = Posterior(bank_of(1024), items, "speed").given()
    low, median, high = draws.quantile(np.array([0.05, 0.5, 0.95]))
    return float(median), float(high - low)


def test_evidence_without_information_returns_the_prior() -> None:
    median, width = spread_of([Item("first", 70.0, 1e5)])
    assert median == pytest.approx(MEAN, abs=1.0)
    assert width == pytest.approx(2.0 * 1.645 * SD, rel=0.05)


def test_order_of_the_items_changes_nothing() -> None:
    one, two = items_at(58.0, 27.0)
    assert spread_of([one, two]) == pytest.approx(spread_of([two, one]), rel=1e-9)


def test_units_change_nothing() -> None:
    bank = bank_of(1024)
    other = Bank({**bank.values, "first": 1000.0 * bank.values["first"]})
    items = items_at(58.0, 27.0)
    scaled = [replace(items[0], value=58_000.0, sd=4000.0), items[1]]
    a = Posterior(bank, items, "speed").given().quantile(0.5)
    b = Posterior(other, scaled, "speed").given().quantile(0.5)
    assert a == pytest.approx(b, rel=1e-9)


def test_less_certain_evidence_widens_the_posterior() -> None:
    widths = [spread_of([Item("first", 55.0, sd)])[1] for sd in (1.0, 4.0, 8.0, 16.0)]
    assert widths == sorted(widths)
    wider = spread_of([Item("first", 55.0, 1.0, relative=0.1)])[1]
    assert wider > widths[0]


def test_a_larger_bank_agrees_within_the_error_of_the_smaller() -> None:
    items = items_at(58.0, 27.0)
    _, sd = exact(items)
    medians = [Posterior(bank_of(n), items, "speed").given().quantile(0.5) for n in (2048, 4096)]
    assert abs(medians[0] - medians[1]) < 0.1 * sd


def test_bounds_and_events_are_likelihoods_not_filters() -> None:
    bank = bank_of(4096)
    struck = bank.values["first"] > 45.0
    bank = Bank({**bank.values, "hit": np.where(struck, bank.values["second"], np.nan)})
    items = [Item("second", 25.0, 50.0), Item("hit", happened=True)]
    posterior = Posterior(bank, items, "speed")
    draws = posterior.given()
    assert draws.weights @ draws.values == pytest.approx(
        bank.values["speed"][struck].mean(), abs=0.6
    )
    # P(hit | fast) over P(hit | slow), counted.
    fast = bank.values["speed"] > 55.0
    ratio = measure_ratio(posterior, Proposition("fast", "speed", low=55.0), draws)
    assert ratio.ratio.value == pytest.approx(struck[fast].mean() / struck[~fast].mean(), rel=0.12)
    missed = Posterior(bank, [Item("second", 25.0, 50.0), Item("hit", happened=False)], "speed")
    assert missed.given().quantile(0.5) < 45.0
    bound = Posterior(bank, [Item("second", 25.0, 50.0), Item("first", low=45.0)], "speed")
    assert bound.given().quantile(0.5) == pytest.approx(draws.quantile(0.5), abs=0.6)
    with pytest.raises(ValueError, match="no run of the bank agrees"):
        simulate_evidence(
            bank, [Item("second", 25.0, 1.0), Item("first", low=1e6)], seed=0, copies=1
        )
    with pytest.raises(ValueError, match="no item of evidence has a value"):
        simulate_evidence(bank, [Item("first", low=45.0)], seed=0, copies=1)


def test_evidence_that_the_prior_cannot_make_is_blamed() -> None:
    def check(items: list[Item]) -> str:
        posterior = Posterior(bank_of(2048), items, "speed")
        return check_prior(posterior.simulated, posterior.prior).blamed

    assert check(items_at(52.0, 24.0)) == ""
    assert check(items_at(52.0, 60.0)) == "second"
    # Each is possible, together they are not: 75 with 17 (mean 25 of a speed of 50).
    third = Item("other", 0.1, 0.1)
    assert check([*items_at(75.0, 12.0), third]) in ("first", "second")


def test_a_ratio_beyond_the_resolution_is_bounded() -> None:
    posterior = Posterior(bank_of(1024), items_at(50.0, 25.0), "speed")
    found = measure_ratio(posterior, Proposition("fast", "speed", low=75.0), posterior.given())
    assert not found.resolved
    assert found.bound <= 1.0
    assert 1.0 / found.bound in (1, 2, 5, 10, 20, 50, 100)
    slow = measure_ratio(posterior, Proposition("slow", "speed", high=75.0), posterior.given())
    assert slow.bound == pytest.approx(1.0 / found.bound)
    with pytest.raises(ValueError, match="false in every run"):
        measure_ratio(posterior, Proposition("never", "speed", low=1e6), posterior.given())


def test_a_narrower_prior_takes_no_run() -> None:
    bank = bank_of(4096)
    old, new = stats.norm(MEAN, SD), stats.norm(45.0, 4.0)
    weights = reweight(bank.values["speed"], old.ppf, new.ppf)
    items = [Item("first", 60.0, 4.0)]
    posterior = Posterior(bank, items, "speed", weights=weights / weights.mean())
    precision = 1.0 / 16.0 + 1.0 / 41.0
    mean = (45.0 / 16.0 + 60.0 / 41.0) / precision
    draws = posterior.given()
    assert draws.weights @ draws.values == pytest.approx(mean, abs=0.35)
    with pytest.raises(ValueError, match="goes beyond"):
        reweight(bank.values["speed"], stats.uniform(0.0, 1.0).ppf, stats.norm(0.5, 3.0).ppf)


def test_density_and_tilt_of_a_normal_distribution() -> None:
    x = np.linspace(20.0, 80.0, 61)
    np.testing.assert_allclose(
        density_of(stats.norm(MEAN, SD).ppf, x), stats.norm(MEAN, SD).pdf(x), rtol=0.02, atol=1e-6
    )
    values = bank_of(4096).values["speed"]
    weights = tilt(values, 1.0)
    assert np.average(values, weights=weights) == pytest.approx(MEAN + SD, abs=0.4)


def test_weighted_quantiles_of_equal_weights_are_quantiles() -> None:
    values = np.random.default_rng(0).normal(size=2001)
    equal = np.full(2001, 1.0 / 2001)
    for level in (0.05, 0.5, 0.9):
        assert weighted_quantile(values, equal, level) == pytest.approx(
            np.quantile(values, level), abs=0.01
        )


def test_contours_follow_a_known_family() -> None:
    rng = np.random.default_rng(2)
    speed, friction = rng.uniform(5.0, 20.0, 6000), rng.uniform(0.4, 0.8, 6000)
    throw = speed**2 / (2.0 * friction * 9.81) * np.exp(0.05 * rng.standard_normal(6000))
    edges = np.array([0.4, 0.5, 0.7, 0.8])
    families = find_families(speed, throw, friction, ["low", "middle", "high"], edges)
    at = 20
    for family, mu in zip(families, (0.45, 0.6, 0.75), strict=True):
        assert family.middle[at] == pytest.approx(family.x[at] ** 2 / (2 * mu * 9.81), rel=0.06)
        assert family.low[at] < family.middle[at] < family.high[at]
    with pytest.raises(ValueError, match="40 are needed"):
        find_families(speed[:50], throw[:50], friction[:50], ["a", "b", "c"], edges)
