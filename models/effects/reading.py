"""Measurement chain of an accelerometer, from the true acceleration to the recorded signal."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.criteria.filters import CUTOFF_FACTOR, filter_cfc
from models.effects.chain import EffectChain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Reading:
    """Accelerometer signal before filtering and recording.

    Attributes
    ----------
    acceleration : (n, axes) array
        g; overwritten by its record.
    channel_class : float
        Channel frequency class of the filter, 0 for none.
    clock : float
        Recorded duration over the true one.
    """

    acceleration: Array
    channel_class: float
    clock: float = 1.0


@dataclass(frozen=True)
class Record:
    """Recorded signal.

    Attributes
    ----------
    acceleration : (n, axes) array
        g.
    clock : float
        Recorded duration over the true one.
    """

    acceleration: Array
    clock: float


def record_reading(
    chain: EffectChain,
    values: Mapping[str, float],
    reading: Reading,
    sampling_rate: float,
    origin: int,
) -> Record:
    """Return the recorded acceleration, with the chain's effects on the signal.

    Parameters
    ----------
    chain : EffectChain
        Effects of the model.
    values : mapping of str to float
        Inputs by name.
    reading : Reading
        Signal of an ideal accelerometer.
    sampling_rate : float
        Hz.
    origin : int
        Sample at which the recorder's clock agrees with the true one.
    """
    reading = chain.act("signal", reading, values)
    signal = reading.acceleration
    # A filter whose corner lies above half the sampling rate is left out.
    if 0.0 < CUTOFF_FACTOR * reading.channel_class < 0.5 * sampling_rate:
        signal = filter_cfc(signal, sampling_rate, reading.channel_class, overwrite=True)
    if reading.clock != 1.0:
        columns = [retime(column, reading.clock, origin) for column in signal.T]
        signal = np.stack(columns, axis=1)
    return Record(signal, reading.clock)


def retime(values: Array, clock: float, origin: int) -> Array:
    """Return a channel as recorded by a recorder whose clock is wrong.

    Parameters
    ----------
    values : (n,) array
        Channel on the true time axis.
    clock : float
        Recorded duration over the true one.
    origin : int
        Sample at which both clocks agree.
    """
    if clock == 1.0:
        return values
    sample = np.arange(values.size)
    return np.interp(origin + (sample - origin) / clock, sample, values)
