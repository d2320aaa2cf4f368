"""Stiffness corridors: coordinates, corridors of measured curves, their files."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from models import data
from models.contact.corridor import Corridor, build_corridor, corridor_text, load_corridors
from models.contact.law import ForceCurve
from models.registry import load_model

Array = NDArray[np.float64]

QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=60)
ZONES = ("hood", "hood_edge", "bumper", "fender_side", "windscreen")
SHIPPED = data.names("corridors")


def curve(knots: list[list[float]], ratio: float = 7.0, damping: float = 0.0) -> ForceCurve:
    table = np.array(knots)
    return ForceCurve(table[:, 0].copy(), table[:, 1].copy(), ratio, damping)


CORRIDOR = Corridor(
    curve([[0.0, 0.0], [0.02, 1200.0], [0.07, 2500.0]], 7.0, 50.0),
    curve([[0.0, 0.0], [0.015, 2200.0], [0.055, 3200.0]], 7.0, 50.0),
    curve([[0.0, 0.0], [0.015, 3000.0], [0.055, 4500.0], [0.075, 9000.0]], 7.0, 50.0),
)
SIMPLE = Corridor(
    *(curve([[0.0, 0.0], [0.05, force], [0.1, 1.5 * force]]) for force in (1e3, 2e3, 4e3))
)


# -- coordinates -----------------------------------------------------------------------------


@pytest.mark.parametrize("zone", ZONES)
@pytest.mark.parametrize("name", SHIPPED)
def test_coordinates_0_and_1_are_the_bounds(name: str, zone: str) -> None:
    corridor = load_corridors(name)[zone]
    depth = np.linspace(0.0, 0.15, 301)
    for coordinate, bound in ((0.0, corridor.lower), (0.5, corridor.median), (1.0, corridor.upper)):
        found = corridor.curve(coordinate)
        np.testing.assert_allclose(found.at(depth), bound.at(depth), rtol=1e-12, atol=1e-9)
        assert found.unloading_ratio == corridor.median.unloading_ratio
        assert found.damping == corridor.median.damping


def test_forces_between_are_interpolated_linearly() -> None:
    depth = np.linspace(0.0, 0.12, 121)
    lower, median, upper = (c.at(depth) for c in (CORRIDOR.lower, CORRIDOR.median, CORRIDOR.upper))
    for coordinate, expected in (
        (0.1, 0.8 * lower + 0.2 * median),
        (0.25, 0.5 * lower + 0.5 * median),
        (0.49, 0.02 * lower + 0.98 * median),
        (0.51, 0.98 * median + 0.02 * upper),
        (0.6, 0.8 * median + 0.2 * upper),
        (0.75, 0.5 * median + 0.5 * upper),
        (0.9, 0.2 * median + 0.8 * upper),
    ):
        found = CORRIDOR.curve(coordinate)
        np.testing.assert_allclose(found.at(depth), expected, rtol=1e-12, atol=1e-9)
        assert found.damping == 50.0


@QUIET
@given(
    st.sampled_from(ZONES),
    st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)),
    st.tuples(st.floats(0.0, 0.2), st.floats(0.0, 0.2)),
)
def test_force_rises_with_penetration_and_coordinate(
    zone: str, coordinates: tuple[float, float], depths: tuple[float, float]
) -> None:
    corridor = load_corridors("working_curves")[zone]
    near, far = sorted(depths)
    soft, stiff = (corridor.curve(c) for c in sorted(coordinates))
    slack = 1.0 + 1e-12
    assert soft.at(np.array(near)) <= soft.at(np.array(far)) * slack
    assert soft.at(np.array(near)) <= stiff.at(np.array(near)) * slack


@pytest.mark.parametrize("coordinate", [-1e-9, 1.0000001, 5.0, float("nan"), float("inf")])
def test_coordinates_outside_are_refused(coordinate: float) -> None:
    with pytest.raises(ValueError, match="0 and 1"):
        CORRIDOR.curve(coordinate)


def test_a_corridor_with_too_many_knots_is_refused_at_once(tmp_path: Path) -> None:
    # Five knots each, none at the same place: each is a good curve, and the model never raises
    # for a row of inputs inside its ranges (models/protocol.py).
    depth = np.linspace(0.0, 0.1, 6)[1:]
    bounds = [
        curve([[0.0, 0.0], *([d * s, f * d] for d in depth)])
        for s, f in ((1.0, 2e4), (1.05, 4e4), (1.1, 6e4))
    ]
    with pytest.raises(ValueError, match="median and lower have 11 different knots"):
        Corridor(*bounds)
    path = tmp_path / "fine.toml"
    rows = [[list(pair) for pair in zip(b.penetration.tolist(), b.force.tolist(), strict=True)]
            for b in bounds]  # fmt: skip
    path.write_text(
        f"[zones.hood]\nunloading_ratio = 5.0\nlower = {rows[0]}\nmedian = {rows[1]}\n"
        f"upper = {rows[2]}\n"
    )
    with pytest.raises(ValueError, match="11 different knots"):
        load_model("headform", {"corridor": str(path)})


# -- from measured curves --------------------------------------------------------------------

BASE = curve([[0.0, 0.0], [0.02, 2000.0], [0.06, 3000.0], [0.08, 5000.0]])
"""Knots on the grid of 4 % of the largest penetration, less the first."""


def scaled_curves(count: int, sigma: float, seed: int = 0) -> tuple[list[ForceCurve], Array]:
    factors = np.exp(sigma * np.random.default_rng(seed).standard_normal(count))
    return [BASE.scaled(force=float(f)) for f in factors], factors


@pytest.mark.parametrize("count", [3, 4, 10, 25])
def test_quantiles_are_those_of_the_forces(count: int) -> None:
    curves, factors = scaled_curves(count, 0.3)
    corridor = build_corridor(curves)
    # Curves that differ by a factor: the pointwise quantile is the base times the factor's.
    for bound, share in ((corridor.lower, 0.05), (corridor.median, 0.5), (corridor.upper, 0.95)):
        expected = float(np.quantile(factors, share)) * BASE.at(bound.penetration)
        # Knots on the grid of 4 %, samples of 0.5 %: the corner at 25 % lies on neither.
        np.testing.assert_allclose(bound.force, expected, atol=0.015 * expected.max())
    np.testing.assert_array_equal(corridor.lower.penetration, corridor.upper.penetration)
    assert corridor.median.penetration[-1] == 0.08


def test_quantiles_of_crossing_curves() -> None:
    # Straight curves of all slopes: the quantiles are straight and known without a fit.
    slopes = np.array([2e4, 9e4, 4e4, 5e4, 7e4])
    curves = [curve([[0.0, 0.0], [0.05 + 0.01 * k, s * (0.05 + 0.01 * k)]])
              for k, s in enumerate(slopes)]  # fmt: skip
    corridor = build_corridor(curves)
    end = 0.07
    assert corridor.median.penetration[-1] == pytest.approx(end)
    for bound, share in ((corridor.lower, 0.05), (corridor.median, 0.5), (corridor.upper, 0.95)):
        np.testing.assert_allclose(bound.force, np.quantile(slopes, share) * bound.penetration)


@pytest.mark.parametrize("sigma", [0.1, 0.35])
def test_components_of_curves_that_differ_by_a_factor(sigma: float) -> None:
    curves, factors = scaled_curves(15, sigma, seed=4)
    corridor = build_corridor(curves, "components")
    logs = np.log(factors)
    # One component holds it all: its standard deviation is that of the logarithms.
    reach = 1.6448536269514722 * float(np.std(logs, ddof=1))
    middle = float(np.exp(logs.mean()))
    for bound, factor in (
        (corridor.lower, middle * np.exp(-reach)),
        (corridor.median, middle),
        (corridor.upper, middle * np.exp(reach)),
    ):
        expected = factor * BASE.at(bound.penetration)
        np.testing.assert_allclose(bound.force, expected, atol=0.015 * expected.max())
    # The same shape: exact ratios, however the knots lie.
    np.testing.assert_allclose(
        corridor.upper.force[1:] / corridor.median.force[1:], np.exp(reach), rtol=1e-9
    )


def test_components_and_quantiles_agree_for_many_curves() -> None:
    # 200 factors: the standard error of a 5 % quantile of the logarithm is 0.15 sigma.
    curves, _ = scaled_curves(200, 0.3, seed=1)
    one, other = build_corridor(curves), build_corridor(curves, "components")
    for name in ("lower", "median", "upper"):
        ratio = getattr(one, name).force[1:] / getattr(other, name).force[1:]
        np.testing.assert_allclose(np.log(ratio), 0.0, atol=3.0 * 0.15 * 0.3)


@st.composite
def any_curves(draw: st.DrawFn) -> list[ForceCurve]:
    rises = st.lists(st.tuples(st.floats(0.002, 0.03), st.floats(1.0, 5e3)), min_size=1, max_size=7)
    curves = []
    for steps in draw(st.lists(rises, min_size=3, max_size=8)):
        table = np.cumsum([[0.0, 0.0], *steps], axis=0)
        curves.append(ForceCurve(table[:, 0].copy(), table[:, 1].copy(), 5.0))
    return curves


@QUIET
@given(any_curves(), st.sampled_from(["quantiles", "components"]))
def test_any_curves_give_a_corridor_that_can_be_used(curves: list[ForceCurve], method: str) -> None:
    corridor = build_corridor(curves, method)
    depth = np.linspace(0.0, 1.2 * corridor.median.penetration[-1], 60)
    for coordinate in (0.0, 0.2, 0.5, 0.8, 1.0):
        found = corridor.curve(coordinate)
        assert np.all(np.diff(found.at(depth)) > 0.0)


@pytest.mark.parametrize("method", ["quantiles", "components"])
def test_the_order_of_the_curves_does_not_matter(method: str) -> None:
    curves, _ = scaled_curves(6, 0.2)
    bumps = [0.9, 1.0, 1.05, 0.97, 1.1, 1.02]
    curves = [c.scaled(penetration=b) for c, b in zip(curves, bumps, strict=True)]
    one, other = build_corridor(curves, method), build_corridor(curves[::-1], method)
    for name in ("lower", "median", "upper"):
        np.testing.assert_allclose(getattr(one, name).force, getattr(other, name).force, rtol=1e-9)


def test_unloading_ratio_is_the_median_and_damping_none() -> None:
    curves = [ForceCurve(BASE.penetration, BASE.force, ratio) for ratio in (4.0, 9.0, 5.0)]
    corridor = build_corridor(curves)
    assert corridor.median.unloading_ratio == 5.0
    assert corridor.median.damping == 0.0


def test_too_few_curves_and_unknown_methods_are_refused() -> None:
    with pytest.raises(ValueError, match="3 or more curves, given 2"):
        build_corridor([BASE, BASE])
    with pytest.raises(ValueError, match="quantiles, components, given 'mean'"):
        build_corridor([BASE] * 3, "mean")


# -- files -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "Hood B",
        'a "quoted" title',
        "back\\slash and \\n",
        "two\nlines\r\nand a\ttab",
        "Motorhaube, Prüfung 3, 漢字, µ",
        "\x00\x1b[31m\x7f\u2028",
        "]]] = {",
        "",
        "\N{COLLISION SYMBOL}",
    ],
)
def test_files_are_read_back_whatever_the_title(tmp_path: Path, text: str) -> None:
    path = tmp_path / "corridor.toml"
    path.write_text(corridor_text(CORRIDOR, text, text, text), encoding="utf-8")
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    assert (table["title"], table["source"]) == (text, text)
    found = load_corridors(str(path))
    assert list(found) == [text]
    for name in ("lower", "median", "upper"):
        one, other = getattr(found[text], name), getattr(CORRIDOR, name)
        np.testing.assert_allclose(one.penetration, other.penetration, rtol=1e-5)
        np.testing.assert_allclose(one.force, other.force, rtol=1e-5)
        assert (one.unloading_ratio, one.damping) == (7.0, 50.0)


def test_a_file_is_an_option_of_the_headform(tmp_path: Path) -> None:
    path = tmp_path / "corridor.toml"
    path.write_text(corridor_text(SIMPLE, "hood", "simple", "test"))
    model = load_model("headform", {"corridor": str(path)})
    direct = load_model("headform", {"hood_curve": [[0.0, 0.0], [0.05, 3e3], [0.1, 4.5e3]]})
    found = model.run({"hood_stiffness": 0.75}).outputs
    expected = direct.run({"hood_unloading_ratio": 7.0}).outputs
    for name, value in expected.items():
        if name != "energy_residual":
            assert found[name] == pytest.approx(value, rel=1e-9, abs=1e-12)


GOOD = corridor_text(SIMPLE, "hood", "simple", "test")
BAD: dict[str, Any] = {
    "empty": ("", "zones"),
    "no zones": (GOOD.replace("zones.", "zone."), "zones"),
    "zones a number": ("zones = 3", "zones"),
    "zone a number": ("[zones]\nhood = 3", "zones"),
    "not toml": (GOOD + "]", None),
    "cut": (GOOD[: len(GOOD) // 2], None),
    "lower missing": (GOOD.replace("lower", "lowest"), "lower is missing"),
    "ratio missing": (GOOD.replace("unloading_ratio", "ratio"), "unloading_ratio is missing"),
    "ratio too small": (GOOD.replace("ratio = 7", "ratio = 0.9"), "unloading_ratio must exceed 1"),
    "ratio nan": (GOOD.replace("ratio = 7", "ratio = nan"), "unloading_ratio"),
    "ratio text": (GOOD.replace("ratio = 7", "ratio = 'hard'"), "hard"),
    "damping negative": (GOOD.replace("damping = 0", "damping = -1"), "damping"),
    "falls": (GOOD.replace("[0.1, 3000]", "[0.1, 1000]"), "median: .*rises"),
    "no origin": (GOOD.replace("[0, 0], [0.05, 2000]", "[0.01, 0], [0.05, 2000]"), "median: "),
    "nan": (GOOD.replace("[0.1, 3000]", "[0.1, nan]"), "median: .*finite"),
    "text": (GOOD.replace("[0.1, 3000]", "[0.1, 'x']"), "median: "),
    "ragged": (GOOD.replace("[0.1, 3000]", "[0.1]"), "median: "),
    "flat list": (GOOD.replace("[[0, 0], [0.05, 2000], [0.1, 3000]]", "[0, 1]"), "median: "),
    "empty list": (GOOD.replace("[[0, 0], [0.05, 2000], [0.1, 3000]]", "[]"), "median: "),
    "a table": (GOOD.replace("[[0, 0], [0.05, 2000], [0.1, 3000]]", "{ a = 1 }"), "median: "),
    "twice": (GOOD + "\n[zones.hood]\n", None),
    "nested": ("a = " + "[" * 300 + "\n", None),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_files_are_named_in_one_line(tmp_path: Path, name: str) -> None:
    text, message = BAD[name]
    assert text != GOOD
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        load_corridors(str(path))
    assert str(path) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_files_that_cannot_be_read_are_value_errors(tmp_path: Path) -> None:
    binary = tmp_path / "binary.toml"
    binary.write_bytes(bytes(range(256)))
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    for path in (binary, folder, tmp_path / "missing.toml", "a\0b.toml", "no such", "", ".toml"):
        with pytest.raises(ValueError, match=r"^corridor ") as caught:
            load_corridors(str(path))
        assert len(str(caught.value).splitlines()) == 1


def test_a_deeply_nested_file_is_a_value_error(tmp_path: Path) -> None:
    path = tmp_path / "deep.toml"
    path.write_text("a = " + "[" * 5000 + "]" * 5000)
    with pytest.raises(ValueError, match=r"^corridor "):
        load_corridors(str(path))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_corridors_have_all_zones_and_a_labelled_source(name: str) -> None:
    table = data.load(f"corridors/{name}.toml")
    assert set(ZONES) <= set(table["zones"])
    assert set(ZONES) <= set(load_corridors(name))
    assert table["title"]
    labels = ("[found]", "[recalled]", "[estimated]", "[assumed]")
    assert any(label in table["source"] for label in labels)
