"""Signals of a low channel class: the law that gives them, not the one that they seem to give."""

import numpy as np
import pytest
from builders import GRAVITY, Array

from models.headform.identification import StiffnessFit, fit_stiffness
from tests.closed_form_pulse import (
    LARGEST,
    MASS,
    PERMANENT,
    RATIO,
    SPEED,
    STIFFNESS,
    filtered,
    pulse,
)  # fmt: skip

RATE = 10_000.0
TIME = np.arange(-0.05, 0.06, 1.0 / RATE)
HOOD = np.array([[0.0, 0.0], [0.015, 2200.0], [0.055, 3200.0], [0.09, 4500.0]])


def fitted(values: Array, channel_class: float, **options: float) -> StiffnessFit:
    return fit_stiffness(TIME, values, SPEED, MASS, channel_class=channel_class, **options)


def stepped(knots: Array, ratio: float, speed: float, mass: float) -> tuple[Array, float]:
    """Return a contact's acceleration (g) at 200 kHz by plain steps, and its penetration (m)."""
    places, forces = knots.T
    depth, deepest, rate, step = 0.0, 0.0, speed, 5e-6
    felt = []
    while True:
        deepest = max(deepest, depth)
        top = float(np.interp(deepest, places, forces))
        force = top if depth >= deepest else max(top * (1 - ratio * (1 - depth / deepest)), 0.0)
        felt.append(force / mass / GRAVITY)
        if force == 0.0 and rate < 0.0:
            return np.array(felt), deepest
        rate -= step * force / mass
        depth += step * rate


@pytest.mark.parametrize(
    ("channel_class", "offset"),
    [(60.0, 0.0), (60.0, 12.0), pytest.param(60.0, -3.0, marks=pytest.mark.slow), (180.0, 0.0),
     pytest.param(600.0, 0.0, marks=pytest.mark.slow)],
)  # fmt: skip
def test_the_law_behind_a_filter_is_found(channel_class: float, offset: float) -> None:
    # Integrated, CFC60 gives 76.6 mm for 66.26, and first contact 1.2 ms early.
    fit = fitted(filtered(pulse(TIME), RATE, channel_class) + offset, channel_class, draws=0)
    assert fit.loop.offset == pytest.approx(offset, abs=1e-2)
    assert fit.largest.value == pytest.approx(LARGEST, rel=1e-3 if offset == 0.0 else 2e-3)
    if offset != 0.0:
        return
    assert fit.permanent.value == pytest.approx(PERMANENT, rel=2e-3)
    assert fit.unloading_ratio.value == pytest.approx(RATIO, rel=5e-3)
    assert fit.loop.onset == pytest.approx(0.0, abs=3e-5)
    places = np.linspace(0.0, LARGEST, 30)
    np.testing.assert_allclose(fit.curve.at(places), STIFFNESS * places, atol=0.003 * 4970.0)
    # The loop has what the filter took away: it is the law's.
    np.testing.assert_allclose(fit.loop.loading[1], STIFFNESS * fit.loop.loading[0], atol=60.0)


@pytest.mark.parametrize("channel_class", [60.0, pytest.param(180.0, marks=pytest.mark.slow)])
def test_a_hood_that_yields_behind_a_filter(channel_class: float) -> None:
    speed, mass = 8.5, 2.5
    felt, deepest = stepped(HOOD, 6.0, speed, mass)
    raw = np.interp(TIME, np.arange(felt.size) * 5e-6, felt, left=0.0, right=0.0)
    fit = fit_stiffness(
        TIME, filtered(raw, RATE, channel_class), speed, mass, channel_class=channel_class, draws=0
    )
    places = np.linspace(0.0, deepest, 60)
    error = fit.curve.at(places) - np.interp(places, *HOOD.T)
    assert np.sqrt(np.mean(error**2)) < 0.01 * 3200.0
    assert fit.largest.value == pytest.approx(deepest, rel=5e-3)
    assert fit.permanent.value == pytest.approx(deepest * 5.0 / 6.0, rel=1e-2)


@pytest.mark.slow
def test_intervals_hold_the_truth() -> None:
    held = []
    for seed in range(6):
        noise = np.random.default_rng(seed).standard_normal(TIME.size)
        values = filtered(pulse(TIME) + 2.0 * noise, RATE, 60.0)
        fit = fitted(values, 60.0, draws=30, seed=seed)
        for bounded, truth in (
            (fit.largest, LARGEST), (fit.permanent, PERMANENT), (fit.unloading_ratio, RATIO)
        ):  # fmt: skip
            held.append(bounded.low <= truth <= bounded.high)
    # 18 intervals of 95 %: four or more miss in one of 100 sets.
    assert np.mean(held) > 0.8


def test_intervals_count_the_uncertainty_of_the_speed() -> None:
    wide = fitted(filtered(pulse(TIME), RATE, 60.0), 60.0, draws=40, speed_sd=0.2)
    # The way is in proportion to the speed where the acceleration is given.
    assert wide.largest.high - wide.largest.low > 1.5 * LARGEST * 0.2 / SPEED
    assert wide.largest.low < LARGEST < wide.largest.high
    assert wide.permanent.low < PERMANENT < wide.permanent.high


def test_the_residual_behind_a_filter_is_a_force() -> None:
    noise = np.random.default_rng(4).standard_normal(TIME.size)
    fit = fitted(filtered(pulse(TIME), RATE, 60.0) + 2.0 * noise, 60.0, draws=0)
    assert fit.residual == pytest.approx(2.0 * GRAVITY * MASS, rel=0.15)
