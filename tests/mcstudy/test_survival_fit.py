"""Risk curves fitted to censored data: equal to other programs, intervals that cover, refusals."""

import functools
import warnings

import numpy as np
import pytest
import statsmodels.api as sm
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import optimize, special, stats

from mcstudy.injury.observations import Observations, check, observe
from mcstudy.injury.survival import (
    FAMILIES,
    QUALITY_AT,
    RiskFit,
    fit_risk_curve,
    quality_class,
)

Array = NDArray[np.float64]

QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=25)

MEDIAN, SLOPE = 1000.0, 2.0
COVERAGE_SETS, COVERAGE_CASES = 300, 60


def score(family: str, risk: Array | float) -> Array:
    """Return z at a risk: the inverse of each family's distribution (ISO/TS 18506)."""
    if family == "log-normal":
        return np.asarray(stats.norm.ppf(risk))
    if family == "log-logistic":
        return np.asarray(stats.logistic.ppf(risk))
    return np.asarray(stats.gumbel_l.ppf(risk))


def frozen(family: str, median: float, slope: float) -> stats.distributions.rv_frozen:
    """Return SciPy's distribution of the stimulus with F(x) = G(a + slope ln x), F(median) = 1/2.

    Scales: exp(-a / slope); SciPy's lognorm, fisk and weibull_min.
    """
    scale = median / np.exp(float(score(family, 0.5)) / slope)
    if family == "log-normal":
        return stats.lognorm(s=1.0 / slope, scale=scale)
    if family == "log-logistic":
        return stats.fisk(c=slope, scale=scale)
    return stats.weibull_min(c=slope, scale=scale)


def censored(
    family: str, n: int, seed: int, slope: float = SLOPE
) -> tuple[Array, NDArray[np.bool_]]:
    """Return stimuli around the median and whether each was injured, by a true curve."""
    rng = np.random.default_rng(seed)
    x = MEDIAN * np.exp(rng.normal(0.0, 0.6, n))
    truth = frozen(family, MEDIAN, slope)
    return x, np.asarray(rng.random(n) < truth.cdf(x))


def mixture(family: str, n: int, seed: int) -> Observations:
    """Return a quarter each of left-, right-, interval-censored and exact cases."""
    rng = np.random.default_rng(seed)
    onset = frozen(family, MEDIAN, SLOPE).ppf(rng.random(n))
    test = MEDIAN * np.exp(rng.normal(0.0, 0.6, n))
    kind = np.arange(n) % 4
    low = np.where(onset > test, test, 0.0)
    high = np.where(onset > test, np.inf, test)
    width = rng.uniform(1.1, 2.0, n)
    low = np.where(kind == 1, onset / width, low)
    high = np.where(kind == 1, onset * width, high)
    low, high = np.where(kind == 2, onset, low), np.where(kind == 2, onset, high)
    return check(Observations(low, high))


def log_likelihood_of(
    family: str, observations: Observations, median: float, slope: float
) -> float:
    """Return the log likelihood from SciPy's distributions: ln f of exact cases, else ln(F - F)."""
    curve = frozen(family, median, slope)
    low, high, exact = observations.low, observations.high, observations.exact
    upper = np.where(np.isinf(high), 1.0, curve.cdf(np.where(np.isinf(high), 1.0, high)))
    # Right-censored cases from the survival function, which keeps its digits.
    share = np.where(np.isinf(high), curve.sf(low), upper - curve.cdf(low))
    with np.errstate(divide="ignore"):
        logs = np.where(exact, curve.logpdf(np.where(exact, high, 1.0)), np.log(share))
    return float(logs.sum())


def regression(family: str, x: Array, injured: Array) -> tuple[Array, float]:
    """Return parameters and log likelihood of statsmodels' binomial regression on ln x."""
    link = {
        "log-normal": sm.families.links.Probit,
        "log-logistic": sm.families.links.Logit,
        "Weibull": sm.families.links.CLogLog,
    }[family]()
    model = sm.GLM(
        injured.astype(float),
        sm.add_constant(np.log(x) - np.log(MEDIAN)),
        family=sm.families.Binomial(link=link),
    )
    with warnings.catch_warnings():
        # Of a design that is nearly separated the weights become small.
        warnings.simplefilter("ignore")
        found = model.fit(maxiter=300, tol=1e-14)
    a, b = found.params
    return np.array([a - b * np.log(MEDIAN), b]), float(found.llf)


