"""Forms of risk functions: from a positive stimulus and parameters to a probability."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]


def _lognormal(x: Array, mean: float, sd: float) -> Array:
    return np.asarray(special.ndtr((_log(x) - mean) / sd))


def _normal(x: Array, mean: float, sd: float) -> Array:
    return np.asarray(special.ndtr((x - mean) / sd))


def _logistic(x: Array, intercept: float, slope: float) -> Array:
    return np.asarray(special.expit(intercept + slope * x))


def _prasad_mertz(x: Array, c1: float, c2: float) -> Array:
    with np.errstate(divide="ignore", over="ignore"):
        return np.asarray(special.expit(-(c1 + 200.0 / x - c2 * x)))


def _weibull(x: Array, scale: float, shape: float, threshold: float) -> Array:
    return np.asarray(-np.expm1(-((np.maximum(x - threshold, 0.0) / scale) ** shape)))


def _threshold(x: Array, median: float, variation: float) -> Array:
    """Return the risk of a threshold with a log-normal width of the given coefficient."""
    return np.asarray(special.ndtr((_log(x) - np.log(median)) / np.sqrt(np.log1p(variation**2))))


def _log(x: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(x)


FORMS: dict[str, Callable[..., Array]] = {
    "lognormal": _lognormal,
    "normal": _normal,
    "logistic": _logistic,
    "prasad_mertz": _prasad_mertz,
    "weibull": _weibull,
    "threshold": _threshold,
}
"""A new form is one function of stimulus and parameters, and one line here."""
