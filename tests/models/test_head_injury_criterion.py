"""Head injury criterion against closed forms, a peer, a slow reference and measurements."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import Array, quiet
from crashmetrics.pedestrian.hic import calculate_hic
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import maximum_filter

from models.criteria import head_injury_criterion

HALF_SINE = 0.4146456495
"""HIC over A^2.5 T of a half sine: root of tan x = x / 0.6 (Chou and Nyquist, SAE 740082)."""
HALF_SINE_WINDOW = 0.6702296
TRIANGLE = 4.0 / 7.0 * (5.0 / 7.0) ** 2.5
MEASURED = Path(__file__).parents[3] / "shared" / "measured" / "q3_child_dummy_head_impact.csv"


def pulse(shape: str, peak: float, length: float, rate: float = 1e4) -> tuple[Array, Array]:
    """Return a pulse of ``peak`` g and ``length`` s that starts at 20 ms of a 120 ms record."""
    time = np.arange(round(0.12 * rate)) / rate
    u = (time - 0.02) / length
    form = {
        "rectangle": np.ones_like(u),
        "half_sine": np.sin(np.pi * u),
        "triangle": 1.0 - np.abs(2.0 * u - 1.0),
    }[shape]
    inside = (u > -1e-9) & (u < 1.0 + 1e-9)
    return time, np.where(inside, np.maximum(peak * form, 0.0), 0.0)


def noisy(seed: int, length: float) -> tuple[Array, Array]:
    time, acceleration = pulse("half_sine", 120.0, length)
    noise = np.random.default_rng(seed).normal(0.0, 8.0, time.size)
    return time, np.abs(acceleration + noise)


def window_value(time: Array, acceleration: Array, start: float, end: float) -> float:
    """Return the criterion's expression for one window of the piecewise-linear signal."""
    knots = np.concatenate(([start], time[(time > start) & (time < end)], [end]))
    area = np.trapezoid(np.interp(knots, time, acceleration), knots)
    return float((end - start) * (area / (end - start)) ** 2.5)


def zoomed_maximum(value: Callable[[Array, Array], Array], x: Array, y: Array) -> float:
    """Return the maximum over the box of two uniform grids, halving the steps at each peak."""
    values = value(*np.meshgrid(x, y, indexing="ij"))
    peaks = np.argwhere(values == maximum_filter(values, 3, mode="nearest"))
    highest = peaks[np.argsort(values[tuple(peaks.T)])[::-1][:5]]
    best = float(values.max())
    for i, j in highest:
        centre, top = (x[i], y[j]), values[i, j]
        reach = [1.5 * (grid[1] - grid[0]) if grid.size > 1 else 0.0 for grid in (x, y)]
        for _ in range(45):
            near = [
                np.clip(c + r * np.linspace(-1.0, 1.0, 9), grid[0], grid[-1])
                for c, r, grid in zip(centre, reach, (x, y), strict=True)
            ]
            fine = np.meshgrid(*near, indexing="ij")
            values_near = value(*fine)
            k = np.unravel_index(np.argmax(values_near), values_near.shape)
            if values_near[k] >= top:
                centre, top = (fine[0][k], fine[1][k]), values_near[k]
            reach = [0.5 * r for r in reach]
        best = max(best, float(top))
    return best


