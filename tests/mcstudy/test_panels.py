"""Panels of curves and bands: what is drawn, labelled and hidden."""

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from mcstudy.figures import style
from mcstudy.figures.panels import Band, Curve, Panel, draw_panels, use_log_scale

X = np.array([0.0, 1.0, 2.0])


def panel(title: str = "", **changes: object) -> Panel:
    plain = {
        "xlabel": "time [ms]",
        "ylabel": "force [kN]",
        "curves": [Curve(X, X**2, "ours")],
        "bands": [],
        "title": title,
    }
    return Panel(**(plain | changes))


def legend_words(figure: Figure, k: int = 0) -> list[str]:
    legend = figure.axes[k].get_legend()
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


@pytest.mark.parametrize(("count", "columns", "rows", "wide"), [
    (1, 2, 1, 1), (2, 2, 1, 2), (3, 2, 2, 2), (4, 3, 2, 3), (7, 3, 3, 3),
])  # fmt: skip
def test_panels_fill_a_grid_and_spare_axes_are_hidden(
    count: int, columns: int, rows: int, wide: int
) -> None:
    figure = draw_panels(
        [panel(f"no. {k}") for k in range(count)], columns=columns, width=3.0, height=2.0
    )
    np.testing.assert_allclose(figure.get_size_inches(), [3.0 * wide, 2.0 * rows])
    assert len(figure.axes) == rows * wide
    shown = [axes for axes in figure.axes if axes.get_visible()]
    assert [axes.get_title() for axes in shown] == [f"no. {k}" for k in range(count)]
    for axes in shown:
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [ms]", "force [kN]")
        assert len(axes.lines) == 1
    for axes in figure.axes[count:]:
        assert not axes.get_visible()


def test_a_curve_is_drawn_as_it_is_given() -> None:
    points = Curve(X, 2.0 * X, "runs", style.SKY, "", "o")
    dashed = Curve(X, 3.0 * X, None, "black", "--")
    figure = draw_panels([panel(curves=[points, dashed])])
    dots, line = figure.axes[0].lines
    np.testing.assert_array_equal(dots.get_xydata(), np.stack([X, 2.0 * X], axis=1))
    np.testing.assert_array_equal(line.get_ydata(), 3.0 * X)
    assert (dots.get_linestyle(), dots.get_marker(), dots.get_color()) == ("None", "o", style.SKY)
    assert (line.get_linestyle(), line.get_color()) == ("--", "black")
    assert legend_words(figure) == ["runs"]


def test_a_band_fills_what_lies_between_its_bounds() -> None:
    band = Band(X, X - 1.0, X + 3.0, "reference", style.GREEN)
    figure = draw_panels([panel(bands=[band])])
    (filled,) = figure.axes[0].collections
    corners = {tuple(point) for point in filled.get_paths()[0].vertices}
    assert {(0.0, -1.0), (0.0, 3.0), (2.0, 1.0), (2.0, 5.0)} <= corners
    assert filled.get_facecolor()[0] == pytest.approx(mpl.colors.to_rgba(style.GREEN, 0.2))
    assert sorted(legend_words(figure)) == ["ours", "reference"]


def test_limits_and_legend_are_those_asked_for() -> None:
    cut = panel(xlim=(0.5, 1.5), ylim=(0.0, None))
    nameless = panel(curves=[Curve(X, X)])
    figure = draw_panels([cut, nameless])
    assert figure.axes[0].get_xlim() == (0.5, 1.5)
    assert figure.axes[0].get_ylim()[0] == 0.0
    assert figure.axes[0].get_ylim()[1] > 4.0
    assert figure.axes[1].get_legend() is None


def test_no_value_is_no_line_and_no_error() -> None:
    figure = draw_panels([panel(curves=[Curve(X, np.full(3, np.nan), "none")])])
    assert np.isnan(figure.axes[0].lines[0].get_ydata()).all()
    assert len(style.png_bytes(figure)) > 1000


def test_the_users_settings_are_left_alone() -> None:
    with mpl.rc_context({"font.size": 23.0, "axes.grid": False}):
        figure = draw_panels([panel("a title")])
        assert mpl.rcParams["font.size"] == 23.0
        assert mpl.rcParams["axes.grid"] is False
    title = figure.axes[0].title
    assert isinstance(title, Text)
    assert title.get_fontsize() == 11.0
    assert not figure.axes[0].spines["top"].get_visible()


def test_ticks_of_a_logarithmic_axis_are_plain_numbers() -> None:
    line = Curve(np.array([1.0, 1e4]), np.array([0.01, 100.0]))
    figure = draw_panels([Panel("x [m]", "y [m]", [line])])
    axes = figure.axes[0]
    use_log_scale(axes, "x")
    use_log_scale(axes, "y")
    figure.canvas.draw()
    shown = [text.get_text() for text in (*axes.get_xticklabels(), *axes.get_yticklabels())]
    assert {"100", "0.01"} <= set(shown)
    assert not any("$" in text for text in shown)
