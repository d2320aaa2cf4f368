"""Tables of cases: one row a case, with stimulus and injury outcome."""

import numbers
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.errors import UserError
from mcstudy.injury.observations import Observations, check, observe
from mcstudy.tables import read_csv

Array = NDArray[np.float64]

INJURED, EXACT, LEVEL, WEIGHT = "injured", "exact", "ais", "weight"
"""Columns beside the stimulus."""
_YES, _NO = ("1", "1.0", "true", "yes"), ("0", "0.0", "false", "no")
_MISSING = ("na", "n/a", "nan", "null", "none", "<na>")
"""Words of other programs for an empty field."""


def read_cases(path: Path, stimulus: str) -> pd.DataFrame:
    """Read a table of cases, CSV or Parquet.

    Parameters
    ----------
    path : Path
        Of the table.
    stimulus : str
        Column that the risk depends on.

    Returns
    -------
    DataFrame
        All columns; of a CSV the stimulus, its bounds, AIS and weight as numbers, the rest as text.

    Raises
    ------
    UserError
        If the file cannot be read, or holds something that is no number where one must be; the
        message names the line.
    """
    if path.suffix == ".parquet":
        return read_parquet(path)
    table = read_csv(path, text=(INJURED, EXACT))
    measured = {stimulus, f"{stimulus}_low", f"{stimulus}_high", LEVEL, WEIGHT}
    return pd.DataFrame(
        {
            name: table.numbers(name, missing=_MISSING, infinite=True)
            if name in measured
            else fields
            for name, fields in table.columns.items()
        }
    )


def read_parquet(path: Path) -> pd.DataFrame:
    """Read a Parquet table.

    Raises
    ------
    UserError
        If the file cannot be read or names a column twice.
    """
    try:
        table = pd.read_parquet(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error})") from None
    except Exception as error:
        # The library raises various exceptions for a damaged file.
        raise UserError(f"{path}: is no Parquet table ({str(error)[:200]})") from None
    if table.columns.duplicated().any():
        raise UserError(f"{path}: names a column twice")
    return table


def observations_of(table: pd.DataFrame, stimulus: str, level: int, source: str) -> Observations:
    """Return the observations of a table of cases.

    Parameters
    ----------
    table : DataFrame
        With either a column ``stimulus`` and ``injured`` (0 or 1) or ``ais``, and optionally
        ``exact`` (1 where the stimulus of injury was measured); or columns ``<stimulus>_low`` and
        ``<stimulus>_high`` (empty or infinite: open). ``weight`` holds how many cases a row stands
        for.
    stimulus : str
        Name of the column.
    level : int
        AIS that counts as injured where the table has ``ais``.
    source : str
        Name for messages.

    Raises
    ------
    UserError
        If a column is missing or wrong, or the cases allow no risk curve.
    """
    try:
        weight = _numbers(table, WEIGHT) if WEIGHT in table.columns else None
        if {f"{stimulus}_low", f"{stimulus}_high"} <= set(table.columns):
            low, high = (_numbers(table, f"{stimulus}_{side}") for side in ("low", "high"))
            # Other programs write a case without a bound as infinite.
            open_below = np.isnan(low) | (low == -np.inf)
            return check(
                Observations(
                    np.where(open_below, 0.0, low), np.where(np.isnan(high), np.inf, high), weight
                )
            )
        values = _numbers(table, stimulus)
        if INJURED in table.columns:
            injured = _flags(table, INJURED)
        elif LEVEL in table.columns:
            injured = _levels(table) >= level
        else:
            raise ValueError(f"has neither a column {INJURED!r} nor {LEVEL!r}")
        exact = _flags(table, EXACT, empty=True) if EXACT in table.columns else None
        return observe(values, injured, exact, weight)
    except ValueError as error:
        raise UserError(f"{source}: {error}") from None


def _numbers(table: pd.DataFrame, name: str) -> Array:
    """Return a column as numbers, NaN where it is empty."""
    if name not in table.columns:
        raise ValueError(f"has no column {name!r}; it has {', '.join(map(str, table.columns))}")
    found = np.full(len(table), np.nan)
    for k, value in enumerate(table[name]):
        number = _number(value)
        if number is None:
            raise ValueError(f"column {name!r}, case {k + 1}: {str(value)[:40]!r} is no number")
        found[k] = number
    return found


def _number(value: Any) -> float | None:
    """Return a number, NaN for an empty field, None for anything else."""
    if value is None or value is pd.NA or value is pd.NaT:
        return np.nan
    if isinstance(value, bool | np.bool_):
        return None
    if isinstance(value, str) and value.strip().lower() in ("", *_MISSING):
        return np.nan
    if not isinstance(value, str | numbers.Real):
        return None
    try:
        return float(value)
    except (ValueError, OverflowError):
        return None


def _levels(table: pd.DataFrame) -> Array:
    values = _numbers(table, LEVEL)
    wrong = np.flatnonzero(~np.isin(values, range(7)))
    if wrong.size:
        raise ValueError(
            f"column {LEVEL!r}, case {wrong[0] + 1}: must be 0 to 6, given {values[wrong[0]]:g}; "
            "leave out cases of unknown severity"
        )
    return values


def _flags(table: pd.DataFrame, name: str, *, empty: bool = False) -> NDArray[np.bool_]:
    """Return the flags of the cases; with ``empty``, an empty field counts as no."""
    words = [str(value).strip().lower() for value in table[name]]
    allowed = {*_YES, *_NO, *(("", *_MISSING) if empty else ())}
    for k, word in enumerate(words):
        if word not in allowed:
            raise ValueError(
                f"column {name!r}, case {k + 1}: {str(table[name].iloc[k])[:40]!r} is neither 0 "
                "nor 1"
            )
    return np.array([word in _YES for word in words], dtype=bool)
