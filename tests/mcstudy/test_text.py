"""Numbers as people write them."""

import math

import pytest

from mcstudy import text


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [
        (1391.0, 3, "1,391"),
        (1391.4, 4, "1,391"),
        (1391.4, 5, "1,391.4"),
        (13.52, 3, "13.5"),
        (1.3245, 3, "1.32"),
        (0.0012345, 3, "0.00123"),
        (-12.345, 3, "-12.3"),
        (5.0, 3, "5.00"),
        (999.6, 3, "1,000"),
        (250000.0, 3, "250,000"),
        (0.0, 3, "0"),
        (-0.0, 3, "0"),
        (None, 3, "–"),
        (math.nan, 3, "–"),
        (math.inf, 3, "–"),
    ],
)
def test_number(value: float | None, digits: int, expected: str) -> None:
    assert text.number(value, digits) == expected


@pytest.mark.parametrize(("value", "expected"), [(9.999, "10.0"), (99.96, "100"), (0.9996, "1.00")])
def test_number_that_rounds_up_to_a_power_of_ten_keeps_its_digits(
    value: float, expected: str
) -> None:
    assert text.number(value, 3) == expected


@pytest.mark.parametrize(
    ("name", "expected"), [("1", ""), ("m/s2", "m/s²"), ("rad/s2", "rad/s²"), ("km/h", "km/h")]
)
def test_unit(name: str, expected: str) -> None:
    assert text.unit(name) == expected


@pytest.mark.parametrize(
    ("value", "name", "expected"),
    [(13.52, "m", "13.5 m"), (700.0, "1", "700"), (6868.0, "rad/s2", "6,868 rad/s²"),
     (None, "1", "–")],
)  # fmt: skip
def test_quantity(value: float | None, name: str, expected: str) -> None:
    assert text.quantity(value, name) == expected


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (12.0, 15.04, "13.5 (12.0 to 15.0)"),
        (None, 15.0, "13.5"),
        (12.0, None, "13.5"),
        (math.nan, 15.0, "13.5"),
    ],
)
def test_interval(low: float | None, high: float | None, expected: str) -> None:
    assert text.interval({"value": 13.52, "low": low, "high": high}) == expected


@pytest.mark.parametrize(
    ("estimate", "expected"),
    [
        ((0.1234, 0.1, 0.15), "12.3 % (10.0 to 15.0 %)"),
        ((0.0, 0.0, 0.0019), "0.0 % (0.0 to 0.2 %)"),
        ((1.0, None, None), "100.0 %"),
        ((None, None, None), "–"),
    ],
)
def test_percent(estimate: tuple[float | None, ...], expected: str) -> None:
    assert text.percent(dict(zip(("value", "low", "high"), estimate, strict=True))) == expected


def test_percent_of_a_share_without_interval() -> None:
    assert text.percent({"value": 0.5, "low": math.nan, "high": math.nan}) == "50.0 %"