def slow_maximum(time: Array, acceleration: Array, window: float) -> float:
    """Return the continuous maximum by dense sampling and repeated zooming.

    The interior is searched apart from the borders of the triangle of windows: the longest ones
    and those that start or end with the record.
    """
    first, last = time[0], time[-1]
    window = min(window, last - first)
    areas = 0.5 * (acceleration[1:] + acceleration[:-1]) * np.diff(time)
    area = np.concatenate(([0.0], np.cumsum(areas)))

    def integral(x: Array) -> Array:
        k = np.clip(np.searchsorted(time, x, side="right") - 1, 0, time.size - 2)
        u = x - time[k]
        slope = (acceleration[k + 1] - acceleration[k]) / (time[k + 1] - time[k])
        return np.asarray(area[k] + u * (acceleration[k] + 0.5 * u * slope))

    def value(start: Array, end: Array) -> Array:
        length = end - start
        gained = np.maximum(integral(end) - integral(start), 0.0)
        return np.asarray(gained**2.5 / np.where(length > 0.0, length, np.inf) ** 1.5)

    start, length = np.linspace(first, last, 161), np.linspace(0.0, window, 161)
    longest, one = np.linspace(first, last - window, 1001), np.array([0.0])
    return max(
        zoomed_maximum(lambda s, d: value(s, np.minimum(s + d, last)), start, length),
        zoomed_maximum(lambda s, _: value(s, s + window), longest, one),
        zoomed_maximum(lambda d, _: value(np.full_like(d, first), first + d), length, one),
        zoomed_maximum(lambda d, _: value(last - d, np.full_like(d, last)), length, one),
    )


@st.composite
def signals(draw: st.DrawFn) -> tuple[Array, Array]:
    """Return a random piecewise-linear signal of up to seven samples."""
    size = draw(st.integers(2, 7))
    steps = draw(st.lists(st.floats(0.5e-3, 3e-3), min_size=size - 1, max_size=size - 1))
    levels = draw(st.lists(st.floats(0.0, 200.0), min_size=size, max_size=size))
    return np.concatenate(([0.0], np.cumsum(steps))), np.array(levels)


windows = st.sampled_from([0.001, 0.0023, 0.004, 0.015, math.inf])


# Table of 1.2 in the data sheet on injury criteria: a prototype of each definition on pulses
# sampled at 10 kHz, HIC15, to the printed digits.
@pytest.mark.parametrize(
    ("shape", "peak", "length", "continuous", "grid"),
    [
        ("rectangle", 100.0, 0.003, 304.016, 300.000),
        ("rectangle", 200.0, 0.005, 2851.108, 2828.427),
        ("rectangle", 120.0, 0.015, 2366.161, 2366.161),
        ("half_sine", 100.0, 0.003, 124.110, 124.106),
        ("half_sine", 150.0, 0.010, 1142.394, 1142.131),
        ("half_sine", 80.0, 0.030, 660.380, 660.380),
        ("triangle", 100.0, 0.003, 73.9202, 73.7934),
        ("triangle", 200.0, 0.005, 696.9263, 696.7296),
    ],
)
def test_sampled_pulses_give_the_reference_values(
    shape: str, peak: float, length: float, continuous: float, grid: float
) -> None:
    signal, digits = pulse(shape, peak, length), 5e-5 if shape == "triangle" else 5e-4
    assert head_injury_criterion(*signal)[0] == pytest.approx(continuous, abs=digits)
    on_grid = head_injury_criterion(*signal, method="grid")[0]
    assert on_grid == pytest.approx(grid, abs=digits)


@pytest.mark.parametrize("window", [0.015, 0.036])
@pytest.mark.parametrize("length", [0.003, 0.008, 0.015, 0.030])
def test_triangle_and_half_sine_meet_their_closed_forms(length: float, window: float) -> None:
    signal = np.array([0.0, 0.5, 1.0]) * length, np.array([0.0, 100.0, 0.0])
    free = 4.0 / 7.0 * length
    if free <= window:
        expected, duration = TRIANGLE * 1e5 * length, free
    else:
        # Longest window, centred: mean = A (1 - W / 2T).
        expected, duration = window * (100.0 * (1.0 - 0.5 * window / length)) ** 2.5, window
    value, start, end = head_injury_criterion(*signal, window)
    assert value == pytest.approx(expected, rel=1e-12)
    assert end - start == pytest.approx(duration, rel=1e-9)
    assert 0.5 * (start + end) == pytest.approx(0.5 * length, rel=1e-9)
    # 4001 samples: the chord's error is (pi / 4000)^2 / 12 of the mean, 2e-7 of the result.
    time = np.linspace(0.0, length, 4001)
    acceleration = np.maximum(150.0 * np.sin(np.pi * time / length), 0.0)
    free = HALF_SINE_WINDOW * length
    if free <= window:
        expected, duration = HALF_SINE * 150.0**2.5 * length, free
    else:
        area = 150.0 * 2.0 * length / np.pi * math.sin(0.5 * np.pi * window / length)
        expected, duration = window * (area / window) ** 2.5, window
    value, start, end = head_injury_criterion(time, acceleration, window)
    assert value == pytest.approx(expected, rel=2e-7)
    assert end - start == pytest.approx(duration, rel=1e-6)


