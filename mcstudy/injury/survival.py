"""Injury-risk curves fitted to censored data by survival analysis, as ISO/TS 18506 requires.

Risk is the distribution of the stimulus x at which injury occurs, one of three families in its
logarithm, F(x) = G(z) with z = intercept + slope ln x (ISO/TS 18506:2014; A. Petitjean et al.,
Stapp Car Crash Journal 53, 2009):

- log-normal: G normal; log-logistic: G logistic; Weibull: G(z) = 1 - exp(-exp(z)).

An interval contributes ln(F(high) - F(low)) to the likelihood, an exact case the log density. All
of it is concave in intercept and slope, so Newton's method finds the one maximum; for data that are
only left- and right-censored it is that of a probit, logit or complementary log-log regression on
ln x.

Rows may have weights. Whole numbers count equal cases, and give the result of repeated rows.
Others are shares of a population (survey weights): the curve is that of the weighted
likelihood, its covariance the sandwich H^-1 (sum w^2 g g') H^-1 of the rows' gradients g (H. White,
Econometrica 50, 1982), which is independent of the sum of the weights.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from mcstudy.injury.observations import Observations, check
from mcstudy.statistics import REACH

Array = NDArray[np.float64]

FAMILIES = ("log-normal", "log-logistic", "Weibull")
NARROW = 1e-6
"""Width in ln x below which an interval's probability is density times width (assumed)."""
QUALITY_AT = (0.05, 0.25, 0.5)
"""Risks at which the quality index is given (ISO/TS 18506)."""
QUALITY_CLASSES = ((0.5, "good"), (1.0, "fair"), (1.5, "marginal"), (np.inf, "unacceptable"))
"""Largest relative width of the interval for each quality class (ISO/TS 18506)."""

NARROWEST = 1e-5
"""Spread of ln x below which stimuli differ by rounding alone (assumed)."""
STEEPEST = 1e4
"""Slope in ln x above which risk rises within 0.1 % of a stimulus (assumed)."""
_TOO_STEEP = "risk jumps at one stimulus, and its slope is not identifiable: no curve is given"
LARGEST_LOG_RATIO = 300.0
"""ln of density over probability above which both have underflowed."""
UNFINISHED = 0.01
"""Largest distance from the maximum of the likelihood, in standard errors (assumed)."""


@dataclass(frozen=True)
class RiskFit:
    """A fitted risk curve.

    Attributes
    ----------
    family : one of ``FAMILIES``.
    intercept, slope : of z in ln x.
    covariance : (2, 2) of intercept and slope.
    log_likelihood : weighted.
    cases : number of rows.
    """

    family: str
    intercept: float
    slope: float
    covariance: Array
    log_likelihood: float
    cases: int

    @property
    def aic(self) -> float:
        """Akaike's information criterion."""
        return 4.0 - 2.0 * self.log_likelihood

    def risk(self, stimulus: Array) -> Array:
        """Return the risk at each positive stimulus."""
        return _risk(self.family, self.intercept + self.slope * np.log(stimulus))

    def band(self, stimulus: Array) -> tuple[Array, Array]:
        """Return the 95 % band of the risk, normal on the scale of z."""
        y = np.log(stimulus)
        z = self.intercept + self.slope * y
        c = self.covariance
        reach = REACH * np.sqrt(c[0, 0] + 2.0 * c[0, 1] * y + c[1, 1] * y * y)
        return _risk(self.family, z - reach), _risk(self.family, z + reach)

    def log_stimulus_at(self, risk: float) -> tuple[float, float]:
        """Return ln x of a risk and half its 95 % interval."""
        centre = (_score(self.family, risk) - self.intercept) / self.slope
        gradient = np.array([1.0, centre]) / self.slope
        return centre, REACH * float(np.sqrt(gradient @ self.covariance @ gradient))

    def stimulus_at(self, risk: float) -> tuple[float, float, float]:
        """Return the stimulus of a risk with its 95 % interval, normal in ln x."""
        centre, reach = self.log_stimulus_at(risk)
        with np.errstate(over="ignore"):
            # The interval of a nearly flat curve may overflow.
            value, low, high = np.exp([centre, centre - reach, centre + reach]).tolist()
        return value, low, high

    def quality_index(self, risk: float) -> float:
        """Return the width of the stimulus's interval over the stimulus (ISO/TS 18506)."""
        # The bounds are the stimulus over and times one factor; the stimulus may underflow.
        with np.errstate(over="ignore"):
            return float(2.0 * np.sinh(self.log_stimulus_at(risk)[1]))


