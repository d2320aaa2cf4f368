"""A risk curve with all that belongs to it, and the figures of risk: content, axes, units."""

import functools
import json
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcstudy.execution.results import to_json
from mcstudy.figures import risk, style
from mcstudy.injury import risk_curve
from mcstudy.injury.observations import Observations, observe
from mcstudy.injury.risk_curve import INFLUENCE_SHOWN, describe_risk
from mcstudy.injury.survival import FAMILIES, QUALITY_AT, fit_risk_curve, quality_class
from mcstudy.injury.turnbull import estimate_steps

Array = NDArray[np.float64]


@functools.cache
def cases(n: int = 50, seed: int = 1) -> Observations:
    """Return censored cases of a log-normal curve with its median at 1000, and three exact ones."""
    rng = np.random.default_rng(seed)
    x = np.exp(rng.normal(np.log(1000.0), 0.5, n))
    injured = x > np.exp(rng.normal(np.log(1000.0), 0.5, n))
    exact = injured & (np.cumsum(injured) <= 3)
    return observe(x, injured, exact)


@functools.cache
def analysis() -> dict[str, Any]:
    return describe_risk(cases())


def assert_units(axes: Axes) -> None:
    """Check that both axes name a quantity with its unit in square brackets."""
    for label in (axes.get_xlabel(), axes.get_ylabel()):
        assert label.endswith("]"), label
        assert label.index("[") > 1, label


def drawn(figure: Figure) -> None:
    """Check that the figure can be drawn."""
    assert style.png_bytes(figure, dpi=50)[:4] == b"\x89PNG"


def words_of(figure: Figure) -> list[str]:
    held = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    return [text.get_text() for legend in held if legend is not None for text in legend.get_texts()]


# -- describe_risk ---------------------------------------------------------------------------


def test_families_are_sorted_by_aic_and_the_best_is_shown() -> None:
    found = analysis()
    aic = [entry["aic"] for entry in found["families"].values()]
    assert aic == sorted(aic)
    assert set(found["families"]) == set(FAMILIES)
    assert found["family"] == next(iter(found["families"]))
    for name, entry in found["families"].items():
        fit = fit_risk_curve(cases(), name)
        assert entry["slope"] == fit.slope
        assert entry["intercept"] == fit.intercept
        assert entry["aic"] == pytest.approx(4.0 - 2.0 * entry["log_likelihood"])
        assert entry["median"] == fit.stimulus_at(0.5)[0]


def test_counts_are_those_of_the_cases() -> None:
    found, held = analysis(), cases()
    assert found["cases"] == 50
    assert found["injured"] == int(held.injured.sum())
    assert found["exact"] == 3
    np.testing.assert_array_equal(found["rug"]["stimulus"], held.stimulus)
    np.testing.assert_array_equal(found["rug"]["injured"], held.injured)


def test_quality_is_given_at_the_risks_of_the_standard() -> None:
    found = analysis()
    fit = fit_risk_curve(cases(), found["family"])
    assert list(found["at"]) == ["0.05", "0.25", "0.5"]
    for p in QUALITY_AT:
        entry = found["at"][f"{p:g}"]
        assert (entry["value"], entry["low"], entry["high"]) == fit.stimulus_at(p)
        assert entry["quality_index"] == pytest.approx(
            (entry["high"] - entry["low"]) / entry["value"]
        )
        assert entry["quality"] == quality_class(entry["quality_index"])


def test_the_curve_spans_all_cases_with_its_band() -> None:
    curve = analysis()["curve"]
    assert curve["stimulus"][0] > 0.0
    assert curve["stimulus"][-1] >= cases().stimulus.max()
    assert np.all(np.diff(curve["risk"]) > 0.0)
    assert np.all((curve["low"] < curve["risk"]) & (curve["risk"] < curve["high"]))
    fit = fit_risk_curve(cases(), analysis()["family"])
    np.testing.assert_array_equal(curve["risk"], fit.risk(curve["stimulus"]))


