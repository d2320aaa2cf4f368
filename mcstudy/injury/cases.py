"""Tables of cases: one row a case, its stimulus and whether it was injured."""

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.errors import UserError
from mcstudy.injury.observations import Observations, check, observe

_YES, _NO = ("1", "1.0", "true", "yes"), ("0", "0.0", "false", "no")


def read_table(path: Path) -> pd.DataFrame:
    """Read a table of cases, CSV or Parquet.

    Raises
    ------
    UserError
        If the file cannot be read.
    """
    try:
        return pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path)
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: cannot be read ({' '.join(str(error).split())[:200]})") from None


def observations_of(table: pd.DataFrame, stimulus: str, level: int, source: str) -> Observations:
    """Return the observations of a table of cases.

    Parameters
    ----------
    table : with either a column ``stimulus`` and ``injured`` (0 or 1) or ``ais``, and where wanted
        ``exact`` (1 where the stimulus of injury was measured); or columns ``<stimulus>_low`` and
        ``<stimulus>_high`` (empty: open).
    stimulus : column. level : AIS that counts as injured where the table has ``ais``.
    source : name for messages.

    Raises
    ------
    UserError
        If a column is missing or wrong, or the cases allow no risk curve.
    """
    try:
        if {f"{stimulus}_low", f"{stimulus}_high"} <= set(table.columns):
            low, high = (_numbers(table, f"{stimulus}_{side}") for side in ("low", "high"))
            return check(
                Observations(np.nan_to_num(low, nan=0.0), np.where(np.isnan(high), np.inf, high))
            )
        values = _numbers(table, stimulus)
        if "injured" in table.columns:
            injured = _flags(table, "injured")
        elif "ais" in table.columns:
            injured = _levels(table) >= level
        else:
            raise ValueError("has neither a column 'injured' nor 'ais'")
        return observe(
            values, injured, _flags(table, "exact") if "exact" in table.columns else None
        )
    except ValueError as error:
        raise UserError(f"{source}: {error}") from None


def _numbers(table: pd.DataFrame, column: str) -> NDArray[np.float64]:
    if column not in table.columns:
        raise ValueError(f"has no column {column!r}; it has {', '.join(map(str, table.columns))}")
    values = pd.to_numeric(table[column], errors="coerce").to_numpy(dtype=float)
    given = table[column].notna().to_numpy()
    wrong = np.flatnonzero(given & np.isnan(values))
    if wrong.size:
        shown = str(table[column].iloc[int(wrong[0])])[:40]
        raise ValueError(f"column {column!r}, case {wrong[0] + 1}: {shown!r} is no number")
    return values


def _levels(table: pd.DataFrame) -> NDArray[np.float64]:
    values = _numbers(table, "ais")
    wrong = np.flatnonzero(~np.isin(values, range(7)))
    if wrong.size:
        raise ValueError(
            f"column 'ais', case {wrong[0] + 1}: must be 0 to 6, given {values[wrong[0]]:g}; leave "
            "out cases of unknown severity"
        )
    return values


def _flags(table: pd.DataFrame, column: str) -> NDArray[np.bool_]:
    words = table[column].astype(str).str.strip().str.lower()
    wrong = np.flatnonzero(~words.isin(_YES + _NO))
    if wrong.size:
        shown = str(table[column].iloc[int(wrong[0])])[:40]
        raise ValueError(f"column {column!r}, case {wrong[0] + 1}: {shown!r} is neither 0 nor 1")
    return words.isin(_YES).to_numpy()
