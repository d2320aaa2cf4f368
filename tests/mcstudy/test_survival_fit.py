"""Risk curves fitted to censored data: equal to other programs, intervals that cover, refusals."""

import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import statsmodels.api as sm
from hypothesis import assume, given
from hypothesis import strategies as st
from mcstudy_tools import Array, Flags, generator, quiet
from numpy.testing import assert_allclose
from scipy import optimize, stats

from mcstudy.injury.observations import Observations, check, observe
from mcstudy.injury.survival import (
    FAMILIES,
    QUALITY_AT,
    RiskFit,
    fit_risk_curve,
    quality_class,
)
from mcstudy.injury.turnbull import estimate_steps

Shape = Callable[[int, int], Observations]

MEDIAN, SLOPE = 1000.0, 2.0
LAWS = {"log-normal": stats.lognorm, "log-logistic": stats.fisk, "Weibull": stats.weibull_min}
SCORES = {"log-normal": stats.norm, "log-logistic": stats.logistic, "Weibull": stats.gumbel_l}
"""Laws of z, of which each family's risk is the distribution (ISO/TS 18506)."""

each_family = pytest.mark.parametrize("family", FAMILIES)


def frozen(family: str, median: float, slope: float) -> stats.distributions.rv_frozen:
    """Return SciPy's law of the stimulus with F(x) = G(a + slope ln x), F(median) = 1/2."""
    scale = median / np.exp(SCORES[family].ppf(0.5) / slope)
    return LAWS[family](1.0 / slope if family == "log-normal" else slope, scale=scale)


def censored(family: str, n: int, seed: int, slope: float = SLOPE) -> tuple[Array, Flags]:
    """Return stimuli around the median and whether each was injured, by a true curve."""
    rng = generator(seed)
    x = MEDIAN * np.exp(rng.normal(0.0, 0.6, n))
    return x, np.asarray(rng.random(n) < frozen(family, MEDIAN, slope).cdf(x))


def fit_of(family: str, n: int = 80, seed: int = 21) -> RiskFit:
    return fit_risk_curve(observe(*censored(family, n, seed)), family)


def mixture(n: int, seed: int, family: str = "log-logistic") -> Observations:
    """Return a quarter each of left- and right-censored, interval-censored and exact cases."""
    rng = generator(seed)
    onset = frozen(family, MEDIAN, SLOPE).ppf(rng.random(n))
    test = MEDIAN * np.exp(rng.normal(0.0, 0.6, n))
    width, kind = rng.uniform(1.1, 2.0, n), np.arange(n) % 4
    low = np.where(kind == 1, onset / width, np.where(onset > test, test, 0.0))
    high = np.where(kind == 1, onset * width, np.where(onset > test, np.inf, test))
    low, high = np.where(kind == 2, onset, low), np.where(kind == 2, onset, high)
    return check(Observations(low, high))


def exact_only(n: int, seed: int) -> Observations:
    x = np.asarray(900.0 * np.exp(0.4 * generator(seed).standard_normal(n)))
    return Observations(x, x.copy())


def intervals_only(n: int, seed: int) -> Observations:
    x, rng = exact_only(n, seed).low, generator(seed + 100)
    return Observations(x / rng.uniform(1.05, 1.6, n), x * rng.uniform(1.05, 1.6, n))


def left_and_exact(n: int, seed: int) -> Observations:
    x, left = exact_only(n, seed).low, np.arange(n) % 2 == 0
    return Observations(np.where(left, 0.0, x), np.where(left, 1.3 * x, x))


def tied(n: int, seed: int) -> Observations:
    """Return intervals of a few tests at the same levels."""
    levels = np.array([300.0, 600.0, 900.0, 1200.0, 1800.0, 3000.0])
    place = np.clip(np.searchsorted(levels, exact_only(n, seed).low), 1, 5)
    return Observations(levels[place - 1], levels[place])


def one_uninjured(n: int, seed: int) -> Observations:
    held = exact_only(n, seed)
    held.high[0] = np.inf
    return held


def one_injured(n: int, seed: int) -> Observations:
    low, high = np.sort(exact_only(n, seed).low), np.full(n, np.inf)
    low[-2], high[-2] = 0.0, low[-2]
    return Observations(low, high)


def three_decades(n: int, seed: int) -> Observations:
    low = 10.0 ** (np.arange(n) % 3)
    return Observations(low, 10.0 * low)


SHAPES = [exact_only, intervals_only, left_and_exact, tied, one_uninjured, one_injured,
          three_decades, mixture]  # fmt: skip


