"""Reports and figures: hostile text, no network, units on every axis."""

import base64
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from mcstudy import statistics
from mcstudy.figures import crash, distributions, relations, style
from mcstudy.figures.distributions import Mark
from mcstudy.report import Section, Table, render

Array = NDArray[np.float64]

HOSTILE = "<script>alert('1')</script>\" onload=\"alert(2) & {{ 7 * 7 }} {% raw %} </title></style>"
UNITS = {"hic15": "1", "throw_distance": "m", "wad": "m"}
MARKS = {
    "hic15": [Mark(700.0, "HIC limit 700", "limit")],
    "throw_distance": [Mark(14.0, "accident, 14 m", "observed")],
    "wad": [Mark(1.35, "accident", "observed"), Mark(1.32, "MBS", "simulated")],
}


class Document(HTMLParser):
    """The tags, attributes and text of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.text: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]

    def handle_data(self, data: str) -> None:
        self.text.append(data)


@pytest.fixture(scope="module")
def runs() -> pd.DataFrame:
    """Return runs of two made-up inputs; every 25th has no head impact."""
    rng = np.random.default_rng(12)
    n = 400
    speed = rng.normal(11.7, 0.55, n)
    frame = pd.DataFrame(
        {
            "impact_speed": speed,
            "hood_stiffness": rng.random(n),
            "hic15": np.exp(6.9 + 0.25 * (speed - 11.7) + 0.3 * rng.normal(size=n)),
            "throw_distance": 13.5 + 1.8 * (speed - 11.7) + rng.normal(size=n),
            "wad": 1.32 + 0.05 * rng.normal(size=n),
        }
    )
    frame.loc[::25, ["hic15", "wad"]] = np.nan
    return frame


def described(runs: pd.DataFrame) -> dict[str, Any]:
    return {name: statistics.describe(runs[name].to_numpy()) for name in UNITS}


def picture() -> Figure:
    time = np.linspace(0.0, 0.1, 50)
    return crash.draw_history(time, {"head": time}, ylabel="head acceleration [g]", until=0.1)


# -- report ----------------------------------------------------------------------------------


def hostile_page() -> str:
    table = Table(HOSTILE, [HOSTILE, "mean [m]"], [[HOSTILE, "1.0"], ["", HOSTILE]])
    section = Section(HOSTILE, [HOSTILE], [table], {HOSTILE: picture()}, {HOSTILE: b"GIF89a"})
    return render(HOSTILE, HOSTILE, [section, Section("last")])


def test_hostile_text_is_shown_and_never_obeyed() -> None:
    page = hostile_page()
    document = Document(page)
    assert "script" not in document.tags
    assert not [name for _, name, _ in document.attributes if name.startswith("on")]
    assert "<script" not in page
    assert "49" not in "".join(document.text)
    # Title twice, subtitle, link, heading, paragraph; a table's caption, head and two cells; two
    # figures' captions.
    assert "".join(document.text).count(HOSTILE) == 12
    alternatives = [value for _, name, value in document.attributes if name == "alt"]
    assert alternatives == [HOSTILE, HOSTILE]
    assert document.tags.count("title") == document.tags.count("style") == 1


def test_report_needs_nothing_from_outside() -> None:
    page = hostile_page()
    document = Document(page)
    text = re.sub(r"base64,[A-Za-z0-9+/=]*", "", page)
    assert len(text) < len(page) / 2
    assert not re.search(r"https?:|//[a-z]|@import|url\(", text)
    assert not {"link", "script", "iframe", "object", "embed"} & set(document.tags)
    for tag, name, value in document.attributes:
        if name in ("src", "href", "srcset", "data", "action"):
            assert value.startswith("data:image/" if tag == "img" else "#")


def test_report_holds_tables_figures_and_animations() -> None:
    figure = picture()
    animation = io.BytesIO()
    frame = Image.new("P", (4, 4))
    frame.save(animation, format="GIF", save_all=True, append_images=[frame])
    section = Section(
        "Result",
        ["One line.", "Another."],
        [Table("Outputs", ["output", "mean"], [["wad", "1.32 (1.30 to 1.34)"], ["hic15", "–"]])],
        {"A figure.": figure},
        {"A film.": animation.getvalue()},
    )
    page = render("Title", "Subtitle", [section])
    document = Document(page)
    text = [part.strip() for part in document.text if part.strip()]
    for part in ("Title", "Subtitle", "Result", "One line.", "Another.", "Outputs", "output",
                 "wad", "1.32 (1.30 to 1.34)", "–", "A figure.", "A film."):  # fmt: skip
        assert part in text
    sources = [value for _, name, value in document.attributes if name == "src"]
    first, second = (base64.b64decode(source.split("base64,")[1]) for source in sources)
    assert Image.open(io.BytesIO(first)).format == "PNG"
    assert second == animation.getvalue()
    assert sources[1].startswith("data:image/gif;")
    anchors = {value for tag, name, value in document.attributes if tag == "a" and name == "href"}
    marks = {value for _, name, value in document.attributes if name == "id"}
    assert anchors == {f"#{mark}" for mark in marks}


def test_an_empty_report_is_a_page() -> None:
    assert render("Title", "", []).startswith("<!DOCTYPE html>")


# -- labels ----------------------------------------------------------------------------------


def shown(axes: Axes) -> list[str]:
    return [label for label in (axes.get_xlabel(), axes.get_ylabel()) if label]


def check_units(figure: Figure, *, names: Sequence[str] = ()) -> None:
    """Check that each label carries a unit and each axis that is not shared has a label."""
    assert figure.axes
    for axes in figure.axes:
        for label in shown(axes):
            assert re.search(r"\[[^\]]+\]", label), label
    labels = [label for axes in figure.axes for label in shown(axes)]
    for name in names:
        assert any(name in label for label in labels), (name, labels)


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


def test_distributions_carry_units(runs: pd.DataFrame) -> None:
    figure = distributions.draw_distributions(runs, UNITS, MARKS, described(runs))
    assert len(figure.axes) == 6
    check_units(figure, names=["HIC15 [–]", "throw distance [m]", "(WAD) [m]", "runs in the bin"])
    for below in figure.axes[3:]:
        assert below.get_xlabel()
    assert figure.axes[0].get_ylabel()
    assert figure.axes[3].get_ylabel()
    legend = figure.axes[0].get_legend()
    assert legend is not None
    assert "HIC limit 700" in [text.get_text() for text in legend.get_texts()]


def test_distributions_draw_what_json_leaves_of_the_analysis(runs: pd.DataFrame) -> None:
    # Intervals that do not exist are null in analysis.json, NaN before.
    for nothing in (None, np.nan):
        analysis = described(runs)
        analysis["wad"]["quantiles"]["0.5"] |= {"low": nothing, "high": nothing}
        figure = distributions.draw_distributions(runs, {"wad": "m"}, {}, analysis)
        assert style.png_bytes(figure).startswith(b"\x89PNG")


def test_cumulative_share_is_the_share_of_runs_below(runs: pd.DataFrame) -> None:
    figure = distributions.draw_distributions(runs, UNITS, {}, described(runs))
    line = figure.axes[4].get_lines()[0]
    values, share = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    median = np.median(runs["throw_distance"])
    assert np.interp(median, values, share) == pytest.approx(0.5, abs=1.0 / len(runs))
    assert share[-1] == 1.0


def test_correlations_are_named_and_print_noise_grey(runs: pd.DataFrame) -> None:
    ranks = runs.corr("spearman").loc[["impact_speed", "hood_stiffness"], list(UNITS)]
    figure = relations.draw_correlations(ranks, 1.96 / np.sqrt(len(runs) - 1))
    check_units(figure, names=["rank correlation [–]"])
    axes = figure.axes[0]
    assert [t.get_text() for t in axes.get_yticklabels()] == ["impact speed", "hood stiffness"]
    texts = {text.get_text(): text.get_color() for text in axes.texts}
    assert set(texts) == {f"{value:.2f}" for value in ranks.to_numpy().ravel()}
    assert texts[f"{ranks.loc['impact_speed', 'throw_distance']:.2f}"] != "#A0A0A0"
    assert texts[f"{ranks.loc['hood_stiffness', 'hic15']:.2f}"] == "#A0A0A0"


def test_outputs_against_an_input_carry_units(runs: pd.DataFrame) -> None:
    figure = relations.draw_against_input(runs, "impact_speed", "impact speed [m/s]", UNITS, MARKS)
    assert len(figure.axes) == 3
    check_units(figure, names=["HIC15 [–]", "throw distance [m]"])
    for axes in figure.axes:
        assert axes.get_xlabel() == "impact speed [m/s]"
        assert axes.get_ylabel()


@pytest.mark.parametrize("point", [{}, {"throw_distance": 14.0, "wad": 1.35}, {"wad": 1.35}])
def test_two_outputs_together_carry_units_and_the_accident(
    runs: pd.DataFrame, point: dict[str, float]
) -> None:
    figure = relations.draw_joint(runs, ("throw_distance", "m"), ("wad", "m"), point)
    check_units(figure, names=["throw distance [m]", "(WAD) [m]"])
    legend = figure.axes[0].get_legend()
    assert legend is not None
    drawn = "accident" in [text.get_text() for text in legend.get_texts()]
    assert drawn == (len(point) == 2)


def test_convergence_carries_units(runs: pd.DataFrame) -> None:
    tables = {
        name: statistics.convergence(runs[name].to_numpy(), lambda part: float(np.median(part)))
        for name in UNITS
    }
    figure = relations.draw_convergence(tables, UNITS)
    check_units(figure, names=["median HIC15 [–]", "median throw distance [m]", "runs [–]"])
    for axes in figure.axes:
        assert axes.get_xlabel()
        assert axes.get_ylabel()


def test_histories_carry_units_and_show_milliseconds() -> None:
    time = np.linspace(0.0, 0.3, 301)
    figure = crash.draw_history(
        time,
        {"hood": 1e3 * time, "bumper": 2e3 * time},
        ylabel="contact force [kN]",
        until=0.12,
        marks={"head meets the car": 0.08, "too late": 0.2},
    )
    check_units(figure, names=["time after first contact [ms]", "contact force [kN]"])
    axes = figure.axes[0]
    hood = axes.get_lines()[0]
    assert np.max(hood.get_xdata()) == pytest.approx(120.0)
    legend = axes.get_legend()
    assert legend is not None
    assert [t.get_text() for t in legend.get_texts()] == ["hood", "bumper", "head meets the car"]


def test_histories_of_many_channels_are_drawn() -> None:
    time = np.linspace(0.0, 0.1, 11)
    channels = {f"zone {k}": time for k in range(9)}
    crash.draw_history(time, channels, ylabel="contact force [kN]", until=0.1)


# -- pictures of a crash ---------------------------------------------------------------------


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


@pytest.fixture(scope="module")
def scene() -> Scene:
    time = np.linspace(0.0, 1.0, 41)
    centre = np.zeros((41, 2, 3))
    centre[:, :, 0] = 10.0 * time[:, None] + 0.1
    centre[:, :, 2] = [1.1, 0.5]
    car = np.zeros((41, 3))
    car[:, 0] = 8.0 * time
    car[:, 2] = 0.1 * time
    return Scene(
        time,
        ("head", "leg_left"),
        np.array([[0.1, 0.08, 0.12], [0.05, 0.05, 0.3]]),
        centre,
        np.tile([1.0, 0.0, 0.0, 0.0], (41, 2, 1)),
        car,
        (np.array([[0.0, 0.3], [0.0, 0.7], [-1.0, 0.9]]),),
        np.array([[0.0, -0.8], [0.0, 0.8], [-4.0, 0.8], [-4.0, -0.8]]),
    )


def test_the_strip_has_a_picture_for_each_time_with_units(scene: Scene) -> None:
    figure = crash.draw_strip(scene, [0.0, 0.1, 0.24])
    check_units(figure, names=["x in the car's frame [m]", "height [m]"])
    assert [axes.get_title() for axes in figure.axes] == ["0 ms", "100 ms", "250 ms"]
    assert all(axes.get_xlabel() for axes in figure.axes)


def test_a_segment_is_drawn_where_it_is_with_its_size(scene: Scene) -> None:
    figure = crash.draw_strip(scene, [0.25])
    outlines = [path.vertices for path in figure.axes[0].collections[0].get_paths()]
    boxes = sorted(
        (tuple(np.round([*np.min(v, axis=0), *np.max(v, axis=0)], 6)) for v in outlines),
        key=lambda box: box[3],
    )
    # x ahead of the car's frame: 0.1 + (10 - 8) 0.25 m; half axes 0.05 and 0.3, 0.1 and 0.12 m.
    assert boxes[0] == pytest.approx((0.55, 0.2, 0.65, 0.8), abs=1e-6)
    assert boxes[1] == pytest.approx((0.5, 0.98, 0.7, 1.22), abs=1e-6)


def test_the_animation_is_a_gif_of_several_pictures(scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "figures" / "crash.gif"
    crash.write_animation(scene, path, frames=5)
    with Image.open(path) as film:
        assert film.format == "GIF"
        assert 2 <= getattr(film, "n_frames", 1) <= 5


# -- style -----------------------------------------------------------------------------------


def test_figures_are_saved_as_png_and_svg_the_same_every_time(tmp_path: Path) -> None:
    for name in ("first", "second"):
        style.save({"history": picture()}, tmp_path / name)
    assert sorted(p.name for p in (tmp_path / "first").iterdir()) == ["history.png", "history.svg"]
    for ending in ("png", "svg"):
        first, second = (
            (tmp_path / name / f"history.{ending}").read_bytes() for name in ("first", "second")
        )
        assert first == second


def test_the_style_leaves_the_users_settings_alone() -> None:
    before = dict(mpl.rcParams)
    picture()
    assert dict(mpl.rcParams) == before


def test_colours_are_told_apart() -> None:
    assert len(set(style.PALETTE)) == len(style.PALETTE)
    assert all(re.fullmatch(r"#[0-9A-F]{6}", colour) for colour in style.PALETTE)
