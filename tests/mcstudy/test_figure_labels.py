"""Texts that people wrote, in figures: in the legend as they are, on the canvas, no warning."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.legend import Legend

from mcstudy.figures import crash, distributions, panels, relations, risk, stiffness, style
from mcstudy.figures.distributions import Mark
from mcstudy.statistics import describe

pytestmark = pytest.mark.filterwarnings("error")

X = np.linspace(0.0, 1.0, 60)
LOST = "\N{REPLACEMENT CHARACTER}"
HOSTILE = {
    "underscore": ("_limit of 2020", "_limit of 2020"),
    "markup": ("[bold]x[/] $a_b$ * 50 % \\frac{1}{2}:", "[bold]x[/] $a_b$ * 50 % \\frac{1}{2}:"),
    "control": ("a\x07b\x1b[31m\tc\nd", f"a{LOST}b{LOST}[31m c d"),
    "no glyph": ("\N{CJK UNIFIED IDEOGRAPH-6F22}", LOST),
    "nothing": (" ", "–"),
}  # fmt: skip


def legend_of(figure: Figure) -> list[str]:
    """Draw a figure and return the words of its legends, on one line each."""
    style.png_bytes(figure, dpi=40)
    texts = [t.get_text() for legend in figure.findobj(Legend) for t in legend.get_texts()]
    return [text.removeprefix("\N{ZERO WIDTH SPACE}").replace("\n", " ") for text in texts]


def draw_distributions(values: np.ndarray, marks: list[Mark]) -> Figure:
    return distributions.draw_distributions(
        pd.DataFrame({"hic15": values}), {"hic15": "1"}, {"hic15": marks},
        {"hic15": describe(values)},
    )  # fmt: skip


def draw_relations(label: str) -> Figure:
    runs = pd.DataFrame({"impact_speed": X, "hic15": X})
    return relations.draw_against_input(
        runs, "impact_speed", "impact speed [km/h]", {"hic15": "1"},
        {"hic15": [Mark(0.5, label, "limit")]},
    )  # fmt: skip


DRAWN = {
    "distributions": lambda label: draw_distributions(X, [Mark(0.5, label, "limit")]),
    "against an input": draw_relations,
    "exceedance": lambda label: risk.draw_exceedance({label: X}, "HIC15 [–]", 0.5),
    "ROC": lambda label: risk.draw_roc({label: (X, X)}, {label: (0.1, 0.1)}, "limit 700"),
    "speed": lambda label: risk.draw_speed_risk(
        {label: {"speed": X, "risk": X, "low": X, "high": X}}, {}, "risk"
    ),
    "loops": lambda label: stiffness.draw_force_penetration({label: (X, X), "other": (X, X)}),
    "history": lambda label: crash.draw_history(
        X, {label: X, "other": X}, ylabel="a [g]", until=1.0
    ),
    "panels": lambda label: panels.draw_panels(
        [panels.Panel("x [m]", "y [m]", [panels.Curve(X, X, label)], title=label)]
    ),
}


@pytest.mark.parametrize(("label", "shown"), HOSTILE.values(), ids=HOSTILE)
def test_a_text_is_drawn_as_it_is_written(label: str, shown: str) -> None:
    assert style.safe(label).removeprefix("\N{ZERO WIDTH SPACE}") == shown
    assert shown in legend_of(DRAWN["exceedance"](label))


@pytest.mark.parametrize("draw", DRAWN.values(), ids=DRAWN)
def test_a_label_that_begins_with_an_underscore_is_in_the_legend(draw: object) -> None:
    assert callable(draw)
    assert "_limit of 2020" in legend_of(draw("_limit of 2020"))


def test_what_brings_a_label_into_the_legend_draws_nothing() -> None:
    pictures = []
    for text in ("_limit", style.safe("_limit")):
        figure = style.new_figure(2.0, 1.0)
        figure.text(0.1, 0.5, text)
        pictures.append(style.png_bytes(figure))
    assert pictures[0] == pictures[1]
    assert style.safe("_limit") != "_limit"


def test_a_long_text_is_wrapped_and_cut() -> None:
    lines = style.safe("word " * 100).split("\n")
    assert [len(line) for line in lines] == [44, 44, 44]
    assert lines[-1].endswith("…")
    assert style.safe("x" * 50) == "x" * 44 + "\n" + "x" * 6
    assert style.quantity("_" + "a" * 200).count("\n") == 2


def test_a_long_legend_leaves_the_bars_free() -> None:
    marks = [Mark(0.1 * k, "long " * 40, "simulated") for k in range(3)]
    tall = draw_distributions(X, marks).axes[0].get_ylim()[1]
    short = draw_distributions(X, []).axes[0].get_ylim()[1]
    assert tall > 1.2 * short


@pytest.mark.parametrize("limit", [1e250, -1e300, 700.0])
def test_a_limit_beyond_the_runs_leaves_the_picture_whole(limit: float) -> None:
    figure = risk.draw_levels({"curves": {3: X}}, X, X, "HIC15 [–]", limit)
    style.png_bytes(figure, dpi=40)
    assert figure.axes[0].get_position().width > 0.7
    samples = {"as it stands": X}
    shown = legend_of(risk.draw_exceedance(samples, "HIC15 [–]", limit))
    assert any(text.startswith(f"limit {limit:g}") for text in shown)


def test_the_ends_of_an_axis_hold_what_varies_and_what_does_not() -> None:
    assert style.ends_of([0.0, 10.0]) == pytest.approx((-0.5, 10.5))
    assert style.ends_of([0.0, 10.0], [20.0, 1e250]) == pytest.approx((-1.0, 21.0))
    assert style.ends_of([700.0, 700.0 * (1.0 + 1e-15)]) == pytest.approx((661.5, 738.5))
    assert style.ends_of([0.0]) == pytest.approx((-1.1, 1.1))


def test_two_runs_are_both_in_the_picture() -> None:
    figure = draw_distributions(np.array([3.0, 7.0]), [])
    bars = [bar for bar in figure.axes[0].containers[0] if bar.get_height()]
    assert [bar.get_x() for bar in bars] == pytest.approx([3.0, 6.9])


@pytest.mark.parametrize("values", [-1e9 - X, -1.0 - X],
                         ids=["a negative offset", "negative"])  # fmt: skip
def test_runs_below_zero_are_within_the_picture(values: np.ndarray) -> None:
    runs = pd.DataFrame({"impact_speed": X, "hic15": values})
    figure = relations.draw_against_input(
        runs, "impact_speed", "impact speed [km/h]", {"hic15": "1"}, {}
    )
    low, high = figure.axes[0].get_ylim()
    assert low < values.min() <= values.max() < high


def test_missing_cells_of_a_heat_map_have_a_dash() -> None:
    table = pd.DataFrame({"hic15": [0.5, None], "wad": [None, None]}, index=["age", "mass"])
    figure = relations.draw_correlations(table, 0.1)
    style.png_bytes(figure, dpi=40)
    shown = [(t.get_position(), t.get_text()) for t in figure.axes[0].texts]
    assert sorted(shown) == [
        ((0.5, 0.5), "0.50"), ((0.5, 1.5), "–"), ((1.5, 0.5), "–"), ((1.5, 1.5), "–"),
    ]  # fmt: skip
