"""What an accelerometer reads, from what it feels to what the recorder writes down."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.criteria.filters import CUTOFF_FACTOR, filter_cfc
from models.effects.chain import EffectChain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Reading:
    """What an accelerometer gives before it is filtered and written down.

    Attributes
    ----------
    acceleration : (n, axes) g. channel_class : of the filter, 0 for none.
    clock : recorded duration over the true one.
    """

    acceleration: Array
    channel_class: float
    clock: float = 1.0


def record_reading(
    chain: EffectChain,
    values: Mapping[str, float],
    reading: Reading,
    sampling_rate: float,
    origin: int,
) -> Array:
    """Return the acceleration (g) as it is written down, with the chain's effects on the signal.

    Parameters
    ----------
    chain : of the model. values : inputs by name.
    reading : of a faultless accelerometer. sampling_rate : Hz.
    origin : sample at which the recorder's clock and the true one agree.
    """
    reading = chain.act("signal", reading, values)
    signal = reading.acceleration
    # A corner above half the sampling rate leaves what was sampled as it is.
    if 0.0 < CUTOFF_FACTOR * reading.channel_class < 0.5 * sampling_rate:
        signal = filter_cfc(signal, sampling_rate, reading.channel_class)
    if reading.clock == 1.0:
        return signal
    # What the recorder calls a time is the true one times the clock's factor.
    sample = np.arange(signal.shape[0])
    true = origin + (sample - origin) / reading.clock
    return np.stack([np.interp(true, sample, column) for column in signal.T], axis=1)
