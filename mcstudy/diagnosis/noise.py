"""Noise of a signal from its samples before contact."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]

MIN_COUNT = 40
"""Samples before contact from which noise is estimated."""
LEVEL = 1e-3
"""p-value below which the stated noise is rejected."""
WEAKEST = 0.15
"""Correlation of neighbours below which the noise counts as white."""


@dataclass(frozen=True)
class Noise:
    """Standard deviation, correlation of neighbouring samples, and whether it was measured."""

    sd: float
    correlation: float
    measured: bool


def estimate_noise(lead_ins: list[Array], stated: float) -> Noise:
    """Return the noise of a channel.

    The stated standard deviation is kept unless the samples before contact contradict it.

    Parameters
    ----------
    lead_ins : (n,) samples before contact, one array a test.
    stated : standard deviation of white noise, 0 if not known.

    Raises
    ------
    ValueError
        If no noise is stated and too few samples lie before contact.
    """
    parts = [part - part.mean() for part in lead_ins if part.size >= 4]
    count = sum(part.size - 1 for part in parts)
    if count < MIN_COUNT:
        if stated > 0.0:
            return Noise(stated, 0.0, False)
        raise ValueError(
            f"sd is 0 and only {count} samples lie before contact, too few to estimate the noise "
            f"({MIN_COUNT} needed); state sd"
        )
    products = sum(float(part[1:] @ part[:-1]) for part in parts)
    square = sum(float(part @ part) for part in parts)
    if square == 0.0:
        if stated > 0.0:
            return Noise(stated, 0.0, False)
        raise ValueError("sd is 0 and the samples before contact do not vary; state sd")
    # Removing each part's mean makes neighbours of white noise correlate by -1/n.
    bias = sum(1.0 for _ in parts) / sum(part.size for part in parts)
    correlation = float(np.clip(products / square + bias, 0.0, 0.98))
    if correlation < WEAKEST:
        correlation = 0.0
    # Correlation reduces the effective number of samples.
    freedom = count * (1.0 - correlation**2) / (1.0 + correlation**2)
    found = float(np.sqrt(square / count))
    if stated > 0.0 and correlation == 0.0:
        tail = stats.chi2(freedom).cdf(freedom * (found / stated) ** 2)
        if min(tail, 1.0 - tail) > LEVEL / 2.0:
            return Noise(stated, 0.0, False)
    return Noise(found, correlation, True)