def test_the_estimate_without_a_family_is_turnbulls() -> None:
    x, steps = estimate_steps(cases()).steps()
    np.testing.assert_array_equal(analysis()["turnbull"]["stimulus"], x)
    np.testing.assert_array_equal(analysis()["turnbull"]["risk"], steps)


def planted() -> Observations:
    """Return clean cases and, as case 31, one that was not injured far above all others."""
    x = np.geomspace(500.0, 2000.0, 60)
    injured = x > 1000.0 * np.where(np.arange(60) % 2 == 0, 0.8, 1.25)
    return observe(np.insert(x, 30, 20_000.0), np.insert(injured, 30, False))


def test_influence_finds_a_planted_outlier() -> None:
    found = describe_risk(planted())["influence"]
    assert found is not None
    assert found["largest"][0]["case"] == 31
    assert len(found["largest"]) == INFLUENCE_SHOWN
    shifts = [abs(entry["shift"]) for entry in found["largest"]]
    assert shifts == sorted(shifts, reverse=True)
    assert shifts[0] > 1.3 * shifts[1]


def test_a_case_that_moves_the_curve_out_of_its_interval_is_influential() -> None:
    # ISO/TS 18506 asks for DFBETA (shared/reference/injury.md 2.4), of both parameters. The planted
    # case moves the stimulus at 5 % beyond the 95 % interval that the others give, and the slope by
    # more than two of its standard errors.
    held, name = planted(), describe_risk(planted())["family"]
    a, b = fit_risk_curve(held, name), fit_risk_curve(held.without(30), name)
    assert a.stimulus_at(0.05)[0] < b.stimulus_at(0.05)[1]
    assert abs(a.slope - b.slope) > 2.0 * np.sqrt(b.covariance[1, 1])
    assert describe_risk(held)["influence"]["influential"] >= 1


def test_influence_is_the_largest_shift_of_three_stimuli_in_standard_errors() -> None:
    # Shift of a case left out over the standard error without it (D. Belsley, E. Kuh, R. Welsch,
    # Regression Diagnostics, 1980), of ln x at 5, 25 and 50 % risk.
    found = analysis()["influence"]["largest"][0]
    name, k = analysis()["family"], found["case"] - 1
    whole, part = (fit_risk_curve(c, name) for c in (cases(), cases().without(k)))
    shifts = []
    for p in (0.05, 0.25, 0.5):
        centre, low, high = np.log(part.stimulus_at(p))
        before = np.log(whole.stimulus_at(p)[0])
        shifts.append((centre - before) / ((high - low) / 3.919928))
    assert found["shift"] == pytest.approx(max(shifts, key=abs), rel=1e-5)


def test_clean_cases_have_no_influential_one() -> None:
    assert analysis()["influence"]["influential"] == 0


def test_a_case_without_which_there_is_no_curve_is_influential() -> None:
    # Leaving out the uninjured at 450, or the injured at 350, separates the rest.
    x = np.array([100.0, 200.0, 300.0, 350.0, 450.0, 500.0, 600.0])
    found = describe_risk(observe(x, np.array([0, 0, 0, 1, 0, 1, 1], dtype=bool)))["influence"]
    assert found["influential"] >= 2
    lost = {e["case"] for e in found["largest"] if np.isinf(e["shift"])}
    assert lost == {4, 5}


def test_many_cases_are_not_left_out_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(risk_curve, "MOST_REFITTED", 49)
    found = describe_risk(cases())
    assert found["influence"] is None
    assert found["family"] == analysis()["family"]


@pytest.mark.parametrize("held", [cases, planted], ids=["plain", "planted"])
def test_the_description_is_json(held: Any) -> None:
    found = describe_risk(held())
    back = json.loads(to_json(found))
    assert back["family"] == found["family"]
    assert list(back["families"]) == list(found["families"])
    assert back["at"]["0.25"]["value"] == found["at"]["0.25"]["value"]
    np.testing.assert_array_equal(back["curve"]["risk"], found["curve"]["risk"])
    np.testing.assert_array_equal(back["rug"]["injured"], found["rug"]["injured"])


