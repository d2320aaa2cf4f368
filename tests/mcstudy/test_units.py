"""Units against their definitions."""

import itertools
import math

import pytest

from mcstudy import units

# Bureau International des Poids et Mesures, The International System of Units, 9th edition, 2019;
# the mile per hour and standard gravity from NIST Special Publication 811, appendix B.8.
DEFINED = [
    ("km/h", "m/s", 1000.0 / 3600.0),
    ("mph", "m/s", 0.44704),
    ("deg", "rad", math.pi / 180.0),
    ("deg/s", "rad/s", math.pi / 180.0),
    ("cm", "m", 0.01),
    ("mm", "m", 0.001),
    ("mm", "cm", 0.1),
    ("ms", "s", 0.001),
    ("month", "year", 1.0 / 12.0),
    ("g_mass", "kg", 0.001),
    ("%", "1", 0.01),
    ("g", "m/s2", 9.80665),
    ("kN", "N", 1000.0),
]


def same_dimension(first: str, second: str) -> bool:
    try:
        units.factor(first, second)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize(("unit", "target", "expected"), DEFINED)
def test_factor_is_the_defined_one(unit: str, target: str, expected: float) -> None:
    assert units.factor(unit, target) == pytest.approx(expected, rel=1e-15)


def test_factors_compose_and_invert() -> None:
    names = units.unit_names()
    for name in names:
        assert units.factor(name, name) == 1.0
    groups = [
        triple for triple in itertools.product(names, repeat=3)
        if same_dimension(triple[0], triple[1]) and same_dimension(triple[1], triple[2])
    ]  # fmt: skip
    assert len(groups) > len(names)
    for a, b, c in groups:
        assert units.factor(a, b) * units.factor(b, c) == pytest.approx(
            units.factor(a, c), rel=1e-14
        )


def test_forty_kilometres_an_hour_are_eleven_and_a_ninth_metres_a_second() -> None:
    assert 40.0 * units.factor("km/h", "m/s") == pytest.approx(100.0 / 9.0, rel=1e-15)


@pytest.mark.parametrize(("unit", "target"), [("furlong", "m"), ("m", "furlong"), ("", "m")])
def test_unknown_units_are_named_with_the_known_ones(unit: str, target: str) -> None:
    wrong = unit if unit not in units.unit_names() else target
    with pytest.raises(ValueError, match="unknown unit") as caught:
        units.factor(unit, target)
    assert repr(wrong) in str(caught.value)
    assert "km/h" in str(caught.value)


@pytest.mark.parametrize(
    ("unit", "target"),
    [("kg", "m/s"), ("rad", "rad/s"), ("1", "m"), ("month", "s"), ("g", "kg"), ("g_mass", "g")],
)
def test_units_of_different_quantities_do_not_convert(unit: str, target: str) -> None:
    with pytest.raises(ValueError, match="measures") as caught:
        units.factor(unit, target)
    assert repr(unit) in str(caught.value)
    assert repr(target) in str(caught.value)
