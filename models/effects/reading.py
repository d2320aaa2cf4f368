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


@dataclass(frozen=True)
class Record:
    """What a recorder wrote down: acceleration (n, axes) in g, and its clock over the true one."""

    acceleration: Array
    clock: float


def record_reading(
    chain: EffectChain,
    values: Mapping[str, float],
    reading: Reading,
    sampling_rate: float,
    origin: int,
) -> Record:
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
    if reading.clock != 1.0:
        columns = [retime(column, reading.clock, origin) for column in signal.T]
        signal = np.stack(columns, axis=1)
    return Record(signal, reading.clock)


def retime(values: Array, clock: float, origin: int) -> Array:
    """Return a channel (n,) as a recorder writes it whose clock is off.

    Parameters
    ----------
    clock : recorded duration over the true one. origin : sample at which both agree.
    """
    if clock == 1.0:
        return values
    sample = np.arange(values.size)
    return np.interp(origin + (sample - origin) / clock, sample, values)
