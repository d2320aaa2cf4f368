"""A cause that leaves structure is named if it explains nearly all, a free form all but little.

The numbers are those of hidden sets: evidence of the best cause, and what a free discrepancy would
still explain beside it.
"""

from dataclasses import replace

import pytest
from linear_tests import BUMP, SIZE, make_problem

from mcstudy.diagnosis.base_model import fit_base
from mcstudy.diagnosis.model_selection import Candidate, indistinguishable
from mcstudy.diagnosis.problem import Form

FORMULA = BUMP.forms[0]
TABLE = Form("bump", "table", {}, (SIZE,), named=False)
WITH_TABLE = replace(BUMP, forms=(*BUMP.forms, TABLE))

RIGHT = {
    "dashpot of dry friction": (363.0, 17.0),
    "logarithmic dashpot": (8_841.0, 115.0),
    "inertia behind a linear spring": (13_513.0, 117.0),
    "inertia behind a linear spring, larger": (28_781.0, 190.0),
    "hardening structure, far from the data": (662_851.0, 1_238.0),
}
RUPTURES = {
    "rupture 8 times the visible size": (527.0, 37.0),
    "rupture 19 times": (1_090.0, 88.0),
    "rupture 65 times": (8_590.0, 428.0),
    "rupture 76 times": (10_792.0, 1_057.0),
    "rupture 99 times": (34_692.0, 998.0),
    "rupture 208 times": (96_820.0, 2_755.0),
}
FORMULAS = {
    "Bessel filter": (2_434.0, 251.0),
    "clip with recovery": (17_484.0, 1_289.0),
    "hardening structure by a quadratic law": (122_003.0, 4_284.0),
}


def names(form: Form, gained: float, left: float) -> bool:
    problem = make_problem(1, tests=3)
    _, fitted = fit_base(problem)
    best = Candidate(WITH_TABLE, fitted, form, gained, {})
    return best.names(gained / (gained + left))


@pytest.mark.parametrize("found", RIGHT.values(), ids=RIGHT)
def test_another_form_of_the_right_cause_is_named(found: tuple[float, float]) -> None:
    assert names(TABLE, *found)


@pytest.mark.parametrize("found", RUPTURES.values(), ids=RUPTURES)
def test_a_free_form_that_imitates_something_else_is_not_named(found: tuple[float, float]) -> None:
    assert not names(TABLE, *found)


@pytest.mark.parametrize("found", FORMULAS.values(), ids=FORMULAS)
def test_a_formula_may_leave_more(found: tuple[float, float]) -> None:
    assert names(FORMULA, *found)
    assert not names(TABLE, *found)


def test_a_cause_that_explains_half_is_not_named() -> None:
    assert not names(FORMULA, 100.0, 100.0)


def test_causes_that_explain_nothing_are_not_listed_beside_one_that_leaves_structure() -> None:
    """A guide that rubs on the headform: a rest of 13 log units would list eleven causes."""
    _, fitted = fit_base(make_problem(1, tests=3))
    evidence = {"guide": 18.6, "inertia": 2.0, "mass": -0.2, "scale": -0.3}
    found = [
        Candidate(replace(BUMP, name=name), fitted, FORMULA, value, {})
        for name, value in evidence.items()
    ]
    assert indistinguishable(found, 12.6) == ("guide", "inertia")
    assert indistinguishable(found[:1] + found[2:], 12.6) == ()