def quality_class(index: float) -> str:
    """Return the quality class of a quality index (ISO/TS 18506)."""
    return next(name for limit, name in QUALITY_CLASSES if index <= limit)


def fit_risk_curve(observations: Observations, family: str) -> RiskFit:
    """Return the maximum-likelihood risk curve.

    Parameters
    ----------
    observations : Observations
    family : str
        One of ``FAMILIES``.

    Raises
    ------
    ValueError
        If the family is unknown, the observations allow no curve (see
        ``mcstudy.injury.observations.check``), or risk does not rise with the stimulus.
    """
    if family not in FAMILIES:
        raise ValueError(f"unknown family {family!r}, choose from {', '.join(FAMILIES)}")
    check(observations)
    with np.errstate(divide="ignore"):
        low, high = np.log(observations.low), np.log(observations.high)
    exact, weights = observations.exact, observations.weights
    # The difference in risk over a narrow interval cancels: it is computed as the density in its
    # middle times its width.
    held = np.isfinite(high) & np.isfinite(low)
    span = np.where(held, observations.high - observations.low, np.inf)
    span = np.log1p(span / np.where(held, observations.low, 1.0))
    narrow = ~exact & (span < NARROW)
    point = exact | narrow
    y = np.log(observations.stimulus)
    middle, spread = float(y.mean()), float(y.std())
    width = spread if spread > NARROWEST else 1.0

    # Centred and scaled to decorrelate the two parameters; weights of mean one make the tolerance
    # of the search independent of their unit.
    place = np.where(narrow, 0.5 * (low + high), high)
    cases = _Cases((low - middle) / width, (place - middle) / width, point,
                   weights / weights.mean())  # fmt: skip

    def loss(p: Array) -> tuple[float, Array]:
        total, gradient, _ = _likelihood(family, p, cases)
        return -total, -gradient.sum(axis=1)

    def curvature(p: Array) -> Array:
        return -_likelihood(family, p, cases)[2]

    # The share of the injured, kept from 0 and 1, at the mean stimulus has a finite likelihood
    # under any censoring.
    share = float(observations.injured.mean())
    rim = 0.5 / observations.size
    start: Array = np.array([_score(family, min(max(share, rim), 1.0 - rim)), 1.0])
    found = optimize.minimize(loss, start, method="trust-exact", jac=True, hess=curvature, tol=1e-9)
    best = np.asarray(found.x)
    total, gradient, hessian = _likelihood(family, best, cases)
    if not (np.isfinite(total) and best[1] > 0.0):
        raise ValueError("risk does not rise with the stimulus: no curve is given")
    try:
        inverse = np.linalg.inv(-hessian)
    except np.linalg.LinAlgError:
        inverse = np.full((2, 2), np.nan)
    if not (np.all(np.isfinite(inverse)) and np.all(np.diag(inverse) > 0.0)):
        raise ValueError("the cases do not identify position and slope: no curve is given")
    ahead = gradient.sum(axis=1)
    if ahead @ inverse @ ahead > UNFINISHED**2:
        raise ValueError(_TOO_STEEP)
    scaled = inverse if observations.counted else inverse @ (gradient @ gradient.T) @ inverse
    if observations.counted:
        scaled = scaled / weights.mean()
    # Transformed to ln x: z = a + b (y - middle) / width.
    back = np.array([[1.0, -middle / width], [0.0, 1.0 / width]])
    intercept, slope = back @ best
    if slope > STEEPEST:
        raise ValueError(_TOO_STEEP)
    # The density of an exact case is one in x, not in the scaled ln x.
    total *= weights.mean()
    total -= float(weights[exact] @ (np.log(width) + high[exact]))
    total += float(weights[narrow] @ np.log(span[narrow] / width))
    return RiskFit(
        family, float(intercept), float(slope), back @ scaled @ back.T, total, observations.size
    )


@dataclass(frozen=True)
class _Cases:
    """Bounds (n,) in scaled ln x, which cases are exact (value in ``high``), and weights."""

    low: Array
    high: Array
    exact: NDArray[np.bool_]
    weight: Array


