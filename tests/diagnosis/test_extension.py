"""The extended model as a study file: posteriors that reach beyond the model's range are cut."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcstudy.studyfile.study_inputs import map_inputs
from models.registry import load_model
from studies.diagnosis.extension import cut_shares, extend
from studies.kinds import parse_study
from studies.monte_carlo.schema import MonteCarloStudy

BASE = """format = "mcstudy-study/1"
kind = "monte-carlo"
name = "base"
title = "Base"

[model]
name = "headform"

[design]
n = 1000

[inputs.impact_speed]
distribution = "uniform"
low = 8.0
high = 9.0
unit = "m/s"
"""
INPUT = "sensor_filter_channel_class"


def row(value: float, low: float, high: float, family: str) -> dict[str, Any]:
    return {"name": "channel_class", "unit": "1", "fixed": False, "family": family,
            "value": value, "low": low, "high": high}  # fmt: skip


@settings(max_examples=40, deadline=None)
@given(
    value=st.floats(120.0, 9000.0), spread=st.floats(1.01, 30.0),
    family=st.sampled_from(["lognormal", "normal", "uniform"]),
)  # fmt: skip
def test_no_draw_of_an_extended_model_lies_outside_its_range(
    value: float, spread: float, family: str
) -> None:
    model = load_model("headform", {}, {"sensor_filter": {}})
    item = next(item for item in model.inputs if item.name == INPUT)
    parameters = {"sensor_filter": [row(value, value / spread, value * spread, family)]}
    study = parse_study(extend(BASE, parameters), "extended")
    assert isinstance(study, MonteCarloStudy)
    # As the runner does: it refuses any value outside the range.
    uniforms = (np.arange(1000)[:, None] + 0.5) / 1000.0 * np.ones((1, 2))
    drawn = map_inputs(study, model, uniforms)[INPUT]
    assert ((drawn >= item.low) & (drawn <= item.high)).all()
    assert np.ptp(drawn) > 0.0


def test_what_was_cut_off_is_known() -> None:
    ranges = {INPUT: (60.0, 4200.0)}
    # Half of a posterior about the end of the range lies beyond it.
    half = cut_shares({"sensor_filter": [row(4200.0, 2000.0, 8820.0, "lognormal")]}, ranges)
    assert half == {INPUT: pytest.approx(0.5, abs=1e-3)}
    tail = cut_shares({"sensor_filter": [row(1000.0, 1000.0 - 196.0, 1196.0, "normal")]},
                      {INPUT: (800.0, 1164.5)})  # fmt: skip
    # Below -2 and above 1.645 standard deviations.
    assert tail == {INPUT: pytest.approx(0.0228 + 0.05, abs=2e-3)}
    assert cut_shares({"sensor_filter": [row(600.0, 500.0, 720.0, "lognormal")]}, ranges) == {}