def maximise(family: str, observations: Observations) -> tuple[float, float]:
    """Return greatest log likelihood and its slope by a search without derivatives."""

    def loss(p: Array) -> float:
        return -log_likelihood_of(family, observations, MEDIAN * np.exp(p[0]), np.exp(p[1]))

    found = optimize.minimize(
        loss, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-10}
    )
    assert found.success
    return -float(found.fun), float(np.exp(found.x[1]))


def centred(fit: RiskFit) -> Array:
    """Return z at the median stimulus and the slope, which hardly depend on each other."""
    return np.array([fit.intercept + fit.slope * np.log(MEDIAN), fit.slope])


# -- equal to other programs -----------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(("n", "seeds"), [(30, 6), (60, 4), (150, 3), (500, 3)])
def test_equal_to_regressions_on_ln_x_for_left_and_right_censored_cases(
    family: str, n: int, seeds: int
) -> None:
    # Probit, logit and complementary log-log regression are the same likelihood
    # (shared/reference/injury.md 2.4, measured with n = 60).
    for seed in range(seeds):
        x, injured = censored(family, n, seed)
        fit = fit_risk_curve(observe(x, injured), family)
        parameters, log_likelihood = regression(family, x, injured)
        assert fit.log_likelihood == pytest.approx(log_likelihood, abs=1e-6)
        np.testing.assert_allclose([fit.intercept, fit.slope], parameters, rtol=1e-5, atol=1e-5)
        assert fit.cases == n
        assert fit.aic == pytest.approx(4.0 - 2.0 * log_likelihood, abs=2e-6)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_regression_that_falls_is_refused(family: str) -> None:
    # Where injury is unrelated to the stimulus half of the regressions have a negative slope.
    fell = rose = 0
    for seed in range(16):
        rng = np.random.default_rng(seed)
        x, injured = np.exp(rng.normal(7.0, 0.5, 40)), rng.random(40) < 0.5
        slope = regression(family, x, injured)[0][1]
        if slope > 0.0:
            rose += 1
            assert fit_risk_curve(observe(x, injured), family).slope == pytest.approx(
                slope, rel=1e-5, abs=1e-6
            )
        else:
            fell += 1
            with pytest.raises(ValueError, match="does not rise with the stimulus"):
                fit_risk_curve(observe(x, injured), family)
    assert min(fell, rose) >= 3


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(("n", "seed"), [(20, 0), (40, 1), (80, 2)])
def test_equal_to_a_direct_maximisation_with_intervals_and_exact_cases(
    family: str, n: int, seed: int
) -> None:
    observations = mixture(family, n, seed)
    fit = fit_risk_curve(observations, family)

    value, slope = maximise(family, observations)
    assert fit.log_likelihood == pytest.approx(value, abs=1e-6)
    assert fit.slope == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize("family", FAMILIES)
def test_equal_to_scipys_fit_of_censored_data(family: str) -> None:
    observations = mixture(family, 60, 8)
    fit = fit_risk_curve(observations, family)
    low, high = observations.low, observations.high
    exact, injured = observations.exact, observations.injured
    left = injured & (low == 0.0)
    between = injured & ~exact & ~left
    data = stats.CensoredData(
        uncensored=high[exact],
        left=high[left],
        right=low[~injured],
        interval=np.column_stack([low[between], high[between]]),
    )
    assert data.num_censored() == int((~exact).sum())
    law = {"log-normal": stats.lognorm, "log-logistic": stats.fisk, "Weibull": stats.weibull_min}
    with warnings.catch_warnings():
        # Its search tries shapes without likelihood.
        warnings.simplefilter("ignore")
        shape, _, scale = law[family].fit(data, floc=0.0)
    slope = 1.0 / shape if family == "log-normal" else shape
    median = float(law[family](shape, scale=scale).ppf(0.5))
    assert fit.slope == pytest.approx(slope, rel=1e-3)
    assert fit.stimulus_at(0.5)[0] == pytest.approx(median, rel=1e-3)
    theirs = log_likelihood_of(family, observations, median, slope)
    assert theirs - 1e-8 <= fit.log_likelihood <= theirs + 1e-4


