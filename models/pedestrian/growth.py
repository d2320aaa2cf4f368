"""Stature and mass for age: LMS growth charts (CDC 2000).

``x(z) = M (1 + L S z)^(1/L)`` with L, M, S interpolated in age (T. Cole and P. Green, Statistics
in Medicine 11, 1992).
"""

import csv
import functools
import math
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray


@functools.cache
def _chart(sex: str) -> NDArray[np.float64]:
    text = files("models.data").joinpath("growth/cdc2000.csv").read_text(encoding="utf-8")
    rows = [row for row in csv.DictReader(text.splitlines()) if row["sex"] == sex]
    if not rows:
        raise ValueError(f"no growth chart for sex {sex!r}: use 'boy' or 'girl'")
    return np.array([[float(v) for k, v in row.items() if k != "sex"] for row in rows])


def parameters(quantity: str, age: float, sex: str = "boy") -> tuple[float, float, float]:
    """Return L, M, S of a quantity at an age.

    Parameters
    ----------
    quantity : {"stature", "body_mass"}
    age : float
        Years.
    sex : {"boy", "girl"}

    Returns
    -------
    L, M, S : float
        M in m or kg.

    Raises
    ------
    ValueError
        If the age lies outside the chart, or sex or quantity is unknown.
    """
    if quantity not in ("stature", "body_mass"):
        raise ValueError(f"quantity must be 'stature' or 'body_mass', given {quantity!r}")
    chart = _chart(sex)
    months = 12.0 * age
    if not chart[0, 0] <= months <= chart[-1, 0]:
        raise ValueError(
            f"age {age:g} y is outside the {sex} chart, "
            f"{chart[0, 0] / 12:.2f} to {chart[-1, 0] / 12:.2f} y"
        )
    first = 1 if quantity == "stature" else 4
    L, M, S = (float(np.interp(months, chart[:, 0], chart[:, first + k])) for k in range(3))
    return L, M / 100.0 if quantity == "stature" else M, S


def value_at(quantity: str, age: float, z: float = 0.0, sex: str = "boy") -> float:
    """Return the stature (m) or body mass (kg) at an age and standard score.

    Parameters
    ----------
    quantity : {"stature", "body_mass"}
    age : float
        Years.
    z : float
        Standard score; 0 is the median.
    sex : {"boy", "girl"}
    """
    L, M, S = parameters(quantity, age, sex)
    return M * math.exp(S * z) if L == 0.0 else float(M * (1.0 + L * S * z) ** (1.0 / L))
