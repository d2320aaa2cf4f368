"""Growth charts against the percentiles of the CDC tables."""

import math
from itertools import pairwise

import pytest

from models.pedestrian.growth import parameters, value_at

Z95 = 1.6448536269514722


# Data sheet, 1.1 (CDC 2000 statage and wtage): 5, 50 and 95 % of stature in cm and mass in kg.
@pytest.mark.parametrize(
    ("sex", "months", "stature", "mass"),
    [
        ("boy", 36.5, (89.2, 95.3, 101.9), (12.1, 14.4, 17.5)),
        ("boy", 72.5, (107.3, 115.7, 123.9), (16.9, 20.8, 27.0)),
        ("boy", 78.5, (110.3, 118.9, 127.5), (17.8, 22.0, 28.9)),
        ("boy", 84.5, (113.2, 122.0, 131.0), (18.7, 23.2, 30.9)),
        ("boy", 90.5, (116.1, 125.1, 134.5), (19.7, 24.4, 33.0)),
        ("boy", 95.5, (118.4, 127.6, 137.3), (20.5, 25.5, 34.9)),
        ("boy", 108.5, (123.8, 133.7, 144.1), (22.7, 28.7, 40.4)),
        ("boy", 144.5, (137.3, 149.3, 161.9), (30.6, 40.7, 59.3)),
        ("girl", 84.5, (113.1, 121.8, 131.3), (18.2, 22.9, 31.5)),
        ("girl", 95.5, (118.1, 127.4, 137.4), (20.0, 25.5, 35.8)),
    ],
)
def test_percentiles_of_the_charts(
    sex: str, months: float, stature: tuple[float, ...], mass: tuple[float, ...]
) -> None:
    age = months / 12.0
    for z, height, weight in zip((-Z95, 0.0, Z95), stature, mass, strict=True):
        assert 100.0 * value_at("stature", age, z, sex) == pytest.approx(height, abs=0.0501)
        assert value_at("body_mass", age, z, sex) == pytest.approx(weight, abs=0.0501)


def test_parameters_are_interpolated_in_age() -> None:
    low, middle, high = (parameters("body_mass", months / 12.0) for months in (84.5, 87.5, 90.5))
    assert middle == pytest.approx([0.5 * (a + b) for a, b in zip(low, high, strict=True)])
    assert parameters("stature", 84.5 / 12.0) == pytest.approx((0.753244, 1.220305, 0.044403))


def test_values_rise_with_age_and_with_the_percentile() -> None:
    for quantity in ("stature", "body_mass"):
        by_age = [value_at(quantity, 3.1 + 0.3 * k) for k in range(29)]
        by_z = [value_at(quantity, 7.5, 0.25 * k) for k in range(-10, 11)]
        for values in (by_age, by_z):
            assert all(b > a for a, b in pairwise(values))


def test_default_is_the_median_boy() -> None:
    assert value_at("stature", 7.5) == value_at("stature", 7.5, 0.0, "boy")
    assert value_at("stature", 7.5) == parameters("stature", 7.5)[1]


@pytest.mark.parametrize(
    ("quantity", "age", "sex", "message"),
    [
        ("head_mass", 7.0, "boy", "quantity"),
        ("stature", 7.5, "child", "sex"),
        ("stature", 2.9, "boy", "outside the boy chart"),
        ("stature", 12.5, "boy", "outside the boy chart"),
        ("body_mass", 6.9, "girl", "outside the girl chart"),
        ("body_mass", math.nan, "boy", "outside the boy chart"),
    ],
)
def test_what_the_charts_do_not_hold_is_refused(
    quantity: str, age: float, sex: str, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        parameters(quantity, age, sex)
