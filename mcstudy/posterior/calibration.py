"""Calibration of a posterior by leaving runs of its bank out: ranks, coverage, scores.

A run of the bank is a draw of the prior with evidence of its own; where posteriors are right, the
rank of its true value is uniform (S. Talts and others, 2018). No further run is needed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mcstudy.posterior.inference import Posterior
from mcstudy.sampling import seeds
from mcstudy.statistics import crps
from mcstudy.typed_json import Real

Array = NDArray[np.float64]

LEFT_OUT = 1000
"""Runs that are left out, one at a time."""
BINS = 20
"""Bins of the ranks for the chi-square statistic."""
LEVELS = (0.5, 0.9)
"""Probabilities of the central intervals whose coverage is counted."""


@dataclass(frozen=True)
class LeftOut:
    """Runs that were left out.

    Attributes
    ----------
    runs : (c,) int array
    true : (c,) array
        Their values of the target.
    ranks : (c,) array
        Posterior probability below the true value.
    medians, widths, scores : (c,) arrays
        Posterior median, width of the 90 % interval, continuous ranked probability score.
    """

    runs: NDArray[np.int64]
    true: Array
    ranks: Array
    medians: Array
    widths: Array
    scores: Array


@dataclass(frozen=True)
class Calibration:
    """Agreement of ranks with a uniform distribution.

    Attributes
    ----------
    label : part of the runs.
    runs : number of runs.
    chi_square : statistic of ``BINS`` bins, and its p-value.
    kolmogorov : largest distance of the distribution of the ranks from the straight line, and its
        p-value.
    coverage : share of the true values in central intervals, by their probability.
    bias : mean of posterior median minus true value.
    width : mean width of the 90 % interval.
    score : mean continuous ranked probability score.
    """

    label: str
    runs: int
    chi_square: tuple[Real, Real]
    kolmogorov: tuple[Real, Real]
    coverage: dict[str, Real]
    bias: Real
    width: Real
    score: Real


def leave_out(posterior: Posterior, *, count: int = LEFT_OUT, seed: int = 0) -> LeftOut:
    """Return the runs that were left out, each with evidence of its own.

    Parameters
    ----------
    posterior : Posterior
    count : int
        Number of runs, at most as many as are possible.
    seed : int
        Of their choice.
    """
    rng = seeds.generator(seed, seeds.EVIDENCE, 1)
    rows = posterior.simulated.rows
    # One set of evidence a run, drawn by the prior.
    shuffled = rng.permutation(rows.size)
    _, first = np.unique(rows[shuffled], return_index=True)
    one_each = shuffled[first]
    chance = posterior.prior[rows[one_each]] * posterior.simulated.possible[rows[one_each]]
    known = int((chance > 0.0).sum())
    places = rng.choice(one_each, min(count, known), replace=False, p=chance / chance.sum())
    true = posterior.bank.values[posterior.target][rows[places]]
    found = np.empty((4, places.size))
    for k, (place, value) in enumerate(zip(places, true, strict=True)):
        draws = posterior.given_set(int(place))
        low, middle, high = draws.quantile(np.array([0.05, 0.5, 0.95]))
        rank = draws.share(draws.values < value) + 0.5 * draws.share(draws.values == value)
        found[:, k] = rank, middle, high - low, crps(draws.values, draws.weights, float(value))
    return LeftOut(rows[places], true, *found)


def calibrate(left: LeftOut, label: str, inside: NDArray[np.bool_] | None = None) -> Calibration:
    """Return the calibration of runs that were left out, or of some of them.

    Parameters
    ----------
    left : LeftOut
    label : str
        Name of the part.
    inside : (c,) bool array, optional
        Runs to use.
    """
    chosen = np.ones(left.true.size, dtype=bool) if inside is None else inside
    ranks = left.ranks[chosen]
    counts = np.histogram(ranks, bins=BINS, range=(0.0, 1.0))[0]
    chi = stats.chisquare(counts)
    ks = stats.kstest(ranks, "uniform")
    return Calibration(
        label=label,
        runs=int(ranks.size),
        chi_square=(float(chi.statistic), float(chi.pvalue)),
        kolmogorov=(float(ks.statistic), float(ks.pvalue)),
        coverage={
            f"{level:g}": float(np.mean(np.abs(ranks - 0.5) <= 0.5 * level)) for level in LEVELS
        },
        bias=float(np.mean(left.medians[chosen] - left.true[chosen])),
        width=float(np.mean(left.widths[chosen])),
        score=float(np.mean(left.scores[chosen])),
    )


def calibrate_thirds(left: LeftOut) -> list[Calibration]:
    """Return the calibration in the low, middle and high third of the posterior medians.

    Posteriors are calibrated given the evidence, not given the truth: near a bound of the prior the
    ranks of the largest true values are high wherever evidence leaves a doubt.

    Parameters
    ----------
    left : LeftOut
    """
    edges = np.quantile(left.medians, [1.0 / 3.0, 2.0 / 3.0])
    third = np.searchsorted(edges, left.medians)
    return [calibrate(left, name, third == k) for k, name in enumerate(("low", "middle", "high"))]
