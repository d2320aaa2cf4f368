"""Numbers formatted for reports."""

import math

from mcstudy.statistics import Estimate

SMALL, LARGE = 1e-9, 1e9
_UNITS = {"1": "", "m/s2": "m/s²", "rad/s2": "rad/s²"}


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with the given significant digits.

    In powers of ten only above a billion and below a billionth.
    """
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    if not SMALL <= abs(value) < LARGE:
        return f"{value:.{digits - 1}e}"
    # The exponent after rounding: 9.999 to three digits is 10.0.
    exponent = int(f"{value:.{digits - 1}e}".partition("e")[2])
    return f"{value:,.{max(0, digits - 1 - exponent)}f}"


def capital(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


def unit(name: str) -> str:
    """Return a unit as printed after a number."""
    return _UNITS.get(name, name)


def quantity(value: float | None, name: str, digits: int = 3) -> str:
    """Return a number with its unit.

    Parameters
    ----------
    value : float or None
        A dash is printed for None and for what is not finite.
    name : str
        Unit as in study files.
    digits : int
        Significant digits.
    """
    return f"{number(value, digits)} {unit(name)}".strip()


def interval(estimate: Estimate, digits: int = 3) -> str:
    """Return ``value (low to high)`` of an estimate."""
    value, low, high = (number(v, digits) for v in (estimate.value, estimate.low, estimate.high))
    return f"{value} ({low} to {high})" if estimate.has_interval else value


def share(estimate: Estimate) -> str:
    """Return ``value (low to high)`` of a share, with two decimals."""
    value, low, high = (
        f"{v:.2f}".replace("-0.00", "0.00") if math.isfinite(v) else "–"
        for v in (estimate.value, estimate.low, estimate.high)
    )
    return f"{value} ({low} to {high})" if estimate.has_interval else value


def percent(estimate: Estimate) -> str:
    """Return a probability with its interval in per cent."""
    value, low, high = (100.0 * v for v in (estimate.value, estimate.low, estimate.high))
    if not math.isfinite(value):
        return "–"
    return (
        f"{value:.1f} % ({low:.1f} to {high:.1f} %)" if estimate.has_interval else f"{value:.1f} %"
    )
