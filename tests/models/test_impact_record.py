"""The first impact of a record: what comes before and after is left out and told."""

import math
import re

import numpy as np
import pytest
from numpy.typing import NDArray

from models.headform.identification import StiffnessFit, fit_stiffness
from models.headform.record import Impact, first_impact
from tests.closed_form_pulse import LARGEST, MASS, PEAK, PERMANENT, SPEED, filtered, pulse

Array = NDArray[np.float64]

RATE = 10_000.0
TIME = np.arange(-0.05, 0.35, 1.0 / RATE)


def at(milliseconds: float) -> int:
    """Return the sample at a time."""
    return int(np.argmin(np.abs(TIME - 1e-3 * milliseconds)))


def record(noise: float = 0.0, seed: int = 1) -> Array:
    return pulse(TIME) + noise * np.random.default_rng(seed).standard_normal(TIME.size)


def fitted(found: Impact, channel_class: float = 0.0) -> StiffnessFit:
    return fit_stiffness(
        found.time, found.acceleration, SPEED, MASS, channel_class=channel_class, draws=0
    )


def assert_is_the_first(found: Impact, channel_class: float = 0.0, rel: float = 5e-3) -> None:
    fit = fitted(found, channel_class)
    assert fit.largest.value == pytest.approx(LARGEST, rel=rel)
    assert fit.permanent.value == pytest.approx(PERMANENT, rel=2.0 * rel)
    assert found.acceleration.max() == pytest.approx(PEAK, rel=0.05)


# -- nothing to leave out ---------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("offset", [0.0, -8.0, 25.0])
def test_a_record_of_one_impact_comes_back_as_it_is(noise: float, offset: float) -> None:
    values = record(noise) + offset
    found = first_impact(TIME, values, SPEED)
    np.testing.assert_array_equal(found.time, TIME)
    np.testing.assert_array_equal(found.acceleration, values)
    assert found.notes == ()


def test_a_contact_with_two_peaks_is_one_impact() -> None:
    # A hood gives way, then the engine stops the rest: the first peak takes 60 % of the speed.
    first = 0.6 * math.pi * SPEED / (2.0 * 9.80665 * 0.008)
    second = 0.5 * math.pi * SPEED / (2.0 * 9.80665 * 0.006)
    values = np.where((TIME > 0) & (TIME < 0.008), first * np.sin(np.pi * TIME / 0.008), 0.0)
    late = (TIME > 0.013) & (TIME < 0.019)
    values += np.where(late, second * np.sin(np.pi * (TIME - 0.013) / 0.006), 0.0)
    found = first_impact(TIME, values, SPEED)
    assert found.time[-1] == TIME[-1]
    assert found.notes == ()


def test_a_record_without_an_impact_comes_back_whole() -> None:
    values = np.random.default_rng(0).standard_normal(TIME.size)
    found = first_impact(TIME, values, SPEED)
    np.testing.assert_array_equal(found.acceleration, values)


# -- later impacts ----------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0.03, 0.06, 0.2, 0.3])
@pytest.mark.parametrize("size", [0.3, 1.0, 2.0, 10.0])
def test_a_second_impact_is_left_out_and_told(delay: float, size: float) -> None:
    # Harder by ten: a fall on concrete. The recorded speed is that of the first impact.
    stiffness = 75e3 * size**2
    values = record() + pulse(TIME - delay, stiffness, 0.5 * SPEED)
    found = first_impact(TIME, values, SPEED)
    assert_is_the_first(found)
    # A soft one is noticed when it has risen.
    assert found.time[-1] < delay + 0.005
    (note,) = found.notes
    told = re.fullmatch(r"a later impact of .* g (.*) ms is left out, .*", note)
    assert told is not None
    assert float(told[1]) == pytest.approx(1e3 * delay, abs=6.0)


@pytest.mark.parametrize("channel_class", [1000.0, 600.0, 180.0])
def test_a_second_impact_in_a_filtered_record(channel_class: float) -> None:
    values = filtered(record(0.5) + 2.0 * pulse(TIME - 0.2), RATE, channel_class)
    found = first_impact(TIME, values, SPEED)
    assert_is_the_first(found, channel_class, rel=0.01)


@pytest.mark.parametrize("drift", [3.0, -3.0, 8.0])
def test_a_drift_between_two_impacts_joins_them_not(drift: float) -> None:
    # The sensor comes back to another zero after the impact.
    values = record(0.5) + np.where(TIME > 0.018, drift, 0.0) + 2.0 * pulse(TIME - 0.2)
    assert_is_the_first(first_impact(TIME, values, SPEED), rel=0.01)


# -- disturbances before contact --------------------------------------------------------------


@pytest.mark.parametrize("size", [-1000.0, -60.0, 60.0, 145.0, 1000.0])
@pytest.mark.parametrize("before", [1.0, 5.0, 20.0, 49.9])
def test_a_spike_of_one_sample_is_replaced_and_told(size: float, before: float) -> None:
    values = record(0.3)
    values[at(-before)] += size
    found = first_impact(TIME, values, SPEED)
    assert_is_the_first(found)
    (note,) = found.notes
    assert "single sample" in note and "spike" in note


def test_a_spike_after_the_impact_is_replaced() -> None:
    values = record()
    values[at(100.0)] = 500.0
    assert_is_the_first(first_impact(TIME, values, SPEED))


def test_a_filtered_spike_is_a_disturbance() -> None:
    raw = record(0.3)
    raw[at(-20.0)] += 2000.0
    values = filtered(raw, RATE, 1000.0)
    found = first_impact(TIME, values, SPEED)
    assert_is_the_first(found, 1000.0)
    assert found.notes


def test_a_release_before_contact_is_left_out() -> None:
    # A launcher: 40 g over 3 ms, 30 ms before contact.
    values = record(0.5) + np.where(np.abs(TIME + 0.03) < 0.0015, 40.0, 0.0)
    found = first_impact(TIME, values, SPEED)
    assert_is_the_first(found, rel=0.01)
    assert any("disturbance" in note for note in found.notes)


# -- clipping ---------------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [60.0, 100.0, 130.0])
def test_a_clipped_sensor_is_told(limit: float) -> None:
    found = first_impact(TIME, np.minimum(record(0.5), limit), SPEED)
    (note,) = [note for note in found.notes if "clipped" in note]
    assert f"{limit:g} g" in note


@pytest.mark.parametrize("channel_class", [600.0, 1000.0])
def test_a_clipped_sensor_behind_a_filter_is_told(channel_class: float) -> None:
    values = filtered(np.minimum(record(0.3), 100.0), RATE, channel_class)
    assert any("clipped" in note for note in first_impact(TIME, values, SPEED).notes)


@pytest.mark.parametrize("digits", [0, 1, 2])
@pytest.mark.parametrize("rate", [5_000.0, 10_000.0, 50_000.0])
def test_a_round_peak_is_no_plateau(rate: float, digits: int) -> None:
    # Readings of whole g are equal over a round peak as well, for a short while.
    time = np.arange(-0.02, 0.04, 1.0 / rate)
    assert first_impact(time, np.round(pulse(time), digits), SPEED).notes == ()
