"""Borgonovo's delta: the shift of an output's density when an input is fixed.

E. Borgonovo, Reliability Engineering and System Safety 92, 2007: half the expected area between the
density of the output and its density at a given input; 0 for an input without influence, 1 for one
that fixes the output. The estimator cuts the sample into classes of equal counts along the input,
estimates the densities by Gaussian kernels and corrects the bias by bootstrap (E. Plischke,
E. Borgonovo, C. Smith, European Journal of Operational Research 226, 2013, equations 26 and 30).

Delta is invariant under increasing transformations of the output, so densities are estimated on its
normal scores, where a skewed output is as well resolved as any other.

SALib 1.6 applies equation 30 to a resample instead of the sample, which leaves twice the bias
(a dummy gets 0.07 at 2,000 runs), so the estimator is implemented here; its equation 26 is tested
against SALib's on equal samples.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

Array = NDArray[np.float64]

RESAMPLES = 30
"""Bootstrap resamples for bias and standard deviation (assumed)."""
GRID = 100
"""Points at which densities are compared (Plischke et al.)."""
MAX_CLASSES = 48


def delta(values: Array, outputs: Array, rng: np.random.Generator) -> Array:
    """Return delta of each input with two bootstrap standard deviations either side, (3, d).

    This is no confidence interval: the remaining bias, upward for inputs without influence and
    downward for others, is as large.

    Parameters
    ----------
    values : (n, d) array
    outputs : (n,) array
        Finite.
    rng : Generator
        Of the resamples.
    """
    n = outputs.size
    if np.ptp(outputs) == 0.0:
        return np.full((3, values.shape[1]), np.nan)
    ranks = stats.rankdata(outputs)
    outputs = special.ndtri((ranks - 0.5) / n)
    found = density_shift(values, outputs)
    resampled = np.empty((RESAMPLES, values.shape[1]))
    for k in range(RESAMPLES):
        part = rng.integers(0, n, n)
        resampled[k] = density_shift(values[part], outputs[part])
    unbiased = 2.0 * found - resampled.mean(axis=0)
    reach = 2.0 * resampled.std(axis=0, ddof=1)
    return np.stack([unbiased, unbiased - reach, unbiased + reach])


def density_shift(values: Array, outputs: Array) -> Array:
    """Return delta of each input without correction for bias (equation 26), shape (d,)."""
    n = outputs.size
    shift = np.zeros(values.shape[1])
    if np.ptp(outputs) == 0.0:
        # A resample may hold one value only: its distribution cannot shift.
        return shift
    grid = np.linspace(outputs.min(), outputs.max(), GRID)
    overall = _density(outputs, grid)
    borders = np.linspace(0.0, n, _classes(n) + 1).astype(int)
    for column, order in enumerate(np.argsort(values, axis=0, kind="stable").T):
        ordered = outputs[order]
        for low, high in pairwise(borders):
            part = ordered[low:high]
            if np.ptp(part) > 0.0:
                gap = np.abs(overall - _density(part, grid))
                moved = 0.5 * float(np.trapezoid(gap, grid))
            else:
                # A single value has no density: the shift is the probability of all other values.
                moved = 1.0 - float(np.mean(outputs == part[0]))
            shift[column] += part.size / n * moved
    return shift


def _classes(n: int) -> int:
    """Return the number of classes (Plischke et al., as SALib)."""
    exponent = 2.0 / (7.0 + np.tanh((1500.0 - n) / 500.0))
    return min(int(np.ceil(n**exponent)), MAX_CLASSES)


def _density(sample: Array, grid: Array) -> Array:
    """Return the Gaussian kernel density with Silverman's width at the grid's points."""
    width = float(sample.std(ddof=1)) * (0.75 * sample.size) ** -0.2
    scores = (grid[:, None] - sample) / width
    weights = np.exp(-0.5 * scores * scores).sum(axis=1)
    return np.asarray(weights / (sample.size * width * np.sqrt(2.0 * np.pi)))
