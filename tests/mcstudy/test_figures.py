"""Figures: what is drawn where, units on every axis, texts as people wrote them."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from mcstudy_tools import Array, check_drawn, check_units, generator, legend_of
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from PIL import Image
from test_risk_curve import analysis, cases

from mcstudy import statistics
from mcstudy.execution.results import to_json
from mcstudy.figures import crash, dents, distributions, panels, relations, risk, stiffness, style
from mcstudy.figures.distributions import Mark
from mcstudy.figures.panels import Band, Curve, Panel, draw_panels, use_log_scale
from mcstudy.injury.risk_curve import RiskDescription
from mcstudy.injury.survival import QUALITY_AT
from mcstudy.typed_json import from_plain

UNITS = {"hic15": "1", "throw_distance": "m", "wad": "m"}
MARKS = {
    "hic15": [Mark(700.0, "HIC limit 700", "limit")],
    "throw_distance": [Mark(14.0, "accident, 14 m", "observed")],
    "wad": [Mark(1.35, "accident", "observed"), Mark(1.32, "MBS", "simulated")],
}
X = np.linspace(0.0, 1.0, 60)
SPEED = ("impact_speed", "impact speed [m/s]")


@pytest.fixture(scope="module")
def runs() -> pd.DataFrame:
    """Return runs of two made-up inputs; every 25th has no head impact."""
    rng, n = generator(12), 400
    speed = rng.normal(11.7, 0.55, n)
    frame = pd.DataFrame({
        "impact_speed": speed,
        "hood_stiffness": rng.random(n),
        "hic15": np.exp(6.9 + 0.25 * (speed - 11.7) + 0.3 * rng.normal(size=n)),
        "throw_distance": 13.5 + 1.8 * (speed - 11.7) + rng.normal(size=n),
        "wad": 1.32 + 0.05 * rng.normal(size=n),
    })  # fmt: skip
    frame.loc[::25, ["hic15", "wad"]] = np.nan
    return frame


def described(runs: pd.DataFrame) -> dict[str, statistics.Described]:
    return {name: statistics.describe(runs[name].to_numpy()) for name in UNITS}


@pytest.mark.parametrize(
    ("name", "unit", "expected"),
    [
        ("hic15", "1", "HIC15 [–]"),
        ("wad", "m", "wrap-around distance (WAD) [m]"),
        ("head_angular_acceleration", "rad/s2", "head angular acceleration [rad/s²]"),
        ("impact_speed", "m/s", "impact speed [m/s]"),
    ],
)
def test_labels_name_the_quantity_and_its_unit(name: str, unit: str, expected: str) -> None:
    assert style.label(name, unit) == expected
    assert expected.startswith(style.words(name))


def test_distributions_carry_units_marks_and_the_share_of_runs_below(runs: pd.DataFrame) -> None:
    figure = distributions.draw_distributions(runs, UNITS, MARKS, described(runs))
    assert len(figure.axes) == 6
    check_units(figure, "HIC15 [–]", "throw distance [m]", "(WAD) [m]", "runs in the bin")
    assert all(below.get_xlabel() for below in figure.axes[3:])
    assert figure.axes[0].get_ylabel() and figure.axes[3].get_ylabel()
    assert "HIC limit 700" in legend_of(figure)
    line = figure.axes[4].get_lines()[0]
    values, share = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    median = np.median(runs["throw_distance"])
    assert np.interp(median, values, share) == pytest.approx(0.5, abs=1.0 / len(runs))
    assert share[-1] == 1.0


def test_a_median_without_an_interval_is_drawn(runs: pd.DataFrame) -> None:
    held = described(runs)["wad"]
    assert isinstance(held, statistics.Distribution)
    median = replace(held.quantiles["0.5"], low=np.nan, high=np.nan)
    bare = replace(held, quantiles={**held.quantiles, "0.5": median})
    check_drawn(distributions.draw_distributions(runs, {"wad": "m"}, {}, {"wad": bare}))


def test_two_runs_are_both_in_the_picture() -> None:
    figure = draw_distributions(np.array([3.0, 7.0]), [])
    bars = [bar for bar in figure.axes[0].containers[0] if bar.get_height()]
    assert [bar.get_x() for bar in bars] == pytest.approx([3.0, 6.9])


def test_correlations_are_named_noise_is_grey_and_none_a_dash(runs: pd.DataFrame) -> None:
    ranks = runs.corr("spearman").loc[["impact_speed", "hood_stiffness"], list(UNITS)]
    figure = relations.draw_correlations(ranks, 1.96 / np.sqrt(len(runs) - 1))
    check_units(figure, "rank correlation [–]")
    axes = figure.axes[0]
    assert [t.get_text() for t in axes.get_yticklabels()] == ["impact speed", "hood stiffness"]
    texts = {text.get_text(): text.get_color() for text in axes.texts}
    assert set(texts) == {f"{value:.2f}" for value in ranks.to_numpy().ravel()}
    assert texts[f"{ranks.loc['impact_speed', 'throw_distance']:.2f}"] != "#A0A0A0"
    assert texts[f"{ranks.loc['hood_stiffness', 'hic15']:.2f}"] == "#A0A0A0"
    table = pd.DataFrame({"hic15": [0.5, None], "wad": [None, None]}, index=["age", "mass"])
    figure = relations.draw_correlations(table, 0.1)
    check_drawn(figure)
    shown = {t.get_position(): t.get_text() for t in figure.axes[0].texts}
    assert shown == {(0.5, 0.5): "0.50", (0.5, 1.5): "–", (1.5, 0.5): "–", (1.5, 1.5): "–"}


def test_outputs_against_an_input_carry_units(runs: pd.DataFrame) -> None:
    figure = relations.draw_against_input(runs, *SPEED, UNITS, MARKS)
    assert len(figure.axes) == 3
    check_units(figure, "HIC15 [–]", "throw distance [m]")
    assert all(axes.get_xlabel() == SPEED[1] and axes.get_ylabel() for axes in figure.axes)


@pytest.mark.parametrize("values", [-1e9 - X, -1.0 - X], ids=["offset", "negative"])
def test_runs_below_zero_are_within_the_picture(values: Array) -> None:
    frame = pd.DataFrame({"impact_speed": X, "hic15": values})
    figure = relations.draw_against_input(frame, *SPEED, {"hic15": "1"}, {})
    low, high = figure.axes[0].get_ylim()
    assert low < values.min() <= values.max() < high


@pytest.mark.parametrize("point", [{}, {"throw_distance": 14.0, "wad": 1.35}, {"wad": 1.35}])
def test_two_outputs_together_show_the_accident(
    runs: pd.DataFrame, point: dict[str, float]
) -> None:
    figure = relations.draw_joint(runs, ("throw_distance", "m"), ("wad", "m"), point)
    check_units(figure, "throw distance [m]", "(WAD) [m]")
    assert ("accident" in legend_of(figure)) == (len(point) == 2)


def test_convergence_carries_units(runs: pd.DataFrame) -> None:
    tables = {
        name: statistics.convergence(runs[name].to_numpy(), lambda part: float(np.median(part)))
        for name in UNITS
    }
    figure = relations.draw_convergence(tables, UNITS)
    check_units(figure, "median HIC15 [–]", "median throw distance [m]", "runs [–]")
    assert all(axes.get_xlabel() and axes.get_ylabel() for axes in figure.axes)


def test_the_risk_curve_is_drawn_with_band_steps_rug_and_lines_of_the_standard() -> None:
    figure = risk.draw_risk_curve(analysis(), "HIC15 [–]", "skull fracture")
    (axes,) = figure.axes
    check_units(figure)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("HIC15 [–]", "risk [–]")
    assert axes.get_title() == "skull fracture"
    assert axes.get_ylim()[0] < 0.0 and axes.get_ylim()[1] > 1.0
    family, hurt = analysis().family, int(cases().injured.sum())
    shown = legend_of(figure)
    assert {"95 % band", family, f"injured ({hurt})", f"uninjured ({50 - hurt})"} <= set(shown)
    assert any("Turnbull" in word for word in shown)
    (curve,) = [line for line in axes.lines if line.get_label() == family]
    assert_array_equal(curve.get_ydata(), analysis().curve.risk)
    dotted = [line for line in axes.lines if line.get_linestyle() == ":"]
    for line, p in zip(dotted, QUALITY_AT, strict=True):
        assert_allclose(line.get_xydata()[1], [analysis().at[f"{p:g}"].value, p])
    marks = {line.get_label(): line for line in axes.lines if line.get_marker() == "|"}
    assert len(marks) == 2
    for label, line in marks.items():
        injured = str(label).startswith("injured")
        expected = cases().stimulus[cases().injured == injured]
        assert_array_equal(np.sort(line.get_xdata()), np.sort(expected))
        heights = np.asarray(line.get_ydata())
        assert np.all(heights > 0.9) if injured else np.all(heights < 0.1)
    # A description read back from JSON is drawn alike.
    back = risk.draw_risk_curve(
        from_plain(RiskDescription, json.loads(to_json(analysis()))), "HIC15 [–]", "skull fracture"
    )
    assert style.png_bytes(figure, dpi=50) == style.png_bytes(back, dpi=50)


def test_levels_are_drawn_over_the_density_of_the_stimulus() -> None:
    x = np.linspace(1.0, 2000.0, 50)
    curves = {"one": {2: x / 2000.0, 3: x / 4000.0}, "other": {3: x / 3000.0}}
    figure = risk.draw_levels(curves, x, np.linspace(100.0, 900.0, 500), "HIC15 [–]", 700.0)
    above, below = figure.axes
    assert (above.get_ylabel(), below.get_xlabel()) == ("risk [–]", "HIC15 [–]")
    assert "density" in below.get_ylabel()
    assert legend_of(figure) == ["AIS2+, one", "AIS3+, one", "AIS3+, other"]
    colours = {line.get_label(): line.get_color() for line in above.lines}
    assert colours["AIS3+, one"] == colours["AIS3+, other"] != colours["AIS2+, one"]
    assert any("700" in text.get_text() for text in above.texts)
    # The bars are a density: their area is one.
    area = sum(bar.get_height() * bar.get_width() for bar in below.patches)
    assert area == pytest.approx(1.0)
    check_drawn(figure)
    without = risk.draw_levels({"one": {1: x / 2.0}}, x, x, "BrIC [–]").axes[0]
    assert (len(without.lines), len(without.texts)) == (1, 0)


def test_risk_against_speed_is_drawn_with_published_curves() -> None:
    v = np.linspace(10.0, 60.0, 6)
    band = {"speed": v, "risk": v / 100, "low": v / 120, "high": v / 80}
    figure = risk.draw_speed_risk({"AIS3+": band}, {"Rosén": (v, v / 200)}, "by impact speed")
    check_units(figure, "impact speed [km/h]")
    assert figure.axes[0].get_ylim() == (0.0, 1.0)
    assert legend_of(figure) == ["AIS3+", "Rosén"]
    check_drawn(figure)


def test_the_ais_bars_fill_up_to_one() -> None:
    shares = {
        "reference": [0.5, 0.2, 0.1, 0.1, 0.05, 0.03, 0.02],
        "slower": [0.9, 0.1, 0, 0, 0, 0, 0],
    }
    figure = risk.draw_ais(shares)
    (axes,) = figure.axes
    assert axes.get_xlabel().endswith("[–]")
    assert [text.get_text() for text in axes.get_yticklabels()] == list(shares)
    widths: dict[float, float] = {}
    for bar in axes.patches:
        widths[bar.get_y()] = widths.get(bar.get_y(), 0.0) + bar.get_width()
    assert list(widths.values()) == pytest.approx([1.0, 1.0])
    # Percentages stand in the wider bars only.
    assert {text.get_text() for text in axes.texts} >= {"50 %", "20 %", "90 %"}
    assert legend_of(figure) == [f"AIS {level}" for level in range(7)]
    check_drawn(figure)


def test_roc_curves_are_drawn_with_their_mark() -> None:
    x = np.array([0.0, 0.2, 1.0])
    figure = risk.draw_roc({"AIS3+": (x, np.sqrt(x))}, {"AIS3+": (0.2, 0.45)}, "HIC 700")
    check_units(figure)
    points = [line.get_xydata() for line in figure.axes[0].lines if line.get_marker() == "o"]
    assert_allclose(next(p for p in points if len(p)), [[0.2, 0.45]])
    assert legend_of(figure) == ["AIS3+", "HIC 700"]
    check_drawn(figure)


def steps_at(figure: Figure, label: str, x: float) -> float:
    """Return what a drawn step line shows at x."""
    (line,) = [one for one in figure.axes[0].lines if one.get_label() == label]
    places, values = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    after = line.get_drawstyle() == "steps-post"
    assert after or line.get_drawstyle() == "steps-pre"
    k = np.searchsorted(places, x, side="right") - 1 if after else np.searchsorted(places, x)
    return float(values[k])


def test_exceedance_shows_the_share_of_runs_above_with_a_band_and_the_limit() -> None:
    sample = np.array([1.0, 2.0, 3.0, 4.0])
    figure = risk.draw_exceedance({"reference": sample}, "HIC15 [–]", 2.5)
    check_units(figure, "HIC15 [–]")
    assert legend_of(figure) == ["reference", "limit 2.5"]
    # A. Dvoretzky, J. Kiefer, J. Wolfowitz 1956 with P. Massart's constant: sqrt(ln 40 / 2n).
    (band,) = figure.axes[0].collections
    tops = np.asarray(band.get_paths()[0].vertices)[:, 1]
    assert tops.max() == 1.0
    assert np.any(np.isclose(tops, 0.25 + np.sqrt(np.log(40.0) / 8.0)))
    # Above 2.5 lie 2 of the 4; with a NaN, never above, 2 of 5.
    samples = {"all": sample, "one missed": np.append(sample, np.nan), "none": np.full(5, np.nan)}
    figure = risk.draw_exceedance(samples, "x [m]", 2.5)
    assert steps_at(figure, "all", 2.5) == pytest.approx(0.5)
    assert steps_at(figure, "one missed", 2.5) == pytest.approx(0.4)
    check_drawn(figure)


@pytest.mark.parametrize("limit", [1e250, -1e300, 700.0])
def test_a_limit_beyond_the_runs_leaves_the_picture_whole(limit: float) -> None:
    figure = risk.draw_levels({"curves": {3: X}}, X, X, "HIC15 [–]", limit)
    check_drawn(figure)
    assert figure.axes[0].get_position().width > 0.7
    figure = risk.draw_exceedance({"as it stands": X}, "HIC15 [–]", limit)
    check_drawn(figure)
    assert any(text.startswith(f"limit {limit:g}") for text in legend_of(figure))


def test_histories_carry_units_and_show_milliseconds() -> None:
    time = np.linspace(0.0, 0.3, 301)
    figure = crash.draw_history(
        time, {"hood": 1e3 * time, "bumper": 2e3 * time}, ylabel="contact force [kN]",
        until=0.12, marks={"head meets the car": 0.08, "too late": 0.2},
    )  # fmt: skip
    check_units(figure, "time after first contact [ms]", "contact force [kN]")
    assert np.max(figure.axes[0].get_lines()[0].get_xdata()) == pytest.approx(120.0)
    assert legend_of(figure) == ["hood", "bumper", "head meets the car"]
    many = {f"zone {k}": time for k in range(9)}
    crash.draw_history(time, many, ylabel="contact force [kN]", until=0.1)


@dataclass(frozen=True)
class Mesh:
    """Facets that move."""

    nodes: Array
    faces: NDArray[np.int64]
    body: str = ""
    time: Array | None = None


@dataclass(frozen=True)
class Scene:
    """A ball and a stick that fly ahead of a box."""

    time: Array
    names: tuple[str, ...]
    semi_axes: Array
    centre: Array
    orientation: Array
    car: Array
    outline: tuple[Array, ...]
    plan: Array
    meshes: tuple[Mesh, ...] = ()


@pytest.fixture(scope="module")
def scene() -> Scene:
    time = np.linspace(0.0, 1.0, 41)
    centre = np.zeros((41, 2, 3))
    centre[:, :, 0] = 10.0 * time[:, None] + 0.1
    centre[:, :, 2] = [1.1, 0.5]
    return Scene(
        time,
        ("head", "leg_left"),
        np.array([[0.1, 0.08, 0.12], [0.05, 0.05, 0.3]]),
        centre,
        np.tile([1.0, 0.0, 0.0, 0.0], (41, 2, 1)),
        np.stack([8.0 * time, 0.0 * time, 0.1 * time], axis=1),
        (np.array([[0.0, 0.3], [0.0, 0.7], [-1.0, 0.9]]),),
        np.array([[0.0, -0.8], [0.0, 0.8], [-4.0, 0.8], [-4.0, -0.8]]),
    )


def test_the_strip_has_a_picture_for_each_time_with_segments_where_they_are(scene: Scene) -> None:
    figure = crash.draw_strip(scene, [0.0, 0.1, 0.24])
    check_units(figure, "x in the car's frame [m]", "height [m]")
    assert [axes.get_title() for axes in figure.axes] == ["0 ms", "100 ms", "250 ms"]
    assert all(axes.get_xlabel() for axes in figure.axes)
    outlines = [path.vertices for path in figure.axes[2].collections[0].get_paths()]
    boxes = [(*v.min(axis=0), *v.max(axis=0)) for v in map(np.asarray, outlines)]
    # x ahead of the car's frame: 0.1 + (10 - 8) 0.25 m; half axes 0.05 and 0.3, 0.1 and 0.12 m.
    expected = [(0.55, 0.2, 0.65, 0.8), (0.5, 0.98, 0.7, 1.22)]
    assert_allclose(sorted(boxes, key=lambda box: box[3]), expected, atol=1e-6)


def test_facets_are_drawn_behind_the_body_where_they_are(scene: Scene) -> None:
    triangle = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.7], [-0.5, 0.0, 0.7]])
    travel = np.zeros((41, 1, 3))
    travel[:, 0, 0] = scene.car[:, 0]
    meshed = replace(scene, meshes=(Mesh(triangle + travel, np.array([[0, 1, 2]])),))
    facets, body = crash.draw_strip(meshed, [0.5]).axes[0].collections
    assert_allclose(facets.get_paths()[0].vertices[:3], triangle[:, [0, 2]], atol=1e-12)
    assert facets.get_zorder() <= body.get_zorder() and len(body.get_paths()) == 2


def test_facets_of_a_rigid_body_move_with_it_and_stand_for_its_ellipsoid(scene: Scene) -> None:
    triangle = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.4], [-0.3, 0.0, 0.4]])
    faces = np.array([[0, 1, 2], [2, 1, 0]])
    meshed = replace(scene, meshes=(Mesh(triangle, faces, "car"), Mesh(triangle, faces, "head")))
    car, head, body = crash.draw_strip(meshed, [0.5]).axes[0].collections
    # One of two opposite facets faces the viewer.
    assert (len(car.get_paths()), len(head.get_paths()), len(body.get_paths())) == (1, 1, 1)
    turned = np.cos(0.05) * triangle[:, 0]
    places = [(car, np.stack([turned, triangle[:, 2]], axis=1)),
              (head, triangle[:, [0, 2]] + [0.1 + 2.0 * 0.5, 1.1])]  # fmt: skip
    for drawn, expected in places:
        found = np.asarray(drawn.get_paths()[0].vertices[:3])
        assert_allclose(np.sort(found, axis=0), np.sort(expected, axis=0), atol=1e-12)


def test_quadrilaterals_and_triangles_are_drawn_in_one_picture(scene: Scene) -> None:
    square = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.4, 0.0, 0.4], [0.0, 0.0, 0.4]])
    both = (
        Mesh(square, np.array([[0, 1, 2, 3]]), "car"),
        Mesh(square, np.array([[0, 1, 2]]), "car"),
    )
    shown = crash.draw_strip(replace(scene, meshes=both), [0.5]).axes[0].collections[0]
    reversed_ = tuple(replace(mesh, faces=mesh.faces[:, ::-1]) for mesh in both)
    hidden = crash.draw_strip(replace(scene, meshes=reversed_), [0.5]).axes[0].collections[0]
    # The side that faces the viewer is drawn: the square as two triangles.
    assert sorted(len(it.get_paths()) for it in (shown, hidden)) == [0, 3]


def test_the_animation_is_a_gif_of_several_pictures(scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "figures" / "crash.gif"
    crash.write_animation(scene, path, frames=3)
    with Image.open(path) as film:
        assert film.format == "GIF"
        assert 2 <= getattr(film, "n_frames", 1) <= 3


THREE = np.array([0.0, 1.0, 2.0])


def panel(title: str = "", **changes: Any) -> Panel:
    plain = {"xlabel": "time [ms]", "ylabel": "force [kN]", "title": title, "bands": [],
             "curves": [Curve(THREE, THREE**2, "ours")]}  # fmt: skip
    return Panel(**(plain | changes))


@pytest.mark.parametrize(("count", "columns", "rows", "wide"), [
    (1, 2, 1, 1), (2, 2, 1, 2), (3, 2, 2, 2), (4, 3, 2, 3),
])  # fmt: skip
def test_panels_fill_a_grid_without_spares(count: int, columns: int, rows: int, wide: int) -> None:
    titles = [f"no. {k}" for k in range(count)]
    figure = draw_panels([panel(t) for t in titles], columns=columns, width=3.0, height=2.0)
    assert_allclose(figure.get_size_inches(), [3.0 * wide, 2.0 * rows])
    assert len(figure.axes) == rows * wide
    assert [axes.get_title() for axes in figure.axes if axes.get_visible()] == titles
    for axes in figure.axes[:count]:
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [ms]", "force [kN]")
        assert len(axes.lines) == 1


def test_curves_and_bands_are_drawn_as_they_are_given() -> None:
    points = Curve(THREE, 2.0 * THREE, "runs", style.SKY, "", "o")
    dashed = Curve(THREE, 3.0 * THREE, None, "black", "--")
    band = Band(THREE, THREE - 1.0, THREE + 3.0, "reference", style.GREEN)
    figure = draw_panels([panel(curves=[points, dashed], bands=[band])])
    dots, line = figure.axes[0].lines
    assert_array_equal(dots.get_xydata(), np.stack([THREE, 2.0 * THREE], axis=1))
    assert_array_equal(line.get_ydata(), 3.0 * THREE)
    assert (dots.get_linestyle(), dots.get_marker(), dots.get_color()) == ("None", "o", style.SKY)
    assert (line.get_linestyle(), line.get_color()) == ("--", "black")
    (filled,) = figure.axes[0].collections
    corners = {tuple(point) for point in filled.get_paths()[0].vertices}
    assert {(0.0, -1.0), (0.0, 3.0), (2.0, 1.0), (2.0, 5.0)} <= corners
    assert filled.get_facecolor()[0] == pytest.approx(mpl.colors.to_rgba(style.GREEN, 0.2))
    assert sorted(legend_of(figure)) == ["reference", "runs"]


def test_limits_are_those_asked_for_and_no_value_or_name_is_no_error() -> None:
    figure = draw_panels([
        panel(xlim=(0.5, 1.5), ylim=(0.0, None)), panel(curves=[Curve(THREE, THREE)]),
        panel(curves=[Curve(THREE, np.full(3, np.nan), "none")]),
    ])  # fmt: skip
    cut, nameless, _ = figure.axes[:3]
    assert cut.get_xlim() == (0.5, 1.5)
    assert cut.get_ylim()[0] == 0.0 and cut.get_ylim()[1] > 4.0
    assert nameless.get_legend() is None
    check_drawn(figure)


def test_ticks_of_a_logarithmic_axis_are_plain_numbers() -> None:
    line = Curve(np.array([1.0, 1e4]), np.array([0.01, 100.0]))
    figure = draw_panels([Panel("x [m]", "y [m]", [line])])
    axes = figure.axes[0]
    use_log_scale(axes, "x")
    use_log_scale(axes, "y")
    figure.canvas.draw()
    shown = {text.get_text() for text in (*axes.get_xticklabels(), *axes.get_yticklabels())}
    assert {"100", "0.01"} <= shown
    assert not any("$" in text for text in shown)


LOST = "\N{REPLACEMENT CHARACTER}"


def words_of(figure: Figure) -> list[str]:
    """Draw a figure and return the words of its legends, on one line each."""
    check_drawn(figure)
    texts = [t.get_text() for legend in figure.findobj(Legend) for t in legend.get_texts()]
    return [text.removeprefix("\N{ZERO WIDTH SPACE}").replace("\n", " ") for text in texts]


def draw_distributions(values: Array, marks: list[Mark]) -> Figure:
    held = statistics.describe(values)
    frame = pd.DataFrame({"hic15": values})
    return distributions.draw_distributions(frame, {"hic15": "1"}, {"hic15": marks},
                                            {"hic15": held})  # fmt: skip


DRAWN = {
    "distributions": lambda label: draw_distributions(X, [Mark(0.5, label, "limit")]),
    "against an input": lambda label: relations.draw_against_input(
        pd.DataFrame({"impact_speed": X, "hic15": X}), *SPEED, {"hic15": "1"},
        {"hic15": [Mark(0.5, label, "limit")]}),
    "exceedance": lambda label: risk.draw_exceedance({label: X}, "HIC15 [–]", 0.5),
    "ROC": lambda label: risk.draw_roc({label: (X, X)}, {label: (0.1, 0.1)}, "limit 700"),
    "speed": lambda label: risk.draw_speed_risk(
        {label: {"speed": X, "risk": X, "low": X, "high": X}}, {}, "risk"),
    "loops": lambda label: stiffness.draw_force_penetration({label: (X, X), "other": (X, X)}),
    "history": lambda label: crash.draw_history(
        X, {label: X, "other": X}, ylabel="a [g]", until=1.0),
    "panels": lambda label: panels.draw_panels(
        [Panel("x [m]", "y [m]", [Curve(X, X, label)], title=label)]),
}  # fmt: skip


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("label", "shown"), [
    ("_limit of 2020", "_limit of 2020"),
    ("[bold]x[/] $a_b$ * 50 % \\frac{1}{2}:", "[bold]x[/] $a_b$ * 50 % \\frac{1}{2}:"),
    ("a\x07b\x1b[31m\tc\nd", f"a{LOST}b{LOST}[31m c d"),
    ("\N{CJK UNIFIED IDEOGRAPH-6F22}", LOST),
    (" ", "–"),
], ids=["underscore", "markup", "control", "no glyph", "nothing"])  # fmt: skip
def test_a_text_is_drawn_as_it_is_written(label: str, shown: str) -> None:
    assert style.safe(label).removeprefix("\N{ZERO WIDTH SPACE}") == shown
    assert shown in words_of(DRAWN["exceedance"](label))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", DRAWN)
def test_a_label_that_begins_with_an_underscore_is_in_the_legend(name: str) -> None:
    assert "_limit of 2020" in words_of(DRAWN[name]("_limit of 2020"))


def test_what_brings_a_label_into_the_legend_draws_nothing() -> None:
    pictures = []
    for text in ("_limit", style.safe("_limit")):
        figure = style.new_figure(2.0, 1.0)
        figure.text(0.1, 0.5, text)
        pictures.append(style.png_bytes(figure))
    assert pictures[0] == pictures[1]
    assert style.safe("_limit") != "_limit"


def test_a_long_text_is_wrapped_and_cut_and_leaves_the_bars_free() -> None:
    lines = style.safe("word " * 100).split("\n")
    assert [len(line) for line in lines] == [44, 44, 44]
    assert lines[-1].endswith("…")
    assert style.safe("x" * 50) == "x" * 44 + "\n" + "x" * 6
    assert style.quantity("_" + "a" * 200).count("\n") == 2
    marks = [Mark(0.1 * k, "long " * 40, "simulated") for k in range(3)]
    tall, short = (draw_distributions(X, m).axes[0].get_ylim()[1] for m in (marks, []))
    assert tall > 1.2 * short


def test_the_ends_of_an_axis_hold_what_varies_and_what_does_not() -> None:
    assert style.ends_of([0.0, 10.0]) == pytest.approx((-0.5, 10.5))
    assert style.ends_of([0.0, 10.0], [20.0, 1e250]) == pytest.approx((-1.0, 21.0))
    assert style.ends_of([700.0, 700.0 * (1.0 + 1e-15)]) == pytest.approx((661.5, 738.5))
    assert style.ends_of([0.0]) == pytest.approx((-1.1, 1.1))


def test_figures_are_saved_as_png_and_svg_the_same_every_time(tmp_path: Path) -> None:
    for name in ("first", "second"):
        style.save({"history": draw_panels([panel()])}, tmp_path / name)
    first, second = (
        {path.name: path.read_bytes() for path in (tmp_path / name).iterdir()}
        for name in ("first", "second")
    )
    assert first == second
    assert first.keys() == {"history.png", "history.svg"}


def test_the_users_settings_are_left_alone() -> None:
    with mpl.rc_context({"font.size": 23.0, "axes.grid": False}):
        before = dict(mpl.rcParams)
        title = draw_panels([panel("a title")]).axes[0].title
        assert dict(mpl.rcParams) == before
    assert title.get_fontsize() == 11.0
    assert not title.axes.spines["top"].get_visible()
    assert len(set(style.PALETTE)) == len(style.PALETTE)


def test_dents_are_drawn_with_their_depths(scene: Scene) -> None:
    # A panel of 2 x 2 squares that is pressed 40 mm at one corner and keeps 25 mm.
    x, y = (g.ravel() for g in np.meshgrid([-0.4, 0.0, 0.4], [-0.4, 0.0, 0.4], indexing="ij"))
    rest = np.stack([x, y, 0.8 + 0.0 * x], axis=1)
    pressed, kept = rest.copy(), rest.copy()
    pressed[8, 2], kept[8, 2] = 0.76, 0.775
    faces = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    panel = Mesh(np.stack([rest, pressed, kept]), faces, "car", np.array([0.0, 0.02, 0.04]))
    assert dents.draw_dents(scene) is None
    figure = dents.draw_dents(replace(scene, meshes=(panel,)))
    assert figure is not None
    written = [[text.get_text() for text in axes.texts] for axes in figure.axes[:2]]
    # Mean of a square's corners.
    assert written == [["10 mm"], ["6 mm"]]
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert any("[mm]" in label for label in labels) and any("[m]" in label for label in labels)


def test_a_surface_that_deforms_is_drawn_as_it_is_at_each_time(scene: Scene) -> None:
    square = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.0, 0.1], [0.0, 0.0, 0.1]])
    faces = np.array([[0, 1, 2, 3]])
    shapes = np.stack([square, 2.0 * square])
    moving = Mesh(shapes, faces, "car", np.array([0.0, float(scene.time[-1])]))
    at_rest = Mesh(square, faces, "car")

    def drawn(mesh: Mesh, time: float) -> Array:
        figure = crash.draw_strip(replace(scene, meshes=(mesh,)), [time])
        paths = figure.axes[0].collections[0].get_paths()
        return np.concatenate([path.vertices for path in paths])

    first, last = float(scene.time[0]), float(scene.time[-1])
    np.testing.assert_allclose(drawn(moving, first), drawn(at_rest, first))
    assert np.ptp(drawn(moving, last), axis=0).max() == pytest.approx(0.2)
