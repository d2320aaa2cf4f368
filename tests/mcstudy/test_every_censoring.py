"""Risk curves of every shape of censoring, against SciPy's fits of censored data and known values.

SciPy maximises the same likelihood with other code, by a simplex in other parameters.
"""

import warnings
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from scipy import stats

from mcstudy.errors import UserError
from mcstudy.injury.cases import observations_of
from mcstudy.injury.observations import Observations, check
from mcstudy.injury.risk_curve import describe_risk
from mcstudy.injury.survival import FAMILIES, RiskFit, fit_risk_curve
from mcstudy.injury.turnbull import estimate_steps

Array = NDArray[np.float64]
Shape = Callable[[int, int], Observations]

DISTRIBUTIONS = {
    "log-normal": stats.lognorm,
    "log-logistic": stats.fisk,
    "Weibull": stats.weibull_min,
}
SIZES = (12,)


def onsets(n: int, seed: int, spread: float = 0.4) -> Array:
    return np.asarray(900.0 * np.exp(spread * np.random.default_rng(seed).standard_normal(n)))


def exact_only(n: int, seed: int) -> Observations:
    x = onsets(n, seed)
    return Observations(x, x.copy())


def intervals_only(n: int, seed: int) -> Observations:
    x = onsets(n, seed)
    rng = np.random.default_rng(seed + 100)
    return Observations(x / rng.uniform(1.05, 1.6, n), x * rng.uniform(1.05, 1.6, n))


def left_and_exact(n: int, seed: int) -> Observations:
    x = onsets(n, seed)
    left = np.arange(n) % 2 == 0
    return Observations(np.where(left, 0.0, x), np.where(left, 1.3 * x, x))


def tied(n: int, seed: int) -> Observations:
    """Return intervals of a few tests at the same levels."""
    levels = np.array([300.0, 600.0, 900.0, 1200.0, 1800.0, 3000.0])
    place = np.clip(np.searchsorted(levels, onsets(n, seed)), 1, 5)
    return Observations(levels[place - 1], levels[place])


def one_uninjured(n: int, seed: int) -> Observations:
    held = exact_only(n, seed)
    held.high[0] = np.inf
    return held


def one_injured(n: int, seed: int) -> Observations:
    x = np.sort(onsets(n, seed))
    low, high = x.copy(), np.full(n, np.inf)
    low[-2], high[-2] = 0.0, x[-2]
    return Observations(low, high)


def three_decades(n: int, seed: int) -> Observations:
    low = 10.0 ** (np.arange(n) % 3)
    return Observations(low, 10.0 * low)


SHAPES = [exact_only, intervals_only, left_and_exact, tied, one_uninjured, one_injured,
          three_decades]  # fmt: skip


def scipy_fit(family: str, held: Observations) -> tuple[float, float, float]:
    """Return log likelihood, slope and median of SciPy's fit."""
    exact = held.exact
    left = ~exact & (held.low == 0.0)
    right = np.isinf(held.high)
    between = ~(exact | left | right)
    data = stats.CensoredData(
        uncensored=held.high[exact], left=held.high[left], right=held.low[right],
        interval=np.stack([held.low[between], held.high[between]], axis=1),
    )  # fmt: skip
    distribution = DISTRIBUTIONS[family]
    found = []
    for start in (0.3, 3.0):
        for scale in (30.0, 900.0):
            with warnings.catch_warnings():
                # The simplex strays where the likelihood is nothing.
                warnings.simplefilter("ignore")
                shape, _, scale = distribution.fit(data, start, floc=0.0, scale=scale)
                frozen = distribution(shape, 0.0, scale)
                upper = np.where(right, 1.0, frozen.cdf(np.where(right, 1.0, held.high)))
                shares = np.where(right, frozen.sf(held.low), upper - frozen.cdf(held.low))
                total = frozen.logpdf(held.high[exact]).sum() + np.log(shares[~exact]).sum()
            found.append((float(total), shape, float(frozen.median())))
    total, shape, median = max(entry for entry in found if np.isfinite(entry[0]))
    slope = 1.0 / shape if family == "log-normal" else shape
    return total, slope, median


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("family", FAMILIES)
def test_every_shape_has_the_curve_of_greatest_likelihood(
    family: str, shape: Shape, n: int
) -> None:
    held = check(shape(n, 3))
    fit = fit_risk_curve(held, family)
    theirs, slope, median = scipy_fit(family, held)
    # A simplex may stop short of the maximum; it may not find a higher one.
    assert fit.log_likelihood >= theirs - 1e-6
    assert fit.log_likelihood == pytest.approx(theirs, abs=2e-4)
    assert fit.slope == pytest.approx(slope, rel=0.02)
    assert fit.stimulus_at(0.5)[0] == pytest.approx(median, rel=0.02)
    assert np.all(np.isfinite(fit.covariance))


