"""Observations and tables of cases: what is told from what, and what is refused."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal

from mcstudy.errors import UserError
from mcstudy.injury.cases import observations_of, read_cases
from mcstudy.injury.observations import Observations, check, observe

X = np.array([100.0, 200.0, 300.0, 400.0])
HURT = np.array([False, True, False, True])
NO = np.zeros(4, dtype=bool)
OPEN = np.inf


def table(**columns: object) -> pd.DataFrame:
    return pd.DataFrame({"hic15": [100.0, 200.0, 300.0, 400.0], **columns})


def of(rows: pd.DataFrame, stimulus: str = "hic15", level: int = 3) -> Observations:
    return observations_of(rows, stimulus, level, "cases.csv")


def test_injured_cases_are_left_censored_uninjured_right_censored_and_exact_ones_points() -> None:
    found = observe(X, HURT)
    assert_array_equal(found.low, [100.0, 0.0, 300.0, 0.0])
    assert_array_equal(found.high, [OPEN, 200.0, OPEN, 400.0])
    assert_array_equal(found.injured, HURT)
    assert_array_equal(found.exact, NO)
    assert_array_equal(found.stimulus, X)
    assert found.size == 4
    exact = observe(list(X), [0, 1, 0, 1], np.array([False, False, False, True]))
    assert_array_equal(exact.low, [100.0, 0.0, 300.0, 400.0])
    assert_array_equal(exact.exact, [False, False, False, True])
    assert_array_equal(exact.stimulus, X)
    one_less = exact.without(1)
    assert one_less.size == 3
    assert_array_equal(one_less.stimulus, [100.0, 300.0, 400.0])
    # Of an interval it is the middle.
    held = Observations(np.array([100.0, 0.0, 50.0]), np.array([300.0, 80.0, OPEN]))
    assert_array_equal(held.stimulus, [200.0, 80.0, 50.0])
    assert_array_equal(held.injured, [True, True, False])


@pytest.mark.parametrize("bad", [-1.0, 0.0, np.nan, np.inf, -np.inf])
def test_a_stimulus_that_is_no_positive_number_is_refused(bad: float) -> None:
    for injured, exact in ((False, False), (True, False), (True, True)):
        with pytest.raises(ValueError, match="case 5: the stimulus must be a positive number"):
            observe(np.append(X, bad), np.append(HURT, injured), np.append(NO, exact))


@pytest.mark.parametrize(("low", "high", "message"), [
    ([100, 300, 0], [OPEN, 200, 250], "case 2: the interval 300 to 200 is empty"),
    ([100, 0, 300, 0], [OPEN, OPEN, OPEN, 400], "case 2: .* neither bound is one"),
    ([0, 0, 0], [1, 2, 3], "all cases are injured.*add uninjured"),
    ([1, 2, 3], [OPEN, OPEN, OPEN], "no case is injured.*add injured"),
    ([], [], "0 cases are too few"),
    ([1, 0], [OPEN, 2], "2 cases are too few"),
    ([100, 200, 0, 0], [OPEN, OPEN, 300, 400],
     r"up to 200\) and the injured \(from 300\) do not overlap.*complete separation"),
    # Quasi-complete: both at 300, and 300 tells the others apart. No finite slope is the best.
    ([100, 300, 0, 0], [OPEN, OPEN, 300, 400], "do not overlap"),
    # All of (100, 500], (200, 600] and (300, inf) hold (300, 500]: a step there has likelihood 1.
    ([100, 200, 300], [500, 600, OPEN], "do not overlap"),
    # A step at an exact case, and at equal ones.
    ([1, 2, 3, 4, 0, 0], [OPEN, OPEN, OPEN, 4, 5, 6], "separation"),
    ([1, 2, 3, 4, 4, 4], [OPEN, OPEN, OPEN, 4, 4, 4], "separation"),
    ([0, 99, 1e-101], [3, OPEN, OPEN], "case 3: the stimulus must be a positive number"),
    ([0, 99, 1], [3, OPEN, 1e101], "case 3: the stimulus must be a positive number, given 1, "),
])  # fmt: skip
def test_cases_that_allow_no_curve_are_refused_with_the_cure(
    low: list[float], high: list[float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        check(Observations(np.array(low, dtype=float), np.array(high, dtype=float)))


def test_cases_that_overlap_by_one_pair_are_enough() -> None:
    held = Observations(np.array([100.0, 0.0, 300.0]), np.array([OPEN, 200.0, 350.0]))
    assert check(held) is held


@pytest.mark.parametrize(("weight", "message"), [
    (0.0, "case 3: the weight must be a positive number, given 0"), (np.nan, "case 3: the weight"),
    (1.1e9, "the weights go from 1 to 1.1e[+]09: a row may not stand for"),
])  # fmt: skip
def test_weights_that_are_none_or_too_unequal_are_refused(weight: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        observe(X, HURT, weight=np.array([1.0, 1.0, weight, 1.0]))
    assert observe(X, HURT, weight=np.array([1.0, 1.0, 1e9, 1.0])).counted
    assert not observe(X, HURT, weight=np.array([1.0, 1.0, 1.5, 1.0])).counted


@pytest.mark.parametrize("flags", [
    [0, 1, 0, 1], [False, True, False, True], ["no", "Yes", " 0 ", "TRUE"], [0.0, 1.0, 0.0, 1.0],
])  # fmt: skip
def test_a_table_with_injured_gives_the_same_observations(flags: list[object]) -> None:
    found = of(table(injured=flags, exact=["", "1", None, "0"]))
    assert_array_equal(found.low, [100.0, 200.0, 300.0, 0.0])
    assert_array_equal(found.high, observe(X, HURT).high)
    assert_array_equal(found.exact, [False, True, False, False])


@pytest.mark.parametrize(
    ("level", "hurt"), [(2, [0, 1, 0, 1]), (3, [0, 0, 0, 1]), (1, [0, 1, 1, 1])]
)
def test_a_table_with_ais_counts_the_level_and_worse(level: int, hurt: list[int]) -> None:
    more = pd.DataFrame({"hic15": [450.0, 50.0], "ais": [0, 6]})
    found = of(pd.concat([table(ais=[0, 2, 1, 5]), more]), level=level)
    assert_array_equal(found.injured, [*map(bool, hurt), False, True])


def test_a_table_with_bounds_and_open_sides() -> None:
    # Other programs write infinite bounds for open ones.
    low, high = [100.0, np.nan, 300.0, 150.0, -np.inf], [np.nan, 200.0, 400.0, 150.0, 320.0]
    found = of(pd.DataFrame({"f_low": low, "f_high": high}), "f")
    assert_array_equal(found.low, [100.0, 0.0, 300.0, 150.0, 0.0])
    assert_array_equal(found.high, [OPEN, 200.0, 400.0, 150.0, 320.0])


def test_weights_come_from_a_column_of_the_table() -> None:
    assert of(table(injured=[0, 1, 0, 1], weight=[3, 1, 2, 5])).weights.tolist() == [3, 1, 2, 5]
    with pytest.raises(UserError, match=r"cases.csv: case 3: the weight must be a positive number"):
        of(table(injured=[0, 1, 0, 1], weight=[3, 1, -1, 5]))


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (table(), r"cases.csv: has neither a column 'injured' nor 'ais'"),
        (pd.DataFrame({"bric": [1.0], "injured": [1]}),
         "cases.csv: has no column 'hic15'; it has bric, injured"),
        (table(injured=[0, 1, 2, 1]), "column 'injured', case 3: '2' is neither 0 nor 1"),
        (table(injured=[0, None, 0, 1]), "column 'injured', case 2: .* is neither 0 nor 1"),
        (table(injured=[0, 1, 0, 1], exact=[0, 0, 0, "maybe"]), "'exact', case 4: 'maybe'"),
        (table(injured=[0, 1, 0, 1], exact=[1, 0, 0, 0]), "cases.csv: case 1 is exact and not"),
        (table(ais=[0, "severe", 0, 3]), "column 'ais', case 2: 'severe' is no number"),
        (pd.DataFrame({"hic15": ["1", "x", "3"], "injured": [0, 1, 0]}),
         "column 'hic15', case 2: 'x' is no number"),
        (pd.DataFrame({"hic15": [1.0, None, 3.0], "injured": [0, 1, 0]}),
         "cases.csv: case 2: the stimulus must be a positive number"),
        (table(injured=[0, 0, 1, 1]), "cases.csv: .*complete separation"),
        # AIS codes severity 1 to 6, 0 for none here; 9 is "injured, severity unknown" (AAAM, AIS
        # 2005). What is unknown is not taken as uninjured.
        *((table(ais=[0, 4, level, 3]), "case 3") for level in (9, 7, -1, 2.5, None)),
        (pd.DataFrame({"hic15_low": [100.0, np.nan, 300.0], "hic15_high": [np.nan, np.nan, 400.0]}),
         "case 2"),
        *((pd.DataFrame({"hic15_low": [1.0, low, 0.1], "hic15_high": [6.0, high, OPEN]}),
           "case 2: the stimulus must be a positive number")
          for low, high in ((OPEN, 6.0), (3.0, -OPEN))),
    ],
)  # fmt: skip
def test_wrong_tables_are_the_users_and_name_the_place(rows: pd.DataFrame, message: str) -> None:
    with pytest.raises(UserError, match=message):
        of(rows)


def test_csv_and_parquet_are_read_alike(tmp_path: Path) -> None:
    held = table(injured=[0, 1, 0, 1])
    held.to_csv(tmp_path / "cases.csv", index=False)
    held.to_parquet(tmp_path / "cases.parquet")
    for name in ("cases.csv", "cases.parquet"):
        found = read_cases(tmp_path / name, "hic15")
        pd.testing.assert_frame_equal(found[["hic15"]], held[["hic15"]])
    (tmp_path / "bounds.csv").write_text("f_low,f_high\n100,\n,200\n300,400\n", encoding="utf-8")
    found = of(read_cases(tmp_path / "bounds.csv", "f"), "f")
    assert_array_equal(found.low, [100.0, 0.0, 300.0])
    assert_array_equal(found.high, [OPEN, 200.0, 400.0])


def test_files_that_cannot_be_read_are_the_users(tmp_path: Path) -> None:
    (tmp_path / "empty.csv").write_text("", encoding="utf-8")
    (tmp_path / "torn.parquet").write_bytes(b"PAR1 torn")
    (tmp_path / "binary.csv").write_bytes(b"\x01\x00\x81")
    for name, message in {
        "missing.csv": "cannot be read", "empty.csv": "line 1 must name the columns",
        "torn.parquet": "is no Parquet table", "binary.csv": "cannot be read",
        "missing.parquet": "cannot be read", ".": "cannot be read",
    }.items():  # fmt: skip
        with pytest.raises(UserError, match=message) as caught:
            read_cases(tmp_path / name, "f")
        assert str(caught.value).startswith(str(tmp_path / name))
