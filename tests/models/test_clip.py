"""The 3 ms clip against closed forms, a peer and measurements."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from crashmetrics.acceleration import clip_3ms
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from models.criteria import clip_level

Array = NDArray[np.float64]

MODES = ("cumulative", "consecutive")
PEER_MODES = [("cumulative", "cumulative"), ("consecutive", "continuous")]
MEASURED = Path(__file__).parents[3] / "shared" / "measured" / "q3_child_dummy_head_impact.csv"


def humps(count: int, length: float, gap: float) -> tuple[Array, Array]:
    """Return rectangles of 100 g, sampled at 100 kHz, with ``gap`` s around each."""
    time = np.arange(round((count * (length + gap) + gap) * 1e5) + 1) / 1e5
    place = (time - gap) % (length + gap)
    inside = (time >= gap - 1e-9) & (place <= length + 1e-9)
    return time, np.where(inside, 100.0, 0.0)


def noisy_trace(seed: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    time = np.arange(500) / 1e4
    trace = 120.0 * np.sin(np.pi * time / 0.05) ** 4 + rng.normal(0.0, 15.0, time.size)
    return time, np.abs(trace)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("peak", "length"), [(100.0, 0.004), (150.0, 0.010), (60.0, 0.030)])
def test_half_sine_meets_its_closed_form(peak: float, length: float, mode: str) -> None:
    # Chords of 4000 cells lie (pi / 4000)^2 / 8 below the arc.
    time = np.linspace(0.0, length, 4001)
    level = clip_level(time, peak * np.sin(np.pi * time / length), mode=mode)
    assert level == pytest.approx(peak * math.cos(math.pi * 0.003 / (2.0 * length)), rel=1e-6)


@pytest.mark.parametrize("mode", MODES)
def test_half_sine_at_ten_kilohertz_gives_the_published_digits(mode: str) -> None:
    # 133.6510 by crashmetrics, pyisomme and the closed form (data sheet, 1.3); the ends of the
    # held interval lie on samples.
    time = np.arange(101) / 1e4
    acceleration = 150.0 * np.sin(np.pi * time / 0.010)
    assert clip_level(time, acceleration, mode=mode) == pytest.approx(133.6510, abs=5e-5)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("duration", [0.0, 0.003, 0.006, 0.010])
def test_triangle_meets_its_closed_form(duration: float, mode: str) -> None:
    level = clip_level([0.0, 0.002, 0.010], [0.0, 80.0, 0.0], duration, mode=mode)
    assert level == pytest.approx(80.0 * (1.0 - duration / 0.010), abs=1e-9)


def test_cumulative_adds_intervals_and_consecutive_does_not() -> None:
    # Two humps of 100 g and 2 ms: 100 and 0 (data sheet, 1.3).
    time, acceleration = humps(2, 0.002, 0.004)
    assert clip_level(time, acceleration, mode="cumulative") == pytest.approx(100.0, rel=1e-12)
    assert clip_level(time, acceleration, mode="consecutive") == pytest.approx(0.0, abs=1e-9)
    one_longer = clip_level(*humps(2, 0.0031, 0.004), mode="consecutive")
    assert one_longer == pytest.approx(100.0, rel=1e-12)


def test_uneven_samples_are_joined_by_straight_lines() -> None:
    # Above 40: 1 ms of the rise (0 to 80 in 2 ms) and 4 ms of the fall (80 to 0 in 8 ms).
    coarse = clip_level([0.0, 0.002, 0.010], [0.0, 80.0, 0.0], 0.005)
    fine_time = np.union1d(np.linspace(0.0, 0.002, 7), np.linspace(0.002, 0.010, 33))
    fine = np.interp(fine_time, [0.0, 0.002, 0.010], [0.0, 80.0, 0.0])
    assert coarse == pytest.approx(40.0, rel=1e-12)
    assert clip_level(fine_time, fine, 0.005) == pytest.approx(40.0, rel=1e-12)


@pytest.mark.parametrize(("mode", "peer_mode"), PEER_MODES)
@pytest.mark.parametrize("seed", range(5))
def test_noisy_traces_agree_with_crashmetrics(seed: int, mode: str, peer_mode: str) -> None:
    time, acceleration = noisy_trace(seed)
    for milliseconds in (0.5, 3.0, 8.0):
        assert clip_level(time, acceleration, 1e-3 * milliseconds, mode=mode) == pytest.approx(
            clip_3ms(time, acceleration, milliseconds, peer_mode), rel=1e-9
        )


@pytest.mark.measured
@pytest.mark.skipif(not MEASURED.exists(), reason="the measurements are not part of the project")
def test_measured_dummy_head_impact() -> None:
    # Q3 at 3.1 m/s (Paez-Granados and Billard 2022); values of the data sheet, 1.3.
    table = np.genfromtxt(MEASURED, delimiter=",", names=True)
    test = table[table["test_speed_m_s"] == 3.1]
    levels = [clip_level(1e-3 * test["time_ms"], test["head_acc_g"], mode=mode) for mode in MODES]
    assert levels == pytest.approx([46.6, 31.4], abs=0.05)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    st.lists(st.floats(0.0, 200.0), min_size=5, max_size=12),
    st.floats(0.0, 0.004),
    st.floats(0.1, 10.0),
)
def test_order_and_scale(levels: list[float], duration: float, factor: float) -> None:
    time, acceleration = 1e-3 * np.arange(len(levels)), np.array(levels)
    cumulative, consecutive = (clip_level(time, acceleration, duration, mode=m) for m in MODES)
    # Smallest value <= one interval <= all intervals together <= peak, to the bisection's last bit.
    values = [acceleration.min(), consecutive, cumulative, acceleration.max()]
    assert all(b >= a * (1.0 - 1e-15) for a, b in pairwise(values))
    assert clip_level(time, factor * acceleration, duration) == pytest.approx(
        factor * cumulative, rel=1e-9, abs=1e-12
    )
    assert clip_level(time, acceleration, 0.5 * duration) >= cumulative * (1.0 - 1e-15)


def test_record_shorter_than_the_duration_has_no_level() -> None:
    assert clip_level([0.0, 0.001, 0.002], [50.0, 50.0, 50.0]) == 0.0


@pytest.mark.parametrize(
    ("time", "acceleration", "mode", "message"),
    [
        ([0.0, 1.0, 2.0], [1.0, 2.0], "cumulative", "equal, 1-D"),
        ([0.0], [1.0], "cumulative", "equal, 1-D"),
        ([0.0, 0.0], [1.0, 2.0], "cumulative", "rising"),
        ([0.0, 1.0], [1.0, math.nan], "cumulative", "finite"),
        ([0.0, 1.0], [1.0, 2.0], "single", "mode"),
    ],
)
def test_bad_input_is_refused(
    time: list[float], acceleration: list[float], mode: str, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        clip_level(time, acceleration, mode=mode)


def test_time_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError):
        clip_level([0.0, math.nan, 1.0], [1.0, 2.0, 3.0])
