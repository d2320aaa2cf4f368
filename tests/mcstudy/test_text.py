"""Numbers as people write them, and units against their definitions."""

import itertools
import math

import pytest

from mcstudy import text, units
from mcstudy.statistics import Estimate
from mcstudy.typed_json import from_plain

NONE = (None, math.nan)


@pytest.mark.parametrize(("value", "digits", "expected"), [
    (1391.0, 3, "1,391"), (1391.4, 4, "1,391"), (1391.4, 5, "1,391.4"), (13.52, 3, "13.5"),
    (1.3245, 3, "1.32"), (0.0012345, 3, "0.00123"), (-12.345, 3, "-12.3"), (5.0, 3, "5.00"),
    (999.6, 3, "1,000"), (250000.0, 3, "250,000"), (0.0, 3, "0"), (-0.0, 3, "0"), (None, 3, "–"),
    (math.nan, 3, "–"), (math.inf, 3, "–"),
    # One that rounds up to a power of ten keeps its digits.
    (9.999, 3, "10.0"), (99.96, 3, "100"), (0.9996, 3, "1.00"),
])  # fmt: skip
def test_a_number_has_its_digits(value: float | None, digits: int, expected: str) -> None:
    assert text.number(value, digits) == expected


@pytest.mark.parametrize(("value", "name", "expected"), [
    (13.52, "m", "13.5 m"), (700.0, "1", "700"), (6868.0, "rad/s2", "6,868 rad/s²"),
    (None, "1", "–"),
])  # fmt: skip
def test_a_quantity_has_its_unit(value: float | None, name: str, expected: str) -> None:
    assert text.quantity(value, name) == expected
    assert [text.unit(name) for name in ("1", "m/s2", "km/h")] == ["", "m/s²", "km/h"]


@pytest.mark.parametrize(("write", "estimate", "expected"), [
    (text.interval, (13.52, 12.0, 15.04), "13.5 (12.0 to 15.0)"),
    *((text.interval, (13.52, low, 15.0), "13.5") for low in NONE),
    (text.interval, (13.52, 12.0, None), "13.5"),
    (text.percent, (0.1234, 0.1, 0.15), "12.3 % (10.0 to 15.0 %)"),
    (text.percent, (0.0, 0.0, 0.0019), "0.0 % (0.0 to 0.2 %)"),
    *((text.percent, (1.0, none, none), "100.0 %") for none in NONE),
    (text.percent, (None, None, None), "–"),
])  # fmt: skip
def test_an_estimate_has_its_interval_where_there_is_one(
    write: object, estimate: tuple[float | None, ...], expected: str
) -> None:
    assert callable(write)
    # JSON has null where a number does not exist.
    read = from_plain(Estimate, dict(zip(("value", "low", "high"), estimate, strict=True)))
    assert write(read) == expected


@pytest.mark.parametrize(("unit", "target", "expected"), [
    # Bureau International des Poids et Mesures, The International System of Units, 9th edition,
    # 2019; the mile per hour and standard gravity from NIST Special Publication 811, appendix B.8.
    ("km/h", "m/s", 1000.0 / 3600.0), ("mph", "m/s", 0.44704), ("deg", "rad", math.pi / 180.0),
    ("deg/s", "rad/s", math.pi / 180.0), ("cm", "m", 0.01), ("mm", "m", 0.001), ("mm", "cm", 0.1),
    ("ms", "s", 0.001), ("month", "year", 1.0 / 12.0), ("g_mass", "kg", 0.001), ("%", "1", 0.01),
    ("g", "m/s2", 9.80665), ("kN", "N", 1000.0),
])  # fmt: skip
def test_a_factor_is_the_defined_one(unit: str, target: str, expected: float) -> None:
    assert units.factor(unit, target) == pytest.approx(expected, rel=1e-15)


def factor_or_none(first: str, second: str) -> float | None:
    try:
        return units.factor(first, second)
    except ValueError:
        return None


def test_factors_compose_and_invert() -> None:
    names = units.unit_names()
    held = {pair: factor_or_none(*pair) for pair in itertools.product(names, repeat=2)}
    assert all(held[name, name] == 1.0 for name in names)
    found = 0
    for a, b, c in itertools.product(names, repeat=3):
        if held[a, b] and held[b, c]:
            found += 1
            assert held[a, b] * held[b, c] == pytest.approx(held[a, c], rel=1e-14)
    assert found > len(names)


@pytest.mark.parametrize(("unit", "target"), [("furlong", "m"), ("m", "furlong"), ("", "m")])
def test_unknown_units_are_named_with_the_known_ones(unit: str, target: str) -> None:
    wrong = target if unit == "m" else unit
    with pytest.raises(ValueError, match=rf"unknown unit.*{wrong!r}.*km/h"):
        units.factor(unit, target)


@pytest.mark.parametrize(
    ("unit", "target"),
    [("kg", "m/s"), ("rad", "rad/s"), ("1", "m"), ("month", "s"), ("g", "kg"), ("g_mass", "g")],
)
def test_units_of_different_quantities_do_not_convert(unit: str, target: str) -> None:
    with pytest.raises(ValueError, match="measures") as caught:
        units.factor(unit, target)
    assert repr(unit) in str(caught.value) and repr(target) in str(caught.value)
