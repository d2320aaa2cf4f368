"""Numbers formatted for reports."""

import math
from collections.abc import Mapping

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


def interval(estimate: Mapping[str, float | None], digits: int = 3) -> str:
    """Return ``value (low to high)`` of an estimate."""
    low, high = estimate["low"], estimate["high"]
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return number(estimate["value"], digits)
    return f"{number(estimate['value'], digits)} ({number(low, digits)} to {number(high, digits)})"


def share(estimate: Mapping[str, float | None]) -> str:
    """Return ``value (low to high)`` of a share, with two decimals."""
    shown = [estimate[key] for key in ("value", "low", "high")]
    value, low, high = (
        "–" if v is None or not math.isfinite(v) else f"{v:.2f}".replace("-0.00", "0.00")
        for v in shown
    )
    return value if "–" in (low, high) else f"{value} ({low} to {high})"


def percent(estimate: Mapping[str, float | None]) -> str:
    """Return a probability with its interval in per cent."""
    value, low, high = (estimate[k] for k in ("value", "low", "high"))
    if value is None or not math.isfinite(value):
        return "–"
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return f"{100.0 * value:.1f} %"
    return f"{100.0 * value:.1f} % ({100.0 * low:.1f} to {100.0 * high:.1f} %)"