def log_likelihood_of(family: str, held: Observations, median: float, slope: float) -> float:
    """Return the log likelihood from SciPy's laws: ln f of exact cases, else ln(F - F)."""
    curve, open_above = frozen(family, median, slope), np.isinf(held.high)
    upper = np.where(open_above, 1.0, held.high)
    # Right-censored cases from the survival function, which keeps its digits.
    share = np.where(open_above, curve.sf(held.low), curve.cdf(upper) - curve.cdf(held.low))
    with np.errstate(divide="ignore"):
        return float(np.where(held.exact, curve.logpdf(upper), np.log(share)).sum())


def maximise(family: str, held: Observations) -> tuple[float, float]:
    """Return greatest log likelihood and its slope by a search without derivatives."""
    found = optimize.minimize(
        lambda p: -log_likelihood_of(family, held, MEDIAN * np.exp(p[0]), np.exp(p[1])),
        np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-10},
    )  # fmt: skip
    assert found.success
    return -float(found.fun), float(np.exp(found.x[1]))


def scipys(family: str, held: Observations) -> tuple[float, float, float]:
    """Return log likelihood, slope and median of SciPy's fit of censored data."""
    left, right = ~held.exact & (held.low == 0.0), np.isinf(held.high)
    between = ~(held.exact | left | right)
    data = stats.CensoredData(
        uncensored=held.high[held.exact], left=held.high[left], right=held.low[right],
        interval=np.stack([held.low[between], held.high[between]], axis=1),
    )  # fmt: skip
    with warnings.catch_warnings():
        # The simplex strays where the likelihood is nothing.
        warnings.simplefilter("ignore")
        shape, _, scale = LAWS[family].fit(data, 1.5, floc=0.0, scale=900.0)
    slope = 1.0 / shape if family == "log-normal" else shape
    median = float(LAWS[family](shape, scale=scale).median())
    return log_likelihood_of(family, held, median, slope), slope, median


def regression(family: str, x: Array, injured: Flags) -> tuple[Array, float]:
    """Return parameters and log likelihood of statsmodels' binomial regression on ln x."""
    links = sm.families.links
    link = {"log-normal": links.Probit, "log-logistic": links.Logit, "Weibull": links.CLogLog}
    model = sm.GLM(
        injured.astype(float), sm.add_constant(np.log(x / MEDIAN)),
        family=sm.families.Binomial(link=link[family]()),
    )  # fmt: skip
    with warnings.catch_warnings():
        # Of a design that is nearly separated the weights become small.
        warnings.simplefilter("ignore")
        found = model.fit(maxiter=300, tol=1e-14)
    a, b = found.params
    return np.array([a - b * np.log(MEDIAN), b]), float(found.llf)


def centred(fit: RiskFit) -> Array:
    """Return z at the median stimulus and the slope, which hardly depend on each other."""
    return np.array([fit.intercept + fit.slope * np.log(MEDIAN), fit.slope])


@each_family
@pytest.mark.parametrize(("n", "seeds"), [(30, 6), (60, 4), (150, 3), (500, 3)])
def test_equal_to_regressions_on_ln_x_without_intervals(family: str, n: int, seeds: int) -> None:
    # Probit, logit and complementary log-log regression are the same likelihood
    # (shared/reference/injury.md 2.4, measured with n = 60).
    for seed in range(seeds):
        x, injured = censored(family, n, seed)
        fit = fit_risk_curve(observe(x, injured), family)
        parameters, log_likelihood = regression(family, x, injured)
        assert fit.log_likelihood == pytest.approx(log_likelihood, abs=1e-6)
        assert_allclose([fit.intercept, fit.slope], parameters, rtol=1e-5, atol=1e-5)
        assert fit.cases == n
        assert fit.aic == pytest.approx(4.0 - 2.0 * log_likelihood, abs=2e-6)