def test_no_curve_is_described_where_none_can_be_given() -> None:
    x = np.array([100.0, 200.0, 300.0, 400.0])
    with pytest.raises(ValueError, match="separation"):
        describe_risk(observe(x, x > 250.0))
    with pytest.raises(ValueError, match="does not rise"):
        describe_risk(observe(np.arange(1.0, 7.0), np.array([1, 1, 0, 1, 0, 0], dtype=bool)))


# -- the fitted curve ------------------------------------------------------------------------


def test_the_risk_curve_is_drawn_with_band_steps_and_rug() -> None:
    figure = risk.draw_risk_curve(analysis(), "HIC15 [–]", "skull fracture")
    (axes,) = figure.axes
    assert_units(axes)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("HIC15 [–]", "risk [–]")
    assert axes.get_title() == "skull fracture"
    low, high = axes.get_ylim()
    assert low < 0.0
    assert high > 1.0
    shown = words_of(figure)
    hurt = int(cases().injured.sum())
    for word in (
        "95 % band",
        analysis()["family"],
        f"injured ({hurt})",
        f"uninjured ({50 - hurt})",
    ):
        assert word in shown
    assert any("Turnbull" in word for word in shown)
    (curve,) = [line for line in axes.lines if line.get_label() == analysis()["family"]]
    np.testing.assert_array_equal(curve.get_ydata(), analysis()["curve"]["risk"])
    drawn(figure)


def test_lines_mark_the_stimulus_at_5_25_and_50_percent() -> None:
    figure = risk.draw_risk_curve(analysis(), "HIC15 [–]", "")
    dotted = [line for line in figure.axes[0].lines if line.get_linestyle() == ":"]
    assert len(dotted) == 3
    for line, p in zip(dotted, QUALITY_AT, strict=True):
        corner = np.asarray(line.get_xydata())[1]
        np.testing.assert_allclose(corner, [analysis()["at"][f"{p:g}"]["value"], p])


def test_the_rug_has_a_mark_a_case_on_its_side() -> None:
    figure = risk.draw_risk_curve(analysis(), "HIC15 [–]", "")
    marks = {line.get_label(): line for line in figure.axes[0].lines if line.get_marker() == "|"}
    assert len(marks) == 2
    for label, line in marks.items():
        injured = str(label).startswith("injured")
        expected = cases().stimulus[cases().injured == injured]
        np.testing.assert_array_equal(np.sort(np.asarray(line.get_xdata())), np.sort(expected))
        heights = np.asarray(line.get_ydata())
        assert np.all(heights > 0.9) if injured else np.all(heights < 0.1)


def test_a_description_read_back_from_json_is_drawn_alike() -> None:
    back = json.loads(to_json(analysis()))
    a = risk.draw_risk_curve(analysis(), "HIC15 [–]", "t")
    b = risk.draw_risk_curve(back, "HIC15 [–]", "t")
    assert style.png_bytes(a, dpi=50) == style.png_bytes(b, dpi=50)


# -- the other figures -----------------------------------------------------------------------


def test_levels_are_drawn_over_the_density_of_the_stimulus() -> None:
    x = np.linspace(1.0, 2000.0, 50)
    curves = {"one": {2: x / 2000.0, 3: x / 4000.0}, "other": {3: x / 3000.0}}
    figure = risk.draw_levels(curves, x, np.linspace(100.0, 900.0, 500), "HIC15 [–]", 700.0)
    above, below = figure.axes
    assert above.get_ylabel() == "risk [–]"
    assert below.get_xlabel() == "HIC15 [–]"
    assert "density" in below.get_ylabel()
    assert words_of(figure) == ["AIS2+, one", "AIS3+, one", "AIS3+, other"]
    colours = {line.get_label(): line.get_color() for line in above.lines}
    assert colours["AIS3+, one"] == colours["AIS3+, other"] != colours["AIS2+, one"]
    assert any("700" in text.get_text() for text in above.texts)
    # The bars are a density: their area is one.
    area = sum(bar.get_height() * bar.get_width() for bar in below.patches)
    assert area == pytest.approx(1.0)
    drawn(figure)


