"""Channel frequency classes against the standard's corridor, its formulas and a peer."""

import math

import numpy as np
import pytest
from crashmetrics.signals import cfc_filter
from numpy.typing import NDArray

from models.criteria import filter_cfc

Array = NDArray[np.float64]

CLASSES = (60.0, 180.0, 600.0, 1000.0)


def gain(frequency: float, frequency_class: float, rate: float) -> float:
    """Return the gain in dB of a long sine, taken from its middle by projection."""
    # A whole number of periods in the middle third.
    periods = 40
    samples = round(periods * rate / frequency)
    time = np.arange(3 * samples) / rate
    wave = np.sin(2.0 * np.pi * frequency * time)
    middle = slice(samples, 2 * samples)
    filtered = filter_cfc(wave, rate, frequency_class)[middle]
    basis = np.stack([f(2.0 * np.pi * frequency * time[middle]) for f in (np.sin, np.cos)], axis=1)
    part = np.linalg.lstsq(basis, filtered, rcond=None)[0]
    # Forwards and backwards: no phase.
    assert abs(part[1]) < 1e-6
    return 20.0 * math.log10(float(np.linalg.norm(part)))


@pytest.mark.parametrize("frequency_class", CLASSES)
@pytest.mark.parametrize("oversampling", [20.0, 50.0, 100.0])
def test_gain_at_the_nominal_corner(frequency_class: float, oversampling: float) -> None:
    # Data sheet, 1.4: -2.88 to -3.01 dB at CFC / 0.6, by sampling rate, to two digits.
    corner = gain(frequency_class / 0.6, frequency_class, oversampling * frequency_class)
    assert -3.01 <= round(corner, 2) <= -2.88


@pytest.mark.parametrize("frequency_class", CLASSES)
@pytest.mark.parametrize("oversampling", [5.0, 10.0, 20.0, 100.0])
def test_each_pass_is_three_decibels_down_at_its_corner(
    frequency_class: float, oversampling: float
) -> None:
    # -6.02 dB at 2.0775 CFC (data sheet, 1.4), at any sampling rate: the formulas are prewarped.
    both = gain(2.0775 * frequency_class, frequency_class, oversampling * frequency_class)
    assert both == pytest.approx(-20.0 * math.log10(2.0), abs=1e-6)


@pytest.mark.parametrize("frequency_class", CLASSES)
def test_gain_follows_the_formulas_of_the_standard(frequency_class: float) -> None:
    # SAE J211-1, appendix C: bilinear two-pole Butterworth, prewarped, applied twice.
    rate = 20.0 * frequency_class
    corner = math.tan(math.pi * 2.0775 * frequency_class / rate)
    for share in (0.1, 0.5, 1.0, 3.0, 5.0):
        frequency = share * frequency_class
        ratio = math.tan(math.pi * frequency / rate) / corner
        expected = -20.0 * math.log10(1.0 + ratio**4)
        assert gain(frequency, frequency_class, rate) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("frequency_class", [180.0, 600.0, 1000.0])
def test_noise_agrees_with_crashmetrics(frequency_class: float) -> None:
    rng = np.random.default_rng(3)
    time = np.arange(4000) / 2e4
    noise = np.cumsum(rng.normal(size=time.size))
    filtered = filter_cfc(noise, 2e4, frequency_class)
    peer = cfc_filter(time, noise, frequency_class)
    # The two reflect ends of different length (60 samples and 10 ms): compare where they have
    # died out, at least 20 ms or 30 time constants away.
    inner = slice(400, -400)
    assert np.abs(filtered - peer)[inner].max() < 1e-9 * np.abs(noise).max()


def test_constants_and_straight_lines_pass_unchanged() -> None:
    time = np.arange(300) / 1e4
    np.testing.assert_allclose(filter_cfc(np.full(300, 7.5), 1e4), 7.5, rtol=1e-12)
    np.testing.assert_allclose(filter_cfc(3.0 - 40.0 * time, 1e4), 3.0 - 40.0 * time, atol=1e-9)


def test_columns_are_filtered_alone() -> None:
    rng = np.random.default_rng(4)
    signal = rng.normal(size=(500, 3))
    together = filter_cfc(signal, 1e4, 180.0)
    alone = np.stack([filter_cfc(column, 1e4, 180.0) for column in signal.T], axis=1)
    assert together.shape == (500, 3)
    np.testing.assert_allclose(together, alone, rtol=1e-12, atol=1e-15)


def test_time_reversal_commutes_with_the_filter() -> None:
    # No phase: a symmetric pulse stays where it is and symmetric.
    time = (np.arange(801) - 400) / 1e4
    filtered = filter_cfc(np.exp(-((time / 0.002) ** 2)), 1e4, 180.0)
    assert int(np.argmax(filtered)) == 400
    np.testing.assert_allclose(filtered, filtered[::-1], atol=1e-9)


def test_short_records_are_filtered() -> None:
    assert filter_cfc([1.0, 2.0, 4.0], 1e4).shape == (3,)
    assert filter_cfc([5.0], 1e4) == pytest.approx([5.0])


@pytest.mark.parametrize("rate", [1000.0, 4155.0])
def test_too_low_a_sampling_rate_is_refused(rate: float) -> None:
    with pytest.raises(ValueError, match="4155 Hz"):
        filter_cfc(np.zeros(100), rate, 1000.0)