@each_family
def test_a_regression_that_falls_is_refused(family: str) -> None:
    # Where injury is unrelated to the stimulus half of the regressions have a negative slope.
    slopes = []
    for seed in range(16):
        rng = generator(seed)
        x, injured = np.exp(rng.normal(7.0, 0.5, 40)), rng.random(40) < 0.5
        slopes.append(regression(family, x, injured)[0][1])
        if slopes[-1] > 0.0:
            fit = fit_risk_curve(observe(x, injured), family)
            assert fit.slope == pytest.approx(slopes[-1], rel=1e-5, abs=1e-6)
        else:
            with pytest.raises(ValueError, match="does not rise with the stimulus"):
                fit_risk_curve(observe(x, injured), family)
    assert 3 <= sum(slope > 0.0 for slope in slopes) <= 13


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("shape", SHAPES)
@each_family
def test_every_shape_has_the_curve_of_greatest_likelihood(family: str, shape: Shape) -> None:
    mixed = shape is mixture
    held = check(shape(60, 8) if mixed else shape(12, 3))
    fit = fit_risk_curve(held, family)
    median = fit.stimulus_at(0.5)[0]
    assert fit.log_likelihood == pytest.approx(
        log_likelihood_of(family, held, median, fit.slope), abs=1e-8
    )
    theirs, slope, middle = scipys(family, held)
    # A simplex may stop short of the maximum; it may not find a higher one.
    assert theirs - (1e-8 if mixed else 1e-6) <= fit.log_likelihood
    assert fit.log_likelihood == pytest.approx(theirs, abs=1e-4 if mixed else 2e-4)
    assert [fit.slope, median] == pytest.approx([slope, middle], rel=1e-3 if mixed else 0.02)
    assert np.all(np.isfinite(fit.covariance))


@each_family
@pytest.mark.parametrize(("n", "seed"), [(20, 0), (40, 1), (80, 2)])
def test_equal_to_a_direct_maximisation(family: str, n: int, seed: int) -> None:
    held = mixture(n, seed, family)
    fit = fit_risk_curve(held, family)
    value, slope = maximise(family, held)
    assert fit.log_likelihood == pytest.approx(value, abs=1e-6)
    assert fit.slope == pytest.approx(slope, rel=1e-5)


@pytest.mark.filterwarnings("error")
@each_family
@pytest.mark.parametrize(("place", "hurt"), [(1e-3 * MEDIAN, True), (1e3 * MEDIAN, False)])
def test_one_case_far_out_in_a_tail_breaks_no_fit(family: str, place: float, hurt: bool) -> None:
    # An injured case at a thousandth and an uninjured one at a thousand times the median, where
    # statsmodels' regressions stop short of the maximum.
    x, injured = censored(family, 60, 5, slope=4.0)
    held = observe(np.append(x, place), np.append(injured, hurt))
    fit = fit_risk_curve(held, family)
    value, slope = maximise(family, held)
    assert fit.log_likelihood == pytest.approx(value, abs=1e-6)
    assert fit.slope == pytest.approx(slope, rel=1e-4)
    assert np.isfinite(fit.covariance).all()


@each_family
def test_covariance_is_the_inverse_of_the_observed_information(family: str) -> None:
    # Differences of SciPy's log likelihood; z at the median of the truth and slope.
    held = mixture(80, 5, family)
    fit = fit_risk_curve(held, family)

    def total(z: float, slope: float) -> float:
        median = MEDIAN * np.exp((SCORES[family].ppf(0.5) - z) / slope)
        return log_likelihood_of(family, held, median, slope)

    best, step, signs = centred(fit), 1e-3 * np.eye(2), (1, -1)
    hessian = np.array([
        [sum(s * t * total(*(best + s * a + t * b)) for s in signs for t in signs) for a in step]
        for b in step
    ]) / 4e-6  # fmt: skip
    shift = np.array([[1.0, np.log(MEDIAN)], [0.0, 1.0]])
    inverse = np.linalg.inv(-hessian)
    assert_allclose(shift @ fit.covariance @ shift.T, inverse, rtol=2e-4, atol=1e-6)


@each_family
def test_risk_is_scipys_distribution_and_its_band_normal_in_z(family: str) -> None:
    # McMurry and Poplin 2015: intervals belong on the scale on which the estimate is normal.
    fit = fit_risk_curve(mixture(60, 1, family), family)
    x = np.geomspace(1.0, 1e5, 40)
    curve, (low, high) = frozen(family, fit.stimulus_at(0.5)[0], fit.slope), fit.band(x)
    assert_allclose(fit.risk(x), curve.cdf(x), rtol=1e-8, atol=1e-300)
    assert np.all((low >= 0.0) & (low <= fit.risk(x)) & (fit.risk(x) <= high) & (high <= 1.0))
    x = np.array([500.0, 1000.0, 1800.0])
    rows = np.stack([np.ones(3), np.log(x)])
    error = 1.959964 * np.sqrt(np.einsum("ik,ij,jk->k", rows, fit.covariance, rows))
    z = SCORES[family].ppf(np.stack([fit.risk(x), *fit.band(x)]))
    assert_allclose(z[1:] - z[0], [-error, error], rtol=1e-5)


