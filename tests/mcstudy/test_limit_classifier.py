"""A limit as a classifier: tables by hand, the ROC area as Mann and Whitney's U."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from mcstudy.injury.classifier import judge_limit, receiver_operating_characteristic

Array = NDArray[np.float64]

QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=60)
NONE = float("nan")

HIC = np.array([300.0, 500.0, 700.0, 800.0, 900.0, 650.0, 1200.0, 400.0])
HURT = np.array([0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0])


def u_area(stimulus: Array, injured: Array) -> float:
    """Return the chance that an injured case is above an uninjured one, ties a half."""
    hurt = injured == 1.0
    found = stats.mannwhitneyu(stimulus[hurt], stimulus[~hurt]).statistic
    return float(found / (hurt.sum() * (~hurt).sum()))


# -- a limit ---------------------------------------------------------------------------------


def test_a_table_by_hand() -> None:
    # Above 700: 800 (no), 900 and 1200 (yes). Injured: 650, 700, 900, 1200. 2 of 4 injured above,
    # 3 of 4 uninjured below; 2 of 3 above are injured, 3 of 5 below are not.
    found = judge_limit(HIC, HURT, 700.0)
    assert found.value == 700.0
    assert found.sensitivity == pytest.approx(2 / 4)
    assert found.specificity == pytest.approx(3 / 4)
    assert found.positive == pytest.approx(2 / 3)
    assert found.negative == pytest.approx(3 / 5)


@pytest.mark.parametrize(
    ("limit", "expected"),
    [(0.0, (1.0, 0.0, 0.5, NONE)), (5000.0, (0.0, 1.0, NONE, 0.5)),
     (600.0, (1.0, 3 / 4, 4 / 5, 1.0)), (699.9, (3 / 4, 3 / 4, 3 / 4, 3 / 4))],
)  # fmt: skip
def test_other_limits_by_hand(limit: float, expected: tuple[float, ...]) -> None:
    # No one above: no positive predictive value; no one below: no negative one.
    found = judge_limit(HIC, HURT, limit)
    values = (found.sensitivity, found.specificity, found.positive, found.negative)
    np.testing.assert_allclose(values, expected)


def test_risks_count_as_parts_of_a_case() -> None:
    # Injured 0.2 + 0.5 + 0.9 = 1.6, of them 1.4 above 100; uninjured 1.4, of them 0.8 below.
    found = judge_limit(np.array([50.0, 150.0, 250.0]), np.array([0.2, 0.5, 0.9]), 100.0)
    values = (found.sensitivity, found.specificity, found.positive, found.negative)
    np.testing.assert_allclose(values, [1.4 / 1.6, 0.8 / 1.4, 1.4 / 2.0, 0.8 / 1.0])


def test_a_blow_that_did_not_happen_is_below() -> None:
    found = judge_limit(np.array([np.nan, 900.0]), np.array([0.0, 1.0]), 700.0)
    assert (found.sensitivity, found.specificity, found.positive, found.negative) == (1, 1, 1, 1)


def test_nobody_injured_has_no_sensitivity() -> None:
    found = judge_limit(HIC, np.zeros(8), 700.0)
    assert np.isnan(found.sensitivity)
    assert found.positive == 0.0
    assert np.isnan(judge_limit(HIC, np.ones(8), 700.0).specificity)


def test_a_limit_of_risks_is_the_mean_of_many_drawn_tables() -> None:
    # The reason for risks instead of draws: 20,000 draws of 0 and 1 agree within 4 deviations.
    rng = np.random.default_rng(3)
    stimulus, risk = rng.random(30), rng.random(30)
    drawn = (rng.random((20_000, 30)) < risk).astype(float)
    hits = drawn[:, stimulus > 0.4].sum(axis=1)
    found = judge_limit(stimulus, risk, 0.4)
    expected = hits.mean() / drawn.sum(axis=1).mean()
    assert found.sensitivity == pytest.approx(expected, abs=0.004)


# -- the curve -------------------------------------------------------------------------------


@QUIET
@given(
    cases=st.lists(st.tuples(st.integers(0, 8), st.booleans()), min_size=2, max_size=40).filter(
        lambda held: len({hurt for _, hurt in held}) == 2
    )
)
def test_the_area_is_mann_and_whitneys_u_with_ties(cases: list[tuple[int, bool]]) -> None:
    # J. Hanley, B. McNeil, Radiology 143, 1982.
    x = np.array([float(place) for place, _ in cases])
    hurt = np.array([float(flag) for _, flag in cases])
    found = receiver_operating_characteristic(x, hurt)
    assert found.area == pytest.approx(u_area(x, hurt), abs=1e-12)
    assert (found.false_alarm[0], found.sensitivity[0]) == (0.0, 0.0)
    assert found.false_alarm[-1] == pytest.approx(1.0)
    assert found.sensitivity[-1] == pytest.approx(1.0)
    assert np.all(np.diff(found.false_alarm) >= 0.0)
    assert np.all(np.diff(found.sensitivity) >= 0.0)


def test_the_area_of_risks_is_that_of_cases_repeated_in_proportion() -> None:
    # A risk of 0.3 is three injured and seven uninjured cases at the same stimulus.
    stimulus, risk = np.array([1.0, 2.0, 2.0, 3.0]), np.array([0.1, 0.3, 0.6, 0.9])
    x = np.repeat(stimulus, 10)
    hurt = np.concatenate([np.arange(10) < round(10 * p) for p in risk]).astype(float)
    found = receiver_operating_characteristic(stimulus, risk)
    assert found.area == pytest.approx(u_area(x, hurt), abs=1e-12)


def test_every_point_of_the_curve_is_that_of_its_limit() -> None:
    found = receiver_operating_characteristic(HIC, HURT)
    for alarm, hit, limit in zip(found.false_alarm, found.sensitivity, found.limit, strict=True):
        above = limit < HIC
        assert hit == pytest.approx(HURT[above].sum() / 4.0)
        assert alarm == pytest.approx((1.0 - HURT[above]).sum() / 4.0)
    # Half-way between neighbours.
    falling = np.sort(HIC)[::-1]
    assert found.limit[0] == falling[0]
    np.testing.assert_allclose(found.limit[1:-1], 0.5 * (falling[1:] + falling[:-1]))


def test_areas_at_the_ends() -> None:
    x = np.arange(10.0)
    assert receiver_operating_characteristic(x, (x > 4.5).astype(float)).area == pytest.approx(1.0)
    assert receiver_operating_characteristic(x, (x < 4.5).astype(float)).area == pytest.approx(0.0)
    assert receiver_operating_characteristic(np.ones(10), (x > 4.5) * 1.0).area == pytest.approx(
        0.5
    )
    assert receiver_operating_characteristic(x, np.full(10, 0.3)).area == pytest.approx(0.5)


def test_the_order_of_the_cases_does_not_count() -> None:
    order = np.random.default_rng(1).permutation(8)
    a = receiver_operating_characteristic(HIC, HURT)
    b = receiver_operating_characteristic(HIC[order], HURT[order])
    assert a.area == pytest.approx(b.area)
    assert a.best == b.best


def test_the_best_limit_has_the_largest_youden_index() -> None:
    # W. Youden, Cancer 3, 1950: sensitivity + specificity - 1; by hand 1 + 3/4 - 1 above 500 and up
    # to 650.
    found = receiver_operating_characteristic(HIC, HURT)
    assert found.best == 575.0
    assert (found.sensitivity - found.false_alarm).max() == pytest.approx(0.75)


def test_the_best_limit_judged_as_a_limit_has_the_curves_youden_index() -> None:
    roc = receiver_operating_characteristic(HIC, HURT)
    judged = judge_limit(HIC, HURT, roc.best)
    best = float((roc.sensitivity - roc.false_alarm).max())
    assert judged.sensitivity + judged.specificity - 1.0 == pytest.approx(best)


@pytest.mark.filterwarnings("error")
def test_one_blow_that_did_not_happen_is_lowest() -> None:
    found = receiver_operating_characteristic(
        np.array([np.nan, 1.0, 2.0, 3.0]), np.array([0.0, 0.0, 1.0, 1.0])
    )
    assert found.area == pytest.approx(1.0)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_several_blows_that_did_not_happen_are_tied() -> None:
    x = np.array([np.nan, np.nan, np.nan, np.nan, 3.0, 4.0])
    hurt = np.array([1.0, 0.0, 1.0, 0.0, 0.0, 1.0])
    expected = u_area(np.nan_to_num(x, nan=-1.0), hurt)
    for order in (np.arange(6), np.array([1, 3, 0, 2, 4, 5])):
        found = receiver_operating_characteristic(x[order], hurt[order])
        assert found.area == pytest.approx(expected)


@pytest.mark.filterwarnings("error")
def test_several_blows_that_did_not_happen_do_not_warn() -> None:
    receiver_operating_characteristic(
        np.array([np.nan, np.nan, 2.0, 3.0]), np.array([0.0, 0.0, 0.4, 0.9])
    )
