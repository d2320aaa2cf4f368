"""Two causes: a second one is warranted by what both explain beyond the best single cause.

Candidates are made by hand: which of them compete is the rule under test, not their fits.
"""

from dataclasses import replace

import pytest
from linear_tests import BUMP, make_problem

from mcstudy.diagnosis import cause_pairs
from mcstudy.diagnosis.base_model import fit_base
from mcstudy.diagnosis.cause_pairs import best_pair
from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.model_selection import Candidate, Remainder

STRUCTURE = Remainder(1e-9, 0.999, 5.6, ("none", 0.0))
CLEAN = Remainder(1.0, 1.0, 0.0, ("none", 0.0))


def candidate(base: Fit, name: str, evidence: float, beside: str = "") -> Candidate:
    form = replace(BUMP.forms[0], cause=name)
    first = [replace(BUMP.forms[0], cause=beside)] if beside else []
    fitted = replace(base, forms=(*first, form))
    return Candidate(replace(BUMP, name=name, forms=(form,)), fitted, form, evidence, {})


def answer(
    monkeypatch: pytest.MonkeyPatch,
    singles: dict[str, float],
    seconds: dict[str, dict[str, float]],
) -> tuple[str, str] | None:
    problem = make_problem(1, tests=3)
    layouts, base = fit_base(problem)
    candidates = [candidate(base, name, evidence) for name, evidence in singles.items()]

    def rank(_problem: object, _layouts: object, first: Fit, *_more: object) -> list[Candidate]:
        beside = first.forms[-1].cause
        return [candidate(base, name, e, beside) for name, e in seconds.get(beside, {}).items()]

    def examine(*_given: object) -> Remainder:
        return CLEAN

    monkeypatch.setattr(cause_pairs, "rank_causes", rank)
    monkeypatch.setattr(cause_pairs, "examine", examine)
    found, _ = best_pair(problem, (), layouts, candidates, STRUCTURE, 1, None)
    return (found[0].first.cause.name, found[0].second) if found else None


def test_a_second_cause_that_explains_the_rest_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    assert answer(monkeypatch, {"a": 900.0}, {"a": {"b": 40.0, "c": 10.0}}) == ("a", "b")


def test_too_many_second_causes_are_none_though_another_pair_does_as_well(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A drifting hood of 18 hidden tests: its rest suits three causes, and was given a name."""
    singles = {"drift": 4357.5, "bias": 2259.5}
    seconds = {"drift": {"clock": 25.7, "gain": 25.6, "bias": 23.3}, "bias": {"drift": 2126.2}}
    assert answer(monkeypatch, singles, seconds) is None


def test_two_causes_must_beat_the_best_single_one(monkeypatch: pytest.MonkeyPatch) -> None:
    singles = {"alone": 500.0, "first": 400.0}
    assert answer(monkeypatch, singles, {"first": {"second": 102.0}}) is None
    assert answer(monkeypatch, singles, {"first": {"second": 140.0}}) == ("first", "second")


def test_a_second_cause_adds_its_share_of_a_large_first_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A saturation of 33,000 log units, whose rest an unloading slope took by 13 of them."""
    singles = {"saturation": 32_990.0}
    assert answer(monkeypatch, singles, {"saturation": {"unloading": 13.0}}) is None
    found = answer(monkeypatch, singles, {"saturation": {"unloading": 200.0}})
    assert found == ("saturation", "unloading")