def test_levels_without_a_limit_have_no_line_for_it() -> None:
    x = np.linspace(0.01, 2.0, 20)
    figure = risk.draw_levels({"one": {1: x / 2.0}}, x, x, "BrIC [–]")
    assert len(figure.axes[0].lines) == 1
    assert not figure.axes[0].texts


def test_risk_against_speed_is_drawn_with_published_curves() -> None:
    speed = np.linspace(10.0, 60.0, 6)
    band = {"speed": speed, "risk": speed / 100, "low": speed / 120, "high": speed / 80}
    figure = risk.draw_speed_risk(
        {"AIS3+": band}, {"Rosén": (speed, speed / 200)}, "by impact speed"
    )
    (axes,) = figure.axes
    assert_units(axes)
    assert axes.get_xlabel() == "impact speed [km/h]"
    assert axes.get_ylim() == (0.0, 1.0)
    assert words_of(figure) == ["AIS3+", "Rosén"]
    drawn(figure)


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
    np.testing.assert_allclose(list(widths.values()), 1.0)
    assert len(widths) == 2
    # Percentages stand in the wider bars only.
    assert {text.get_text() for text in axes.texts} >= {"50 %", "20 %", "90 %"}
    assert words_of(figure) == [f"AIS {level}" for level in range(7)]
    drawn(figure)


def test_roc_curves_are_drawn_with_their_mark() -> None:
    x = np.array([0.0, 0.2, 1.0])
    figure = risk.draw_roc({"AIS3+": (x, np.sqrt(x))}, {"AIS3+": (0.2, 0.45)}, "HIC 700")
    (axes,) = figure.axes
    assert_units(axes)
    marks = [
        line.get_xydata()
        for line in axes.lines
        if line.get_marker() == "o" and len(line.get_xydata())
    ]
    np.testing.assert_allclose(marks[0], [[0.2, 0.45]])
    assert words_of(figure) == ["AIS3+", "HIC 700"]
    drawn(figure)


def test_exceedance_has_a_band_and_the_limit() -> None:
    sample = np.array([1.0, 2.0, 3.0, 4.0])
    figure = risk.draw_exceedance({"reference": sample}, "HIC15 [–]", 2.5)
    (axes,) = figure.axes
    assert_units(axes)
    assert axes.get_xlabel() == "HIC15 [–]"
    assert words_of(figure) == ["reference", "limit 2.5"]
    # A. Dvoretzky, J. Kiefer, J. Wolfowitz 1956 with P. Massart's constant: sqrt(ln 40 / 2n).
    (band,) = axes.collections
    reach = np.sqrt(np.log(40.0) / 8.0)
    tops = np.asarray(band.get_paths()[0].vertices)[:, 1]
    assert tops.max() == 1.0
    assert np.any(np.isclose(tops, 0.25 + reach))
    drawn(figure)


def steps_at(figure: Figure, label: str, x: float) -> float:
    """Return what a drawn step line shows at x."""
    (line,) = [one for one in figure.axes[0].lines if one.get_label() == label]
    places, values = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    if line.get_drawstyle() == "steps-post":
        return float(values[np.searchsorted(places, x, side="right") - 1])
    assert line.get_drawstyle() == "steps-pre"
    return float(values[np.searchsorted(places, x, side="left")])


def test_exceedance_shows_the_share_of_runs_above() -> None:
    # Above 2.5 lie 2 of the 4; with a NaN, never above, 2 of 5.
    sample = np.array([1.0, 2.0, 3.0, 4.0])
    figure = risk.draw_exceedance(
        {"all": sample, "one missed": np.append(sample, np.nan)}, "x", 2.5
    )
    assert steps_at(figure, "all", 2.5) == pytest.approx(0.5)
    assert steps_at(figure, "one missed", 2.5) == pytest.approx(0.4)


def test_exceedance_of_runs_without_any_value_is_drawn() -> None:
    drawn(risk.draw_exceedance({"none": np.full(5, np.nan), "some": np.arange(5.0)}, "x", 2.0))
