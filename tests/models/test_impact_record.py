"""The first impact of a record: what comes before and after is left out and told."""

import math
import re

import numpy as np
import pytest
from builders import GRAVITY, Array

from models.headform.identification import fit_stiffness
from models.headform.record import Impact, first_impact
from tests.closed_form_pulse import LARGEST, MASS, PEAK, PERMANENT, SPEED, filtered, pulse

RATE = 10_000.0
TIME = np.arange(-0.05, 0.35, 1.0 / RATE)


def at(milliseconds: float) -> int:
    """Return the sample at a time."""
    return int(np.argmin(np.abs(TIME - 1e-3 * milliseconds)))


def record(noise: float = 0.0, seed: int = 1) -> Array:
    return pulse(TIME) + noise * np.random.default_rng(seed).standard_normal(TIME.size)


def found_in(values: Array, channel_class: float = 0.0, rel: float = 5e-3) -> Impact:
    """Return the first impact, which is the one of the pulse."""
    found = first_impact(TIME, values, SPEED)
    fit = fit_stiffness(
        found.time, found.acceleration, SPEED, MASS, channel_class=channel_class, draws=0
    )
    assert fit.largest.value == pytest.approx(LARGEST, rel=rel)
    assert fit.permanent.value == pytest.approx(PERMANENT, rel=2.0 * rel)
    assert found.acceleration.max() == pytest.approx(PEAK, rel=0.05)
    return found


def two_peaks() -> Array:
    """Return a contact in which a hood gives way, then the engine stops the rest."""
    values = np.zeros_like(TIME)
    # The first peak takes 60 % of the speed.
    for share, start, length in ((0.6, 0.0, 0.008), (0.5, 0.013, 0.006)):
        peak = share * math.pi * SPEED / (2.0 * GRAVITY * length)
        inside = (start < TIME) & (start + length > TIME)
        values += np.where(inside, peak * np.sin(np.pi * (TIME - start) / length), 0.0)
    return values


@pytest.mark.parametrize(
    "values",
    [
        *(record(noise) + offset for noise in (0.0, 3.0) for offset in (0.0, -8.0, 25.0)),
        two_peaks(),
        np.random.default_rng(0).standard_normal(TIME.size),  # no impact at all
    ],
)
def test_what_is_one_impact_comes_back_as_it_is(values: Array) -> None:
    found = first_impact(TIME, values, SPEED)
    np.testing.assert_array_equal(found.time, TIME)
    np.testing.assert_array_equal(found.acceleration, values)
    assert found.notes == ()


@pytest.mark.parametrize("digits", [0, 1, 2])
@pytest.mark.parametrize("rate", [5_000.0, 10_000.0, 50_000.0])
def test_a_round_peak_is_no_plateau(rate: float, digits: int) -> None:
    # Readings of whole g are equal over a round peak as well, for a short while.
    time = np.arange(-0.02, 0.04, 1.0 / rate)
    assert first_impact(time, np.round(pulse(time), digits), SPEED).notes == ()


@pytest.mark.parametrize("delay", [0.03, 0.06, 0.3])
@pytest.mark.parametrize("size", [0.3, 1.0, 10.0])
def test_a_second_impact_is_left_out_and_told(delay: float, size: float) -> None:
    # Harder by ten: a fall on concrete. The recorded speed is that of the first impact.
    found = found_in(record() + pulse(TIME - delay, 75e3 * size**2, 0.5 * SPEED))
    # A soft one is noticed when it has risen.
    assert found.time[-1] < delay + 0.005
    (note,) = found.notes
    told = re.fullmatch(r"a later impact of .* g (.*) ms is left out, .*", note)
    assert told is not None
    assert float(told[1]) == pytest.approx(1e3 * delay, abs=6.0)


@pytest.mark.parametrize("channel_class", [1000.0, 180.0])
def test_a_second_impact_in_a_filtered_record(channel_class: float) -> None:
    values = filtered(record(0.5) + 2.0 * pulse(TIME - 0.2), RATE, channel_class)
    found_in(values, channel_class, rel=0.01)


@pytest.mark.parametrize("drift", [3.0, -3.0, 8.0])
def test_a_drift_between_two_impacts_joins_them_not(drift: float) -> None:
    # The sensor comes back to another zero after the impact.
    found_in(record(0.5) + np.where(TIME > 0.018, drift, 0.0) + 2.0 * pulse(TIME - 0.2), rel=0.01)


@pytest.mark.parametrize("size", [-1000.0, -60.0, 60.0, 1000.0])
@pytest.mark.parametrize("before", [1.0, 5.0, 49.9])
def test_a_spike_of_one_sample_is_replaced_and_told(size: float, before: float) -> None:
    values = record(0.3)
    values[at(-before)] += size
    (note,) = found_in(values).notes
    assert "single sample" in note and "spike" in note


def test_disturbances_before_and_after_are_left_out() -> None:
    after = record()
    after[at(100.0)] = 500.0
    found_in(after)
    raw = record(0.3)
    raw[at(-20.0)] += 2000.0
    assert found_in(filtered(raw, RATE, 1000.0), 1000.0).notes
    # A launcher: 40 g over 3 ms, 30 ms before contact.
    released = record(0.5) + np.where(np.abs(TIME + 0.03) < 0.0015, 40.0, 0.0)
    assert any("disturbance" in note for note in found_in(released, rel=0.01).notes)


@pytest.mark.parametrize("limit", [60.0, 100.0, 130.0])
def test_a_clipped_sensor_is_told(limit: float) -> None:
    found = first_impact(TIME, np.minimum(record(0.5), limit), SPEED)
    (note,) = [note for note in found.notes if "clipped" in note]
    assert f"{limit:g} g" in note


@pytest.mark.parametrize("channel_class", [600.0, 1000.0])
def test_a_clipped_sensor_behind_a_filter_is_told(channel_class: float) -> None:
    values = filtered(np.minimum(record(0.3), 100.0), RATE, channel_class)
    assert any("clipped" in note for note in first_impact(TIME, values, SPEED).notes)
