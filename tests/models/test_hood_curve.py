"""The option hood_curve of the crash models: a fitted curve in place of the hood's corridor."""

from typing import Any

import pytest

from models.registry import load_model
from models.vehicle.profile import load_vehicle

CAR = load_vehicle("family_car_1990s")
MEDIAN = CAR.zones[CAR.zone_index("hood")].corridor.median.knots
SOFT = [[depth, 0.6 * force] for depth, force in MEDIAN]


@pytest.mark.parametrize("name", ["multibody", "facet", "planar"])
def test_the_corridors_own_median_changes_nothing_and_a_softer_curve_does(name: str) -> None:
    plain, same, soft = (
        dict(load_model(name, options).run({}).outputs)
        for options in ({}, {"hood_curve": MEDIAN}, {"hood_curve": SOFT})
    )
    assert same == plain
    assert soft["hic15"] < 0.95 * plain["hic15"]
    assert soft["hood_intrusion"] > plain["hood_intrusion"]


def test_a_headform_on_facets_takes_the_curve_too() -> None:
    plain, soft = (
        load_model("headform", {"surface": "facet", **options}).run({}).outputs["hic15"]
        for options in ({}, {"hood_curve": SOFT})
    )
    assert soft < 0.95 * plain


@pytest.mark.parametrize(
    "curve", [[[0.0, 0.0]], [[0.0, 1.0], [0.1, 2.0]], [0.0, 1.0], [[0.0, 0.0], [0.1, -1.0]]]
)
def test_knots_that_are_no_loading_curve_are_refused(curve: Any) -> None:
    with pytest.raises(ValueError, match=r"^curve of the hood: [^\n]*$"):
        load_model("multibody", {"hood_curve": curve})


def test_a_zone_that_is_not_there_has_no_curve() -> None:
    with pytest.raises(ValueError, match="has no zone 'boot'"):
        CAR.with_curve("boot", MEDIAN)
