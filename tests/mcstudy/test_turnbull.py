"""The estimate without a family: Turnbull's, isotonic regression, the empirical distribution."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcstudy_tools import Array, Flags, quiet
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from mcstudy.injury.observations import Observations
from mcstudy.injury.turnbull import StepRisk, estimate_steps

# Breast retraction after radiotherapy alone, months (D. Finkelstein, R. Wolfe, Biometrics 41, 1985;
# in this order in R's package interval, bcos).
COSMESIS_LOW = (
    45, 6, 0, 46, 46, 7, 17, 7, 37, 0, 4, 15, 11, 22, 46, 46, 25, 46, 26, 46, 27, 36, 46, 36, 37,
    40, 17, 46, 11, 38, 5, 37, 0, 18, 24, 36, 5, 19, 17, 24, 32, 33, 19, 37, 34, 36,
)  # fmt: skip
O = np.inf  # noqa: E741
COSMESIS_HIGH = (
    O, 10, 7, O, O, 16, O, 14, 44, 8, 11, O, 15, O, O, O, 37, O, 40, O, 34, 44, O, 48, O, O, 25, O,
    18, O, 12, O, 5, O, O, O, 11, 35, 25, O, O, O, 26, O, O, O,
)  # fmt: skip


def of(low: object, high: object) -> Observations:
    return Observations(np.array(low, dtype=float), np.array(high, dtype=float))


def value_at(steps: StepRisk, x: Array) -> Array:
    """Return the risk at x of the curve that rises at the end of each interval."""
    return np.array([float(steps.share[steps.high <= point].sum()) for point in x])


def mixed(seed: int, n: int = 40) -> Observations:
    """Return cases of all four kinds on a coarse grid, with many ties."""
    rng = np.random.default_rng(seed)
    a = rng.integers(1, 12, n).astype(float)
    b = a + rng.integers(1, 6, n)
    kind = rng.integers(0, 4, n)
    low = np.select([kind == 0, kind == 1], [0.0, a], a)
    high = np.select([kind == 0, kind == 1, kind == 2], [a, np.inf, a], b)
    return Observations(low, high)


def membership(observations: Observations, steps: StepRisk) -> Flags:
    """Return whether a case (row) holds an interval of the estimate (column), by a point in it.

    The point is the middle of an interval or the value of a point: a case (low, high] holds it if
    low < point <= high, an exact case if it is its value.
    """
    beyond = 1.0 + 2.0 * np.where(np.isinf(steps.high), steps.low, steps.high)
    inner = np.where(np.isinf(steps.high), beyond, 0.5 * (steps.low + steps.high))
    low, high = observations.low[:, None], observations.high[:, None]
    point = steps.low == steps.high
    holds = (low < inner) & (inner <= high)
    return np.where(observations.exact[:, None], point & (inner == high), holds)


def max_min(x: Array, injured: Array) -> tuple[Array, Array]:
    """Return distinct stimuli and the isotonic regression of injury, by the max-min formula.

    max over j <= i, min over k >= i of the mean of the cases from j to k (T. Robertson, F. Wright,
    R. Dykstra, Order Restricted Statistical Inference, 1988, theorem 1.4.4).
    """
    places, codes = np.unique(x, return_inverse=True)
    hurt = np.concatenate([[0.0], np.cumsum(np.bincount(codes, weights=injured))])
    count = np.concatenate([[0.0], np.cumsum(np.bincount(codes))])
    m = places.size
    means = np.array([
        [(hurt[k + 1] - hurt[j]) / (count[k + 1] - count[j]) if k >= j else np.inf
         for k in range(m)]
        for j in range(m)
    ])  # fmt: skip
    return places, np.array([max(means[j, i:].min() for j in range(i + 1)) for i in range(m)])


@quiet(40)
@given(
    cases=st.lists(st.tuples(st.integers(1, 12), st.booleans()), min_size=2, max_size=30),
)
def test_cases_censored_on_one_side_give_isotonic_regression(cases: list[tuple[int, bool]]) -> None:
    # Also with ties, with one class alone and with complete separation.
    x = np.array([float(place) for place, _ in cases])
    injured = np.array([hurt for _, hurt in cases])
    steps = estimate_steps(of(np.where(injured, 0.0, x), np.where(injured, x, np.inf)))
    places, risk = max_min(x, injured.astype(float))
    assert_allclose(value_at(steps, places), risk, atol=1e-12)
    assert float(steps.share.sum()) == pytest.approx(1.0, abs=1e-12)
    assert np.all(steps.share > 0.0)
    assert np.all(steps.low < steps.high)
    assert np.all(steps.low[1:] >= steps.high[:-1])


@pytest.mark.parametrize(("low", "high", "expected"), [
    # Injured at 1, 2 and 4, uninjured at 3 and 5: pooled 2/3 up to 3, then 1/2 of 4 and 5 pools
    # with them: 3/5. An uninjured first case at 0.5 stays apart. The rest lies beyond 5.
    ([0.5, 0, 0, 3, 0, 5], [O, 1, 2, O, 4, O], [(0.5, 1, 0.6), (5, O, 0.4)]),
    # (0, 2], (1, 3] and (2.5, inf): innermost are (1, 2] and (2.5, 3]. With p in the first the
    # likelihood is p * 1 * (1 - p), greatest at 1/2.
    ([0, 1, 2.5], [2, 3, O], [(1, 2, 0.5), (2.5, 3, 0.5)]),
    # (1, 5] holds an onset at 5, (5, 8] does not: the first shares the point, the second has a
    # share of its own.
    ([1, 5, 5], [5, 5, 8], [(5, 5, 2 / 3), (5, 8, 1 / 3)]),
    # Exact cases: the empirical distribution, ties together.
    ([2, 2, 7, 5, 2, 5], [2, 2, 7, 5, 2, 5], [(2, 2, 1 / 2), (5, 5, 1 / 3), (7, 7, 1 / 6)]),
])  # fmt: skip
def test_estimates_by_hand(
    low: list[float], high: list[float], expected: list[tuple[float, ...]]
) -> None:
    steps = estimate_steps(of(low, high))
    assert_allclose(np.stack([steps.low, steps.high, steps.share], axis=1), expected, atol=1e-7)


def test_exact_and_right_censored_cases_give_kaplan_and_meiers_curve() -> None:
    # E. Kaplan, P. Meier, JASA 53, 1958; Turnbull's estimate reduces to it. SciPy's ecdf does it.
    rng = np.random.default_rng(3)
    x = np.round(rng.weibull(2.0, 60), 1) + 0.1
    seen = rng.random(60) < 0.6
    steps = estimate_steps(of(x, np.where(seen, x, np.inf)))
    theirs = stats.ecdf(stats.CensoredData(uncensored=x[seen], right=x[~seen])).cdf
    assert_allclose(value_at(steps, theirs.quantiles), theirs.probabilities, atol=1e-6)


def test_the_textbook_example_of_interval_censored_cases() -> None:
    # The shares that R's package interval prints for the radiotherapy group [recalled]; they agree
    # with the independent EM below.
    steps = estimate_steps(of(COSMESIS_LOW, COSMESIS_HIGH))
    kept = steps.share > 1e-4
    assert_array_equal(steps.low[kept], [4, 6, 7, 11, 24, 33, 38, 46])
    assert_array_equal(steps.high[kept], [5, 7, 8, 12, 25, 34, 40, 48])
    assert_allclose(
        steps.share[kept],
        [0.0463, 0.0334, 0.0887, 0.0708, 0.0926, 0.0818, 0.1209, 0.4656],
        atol=1e-4,
    )


def independent_em(observations: Observations, steps: int = 30_000) -> Array:
    """Return the probability of every case by plain EM on points and the gaps between them."""
    low, high = observations.low, observations.high
    ends = np.unique(np.concatenate([low, high[np.isfinite(high)]]))
    cells = np.sort(np.concatenate([ends, 0.5 * (ends[1:] + ends[:-1]), [ends[-1] + 1.0]]))
    holds = (low[:, None] < cells) & (cells <= high[:, None])
    exact = low == high
    holds[exact] = cells == high[exact][:, None]
    share = holds.mean(axis=0) / holds.mean(axis=0).sum()
    for _ in range(steps):
        updated = share * (holds / (holds @ share)[:, None]).mean(axis=0)
        if np.max(np.abs(updated - share)) < 1e-12:
            break
        share = updated
    return holds @ share


@pytest.mark.parametrize("seed", range(8))
def test_the_likelihood_is_that_of_an_independent_em(seed: int) -> None:
    # The shares need not be unique, the probability of every case is (R. Gentleman, C. Geyer,
    # Biometrika 81, 1994).
    observations = of(COSMESIS_LOW, COSMESIS_HIGH) if seed == 0 else mixed(seed)
    steps = estimate_steps(observations)
    ours = membership(observations, steps) @ steps.share
    theirs = independent_em(observations)
    assert_allclose(ours, theirs, atol=2e-4)
    assert float(np.log(ours).sum()) == pytest.approx(float(np.log(theirs).sum()), abs=1e-4)


@quiet(40)
@given(seed=st.integers(0, 10_000), n=st.integers(3, 30))
def test_shares_are_self_consistent_and_of_greatest_likelihood(seed: int, n: int) -> None:
    # Turnbull 1976: a share is the mean over the cases of their chance to lie there. Gentleman and
    # Geyer 1994: at the greatest likelihood no share's gain exceeds the number of cases.
    observations = mixed(seed, n)
    if not observations.exact.any() and np.all(
        (observations.low == 0.0) | np.isinf(observations.high)
    ):
        return
    steps = estimate_steps(observations)
    holds = membership(observations, steps)
    chance = holds @ steps.share
    assert np.all(chance > 0.0)
    consistent = steps.share * (holds / chance[:, None]).mean(axis=0)
    assert_allclose(steps.share, consistent, atol=1e-7)
    assert float(steps.share.sum()) == pytest.approx(1.0, abs=1e-9)
    assert np.all(steps.share >= 0.0)
    assert np.all((holds / chance[:, None]).mean(axis=0) <= 1.0 + 2e-3)
    assert np.all(np.diff(steps.high) >= 0.0)
    order = np.random.default_rng(seed).permutation(n)
    other = estimate_steps(Observations(observations.low[order], observations.high[order]))
    assert_array_equal(other.low, steps.low)
    assert_allclose(other.share, steps.share, atol=1e-7)


def test_the_drawn_curve_rises_at_the_end_of_each_interval() -> None:
    shares = np.array([0.2, 0.5, 0.3])
    steps = StepRisk(np.array([0.0, 2.0, 5.0]), np.array([1.0, 3.0, np.inf]), shares)
    x, risk = steps.steps()
    assert_allclose(x, [0, 1, 1, 3, 3])
    assert_allclose(risk, [0, 0, 0.2, 0.2, 0.7])
