"""A limit as a classifier: tables by hand, the ROC area as Mann and Whitney's U."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcstudy_tools import Array, generator, quiet
from numpy.testing import assert_allclose
from scipy import stats

from mcstudy.injury.classifier import judge_limit, receiver_operating_characteristic

NONE = float("nan")

HIC = np.array([300.0, 500.0, 700.0, 800.0, 900.0, 650.0, 1200.0, 400.0])
HURT = np.array([0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0])


def u_area(stimulus: Array, injured: Array) -> float:
    """Return the chance that an injured case is above an uninjured one, ties a half."""
    hurt = injured == 1.0
    found = stats.mannwhitneyu(stimulus[hurt], stimulus[~hurt]).statistic
    return float(found / (hurt.sum() * (~hurt).sum()))


def judged(stimulus: Array, risk: Array, limit: float) -> tuple[float, ...]:
    found = judge_limit(stimulus, risk, limit)
    assert found.value == limit
    return found.sensitivity, found.specificity, found.positive, found.negative


@pytest.mark.parametrize(("stimulus", "risk", "limit", "expected"), [
    # Above 700: 800 (no), 900 and 1200 (yes). Injured: 650, 700, 900, 1200. 2 of 4 injured above,
    # 3 of 4 uninjured below; 2 of 3 above are injured, 3 of 5 below are not.
    (HIC, HURT, 700.0, (2 / 4, 3 / 4, 2 / 3, 3 / 5)),
    (HIC, HURT, 600.0, (1.0, 3 / 4, 4 / 5, 1.0)),
    (HIC, HURT, 699.9, (3 / 4, 3 / 4, 3 / 4, 3 / 4)),
    # No one above: no positive predictive value; no one below: no negative one.
    (HIC, HURT, 0.0, (1.0, 0.0, 0.5, NONE)),
    (HIC, HURT, 5000.0, (0.0, 1.0, NONE, 0.5)),
    # Nobody injured, nobody spared.
    (HIC, np.zeros(8), 700.0, (NONE, 5 / 8, 0.0, 1.0)),
    (HIC, np.ones(8), 700.0, (3 / 8, NONE, 1.0, 0.0)),
    # Risks count as parts of a case: injured 1.6, of them 1.4 above 100; uninjured 1.4, 0.8 below.
    (np.array([50.0, 150.0, 250.0]), np.array([0.2, 0.5, 0.9]), 100.0,
     (1.4 / 1.6, 0.8 / 1.4, 1.4 / 2.0, 0.8 / 1.0)),
    # A blow that did not happen is below.
    (np.array([np.nan, 900.0]), np.array([0.0, 1.0]), 700.0, (1.0, 1.0, 1.0, 1.0)),
])  # fmt: skip
def test_tables_by_hand(
    stimulus: Array, risk: Array, limit: float, expected: tuple[float, ...]
) -> None:
    assert_allclose(judged(stimulus, risk, limit), expected)


@quiet(60)
@given(
    cases=st.lists(st.tuples(st.integers(0, 8), st.booleans()), min_size=2, max_size=40).filter(
        lambda held: len({hurt for _, hurt in held}) == 2
    ),
    seed=st.integers(0, 9),
)
def test_the_area_is_mann_and_whitneys_with_ties(cases: list[tuple[int, bool]], seed: int) -> None:
    # J. Hanley, B. McNeil, Radiology 143, 1982.
    x = np.array([float(place) for place, _ in cases])
    hurt = np.array([float(flag) for _, flag in cases])
    found = receiver_operating_characteristic(x, hurt)
    assert found.area == pytest.approx(u_area(x, hurt), abs=1e-12)
    for ends in (found.false_alarm, found.sensitivity):
        assert ends[0] == 0.0 and ends[-1] == pytest.approx(1.0)
        assert np.all(np.diff(ends) >= 0.0)
    order = generator(seed).permutation(len(x))
    again = receiver_operating_characteristic(x[order], hurt[order])
    assert (again.area, again.best) == (pytest.approx(found.area), found.best)


def test_the_area_of_risks_is_that_of_cases_repeated_in_proportion() -> None:
    # A risk of 0.3 is three injured and seven uninjured cases at the same stimulus.
    stimulus, risk = np.array([1.0, 2.0, 2.0, 3.0]), np.array([0.1, 0.3, 0.6, 0.9])
    hurt = np.concatenate([np.arange(10) < round(10 * p) for p in risk]).astype(float)
    expected = pytest.approx(u_area(np.repeat(stimulus, 10), hurt), abs=1e-12)
    assert receiver_operating_characteristic(stimulus, risk).area == expected


def test_every_point_of_the_curve_is_that_of_its_limit() -> None:
    found = receiver_operating_characteristic(HIC, HURT)
    for alarm, hit, limit in zip(found.false_alarm, found.sensitivity, found.limit, strict=True):
        assert judged(HIC, HURT, limit)[:2] == pytest.approx((hit, 1.0 - alarm))
    # Half-way between neighbours.
    falling = np.sort(HIC)[::-1]
    assert found.limit[0] == falling[0]
    assert_allclose(found.limit[1:-1], 0.5 * (falling[1:] + falling[:-1]))
    # W. Youden, Cancer 3, 1950: sensitivity + specificity - 1; by hand 1 + 3/4 - 1 above 500 and up
    # to 650.
    assert found.best == 575.0
    assert (found.sensitivity - found.false_alarm).max() == pytest.approx(0.75)


def test_areas_at_the_ends() -> None:
    x = np.arange(10.0)
    for stimulus, risk, area in (
        (x, x > 4.5, 1.0), (x, x < 4.5, 0.0), (np.ones(10), x > 4.5, 0.5),
        (x, np.full(10, 0.3), 0.5),
    ):  # fmt: skip
        found = receiver_operating_characteristic(stimulus, risk.astype(float))
        assert found.area == pytest.approx(area)


@pytest.mark.filterwarnings("error")
def test_blows_that_did_not_happen_are_lowest_and_tied() -> None:
    x, hurt = np.array([np.nan, 1.0, 2.0, 3.0]), np.array([0.0, 0.0, 1.0, 1.0])
    assert receiver_operating_characteristic(x, hurt).area == pytest.approx(1.0)
    x = np.array([np.nan, np.nan, np.nan, np.nan, 3.0, 4.0])
    hurt = np.array([1.0, 0.0, 1.0, 0.0, 0.0, 1.0])
    expected = u_area(np.nan_to_num(x, nan=-1.0), hurt)
    for order in (np.arange(6), np.array([1, 3, 0, 2, 4, 5])):
        found = receiver_operating_characteristic(x[order], hurt[order])
        assert found.area == pytest.approx(expected)
