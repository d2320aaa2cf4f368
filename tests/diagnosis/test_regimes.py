"""Factors of a discrepancy: what differs from test to test by more than errors of recording."""

from dataclasses import replace

import numpy as np
import pytest
from linear_tests import make_problem

from mcstudy.diagnosis.layout import Layout
from mcstudy.diagnosis.regimes import separate_factors

ORDERS = {
    "rising": np.arange(12.0),
    "falling": np.arange(12.0)[::-1],
    "shuffled": np.array([4.0, 9, 0, 7, 11, 2, 5, 10, 1, 8, 3, 6]),
}


def layouts_of(
    order: np.ndarray, *, speed: float | None = None, speed_sd: float = 0.05
) -> list[Layout]:
    """Return twelve tests from 5 to 10 m/s in an order, or all at one nominal speed."""
    found = []
    errors = np.random.default_rng(4).normal(0.0, speed_sd, 12)
    for test, place, error in zip(make_problem(3).tests, order, errors, strict=True):
        inputs = dict(test.inputs)
        if speed is not None:
            inputs["impact_speed"] = speed + float(error)
        changed = replace(
            test,
            inputs=inputs,
            doubtful={"impact_speed": speed_sd},
            covariates={"order": float(place)},
        )
        found.append(Layout(changed, 0.0, (0.0, 0.015)))
    return found


@pytest.mark.parametrize(
    ("order", "kept"),
    [
        ("rising", ["impact_speed"]),
        ("falling", ["impact_speed"]),
        ("shuffled", ["impact_speed", "order"]),
    ],
)
def test_an_order_that_follows_the_speed_is_no_factor_of_its_own(
    order: str, kept: list[str]
) -> None:
    assert list(separate_factors(layouts_of(ORDERS[order]))) == kept


def test_speeds_that_differ_by_their_errors_alone_are_no_factor() -> None:
    assert list(separate_factors(layouts_of(ORDERS["rising"], speed=8.0))) == ["order"]


def test_two_covariates_that_are_the_same_are_one_factor() -> None:
    layouts = [
        replace(
            layout,
            test=replace(
                layout.test,
                covariates={
                    "order": layout.test.covariates["order"],
                    "temperature": 20.0 - 0.3 * layout.test.covariates["order"],
                },
            ),
        )
        for layout in layouts_of(ORDERS["shuffled"])
    ]
    assert list(separate_factors(layouts)) == ["impact_speed", "order"]