@pytest.mark.parametrize("family", FAMILIES)
def test_covariance_is_the_inverse_of_the_observed_information(family: str) -> None:
    # Differences of SciPy's log likelihood; z at the median of the truth and slope.
    observations = mixture(family, 80, 5)
    fit = fit_risk_curve(observations, family)

    def total(z: float, slope: float) -> float:
        median = MEDIAN * np.exp((float(score(family, 0.5)) - z) / slope)
        return log_likelihood_of(family, observations, median, slope)

    best, step = centred(fit), np.diag([1e-3, 1e-3])
    hessian = np.empty((2, 2))
    for i in range(2):
        for j in range(2):
            corners = [
                s * t * total(*(best + s * step[i] + t * step[j])) for s in (1, -1) for t in (1, -1)
            ]
            hessian[i, j] = sum(corners) / (4.0 * 1e-6)
    shift = np.array([[1.0, np.log(MEDIAN)], [0.0, 1.0]])
    np.testing.assert_allclose(
        shift @ fit.covariance @ shift.T, np.linalg.inv(-hessian), rtol=2e-4, atol=1e-6
    )


@pytest.mark.parametrize("family", FAMILIES)
def test_risk_is_scipys_distribution(family: str) -> None:
    fit = fit_risk_curve(mixture(family, 60, 1), family)
    x = np.geomspace(1.0, 1e5, 40)
    curve = frozen(family, fit.stimulus_at(0.5)[0], fit.slope)
    np.testing.assert_allclose(fit.risk(x), curve.cdf(x), rtol=1e-8, atol=1e-300)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_maximum_is_one_of_the_likelihood(family: str) -> None:
    observations = mixture(family, 50, 4)
    fit = fit_risk_curve(observations, family)
    median, slope = fit.stimulus_at(0.5)[0], fit.slope
    assert log_likelihood_of(family, observations, median, slope) == pytest.approx(
        fit.log_likelihood, abs=1e-9
    )
    for a, b in ((1.01, 1.0), (0.99, 1.0), (1.0, 1.02), (1.0, 0.98), (3.0, 0.3)):
        other = log_likelihood_of(family, observations, a * median, b * slope)
        assert other < fit.log_likelihood


# -- intervals -------------------------------------------------------------------------------


@functools.cache
def coverage(family: str) -> tuple[float, float, int]:
    """Return how often band and stimulus interval hold the truth at 25 %, and refused sets."""
    truth = float(frozen(family, MEDIAN, SLOPE).ppf(0.25))
    held, inverse, refused = [], [], 0
    for seed in range(COVERAGE_SETS):
        x, injured = censored(family, COVERAGE_CASES, 10_000 + seed)
        try:
            fit = fit_risk_curve(observe(x, injured), family)
        except ValueError:
            refused += 1
            continue
        low, high = (float(side) for side in fit.band(np.array(truth)))
        held.append(low <= 0.25 <= high)
        _, left, right = fit.stimulus_at(0.25)
        inverse.append(left <= truth <= right)
    return float(np.mean(held)), float(np.mean(inverse)), refused


@pytest.mark.parametrize("family", FAMILIES)
def test_the_band_covers_the_true_curve(family: str) -> None:
    # 300 sets at 0.95 scatter by 0.0126: 0.92 to 0.98 is within 2.4 standard deviations.
    band, _, refused = coverage(family)
    assert refused <= 3
    assert 0.92 <= band <= 0.98, band


@pytest.mark.parametrize("family", FAMILIES)
def test_the_interval_of_the_stimulus_covers_the_truth(family: str) -> None:
    # A delta-method interval at 60 cases is a little off 0.95.
    assert 0.90 <= coverage(family)[1] <= 0.99


@pytest.mark.parametrize("family", FAMILIES)
def test_fits_are_right_on_average_over_many_cases(family: str) -> None:
    # At 2,000 cases the bias of maximum likelihood, of order 1 / n, is below the errors.
    x, injured = censored(family, 2000, 3)
    fit = fit_risk_curve(observe(x, injured), family)
    value, low, high = fit.stimulus_at(0.5)
    assert abs(np.log(value / MEDIAN)) < 4.0 * np.log(high / low) / 3.92
    assert abs(fit.slope - SLOPE) < 4.0 * np.sqrt(fit.covariance[1, 1])