@pytest.mark.parametrize("sets", [40, pytest.param(300, marks=pytest.mark.slow)])
@each_family
def test_band_and_interval_cover_the_true_curve(family: str, sets: int) -> None:
    # 300 sets at 0.95 scatter by 0.0126: 0.92 to 0.98 is within 2.4 standard deviations. A
    # delta-method interval at 60 cases is a little off 0.95.
    more = np.sqrt(300 / sets)
    truth = float(frozen(family, MEDIAN, SLOPE).ppf(0.25))
    held = []
    for seed in range(sets):
        try:
            fit = fit_of(family, 60, 10_000 + seed)
        except ValueError:
            continue
        low, high = fit.band(np.array(truth))
        _, left, right = fit.stimulus_at(0.25)
        held.append([low <= 0.25 <= high, left <= truth <= right])
    assert len(held) >= 0.99 * sets
    band, interval = np.mean(held, axis=0)
    assert abs(band - 0.95) <= 0.03 * more
    assert -0.05 * more <= interval - 0.95 <= 0.04 * more


@each_family
def test_cases_counted_four_times_in_any_order_halve_the_errors(family: str) -> None:
    # The likelihood of every case four times is four times the logarithm.
    once = mixture(40, 7, family)
    order = generator(1).permutation(160)
    four = Observations(np.tile(once.low, 4)[order], np.tile(once.high, 4)[order])
    a, b = fit_risk_curve(once, family), fit_risk_curve(four, family)
    assert_allclose(centred(b), centred(a), rtol=1e-6, atol=1e-6)
    assert_allclose(b.covariance, a.covariance / 4.0, rtol=1e-5)
    assert b.log_likelihood == pytest.approx(4.0 * a.log_likelihood, rel=1e-9)


@each_family
def test_the_interval_of_the_stimulus_is_the_delta_method_in_ln_x(family: str) -> None:
    # Derivatives by differences. ISO/TS 18506 (shared/reference/injury.md 2.4): the quality index
    # is the width over the stimulus at 5, 25 and 50 %.
    fit, step = fit_of(family), 1e-5
    assert QUALITY_AT == (0.05, 0.25, 0.5)
    for risk in QUALITY_AT:
        value, low, high = fit.stimulus_at(risk)
        ends = [
            [np.log(replace(fit, **{key: getattr(fit, key) + s}).stimulus_at(risk)[0])
             for key in ("intercept", "slope")]
            for s in (step, -step)
        ]  # fmt: skip
        gradient = np.subtract(*ends) / (2.0 * step)
        reach = 1.959964 * np.sqrt(gradient @ fit.covariance @ gradient)
        assert np.log([high / value, value / low]) == pytest.approx(reach, rel=1e-6)
        assert fit.quality_index(risk) == pytest.approx((high - low) / value, rel=1e-12)


def test_classes_of_quality() -> None:
    # shared/reference/injury.md 2.4: good to 0.5, fair to 1, marginal to 1.5, else unacceptable.
    named = {"good": (0.0, 0.5), "fair": (0.5001, 1.0), "marginal": (1.0001, 1.5),
             "unacceptable": (1.5001, 1e9, np.inf)}  # fmt: skip
    for name, indices in named.items():
        assert [quality_class(index) for index in indices] == [name] * len(indices)


@quiet(25)
@given(
    family=st.sampled_from(FAMILIES),
    factor=st.floats(-6.0, 6.0).map(lambda p: float(10.0**p)),
    seed=st.integers(0, 40),
    exact=st.booleans(),
    risk=st.floats(1e-6, 1.0 - 1e-6),
)
def test_the_unit_of_the_stimulus_does_not_count(
    family: str, factor: float, seed: int, exact: bool, risk: float
) -> None:
    if exact:
        plain = mixture(40, seed, family)
    else:
        x, injured = censored(family, 40, seed)
        assume(x[injured].min() < x[~injured].max())
        plain = observe(x, injured)
    a = fit_risk_curve(plain, family)
    b = fit_risk_curve(Observations(plain.low * factor, plain.high * factor), family)
    assert b.slope == pytest.approx(a.slope, rel=1e-6)
    assert_allclose(b.stimulus_at(0.25), factor * np.array(a.stimulus_at(0.25)), rtol=1e-6)
    x = np.array([300.0, 1000.0, 2500.0])
    assert_allclose(b.risk(factor * x), a.risk(x), rtol=1e-5)
    assert_allclose(b.band(factor * x), a.band(x), rtol=1e-5)
    # A density in x is one over its unit.
    moved = float(plain.exact.sum()) * np.log(factor)
    assert b.log_likelihood == pytest.approx(a.log_likelihood - moved, abs=1e-6)
    value, low, high = a.stimulus_at(risk)
    assert 0.0 < low < value < high
    assert float(a.risk(np.array(value))) == pytest.approx(risk, rel=1e-9)


