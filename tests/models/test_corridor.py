"""Loading curves fitted to samples; stiffness corridors: coordinates, measured curves, files."""

import itertools
import tomllib
from pathlib import Path

import numpy as np
import pytest
from builders import Array, law, quiet
from hypothesis import given
from hypothesis import strategies as st

from models import data
from models.contact.corridor import Corridor, build_corridor, corridor_text, load_corridors
from models.contact.law import ForceCurve
from models.contact.loading import choose_knots, fit_loading
from models.registry import load_model

ZONES = ("hood", "hood_edge", "bumper", "fender_side", "windscreen")
SHIPPED = data.names("corridors")
BOUNDS = ("lower", "median", "upper")
DEPTH = np.linspace(0.0, 0.05, 251)
CORRIDOR = Corridor(
    law([[0.0, 0.0], [0.02, 1200.0], [0.07, 2500.0]], 7.0, 50.0),
    law([[0.0, 0.0], [0.015, 2200.0], [0.055, 3200.0]], 7.0, 50.0),
    law([[0.0, 0.0], [0.015, 3000.0], [0.055, 4500.0], [0.075, 9000.0]], 7.0, 50.0),
)
SIMPLE = Corridor(
    *(law([[0.0, 0.0], [0.05, force], [0.1, 1.5 * force]]) for force in (1e3, 2e3, 4e3))
)


# -- loading curves --------------------------------------------------------------------------


@st.composite
def any_samples(draw: st.DrawFn) -> tuple[Array, Array]:
    """Return depths that rise and forces of which one is positive at least."""
    count = draw(st.integers(8, 60))
    steps = draw(st.lists(st.floats(1e-5, 1e-2), min_size=count, max_size=count))
    forces = np.array(draw(st.lists(st.floats(-2e3, 2e4), min_size=count, max_size=count)))
    forces[draw(st.integers(0, count - 1))] = draw(st.floats(10.0, 2e4))
    return np.cumsum(steps), forces


def squares(depth: Array, force: Array, places: Array) -> float:
    fitted = np.interp(depth, places, fit_loading(depth, force, places))
    return float(np.sum((force - fitted) ** 2))


