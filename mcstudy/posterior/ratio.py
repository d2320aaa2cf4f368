"""Likelihood ratio of two propositions: what the evidence says of one against the other.

The ratio is the posterior odds over the prior odds, so the prior probabilities cancel; what is left
of the prior are the conditional priors, which say what the quantity is like if a proposition is
true.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mcstudy.posterior.inference import Draws, Posterior
from mcstudy.statistics import CONFIDENCE, Estimate
from mcstudy.typed_json import Real

Array = NDArray[np.float64]

LEAST_TAIL = 10.0
"""Effective runs that each proposition must have among the draws for its ratio to be given."""
ROUND_LIMITS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)
"""Ratios, and their inverses, by which a ratio beyond the resolution of a bank is bounded."""


@dataclass(frozen=True)
class Proposition:
    """That a quantity lies between bounds, against that it does not.

    Attributes
    ----------
    label : str
        In words.
    name : str
        Input or output.
    low, high : float
        Bounds in the model's unit.
    """

    label: str
    name: str
    low: float = -np.inf
    high: float = np.inf

    def holds(self, values: Array) -> NDArray[np.bool_]:
        """Return where it is true; an output that a run does not have makes it false."""
        with np.errstate(invalid="ignore"):
            return np.asarray((values > self.low) & (values <= self.high))


@dataclass(frozen=True)
class Ratio:
    """A likelihood ratio.

    Attributes
    ----------
    prior : probability of the proposition before the evidence.
    posterior : and after it.
    ratio : probability of the evidence if it is true over that if it is not; NaN where it is
        beyond the resolution of the bank.
    tail : effective runs of the rarer side among the draws.
    bound : ratio below which (if the proposition is the rarer side) or above which it lies where
        it is not given; NaN where it is.
    """

    prior: Real
    posterior: Estimate
    ratio: Estimate
    tail: Real
    bound: Real

    @property
    def resolved(self) -> bool:
        """Whether the ratio is given."""
        return bool(np.isfinite(self.ratio.value))


def measure_ratio(posterior: Posterior, proposition: Proposition, draws: Draws) -> Ratio:
    """Return the likelihood ratio of a proposition on the target of a posterior.

    Parameters
    ----------
    posterior : Posterior
        Of the quantity of the proposition.
    proposition : Proposition
    draws : Draws
        Of that posterior.

    Raises
    ------
    ValueError
        If the prior leaves no doubt of the proposition.
    """
    values = posterior.bank.values[proposition.name]
    weights = posterior.prior / posterior.prior.sum()
    prior = float(weights[proposition.holds(values)].sum())
    if not 0.0 < prior < 1.0:
        state = "true" if prior >= 1.0 else "false"
        raise ValueError(f"{proposition.label}: {state} in every run of the bank")
    inside = proposition.holds(draws.values)
    share = draws.share(inside)
    n = draws.effective
    rare = inside if share <= 0.5 else ~inside
    tail = draws.effective_among(rare)
    tail_level = 0.5 - 0.5 * CONFIDENCE
    # Jeffreys' interval (L. Brown, T. Cai, A. DasGupta, 2001) of as many independent draws.
    beta = stats.beta(n * share + 0.5, n * (1.0 - share) + 0.5)
    low, high = float(beta.ppf(tail_level)), float(beta.ppf(1.0 - tail_level))
    found = Estimate(share, low, high)
    odds = prior / (1.0 - prior)
    ends = [_odds(p) / odds for p in (share, low, high)]
    if tail >= LEAST_TAIL:
        return Ratio(prior, found, Estimate(*ends), tail, np.nan)
    if share <= 0.5:
        bound = 1.0 / max(k for k in ROUND_LIMITS if k <= max(1.0 / ends[2], 1.0))
    else:
        bound = float(max(k for k in ROUND_LIMITS if k <= max(ends[1], 1.0)))
    return Ratio(prior, found, Estimate(np.nan, np.nan, np.nan), tail, bound)


def _odds(p: float) -> float:
    return p / (1.0 - p) if p < 1.0 else np.inf