def test_the_best_family_is_the_true_one_for_hundreds_of_exact_cases() -> None:
    for truth in FAMILIES:
        onset = frozen(truth, MEDIAN, SLOPE).ppf(generator(2).random(800))
        held = check(Observations(np.append(onset, 10.0), np.append(onset, np.inf)))
        assert min(FAMILIES, key=lambda name: fit_risk_curve(held, name).aic) == truth


@pytest.mark.filterwarnings("error")
@each_family
def test_a_narrow_interval_is_almost_an_exact_case(family: str) -> None:
    # ln(F(x (1 + d)) - F(x)) is ln f(x) + ln(x d) for small d.
    plain, d = mixture(40, 3, family), 1e-7
    narrow = replace(plain, high=np.where(plain.exact, plain.high * (1.0 + d), plain.high))
    a, b = fit_risk_curve(plain, family), fit_risk_curve(narrow, family)
    assert_allclose(centred(b), centred(a), rtol=1e-4, atol=1e-5)
    width = float(np.log(plain.high[plain.exact] * d).sum())
    assert b.log_likelihood == pytest.approx(a.log_likelihood + width, abs=1e-3)


@each_family
def test_intervals_of_any_width_are_continuous(family: str) -> None:
    x = np.array([5.0, 6.0, 7.5, 9.0])
    exact = fit_risk_curve(Observations(x, x.copy()), family)
    for width in 10.0 ** np.arange(-4.0, -15.0, -1.0):
        fit = fit_risk_curve(Observations(x, x * (1.0 + width)), family)
        assert fit.slope == pytest.approx(exact.slope, rel=2e-3)
        known = float(np.log(x * (1.0 + width) - x).sum())
        assert fit.log_likelihood - known == pytest.approx(exact.log_likelihood, abs=5e-3)


@pytest.mark.parametrize("shape", SHAPES)
@each_family
def test_whole_weights_count_equal_cases(family: str, shape: Shape) -> None:
    held, counts = shape(12, 1), generator(4).integers(1, 5, 12)
    weighted = replace(held, weight=counts.astype(float))
    repeated = Observations(np.repeat(held.low, counts), np.repeat(held.high, counts))
    one, other = fit_risk_curve(weighted, family), fit_risk_curve(repeated, family)
    assert one.slope == pytest.approx(other.slope, rel=1e-6)
    assert one.stimulus_at(0.5) == pytest.approx(other.stimulus_at(0.5), rel=1e-6)
    assert one.log_likelihood == pytest.approx(other.log_likelihood, rel=1e-8)
    steps, plain = estimate_steps(weighted), estimate_steps(repeated)
    assert_allclose(steps.steps()[1], plain.steps()[1], atol=2e-5)


def test_shares_of_a_population_do_not_count_cases() -> None:
    # Survey weights: what they add up to says nothing of how much is known.
    held, weight = intervals_only(60, 2), generator(1).uniform(0.2, 3.0, 60)
    one, thousand = (
        fit_risk_curve(replace(held, weight=factor * weight), "Weibull") for factor in (1.0, 1e3)
    )
    assert thousand.slope == pytest.approx(one.slope, rel=1e-7)
    assert_allclose(thousand.covariance, one.covariance, rtol=1e-6)


@pytest.mark.parametrize("sets", [40, pytest.param(150, marks=pytest.mark.slow)])
def test_intervals_of_survey_weights_cover(sets: int) -> None:
    inside = []
    for seed in range(sets):
        held, weight = intervals_only(80, 1000 + seed), generator(seed).uniform(0.1, 4.0, 80)
        _, low, high = fit_risk_curve(replace(held, weight=weight), "log-normal").stimulus_at(0.5)
        inside.append(low <= 900.0 <= high)
    # 95 % of 150: 142, with a standard error of 2.7.
    assert 132 / 150 <= np.mean(inside) <= 149 / 150


@pytest.mark.parametrize("name", ["weibull", "lognormal", ""])
def test_an_unknown_family_gives_no_curve(name: str) -> None:
    with pytest.raises(ValueError, match="family"):
        fit_risk_curve(mixture(20, 0), name)


@each_family
def test_risk_that_falls_and_cases_that_allow_no_curve_give_none(family: str) -> None:
    x, injured = censored(family, 100, 1)
    with pytest.raises(ValueError, match="risk does not rise with the stimulus"):
        fit_risk_curve(observe(x, ~injured), family)
    with pytest.raises(ValueError, match="complete separation"):
        fit_risk_curve(Observations(np.array([1.0, 0, 2]), np.array([np.inf, 3, 4])), family)