@pytest.mark.parametrize(
    ("places", "forces"),
    [
        ([0.0, 0.05], [0.0, 4000.0]),
        ([0.0, 0.02, 0.05], [0.0, 500.0, 6000.0]),
        ([0.0, 0.006, 0.015, 0.03, 0.05], [0.0, 1500.0, 1800.0, 4000.0, 4100.0]),
        # Beyond the last knot the curve goes on with its last slope.
        ([0.0, 0.01, 0.03], [0.0, 2000.0, 2600.0]),
    ],
)
def test_knots_at_the_right_places_give_the_curve_exactly(
    places: list[float], forces: list[float]
) -> None:
    force = law(np.column_stack([places, forces])).at(DEPTH)
    found = fit_loading(DEPTH, force, np.array(places))
    np.testing.assert_allclose(found, forces, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize(
    ("shares", "forces"),
    [
        ([0.0, 1.0], [0.0, 4000.0]),
        ([0.0, 0.72, 1.0], [0.0, 1000.0, 3500.0]),
        ([0.0, 0.12, 0.48, 0.8, 1.0], [0.0, 1500.0, 1900.0, 2400.0, 5200.0]),
    ],
)
def test_knots_of_an_exact_curve_are_found(shares: list[float], forces: list[float]) -> None:
    # The knots lie on the grid of 4 % that choose_knots searches.
    force = law(np.column_stack([0.05 * np.array(shares), forces])).at(DEPTH)
    places = choose_knots(DEPTH, force, 8)
    fitted = np.interp(DEPTH, places, fit_loading(DEPTH, force, places))
    np.testing.assert_allclose(fitted, force, atol=1e-5 * force.max())


def test_knots_of_a_smooth_curve_follow_it_and_noise_gets_none() -> None:
    force = 4000.0 * np.sqrt(DEPTH / 0.05)
    found = [choose_knots(DEPTH, force, most) for most in range(2, 9)]
    assert all(places.size <= most for most, places in enumerate(found, 2))
    errors = [squares(DEPTH, force, places) for places in found]
    assert all(b <= a * (1.0 + 1e-9) for a, b in itertools.pairwise(errors))
    assert errors[-1] < 0.02 * errors[0]
    # A straight line in white noise: two parameters a knot cost more than they win.
    noise = [30.0 * np.random.default_rng(k).standard_normal(DEPTH.size) for k in range(20)]
    straight = [choose_knots(DEPTH, 8e4 * DEPTH + n, 8).size == 2 for n in noise]
    assert np.mean(straight) >= 0.9
    # The fewer samples are independent, the more a knot must explain.
    bend = law([[0.0, 0.0], [0.02, 1650.0], [0.05, 4000.0]]).at(DEPTH) + noise[1]
    few = choose_knots(DEPTH, bend, 8, independent_samples=5.0).size
    assert few <= choose_knots(DEPTH, bend, 8).size


@quiet(40)
@given(any_samples(), st.integers(2, 8))
def test_any_samples_give_a_rising_law_no_worse_than_a_line(
    samples: tuple[Array, Array], most: int
) -> None:
    depth, force = samples
    places = choose_knots(depth, force, most)
    assert 2 <= places.size <= most
    assert (places[0], places[-1]) == (0.0, depth.max())
    # ForceCurve refuses what does not rise strictly from (0, 0).
    ForceCurve(places, fit_loading(depth, force, places), 2.0)
    slope = max(float(depth @ force) / float(depth @ depth), 1e-3 * force.max() / depth.max())
    line = float(np.sum((force - slope * depth) ** 2))
    assert squares(depth, force, places) <= line * (1.0 + 1e-9) + 1e-6 * force.max() ** 2


@pytest.mark.parametrize("most", [-1, 0, 1, 9])
def test_number_of_knots_is_checked(most: int) -> None:
    with pytest.raises(ValueError, match="2 to 8 knots"):
        choose_knots(DEPTH, 8e4 * DEPTH, most)


# -- coordinates -----------------------------------------------------------------------------


@pytest.mark.parametrize("zone", ZONES)
@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_corridors_and_their_bounds(name: str, zone: str) -> None:
    table, corridor = data.load(f"corridors/{name}.toml"), load_corridors(name)[zone]
    labels = ("[found]", "[recalled]", "[estimated]", "[assumed]")
    assert table["title"] and any(label in table["source"] for label in labels)
    depth = np.linspace(0.0, 0.15, 301)
    for coordinate, bound in zip((0.0, 0.5, 1.0), BOUNDS, strict=True):
        found, expected = corridor.curve(coordinate), getattr(corridor, bound).at(depth)
        np.testing.assert_allclose(found.at(depth), expected, rtol=1e-12, atol=1e-9)
        assert found.unloading_ratio == corridor.median.unloading_ratio
        assert found.damping == corridor.median.damping
    table = [corridor.curve(c).at(depth) for c in np.linspace(0.0, 1.0, 21)]
    assert (np.diff(table, axis=1) > 0.0).all() and (np.diff(table, axis=0) >= 0.0).all()


def test_forces_between_are_interpolated_linearly() -> None:
    depth = np.linspace(0.0, 0.12, 121)
    lower, median, upper = (getattr(CORRIDOR, name).at(depth) for name in BOUNDS)
    for coordinate, expected in (
        (0.1, 0.8 * lower + 0.2 * median),
        (0.49, 0.02 * lower + 0.98 * median),
        (0.51, 0.98 * median + 0.02 * upper),
        (0.9, 0.2 * median + 0.8 * upper),
    ):
        found = CORRIDOR.curve(coordinate)
        np.testing.assert_allclose(found.at(depth), expected, rtol=1e-12, atol=1e-9)
        assert found.damping == 50.0


@pytest.mark.parametrize("coordinate", [-1e-9, 1.0000001, float("nan"), float("inf")])
def test_coordinates_outside_are_refused(coordinate: float) -> None:
    with pytest.raises(ValueError, match="0 and 1"):
        CORRIDOR.curve(coordinate)


def test_a_corridor_with_too_many_knots_is_refused_at_once(tmp_path: Path) -> None:
    # Five knots each, none at the same place: each is a good curve, and the model never raises
    # for a row of inputs inside its ranges (models/protocol.py).
    depth = np.linspace(0.0, 0.1, 6)
    rows = [np.column_stack([d * s, f * d]).tolist() for d, s, f in
            ((depth, 1.0, 2e4), (depth, 1.05, 4e4), (depth, 1.1, 6e4))]  # fmt: skip
    with pytest.raises(ValueError, match="median and lower have 11 different knots"):
        Corridor(*(law(row) for row in rows))
    path = tmp_path / "fine.toml"
    lines = [f"{name} = {row}" for name, row in zip(BOUNDS, rows, strict=True)]
    path.write_text("\n".join(["[zones.hood]", "unloading_ratio = 5.0", *lines]))
    with pytest.raises(ValueError, match="11 different knots"):
        load_model("headform", {"corridor": str(path)})


# -- from measured curves --------------------------------------------------------------------

BASE = law([[0.0, 0.0], [0.02, 2000.0], [0.06, 3000.0], [0.08, 5000.0]])
"""Knots on the grid of 4 % of the largest penetration, less the first."""


def scaled_curves(count: int, sigma: float, seed: int = 0) -> tuple[list[ForceCurve], Array]:
    factors = np.exp(sigma * np.random.default_rng(seed).standard_normal(count))
    return [BASE.scaled(force=float(f)) for f in factors], factors


@pytest.mark.parametrize("count", [3, 4, 25])
def test_quantiles_are_those_of_the_forces(count: int) -> None:
    curves, factors = scaled_curves(count, 0.3)
    corridor = build_corridor(curves)
    # Curves that differ by a factor: the pointwise quantile is the base times the factor's.
    for name, share in zip(BOUNDS, (0.05, 0.5, 0.95), strict=True):
        bound = getattr(corridor, name)
        expected = float(np.quantile(factors, share)) * BASE.at(bound.penetration)
        # Knots on the grid of 4 %, samples of 0.5 %: the corner at 25 % lies on neither.
        np.testing.assert_allclose(bound.force, expected, atol=0.015 * expected.max())
    np.testing.assert_array_equal(corridor.lower.penetration, corridor.upper.penetration)
    assert corridor.median.penetration[-1] == 0.08


def test_quantiles_of_crossing_curves() -> None:
    # Straight curves of all slopes: the quantiles are straight and known without a fit.
    slopes = np.array([2e4, 9e4, 4e4, 5e4, 7e4])
    ends = 0.05 + 0.01 * np.arange(5)
    ratios = (4.0, 9.0, 5.0, 3.0, 8.0)
    given = zip(slopes, ends, ratios, strict=True)
    curves = [law([[0.0, 0.0], [x, s * x]], ratio) for s, x, ratio in given]
    corridor = build_corridor(curves)
    assert corridor.median.penetration[-1] == pytest.approx(0.07)
    for name, share in zip(BOUNDS, (0.05, 0.5, 0.95), strict=True):
        bound = getattr(corridor, name)
        np.testing.assert_allclose(bound.force, np.quantile(slopes, share) * bound.penetration)
    # The median of the ratios, and no damping.
    assert (corridor.median.unloading_ratio, corridor.median.damping) == (5.0, 0.0)


@pytest.mark.parametrize("sigma", [0.1, 0.35])
def test_components_of_curves_that_differ_by_a_factor(sigma: float) -> None:
    curves, factors = scaled_curves(15, sigma, seed=4)
    corridor, logs = build_corridor(curves, "components"), np.log(factors)
    # One component holds it all: its standard deviation is that of the logarithms.
    reach = 1.6448536269514722 * float(np.std(logs, ddof=1))
    for name, share in zip(BOUNDS, (-reach, 0.0, reach), strict=True):
        bound = getattr(corridor, name)
        expected = np.exp(logs.mean() + share) * BASE.at(bound.penetration)
        np.testing.assert_allclose(bound.force, expected, atol=0.015 * expected.max())
        # The same shape: exact ratios, however the knots lie.
        ratios = bound.force[1:] / corridor.median.force[1:]
        np.testing.assert_allclose(ratios, np.exp(share), rtol=1e-9)


def test_components_and_quantiles_agree_for_many_curves() -> None:
    # 200 factors: the standard error of a 5 % quantile of the logarithm is 0.15 sigma.
    curves, _ = scaled_curves(200, 0.3, seed=1)
    one, other = build_corridor(curves), build_corridor(curves, "components")
    for name in BOUNDS:
        ratio = getattr(one, name).force[1:] / getattr(other, name).force[1:]
        np.testing.assert_allclose(np.log(ratio), 0.0, atol=3.0 * 0.15 * 0.3)


@st.composite
def any_curves(draw: st.DrawFn) -> list[ForceCurve]:
    rises = st.lists(st.tuples(st.floats(0.002, 0.03), st.floats(1.0, 5e3)), min_size=1, max_size=7)
    many = draw(st.lists(rises, min_size=3, max_size=8))
    return [law(np.cumsum([[0.0, 0.0], *steps], axis=0), 5.0) for steps in many]


@quiet(12)
@given(any_curves(), st.sampled_from(["quantiles", "components"]))
def test_any_curves_give_a_corridor_that_can_be_used(curves: list[ForceCurve], method: str) -> None:
    corridor = build_corridor(curves, method)
    depth = np.linspace(0.0, 1.2 * corridor.median.penetration[-1], 60)
    for coordinate in (0.0, 0.2, 0.5, 0.8, 1.0):
        assert np.all(np.diff(corridor.curve(coordinate).at(depth)) > 0.0)


@pytest.mark.parametrize("method", ["quantiles", "components"])
def test_the_order_of_the_curves_does_not_matter(method: str) -> None:
    bumps = [0.9, 1.0, 1.05, 0.97, 1.1, 1.02]
    curves = [c.scaled(penetration=b) for c, b in zip(scaled_curves(6, 0.2)[0], bumps, strict=True)]
    one, other = build_corridor(curves, method), build_corridor(curves[::-1], method)
    for name in BOUNDS:
        np.testing.assert_allclose(getattr(one, name).force, getattr(other, name).force, rtol=1e-9)


def test_too_few_curves_and_unknown_methods_are_refused() -> None:
    with pytest.raises(ValueError, match="3 or more curves, given 2"):
        build_corridor([BASE, BASE])
    with pytest.raises(ValueError, match="quantiles, components, given 'mean'"):
        build_corridor([BASE] * 3, "mean")


# -- files -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    ["Hood B", 'a "quoted" title', "back\\slash and \\n", "two\nlines\r\nand a\ttab",
     "Motorhaube, Prüfung 3, 漢字, µ", "\x00\x1b[31m\x7f\u2028", "]]] = {", ""],
)  # fmt: skip
def test_files_are_read_back_whatever_the_title(tmp_path: Path, text: str) -> None:
    path = tmp_path / "corridor.toml"
    path.write_text(corridor_text(CORRIDOR, text, text, text), encoding="utf-8")
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    assert (table["title"], table["source"]) == (text, text)
    found = load_corridors(str(path))
    assert list(found) == [text]
    for name in BOUNDS:
        one, other = getattr(found[text], name), getattr(CORRIDOR, name)
        np.testing.assert_allclose(one.penetration, other.penetration, rtol=1e-5)
        np.testing.assert_allclose(one.force, other.force, rtol=1e-5)
        assert (one.unloading_ratio, one.damping) == (7.0, 50.0)