def _likelihood(family: str, parameters: Array, cases: _Cases) -> tuple[float, Array, Array]:
    """Return log likelihood, its gradient by case (2, n) and Hessian (2, 2), all weighted.

    Both are in intercept and slope.
    """
    a, b = parameters
    exact, weight = cases.exact, cases.weight
    gradient, hessian = np.zeros((2, exact.size)), np.zeros((2, 2))
    if exact.any() and b <= 0.0:
        return -np.inf, gradient, -np.eye(2)
    total = 0.0
    if exact.any():
        y, w = cases.high[exact], weight[exact]
        log_density, first, second = _density(family, a + b * y)
        rows = np.stack([np.ones_like(y), y])
        total += float(w @ log_density + w.sum() * np.log(b))
        gradient[:, exact] = w * (rows * first + np.array([[0.0], [1.0 / b]]))
        hessian += (rows * (w * second)) @ rows.T - np.diag([0.0, w.sum() / b**2])
    if exact.all():
        return total, gradient, hessian
    y1, y2, w = cases.low[~exact], cases.high[~exact], weight[~exact]
    log_share = _log_between(family, y1, y2, a, b)
    total += float(w @ log_share)
    if not np.isfinite(total):
        # Infeasible parameters: an interval has zero probability.
        return -np.inf, gradient, -np.eye(2)
    sides = []
    for y in (y1, y2):
        finite = np.isfinite(y)
        held = np.where(finite, y, 0.0)
        log_density, first, _ = _density(family, a + b * held)
        log_ratio = np.where(finite, log_density - log_share, -np.inf)
        if log_ratio.max(initial=0.0) > LARGEST_LOG_RATIO:
            return -np.inf, np.zeros_like(gradient), -np.eye(2)
        ratio = np.exp(log_ratio)
        sides.append((ratio, ratio * first, np.stack([np.ones_like(held), held])))
    (r1, d1, rows1), (r2, d2, rows2) = sides
    gradient[:, ~exact] = w * (rows2 * r2 - rows1 * r1)
    cross = (rows1 * (w * r1 * r2)) @ rows2.T
    upper = (rows2 * (w * (d2 - r2**2))) @ rows2.T
    lower = (rows1 * (w * (d1 + r1**2))) @ rows1.T
    return total, gradient, hessian + upper - lower + cross + cross.T


def _log_between(family: str, y1: Array, y2: Array, a: float, b: float) -> Array:
    """Return ln(F(y2) - F(y1)), from the tail without cancellation."""
    z1 = np.where(np.isfinite(y1), a + b * np.where(np.isfinite(y1), y1, 0.0), -np.inf)
    z2 = np.where(np.isfinite(y2), a + b * np.where(np.isfinite(y2), y2, 0.0), np.inf)
    low1, up1 = _log_tails(family, z1)
    low2, up2 = _log_tails(family, z2)
    with np.errstate(divide="ignore", invalid="ignore"):
        from_below = low2 + np.log1p(-np.exp(low1 - low2))
        from_above = up1 + np.log1p(-np.exp(up2 - up1))
    return np.where(z1 > 0.0, from_above, from_below)


def _log_tails(family: str, z: Array) -> tuple[Array, Array]:
    """Return ln G(z) and ln(1 - G(z))."""
    if family == "log-normal":
        return special.log_ndtr(z), special.log_ndtr(-z)
    if family == "log-logistic":
        return special.log_expit(z), special.log_expit(-z)
    hazard = np.exp(np.minimum(z, 700.0))
    with np.errstate(divide="ignore"):
        return np.log(-np.expm1(-hazard)), -hazard


def _density(family: str, z: Array) -> tuple[Array, Array, Array]:
    """Return the log density at z and its first and second derivative."""
    if family == "log-normal":
        return -0.5 * z * z - 0.5 * np.log(2.0 * np.pi), -z, np.full_like(z, -1.0)
    if family == "log-logistic":
        share = special.expit(z)
        below, above = _log_tails(family, z)
        return below + above, 1.0 - 2.0 * share, -2.0 * share * (1.0 - share)
    hazard = np.exp(np.minimum(z, 700.0))
    return z - hazard, 1.0 - hazard, -hazard


def _risk(family: str, z: Array) -> Array:
    return np.exp(_log_tails(family, z)[0])


def _score(family: str, risk: float) -> float:
    """Return z at a risk."""
    if family == "log-normal":
        return float(special.ndtri(risk))
    if family == "log-logistic":
        return float(special.logit(risk))
    return float(np.log(-np.log1p(-risk)))
