"""A risk curve with all that belongs to it: families, quality, influence of single cases."""

import functools
import json

import numpy as np
import pytest
from mcstudy_tools import generator
from numpy.testing import assert_array_equal

from mcstudy.execution.results import to_json
from mcstudy.injury import risk_curve
from mcstudy.injury.observations import Observations, observe
from mcstudy.injury.risk_curve import INFLUENCE_SHOWN, RiskDescription, describe_risk
from mcstudy.injury.survival import FAMILIES, QUALITY_AT, fit_risk_curve, quality_class
from mcstudy.injury.turnbull import estimate_steps
from mcstudy.typed_json import from_plain


@functools.cache
def cases(n: int = 50, seed: int = 1) -> Observations:
    """Return censored cases of a log-normal curve with its median at 1000, and three exact ones."""
    rng = generator(seed)
    x = np.exp(rng.normal(np.log(1000.0), 0.5, n))
    injured = x > np.exp(rng.normal(np.log(1000.0), 0.5, n))
    return observe(x, injured, injured & (np.cumsum(injured) <= 3))


@functools.cache
def analysis() -> RiskDescription:
    return describe_risk(cases())


def planted() -> Observations:
    """Return clean cases and, as case 31, one that was not injured far above all others."""
    x = np.geomspace(500.0, 2000.0, 60)
    injured = x > 1000.0 * np.where(np.arange(60) % 2 == 0, 0.8, 1.25)
    return observe(np.insert(x, 30, 20_000.0), np.insert(injured, 30, False))


def test_families_are_sorted_by_aic_and_the_best_is_shown() -> None:
    found = analysis()
    aic = [entry.aic for entry in found.families.values()]
    assert aic == sorted(aic)
    assert set(found.families) == set(FAMILIES)
    assert found.family == next(iter(found.families))
    for name, entry in found.families.items():
        fit = fit_risk_curve(cases(), name)
        expected = (fit.slope, fit.intercept, fit.log_likelihood, fit.aic, fit.stimulus_at(0.5)[0])
        names = ("slope", "intercept", "log_likelihood", "aic", "median")
        assert tuple(getattr(entry, key) for key in names) == expected


def test_the_best_curve_is_given_with_its_band_and_its_quality_at_the_standards_risks() -> None:
    found = analysis()
    fit, curve = fit_risk_curve(cases(), found.family), found.curve
    assert list(found.at) == ["0.05", "0.25", "0.5"]
    for p in QUALITY_AT:
        entry = found.at[f"{p:g}"]
        assert (entry.value, entry.low, entry.high) == fit.stimulus_at(p)
        width = (entry.high - entry.low) / entry.value
        assert entry.quality_index == pytest.approx(width)
        assert entry.quality == quality_class(width)
    assert curve.stimulus[0] > 0.0
    assert curve.stimulus[-1] >= cases().stimulus.max()
    assert_array_equal(curve.risk, fit.risk(curve.stimulus))
    assert_array_equal([curve.low, curve.high], fit.band(curve.stimulus))


def test_counts_and_the_estimate_without_a_family_are_those_of_the_cases() -> None:
    found, held = analysis(), cases()
    assert (found.cases, found.exact) == (50, 3)
    assert found.injured == int(held.injured.sum())
    assert_array_equal(found.rug.stimulus, held.stimulus)
    assert_array_equal(found.rug.injured, held.injured)
    x, steps = estimate_steps(held).steps()
    assert_array_equal(found.turnbull.stimulus, x)
    assert_array_equal(found.turnbull.risk, steps)


def test_influence_finds_a_planted_outlier_and_none_in_clean_cases() -> None:
    # ISO/TS 18506 asks for DFBETA (shared/reference/injury.md 2.4), of both parameters. The planted
    # case moves the stimulus at 5 % beyond the 95 % interval that the others give, and the slope by
    # more than two of its standard errors.
    held = planted()
    described = describe_risk(held)
    found, name = described.influence, described.family
    assert found.largest[0].case == 31
    assert len(found.largest) == INFLUENCE_SHOWN
    shifts = [abs(entry.shift) for entry in found.largest]
    assert shifts == sorted(shifts, reverse=True)
    assert shifts[0] > 1.3 * shifts[1]
    assert found.influential >= 1
    a, b = fit_risk_curve(held, name), fit_risk_curve(held.without(30), name)
    assert a.stimulus_at(0.05)[0] < b.stimulus_at(0.05)[1]
    assert abs(a.slope - b.slope) > 2.0 * np.sqrt(b.covariance[1, 1])
    assert analysis().influence.influential == 0


def test_influence_is_the_largest_shift_of_three_stimuli_in_standard_errors() -> None:
    # Shift of a case left out over the standard error without it (D. Belsley, E. Kuh, R. Welsch,
    # Regression Diagnostics, 1980), of ln x at 5, 25 and 50 % risk.
    found = analysis().influence.largest[0]
    whole, part = (
        fit_risk_curve(held, analysis().family)
        for held in (cases(), cases().without(found.case - 1))
    )
    shifts = []
    for p in (0.05, 0.25, 0.5):
        centre, low, high = np.log(part.stimulus_at(p))
        shifts.append((centre - np.log(whole.stimulus_at(p)[0])) / ((high - low) / 3.919928))
    assert found.shift == pytest.approx(max(shifts, key=abs), rel=1e-5)


def test_a_case_without_which_there_is_no_curve_is_influential() -> None:
    # Leaving out the uninjured at 450, or the injured at 350, separates the rest.
    x = np.array([100.0, 200.0, 300.0, 350.0, 450.0, 500.0, 600.0])
    found = describe_risk(observe(x, np.array([0, 0, 0, 1, 0, 1, 1], dtype=bool))).influence
    assert found.influential >= 2
    assert {e.case for e in found.largest if np.isinf(e.shift)} == {4, 5}
    # One that leaves a curve, of exact cases and one uninjured, is told by a number.
    x = 900.0 * np.exp(0.4 * generator(5).standard_normal(12))
    left = Observations(x, np.where(np.arange(12) == 0, np.inf, x))
    largest = describe_risk(left).influence.largest
    assert all(np.isfinite(entry.shift) for entry in largest)


def test_many_cases_are_not_left_out_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(risk_curve, "MAX_REFITTED", 49)
    found = describe_risk(cases())
    assert found.influence is None
    assert found.family == analysis().family


def test_the_description_is_json() -> None:
    found = analysis()
    assert from_plain(RiskDescription, json.loads(to_json(found))) == found


def test_no_curve_is_described_where_none_can_be_given() -> None:
    x = np.array([100.0, 200.0, 300.0, 400.0])
    with pytest.raises(ValueError, match="separation"):
        describe_risk(observe(x, x > 250.0))
    with pytest.raises(ValueError, match="does not rise"):
        describe_risk(observe(np.arange(1.0, 7.0), np.array([1, 1, 0, 1, 0, 0], dtype=bool)))
