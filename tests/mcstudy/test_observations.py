"""Observations and tables of cases: what is told from what, and what is refused."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mcstudy.errors import UserError
from mcstudy.injury.cases import observations_of, read_cases
from mcstudy.injury.observations import Observations, check, observe

X = np.array([100.0, 200.0, 300.0, 400.0])
HURT = np.array([False, True, False, True])
OPEN = np.inf


def table(**columns: object) -> pd.DataFrame:
    return pd.DataFrame({"hic15": [100.0, 200.0, 300.0, 400.0], **columns})


# -- observe ---------------------------------------------------------------------------------


def test_injured_cases_are_left_and_uninjured_right_censored() -> None:
    # Module text: injured (0, x), uninjured (x, infinity), exact (x, x).
    found = observe(X, HURT)
    np.testing.assert_array_equal(found.low, [100.0, 0.0, 300.0, 0.0])
    np.testing.assert_array_equal(found.high, [OPEN, 200.0, OPEN, 400.0])
    np.testing.assert_array_equal(found.injured, HURT)
    np.testing.assert_array_equal(found.exact, [False] * 4)
    np.testing.assert_array_equal(found.stimulus, X)
    assert found.size == 4


def test_an_exact_case_is_a_point() -> None:
    found = observe(X, HURT, np.array([False, False, False, True]))
    np.testing.assert_array_equal(found.low, [100.0, 0.0, 300.0, 400.0])
    np.testing.assert_array_equal(found.exact, [False, False, False, True])
    np.testing.assert_array_equal(found.stimulus, X)


def test_the_stimulus_of_an_interval_is_its_middle() -> None:
    held = Observations(np.array([100.0, 0.0, 50.0]), np.array([300.0, 80.0, OPEN]))
    np.testing.assert_array_equal(held.stimulus, [200.0, 80.0, 50.0])
    np.testing.assert_array_equal(held.injured, [True, True, False])


def test_without_leaves_out_one_case() -> None:
    found = observe(X, HURT).without(1)
    assert found.size == 3
    np.testing.assert_array_equal(found.stimulus, [100.0, 300.0, 400.0])


def test_flags_may_be_zeros_and_ones() -> None:
    a, b = observe(X, HURT), observe(list(X), [0, 1, 0, 1])
    np.testing.assert_array_equal(a.low, b.low)
    np.testing.assert_array_equal(a.high, b.high)


def test_an_exact_case_that_is_not_injured_is_refused() -> None:
    with pytest.raises(ValueError, match="case 3 is exact and not injured"):
        observe(X, HURT, np.array([False, False, True, False]))


@pytest.mark.parametrize("injured", [False, True])
@pytest.mark.parametrize("bad", [-1.0, np.nan, -np.inf])
def test_a_stimulus_that_is_no_positive_number_is_refused(bad: float, injured: bool) -> None:
    with pytest.raises(ValueError, match=r"case 5: the stimulus must be a positive number, given"):
        observe(np.append(X, bad), np.append(HURT, injured))


@pytest.mark.parametrize(("bad", "injured"), [
    (0.0, True), (np.inf, False), (0.0, False), (np.inf, True),
])  # fmt: skip
def test_zero_and_infinity_are_refused(bad: float, injured: bool) -> None:
    with pytest.raises(ValueError, match="case 5: the stimulus must be a positive number"):
        observe(np.append(X, bad), np.append(HURT, injured))


@pytest.mark.parametrize("bad", [0.0, -3.0, np.nan, np.inf])
def test_an_exact_stimulus_that_is_no_positive_number_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="case 5: the stimulus must be a positive number"):
        observe(np.append(X, bad), np.append(HURT, True), np.append([False] * 4, True))


# -- check -----------------------------------------------------------------------------------


def test_an_empty_interval_is_refused() -> None:
    low, high = np.array([100.0, 300.0, 0.0]), np.array([OPEN, 200.0, 250.0])
    with pytest.raises(ValueError, match="case 2: the interval 300 to 200 is empty"):
        check(Observations(low, high))


def test_one_class_alone_is_refused_with_the_cure() -> None:
    with pytest.raises(ValueError, match=r"all cases are injured.*add uninjured"):
        observe(X, np.ones(4, dtype=bool))
    with pytest.raises(ValueError, match=r"no case is injured.*add injured"):
        observe(X, np.zeros(4, dtype=bool))


@pytest.mark.parametrize("n", [0, 1, 2])
def test_too_few_cases_are_refused(n: int) -> None:
    with pytest.raises(ValueError, match=f"{n} cases are too few"):
        observe(X[:n], HURT[:n])


def test_separated_cases_are_refused_with_the_two_ends() -> None:
    with pytest.raises(ValueError, match=r"up to 200\) and the injured \(from 300\).*separation"):
        observe(X, np.array([False, False, True, True]))


def test_cases_that_overlap_by_one_pair_are_enough() -> None:
    assert observe(X, np.array([False, True, False, True])).size == 4


def test_check_returns_what_it_was_given() -> None:
    held = Observations(np.array([100.0, 0.0, 300.0]), np.array([OPEN, 200.0, 350.0]))
    assert check(held) is held


# -- tables of cases -------------------------------------------------------------------------


def test_a_table_with_injured_gives_the_same_observations() -> None:
    for flags in ([0, 1, 0, 1], [False, True, False, True], ["no", "Yes", " 0 ", "TRUE"],
                  [0.0, 1.0, 0.0, 1.0]):  # fmt: skip
        found = observations_of(table(injured=flags), "hic15", 3, "cases.csv")
        np.testing.assert_array_equal(found.low, observe(X, HURT).low)
        np.testing.assert_array_equal(found.high, observe(X, HURT).high)


@pytest.mark.parametrize(
    ("level", "hurt"), [(2, [0, 1, 0, 1]), (3, [0, 0, 0, 1]), (1, [0, 1, 1, 1])]
)
def test_a_table_with_ais_counts_the_level_and_worse(level: int, hurt: list[int]) -> None:
    held = pd.concat(
        [table(ais=[0, 2, 1, 5]), pd.DataFrame({"hic15": [450.0, 50.0], "ais": [0, 6]})]
    )
    found = observations_of(held, "hic15", level, "cases.csv")
    np.testing.assert_array_equal(found.injured, [*map(bool, hurt), False, True])


def test_a_table_with_exact_cases() -> None:
    found = observations_of(table(injured=[0, 1, 0, 1], exact=[0, 0, 0, 1]), "hic15", 3, "c")
    np.testing.assert_array_equal(found.exact, [False, False, False, True])


def test_a_table_with_bounds_and_empty_sides() -> None:
    held = pd.DataFrame(
        {"f_low": [100.0, np.nan, 300.0, 150.0], "f_high": [np.nan, 200.0, 400.0, 150.0]}
    )
    found = observations_of(held, "f", 3, "cases.csv")
    np.testing.assert_array_equal(found.low, [100.0, 0.0, 300.0, 150.0])
    np.testing.assert_array_equal(found.high, [OPEN, 200.0, 400.0, 150.0])


@pytest.mark.parametrize(
    ("held", "message"),
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
        (table(injured=[0, 0, 0, 0]), "cases.csv: no case is injured"),
    ],
)  # fmt: skip
def test_wrong_tables_are_the_users_and_name_the_place(held: pd.DataFrame, message: str) -> None:
    # CONTRIBUTING.md: errors name the place and the cure.
    with pytest.raises(UserError, match=message):
        observations_of(held, "hic15", 3, "cases.csv")


def test_a_case_without_an_ais_is_not_taken_as_uninjured() -> None:
    # CONTRIBUTING.md: never a silent number.
    with pytest.raises(UserError, match="case 3"):
        observations_of(table(ais=[0, 4, None, 3]), "hic15", 3, "cases.csv")


@pytest.mark.parametrize("level", [9, 7, -1, 2.5])
def test_an_ais_that_is_none_is_refused(level: float) -> None:
    # AIS codes severity 1 to 6, 0 for none here; 9 is "injured, severity unknown" (AAAM, AIS 2005).
    with pytest.raises(UserError, match="case 3"):
        observations_of(table(ais=[0, 4, level, 3]), "hic15", 3, "cases.csv")


def test_a_case_without_either_bound_is_refused() -> None:
    held = pd.DataFrame(
        {"f_low": [100.0, np.nan, 300.0, np.nan], "f_high": [np.nan, 200.0, 400.0, np.nan]}
    )
    with pytest.raises(UserError, match="case 4"):
        observations_of(held, "f", 3, "cases.csv")


# -- files -----------------------------------------------------------------------------------


def test_csv_and_parquet_are_read_alike(tmp_path: Path) -> None:
    held = table(injured=[0, 1, 0, 1])
    held.to_csv(tmp_path / "cases.csv", index=False)
    held.to_parquet(tmp_path / "cases.parquet")
    for name in ("cases.csv", "cases.parquet"):
        pd.testing.assert_frame_equal(
            read_cases(tmp_path / name, "hic15")[["hic15"]], held[["hic15"]]
        )


def test_files_that_cannot_be_read_are_the_users(tmp_path: Path) -> None:
    (tmp_path / "empty.csv").write_text("", encoding="utf-8")
    (tmp_path / "torn.parquet").write_bytes(b"PAR1 torn")
    (tmp_path / "binary.csv").write_bytes(b"\x01\x00\x81")
    for name, message in {
        "missing.csv": "cannot be read", "empty.csv": "line 1 must name the columns",
        "torn.parquet": "is no Parquet table", "binary.csv": "cannot be read",
        "missing.parquet": "cannot be read",
    }.items():  # fmt: skip
        with pytest.raises(UserError, match=rf"{name}: {message}"):
            read_cases(tmp_path / name, "f")


def test_a_folder_is_no_table(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot be read"):
        read_cases(tmp_path, "f")


def test_a_csv_from_a_spreadsheet_is_read_with_empty_bounds(tmp_path: Path) -> None:
    path = tmp_path / "bounds.csv"
    path.write_text("f_low,f_high\n100,\n,200\n300,400\n", encoding="utf-8")
    found = observations_of(read_cases(path, "f"), "f", 3, "bounds.csv")
    np.testing.assert_array_equal(found.low, [100.0, 0.0, 300.0])
    np.testing.assert_array_equal(found.high, [OPEN, 200.0, 400.0])