@pytest.mark.parametrize(("window", "held"), [(0.015, 0.015), (0.036, 0.030)])
def test_rectangle_meets_its_closed_form(window: float, held: float) -> None:
    time = np.linspace(0.0, 0.030, 301)
    for method in ("continuous", "grid"):
        value, start, end = head_injury_criterion(time, np.full(301, 80.0), window, method=method)
        assert value == pytest.approx(80.0**2.5 * held, rel=1e-9)
        assert end - start == pytest.approx(held, rel=1e-9)
    assert head_injury_criterion([0.0, 0.01, 0.02], [0.0, 0.0, 0.0])[0] == 0.0


@pytest.mark.parametrize("window", [0.015, 0.036])
@pytest.mark.parametrize("seed", range(3))
def test_noisy_traces_agree_with_crashmetrics(seed: int, window: float) -> None:
    # crashmetrics searches all pairs of a 0.1 ms grid, which are the samples here.
    time, acceleration = (x[:700] for x in noisy(seed, (0.004, 0.011, 0.02)[seed]))
    peer = calculate_hic(time, acceleration, 1e3 * window)
    value, start, end = head_injury_criterion(time, acceleration, window, method="grid")
    assert value == pytest.approx(peer.value, rel=1e-9)
    assert (start, end) == pytest.approx((peer.start_time, peer.end_time), abs=1e-9)


def test_continuous_maximum_is_the_limit_of_a_refined_grid() -> None:
    # A grid of step h misses the ends by h/2 at most, and the maximum is flat there: the loss
    # falls with h^2, from below.
    time, acceleration = (x[150:350] for x in noisy(5, 0.006))
    exact = head_injury_criterion(time, acceleration)[0]
    losses = [
        1.0 - calculate_hic(time, acceleration, 15.0, resolution).value / exact
        for resolution in (0.1, 0.02, 0.005)
    ]
    assert all(loss >= -1e-12 for loss in losses)
    assert losses[2] < losses[0] / 100.0


@pytest.mark.measured
@pytest.mark.skipif(not MEASURED.exists(), reason="the measurements are not part of the project")
def test_measured_dummy_head_impact() -> None:
    # Q3 at 3.1 m/s (Paez-Granados and Billard 2022); values of the data sheet, 1.2.
    table = np.genfromtxt(MEASURED, delimiter=",", names=True)
    test = table[table["test_speed_m_s"] == 3.1]
    signal = 1e-3 * test["time_ms"], test["head_acc_g"]
    assert head_injury_criterion(*signal, method="grid")[0] == pytest.approx(549.906, abs=5e-4)
    assert head_injury_criterion(*signal)[0] == pytest.approx(550.008, abs=5e-4)


def check_global(signal: tuple[Array, Array], window: float) -> None:
    value = head_injury_criterion(*signal, window)[0]
    # 1e-30: HIC of signals of denormal size.
    assert value == pytest.approx(slow_maximum(*signal, window), rel=1e-9, abs=1e-30)


@quiet(8)
@given(signals(), windows)
def test_continuous_maximum_is_the_global_one(signal: tuple[Array, Array], window: float) -> None:
    check_global(signal, window)


@pytest.mark.slow
@quiet(200)
@given(signals(), windows)
def test_many_continuous_maxima_are_global(signal: tuple[Array, Array], window: float) -> None:
    check_global(signal, window)