@pytest.mark.parametrize("family", FAMILIES)
def test_intervals_of_any_width_are_continuous(family: str) -> None:
    # Three onsets known to one part in 10^4 to 10^14: the curve is that of exact ones.
    x = np.array([5.0, 6.0, 7.5, 9.0])
    exact = fit_risk_curve(Observations(x, x.copy()), family)
    for width in 10.0 ** np.arange(-4.0, -15.0, -1.0):
        fit = fit_risk_curve(Observations(x, x * (1.0 + width)), family)
        assert fit.slope == pytest.approx(exact.slope, rel=2e-3)
        known = float(np.log(x * (1.0 + width) - x).sum())
        assert fit.log_likelihood - known == pytest.approx(exact.log_likelihood, abs=5e-3)


# -- influence --------------------------------------------------------------------------------


def test_a_curve_that_is_left_is_said_to_be_left() -> None:
    held = one_uninjured(12, 5)
    influence = describe_risk(held)["influence"]
    assert all(np.isfinite(entry["shift"]) for entry in influence["largest"])


# -- weights ----------------------------------------------------------------------------------


def repeated(held: Observations, counts: NDArray[np.int64]) -> Observations:
    return Observations(np.repeat(held.low, counts), np.repeat(held.high, counts))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("family", FAMILIES)
def test_whole_weights_count_equal_cases(family: str, shape: Shape) -> None:
    held = shape(12, 1)
    counts = np.random.default_rng(4).integers(1, 5, 12)
    weighted = Observations(held.low, held.high, counts.astype(float))
    one, other = fit_risk_curve(weighted, family), fit_risk_curve(repeated(held, counts), family)
    assert one.slope == pytest.approx(other.slope, rel=1e-6)
    assert one.stimulus_at(0.5) == pytest.approx(other.stimulus_at(0.5), rel=1e-6)
    assert one.log_likelihood == pytest.approx(other.log_likelihood, rel=1e-8)
    steps, plain = estimate_steps(weighted), estimate_steps(repeated(held, counts))
    np.testing.assert_allclose(steps.steps()[1], plain.steps()[1], atol=2e-5)


def scaled(factor: float) -> RiskFit:
    held = intervals_only(60, 2)
    weight = factor * np.random.default_rng(1).uniform(0.2, 3.0, 60)
    return fit_risk_curve(Observations(held.low, held.high, weight), "Weibull")


def test_shares_of_a_population_do_not_count_cases() -> None:
    # Survey weights: what they add up to says nothing of how much is known.
    one, thousand = scaled(1.0), scaled(1000.0)
    assert thousand.slope == pytest.approx(one.slope, rel=1e-7)
    np.testing.assert_allclose(thousand.covariance, one.covariance, rtol=1e-6)


def test_intervals_of_survey_weights_cover() -> None:
    truth, inside = 900.0, 0
    for seed in range(150):
        held = intervals_only(80, 1000 + seed)
        weight = np.random.default_rng(seed).uniform(0.1, 4.0, 80)
        fit = fit_risk_curve(Observations(held.low, held.high, weight), "log-normal")
        _, low, high = fit.stimulus_at(0.5)
        inside += low <= truth <= high
    # 95 % of 150: 142, with a standard error of 2.7.
    assert 132 <= inside <= 149


def test_weights_come_from_a_column_of_the_table() -> None:
    rows = pd.DataFrame(
        {"x": [100.0, 200.0, 300.0, 400.0], "injured": [0, 1, 0, 1], "weight": [3, 1, 2, 5]}
    )
    assert observations_of(rows, "x", 3, "t.csv").weights.tolist() == [3.0, 1.0, 2.0, 5.0]
    rows.loc[2, "weight"] = -1
    with pytest.raises(UserError, match=r"t\.csv: case 3: the weight must be a positive number"):
        observations_of(rows, "x", 3, "t.csv")


# -- bounds as other programs write them ------------------------------------------------------


def test_infinite_bounds_are_open() -> None:
    rows = pd.DataFrame(
        {"x_low": [-np.inf, 3.0, 4.0, np.nan], "x_high": [5.0, 6.0, np.inf, 3.5]}
    )  # fmt: skip
    held = observations_of(rows, "x", 3, "t.csv")
    assert held.low.tolist() == [0.0, 3.0, 4.0, 0.0]
    assert held.high.tolist() == [5.0, 6.0, np.inf, 3.5]
    for column, value in (("x_low", np.inf), ("x_high", -np.inf)):
        with pytest.raises(UserError, match="case 2: the stimulus must be a positive number"):
            wrong = rows.copy()
            wrong.loc[1, column] = value
            observations_of(wrong, "x", 3, "t.csv")


def test_an_empty_exact_field_says_no() -> None:
    rows = pd.DataFrame({"x": [1.0, 2.0, 3.0, 4.0], "injured": [0, 1, 0, 1],
                         "exact": ["", "1", None, "0"]})  # fmt: skip
    held = observations_of(rows, "x", 3, "t.csv")
    assert held.exact.tolist() == [False, True, False, False]