@pytest.mark.parametrize("family", FAMILIES)
def test_the_band_holds_the_curve_within_0_and_1(family: str) -> None:
    x, injured = censored(family, 40, 2)
    fit = fit_risk_curve(observe(x, injured), family)
    grid = np.geomspace(1e-3, 1e7, 300)
    low, high = fit.band(grid)
    risk = fit.risk(grid)
    assert np.all((low >= 0.0) & (low <= risk) & (risk <= high) & (high <= 1.0))
    assert np.all(np.diff(risk) >= 0.0)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_band_is_normal_on_the_scale_of_z(family: str) -> None:
    # McMurry and Poplin 2015: intervals belong on the scale on which the estimate is normal.
    fit = fit_risk_curve(mixture(family, 60, 6), family)
    x = np.array([500.0, 1000.0, 1800.0])
    rows = np.stack([np.ones(3), np.log(x)])
    error = np.sqrt(np.einsum("ik,ij,jk->k", rows, fit.covariance, rows))
    for side, sign in zip(fit.band(x), (-1.0, 1.0), strict=True):
        z = fit.intercept + fit.slope * np.log(x)
        np.testing.assert_allclose(score(family, side) - z, sign * 1.959964 * error, rtol=1e-5)


@pytest.mark.parametrize("family", FAMILIES)
def test_cases_counted_four_times_halve_the_errors(family: str) -> None:
    # The likelihood of every case four times is four times the logarithm.
    once = mixture(family, 40, 7)
    four = Observations(np.tile(once.low, 4), np.tile(once.high, 4))
    a, b = fit_risk_curve(once, family), fit_risk_curve(four, family)
    np.testing.assert_allclose(centred(b), centred(a), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(b.covariance, a.covariance / 4.0, rtol=1e-5)
    assert b.log_likelihood == pytest.approx(4.0 * a.log_likelihood, rel=1e-9)


@pytest.mark.parametrize("family", FAMILIES)
def test_more_cases_narrow_the_interval(family: str) -> None:
    # Errors go with the root of the number: sixteen times the cases, a quarter of the width.
    widths = []
    for n in (50, 200, 800):
        ends = np.array([fit_of(family, n, seed).stimulus_at(0.25) for seed in range(6)])
        widths.append(np.log(ends[:, 2] / ends[:, 1]).mean())
    assert widths[0] > widths[1] > widths[2]
    assert widths[0] / widths[2] == pytest.approx(4.0, rel=0.35)


# -- units, inverse, quality -----------------------------------------------------------------


@QUIET
@given(
    family=st.sampled_from(FAMILIES),
    factor=st.floats(-6.0, 6.0).map(lambda p: float(10.0**p)),
    seed=st.integers(0, 40),
    exact=st.booleans(),
)
def test_the_unit_of_the_stimulus_does_not_count(
    family: str, factor: float, seed: int, exact: bool
) -> None:
    if exact:
        plain = mixture(family, 40, seed)
    else:
        x, injured = censored(family, 40, seed)
        assume(x[injured].min() < x[~injured].max())
        plain = observe(x, injured)
    scaled = Observations(plain.low * factor, plain.high * factor)
    a, b = fit_risk_curve(plain, family), fit_risk_curve(scaled, family)
    assert b.slope == pytest.approx(a.slope, rel=1e-6)
    np.testing.assert_allclose(
        b.stimulus_at(0.25), factor * np.array(a.stimulus_at(0.25)), rtol=1e-6
    )
    x = np.array([300.0, 1000.0, 2500.0])
    np.testing.assert_allclose(b.risk(factor * x), a.risk(x), rtol=1e-5)
    np.testing.assert_allclose(b.band(factor * x), a.band(x), rtol=1e-5)
    # A density in x is one over its unit.
    moved = float(plain.exact.sum()) * np.log(factor)
    assert b.log_likelihood == pytest.approx(a.log_likelihood - moved, abs=1e-6)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_order_of_the_cases_does_not_count(family: str) -> None:
    plain = mixture(family, 40, 9)
    order = np.random.default_rng(1).permutation(40)
    a = fit_risk_curve(plain, family)
    b = fit_risk_curve(Observations(plain.low[order], plain.high[order]), family)
    np.testing.assert_allclose(centred(b), centred(a), rtol=1e-7, atol=1e-9)


@QUIET
@given(family=st.sampled_from(FAMILIES), risk=st.floats(1e-6, 1.0 - 1e-6))
def test_stimulus_is_the_inverse_of_risk(family: str, risk: float) -> None:
    fit = fit_of(family)
    value, low, high = fit.stimulus_at(risk)
    assert 0.0 < low < value < high
    assert float(fit.risk(np.array(value))) == pytest.approx(risk, rel=1e-9)


@functools.cache
def fit_of(family: str, n: int = 80, seed: int = 21) -> RiskFit:
    """Return the curve of one set of cases."""
    x, injured = censored(family, n, seed)
    return fit_risk_curve(observe(x, injured), family)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_interval_of_the_stimulus_is_the_delta_method_in_ln_x(family: str) -> None:
    # ln x_p = (z_p - a) / b: gradient -1 / b and -ln x_p / b. Symmetric about ln x_p.
    fit = fit_of(family)
    for risk in QUALITY_AT:
        value, low, high = fit.stimulus_at(risk)
        gradient = np.array([-1.0, -np.log(value)]) / fit.slope
        error = float(np.sqrt(gradient @ fit.covariance @ gradient))
        assert np.log(high / value) == pytest.approx(1.959964 * error, rel=1e-6)
        assert np.log(value / low) == pytest.approx(1.959964 * error, rel=1e-6)


def test_the_quality_index_is_the_width_over_the_stimulus() -> None:
    # ISO/TS 18506 (shared/reference/injury.md 2.4): width / stimulus at 5, 25 and 50 %.
    assert QUALITY_AT == (0.05, 0.25, 0.5)
    for family in FAMILIES:
        fit = fit_of(family)
        for risk in QUALITY_AT:
            value, low, high = fit.stimulus_at(risk)
            assert fit.quality_index(risk) == pytest.approx((high - low) / value, rel=1e-12)


@pytest.mark.parametrize(
    ("index", "name"),
    [(0.0, "good"), (0.5, "good"), (0.5001, "fair"), (1.0, "fair"), (1.0001, "marginal"),
     (1.5, "marginal"), (1.5001, "unacceptable"), (1e9, "unacceptable"), (np.inf, "unacceptable")],
)  # fmt: skip
def test_classes_of_quality(index: float, name: str) -> None:
    # shared/reference/injury.md 2.4: good to 0.5, fair to 1, marginal to 1.5, else unacceptable.
    assert quality_class(index) == name


def test_the_best_family_is_the_true_one_more_often_than_not_for_exact_cases() -> None:
    # With hundreds of measured onsets the three families are told apart (AIC).
    for truth in FAMILIES:
        onset = frozen(truth, MEDIAN, SLOPE).ppf(np.random.default_rng(2).random(800))
        low, high = np.append(onset, 10.0), np.append(onset, np.inf)
        observations = check(Observations(low, high))
        aic = {name: fit_risk_curve(observations, name).aic for name in FAMILIES}
        assert min(aic, key=aic.__getitem__) == truth


# -- hard but allowed ------------------------------------------------------------------------


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(("place", "hurt"), [(1e-3 * MEDIAN, True), (1e3 * MEDIAN, False)])
def test_one_case_far_out_in_a_tail_does_not_break_the_fit(
    family: str, place: float, hurt: bool
) -> None:
    # An injured case at a thousandth and an uninjured one at a thousand times the median, where
    # statsmodels' regressions stop short of the maximum.
    x, injured = censored(family, 60, 5, slope=4.0)
    held = observe(np.append(x, place), np.append(injured, hurt))
    fit = fit_risk_curve(held, family)
    value, slope = maximise(family, held)
    assert fit.log_likelihood == pytest.approx(value, abs=1e-6)
    assert fit.slope == pytest.approx(slope, rel=1e-4)
    assert np.isfinite(fit.covariance).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("family", FAMILIES)
def test_a_narrow_interval_is_almost_an_exact_case(family: str) -> None:
    # ln(F(x (1 + d)) - F(x)) is ln f(x) + ln(x d) for small d.
    plain = mixture(family, 40, 3)
    exact, d = plain.exact, 1e-7
    narrow = Observations(plain.low, np.where(exact, plain.high * (1.0 + d), plain.high))
    a, b = fit_risk_curve(plain, family), fit_risk_curve(narrow, family)
    np.testing.assert_allclose(centred(b), centred(a), rtol=1e-4, atol=1e-5)
    width = float(np.log(plain.high[exact] * d).sum())
    assert b.log_likelihood == pytest.approx(a.log_likelihood + width, abs=1e-3)


def test_arguments_are_kept() -> None:
    observations = mixture("Weibull", 40, 2)
    low, high = observations.low.copy(), observations.high.copy()
    fit_risk_curve(observations, "Weibull")
    np.testing.assert_array_equal(observations.low, low)
    np.testing.assert_array_equal(observations.high, high)


# -- refusals --------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
def test_separated_cases_give_no_curve(family: str) -> None:
    x = np.array([100.0, 200.0, 300.0, 400.0, 500.0, 600.0])
    with pytest.raises(ValueError, match=r"up to 300.*from 400.*complete separation"):
        fit_risk_curve(
            Observations(np.where(x < 350, x, 0.0), np.where(x < 350, np.inf, x)), family
        )
    # Quasi-complete: both at 300, and 300 tells the others apart. No finite slope is the best.
    with pytest.raises(ValueError, match="do not overlap"):
        fit_risk_curve(
            Observations(
                np.array([100.0, 300.0, 0.0, 0.0]), np.array([np.inf, np.inf, 300.0, 400.0])
            ),
            family,
        )


@pytest.mark.parametrize("family", FAMILIES)
def test_intervals_that_share_a_point_give_no_curve(family: str) -> None:
    # All of (100, 500], (200, 600] and (300, inf) hold (300, 500]: a step there has likelihood 1.
    with pytest.raises(ValueError, match="do not overlap"):
        fit_risk_curve(
            Observations(np.array([100.0, 200.0, 300.0]), np.array([500.0, 600.0, np.inf])), family
        )


@pytest.mark.parametrize(
    ("x", "injured", "exact"),
    [([1, 2, 3, 4, 5, 6], [0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 0, 0]),
     ([1, 2, 3, 4, 4, 4], [0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 1])],
    ids=["one exact case", "equal exact cases"],
)  # fmt: skip
def test_a_step_at_an_exact_case_gives_no_curve(
    x: list[float], injured: list[int], exact: list[int]
) -> None:
    for family in FAMILIES:
        with pytest.raises(ValueError, match="separation"):
            fit_risk_curve(
                observe(np.array(x), np.array(injured, bool), np.array(exact, bool)), family
            )


@pytest.mark.parametrize("name", ["weibull", "lognormal", ""])
def test_an_unknown_family_gives_no_curve(name: str) -> None:
    with pytest.raises(ValueError, match="family"):
        fit_risk_curve(mixture("Weibull", 20, 0), name)


@pytest.mark.parametrize("family", FAMILIES)
def test_one_class_alone_gives_no_curve(family: str) -> None:
    x = np.array([100.0, 200.0, 300.0, 400.0])
    with pytest.raises(ValueError, match="all cases are injured"):
        fit_risk_curve(Observations(np.zeros(4), x), family)
    with pytest.raises(ValueError, match="no case is injured"):
        fit_risk_curve(Observations(x, np.full(4, np.inf)), family)


@pytest.mark.parametrize("family", FAMILIES)
def test_risk_that_falls_gives_no_curve(family: str) -> None:
    x, injured = censored(family, 100, 1)
    with pytest.raises(ValueError, match="risk does not rise with the stimulus"):
        fit_risk_curve(observe(x, ~injured), family)


@pytest.mark.parametrize(("bad", "injured"), [
    (0.0, True), (-5.0, True), (-5.0, False), (np.nan, True), (np.nan, False), (0.0, False),
])  # fmt: skip
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_stimulus_that_is_no_positive_number_gives_no_curve(bad: float, injured: bool) -> None:
    x, hurt = censored("Weibull", 30, 1)
    low = np.append(np.where(hurt, 0.0, x), 0.0 if injured else bad)
    high = np.append(np.where(hurt, x, np.inf), bad if injured else np.inf)
    with pytest.raises(ValueError, match="case 31: the stimulus must be a positive number"):
        fit_risk_curve(Observations(low, high), "Weibull")


@pytest.mark.parametrize("n", [0, 1, 2])
def test_too_few_cases_give_no_curve(n: int) -> None:
    x = np.array([200.0, 100.0])[:n]
    with pytest.raises(ValueError, match=f"{n} cases are too few"):
        fit_risk_curve(
            Observations(np.where(x > 150, x, 0.0), np.where(x > 150, np.inf, x)), "Weibull"
        )


def test_logit_of_a_curve_is_scipys() -> None:
    # log-logistic: the odds are a power of the stimulus.
    fit = fit_of("log-logistic")
    x = np.array([400.0, 1600.0])
    ratio = np.diff(special.logit(fit.risk(x)))[0]
    assert ratio == pytest.approx(fit.slope * np.log(4.0), rel=1e-9)