def test_maximum_whose_end_stands_on_a_sample() -> None:
    # 0.6 mean = 3 for the window from the second sample (a = 3) to where the fall passes 3:
    # length 18/7 ms, mean 5. No better window exists (checked by the slow maximum).
    signal = np.array([0.0, 0.003, 0.005, 0.006]), np.array([0.0, 3.0, 7.0, 0.0])
    expected = 18e-3 / 7.0 * 5.0**2.5
    assert slow_maximum(*signal, 0.015) == pytest.approx(expected, rel=1e-9)
    assert head_injury_criterion(*signal)[0] == pytest.approx(expected, rel=1e-9)


@quiet(60)
@given(signals(), windows, st.floats(0.1, 10.0), st.floats(-1.0, 1.0))
def test_window_bounds_scale_and_shift(
    signal: tuple[Array, Array], window: float, factor: float, shift: float
) -> None:
    time, acceleration = signal
    found = {}
    for method in ("continuous", "grid"):
        value, start, end = head_injury_criterion(time, acceleration, window, method=method)
        assert time[0] <= start <= end <= time[-1] * (1.0 + 1e-12)
        assert end - start <= window * (1.0 + 1e-7)
        if value > 1e-12:
            assert window_value(time, acceleration, start, end) == pytest.approx(value, rel=1e-9)
        found[method] = value
    bound = acceleration.max() ** 2.5 * min(window, time[-1] - time[0])
    one = found["continuous"]
    assert found["grid"] <= one <= bound * (1.0 + 1e-7)
    other = head_injury_criterion(time, factor * acceleration, window)[0]
    assert other == pytest.approx(factor**2.5 * one, rel=1e-9, abs=1e-30)
    # Times of 1 s carry 1e-16 s of rounding, 2e-13 of the shortest cell.
    moved = head_injury_criterion(time + shift, acceleration, window)[0]
    assert moved == pytest.approx(one, rel=1e-10, abs=1e-30)


@quiet(60)
@given(signals(), windows, st.lists(st.floats(0.01, 0.99), min_size=1, max_size=12))
def test_more_samples_on_the_lines_change_only_the_grid_value(
    signal: tuple[Array, Array], window: float, places: list[float]
) -> None:
    time, acceleration = signal
    finer = np.unique(np.concatenate((time, np.array(places) * time[-1])))
    finer = np.union1d(finer[np.concatenate(([True], np.diff(finer) > 1e-7))], time)
    both = signal, (finer, np.interp(finer, time, acceleration))
    one, other = (head_injury_criterion(*given, window)[0] for given in both)
    assert other == pytest.approx(one, rel=1e-9, abs=1e-30)
    grid, finer_grid = (head_injury_criterion(*g, window, method="grid")[0] for g in both)
    assert finer_grid >= grid * (1.0 - 1e-12)


@pytest.mark.parametrize(
    ("time", "acceleration", "arguments", "message"),
    [
        ([0.0, 1.0, 2.0], [1.0, 2.0], {}, "equal and 1-D"),
        ([0.0], [1.0], {}, "n >= 2"),
        ([[0.0, 1.0]], [[1.0, 2.0]], {}, "1-D"),
        ([0.0, math.nan], [1.0, 2.0], {}, "finite"),
        ([0.0, 1.0], [1.0, math.inf], {}, "finite"),
        ([0.0, 0.0], [1.0, 2.0], {}, "rise"),
        ([0.0, 1.0], [1.0, -2.0], {}, "negative"),
        ([0.0, 1.0], [1.0, 2.0], {"window": 0.0}, "window"),
        ([0.0, 1.0], [1.0, 2.0], {"window": math.nan}, "window"),
        ([0.0, 1.0], [1.0, 2.0], {"method": "fast"}, "method"),
    ],
)
def test_bad_input_is_refused(
    time: list[float], acceleration: list[float], arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        head_injury_criterion(time, acceleration, **arguments)
