"""The time origin of a record: known, or arbitrary and taken from the rising flanks."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mcstudy.diagnosis.time_origin import time_shift

Array = NDArray[np.float64]

STEP = 5e-5
TIME = np.arange(-0.004, 0.03, STEP)


def plateau(time: Array) -> Array:
    """A pulse of 20 ms: a flank of 2 ms, then a slow rise."""
    rise = np.clip(time / 0.002, 0.0, 1.0)
    return rise * np.clip((0.02 - time) / 0.003, 0.0, 1.0) * (40.0 + 2000.0 * time)


def bottomed(time: Array) -> Array:
    """The same beginning, then a high narrow peak and no slow fall."""
    peak = 300.0 * np.exp(-0.5 * ((time - 0.0075) / 0.0007) ** 2)
    return np.where(time < 0.009, plateau(time) + peak, 0.0)


@pytest.mark.parametrize("delay", [0.0, 5e-4, 1.9e-3])
def test_an_origin_near_that_of_the_model_is_known(delay: float) -> None:
    assert time_shift(TIME, plateau(TIME - delay), TIME, plateau(TIME), STEP) == 0.0


@pytest.mark.parametrize("delay", [2.5e-3, 0.012, -0.5])
def test_an_arbitrary_origin_is_found(delay: float) -> None:
    moved = TIME + delay
    found = time_shift(moved, plateau(moved - delay), TIME, plateau(TIME), STEP)
    assert found == pytest.approx(delay, abs=1e-9)


def test_a_late_peak_leaves_a_known_origin_alone() -> None:
    wide = np.correlate(bottomed(TIME), plateau(TIME), mode="full")
    assert abs(int(np.argmax(wide)) - (TIME.size - 1)) * STEP > 2e-3
    assert time_shift(TIME, bottomed(TIME), TIME, plateau(TIME), STEP) == 0.0


def test_a_late_peak_does_not_bend_an_arbitrary_origin() -> None:
    delay = 0.1
    moved = TIME + delay
    found = time_shift(moved, bottomed(moved - delay), TIME, plateau(TIME), STEP)
    assert found == pytest.approx(delay, abs=1e-4)


def test_noise_and_an_offset_do_not_hide_the_flank() -> None:
    noisy = plateau(TIME) + 3.0 + np.random.default_rng(1).normal(0.0, 1.0, TIME.size)
    assert time_shift(TIME, noisy, TIME, plateau(TIME), STEP) == 0.0