def test_a_file_is_an_option_of_the_headform(tmp_path: Path) -> None:
    path = tmp_path / "corridor.toml"
    path.write_text(corridor_text(SIMPLE, "hood", "simple", "test"))
    model = load_model("headform", {"corridor": str(path)})
    direct = load_model("headform", {"hood_curve": [[0.0, 0.0], [0.05, 3e3], [0.1, 4.5e3]]})
    found = dict(model.run({"hood_stiffness": 0.75}).outputs)
    expected = dict(direct.run({"hood_unloading_ratio": 7.0}).outputs)
    expected["energy_residual"] = found["energy_residual"]
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)


GOOD = corridor_text(SIMPLE, "hood", "simple", "test")
MEDIAN = "[[0, 0], [0.05, 2000], [0.1, 3000]]"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (GOOD, "", "zones"),
        ("zones.", "zone.", "zones"),
        (GOOD, "zones = 3", "zones"),
        (GOOD, "[zones]\nhood = 3", "zones"),
        (GOOD, GOOD + "]", "^corridor "),
        (GOOD, GOOD[: len(GOOD) // 2], "^corridor "),
        (GOOD, GOOD + "\n[zones.hood]\n", "^corridor "),
        (GOOD, "a = " + "[" * 300 + "\n", "^corridor "),
        (GOOD, "a = " + "[" * 5000 + "]" * 5000, "^corridor "),
        ("lower", "lowest", "lower is missing"),
        ("unloading_ratio", "ratio", "unloading_ratio is missing"),
        ("ratio = 7", "ratio = 0.9", "unloading_ratio must exceed 1"),
        ("ratio = 7", "ratio = nan", "unloading_ratio"),
        ("ratio = 7", "ratio = 'hard'", "hard"),
        ("damping = 0", "damping = -1", "damping"),
        ("[0.1, 3000]", "[0.1, 1000]", "median: .*rises"),
        ("[0, 0], [0.05, 2000]", "[0.01, 0], [0.05, 2000]", "median: "),
        ("[0.1, 3000]", "[0.1, nan]", "median: .*finite"),
        ("[0.1, 3000]", "[0.1, 'x']", "median: "),
        ("[0.1, 3000]", "[0.1]", "median: "),
        (MEDIAN, "[0, 1]", "median: "),
        (MEDIAN, "[]", "median: "),
        (MEDIAN, "{ a = 1 }", "median: "),
    ],
)
def test_bad_files_are_named_in_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD
    path = tmp_path / "bad.toml"
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(ValueError, match=message) as caught:
        load_corridors(str(path))
    assert str(path) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_files_that_cannot_be_read_are_value_errors(tmp_path: Path) -> None:
    binary, folder = tmp_path / "binary.toml", tmp_path / "folder.toml"
    binary.write_bytes(bytes(range(256)))
    folder.mkdir()
    for path in (binary, folder, tmp_path / "missing.toml", "a\0b.toml", "no such", "", ".toml"):
        with pytest.raises(ValueError, match=r"^corridor ") as caught:
            load_corridors(str(path))
        assert len(str(caught.value).splitlines()) == 1
