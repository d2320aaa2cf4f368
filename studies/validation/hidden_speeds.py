"""Hidden speeds: crashes of unknown speed, found by a posterior and by an independent method.

The bank is of the multibody model. Crashes of that model that are not in the bank, and crashes of
the planar model, which nothing was calibrated to, are measured with noise; the posterior must hold
their true speeds as often as it says.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import emcee
import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcstudy.execution.workers import parallel_backend
from mcstudy.figures import style
from mcstudy.figures.panels import Curve, Panel, draw_panels
from mcstudy.posterior.evidence import Bank, Item
from mcstudy.posterior.inference import Posterior
from mcstudy.posterior.kernel import weighted_quantile
from mcstudy.sampling import designs
from mcstudy.statistics import crps
from mcstudy.studyfile.distributions import Normal, Triangular, Uniform
from mcstudy.studyfile.input_space import InputSpace
from mcstudy.text import number
from models.registry import load_model
from studies.runs import evaluator_of
from studies.validation.check import Part, check

Array = NDArray[np.float64]

RUNS = 2048
"""Runs of the bank."""
HIDDEN = 200
"""Crashes of each model whose speed is found."""
COMPARED = 16
"""Crashes that the second method finds too."""
SPEEDS = (20.0 / 3.6, 65.0 / 3.6)
"""m/s, range of the hidden speeds: the prior reaches further."""
SEED = 23
EVIDENCE = {
    "throw_distance": 0.7,
    "wad": 0.03,
    "car_stopping_distance": 0.7,
    "stature": 0.01,
    "body_mass": 1.0,
}
"""Standard uncertainty of each item, in the model's units."""
DISCREPANCY = 0.10
"""Model error of the throw distance, relative, where another model stands for reality."""
WALKERS, STEPS, SKIPPED = 64, 1200, 400
"""Of the Markov chains."""
BINS, KEPT = 8, 40
"""Parts of the speed whose residuals are kept apart, and how many of each."""
PRIORS: Mapping[str, Normal | Uniform | Triangular] = {
    "impact_speed": Uniform(distribution="uniform", unit="km/h", low=15.0, high=75.0),
    "running_speed": Normal(distribution="normal", unit="m/s", mean=2.8, sd=0.5, low=1.5, high=4.5),
    "gait_phase": Uniform(distribution="uniform", low=0.0, high=1.0),
    "facing_angle": Normal(
        distribution="normal", unit="deg", mean=90.0, sd=12.0, low=55.0, high=125.0
    ),
    "friction_body_road": Normal(
        distribution="normal", mean=0.6, sd=0.08, low=0.45, high=0.8
    ),
    "friction_body_car": Triangular(distribution="triangular", low=0.15, mode=0.25, high=0.4),
    "friction_tyre_road": Normal(distribution="normal", mean=0.7, sd=0.06, low=0.55, high=0.9),
    "hood_stiffness": Uniform(distribution="uniform", low=0.0, high=1.0),
    "stature": Normal(distribution="normal", unit="m", mean=1.25, sd=0.055, low=1.1, high=1.4),
    "body_mass": Normal(distribution="normal", unit="kg", mean=24.5, sd=3.0, low=18.0, high=34.0),
}  # fmt: skip
"""Priors of what is not known, as in the reference case; other inputs are nominal."""


@dataclass(frozen=True)
class Found:
    """Hidden speeds and what was found of them, km/h."""

    true: Array
    low: Array
    median: Array
    high: Array
    scores: Array

    @property
    def coverage(self) -> float:
        """Share (%) of the true speeds in their 90 % interval."""
        return 100.0 * float(np.mean((self.low <= self.true) & (self.true <= self.high)))

    @property
    def bias(self) -> float:
        """Mean of median minus true speed, km/h."""
        return float(np.mean(self.median - self.true))


def validate(workers: int) -> Part:
    """Return the part on hidden speeds."""
    space = _space()
    with parallel_backend(workers):
        bank = _crashes("multibody", space, designs.draw("sobol", RUNS, RUNS, len(PRIORS), SEED))
        rng = np.random.default_rng(SEED)
        uniforms = rng.random((HIDDEN, len(PRIORS)))
        first = list(PRIORS).index("impact_speed")
        low, high = (PRIORS["impact_speed"].low or 0.0) / 3.6, 75.0 / 3.6
        shares = (rng.uniform(*SPEEDS, HIDDEN) - low) / (high - low)
        uniforms[:, first] = shares
        hidden = {name: _crashes(name, space, uniforms) for name in ("multibody", "planar")}
    own = _find(bank, hidden["multibody"], 0.0)
    foreign = _find(bank, hidden["planar"], DISCREPANCY)
    throw = _find(bank, hidden["planar"], DISCREPANCY, ("throw_distance",))
    apart, wider = _compare(bank, hidden["multibody"], space)
    checks = [
        check("speed_coverage", own.coverage),
        check("speed_width", float(np.mean(own.high - own.low))),
        check("speed_score", float(np.mean(own.scores))),
        check("speed_planar_coverage", foreign.coverage),
        check("speed_planar_bias", foreign.bias),
        check("speed_planar_throw", throw.coverage),
        check("speed_second_median", apart),
        check("speed_second_width", wider),
    ]
    words = [
        f"A bank of {RUNS:,} multibody runs, and {HIDDEN} crashes of 20 to 65 km/h of each model "
        "that are not in it. Evidence: throw, wrap-around and stopping distance, stature and mass, "
        "with noise. Where the planar model stands for reality, a model error of 10 % of the throw "
        "is stated.",
        f"Found by Markov chains on an emulator of the same runs, {COMPARED} medians lie "
        f"{number(apart, 2)} km/h from those of the kernel posterior (root mean square), and the "
        f"90 % intervals are {number(wider, 2)} times as wide.",
    ]
    panels = [
        _panel(own, "multibody crashes, not in the bank"),
        _panel(foreign, "planar crashes, model error stated"),
    ]
    caption = "Median and 90 % interval of the speed over the true one."
    return Part("Hidden speeds", words, checks, {caption: draw_panels(panels)})


def _space() -> InputSpace:
    units = {item.name: item.unit for item in load_model("multibody").inputs}
    return InputSpace(PRIORS, {name: units[name] for name in PRIORS})


def _crashes(name: str, space: InputSpace, uniforms: Array) -> Bank:
    """Return the crashes of a model at points of the unit cube; failed ones are left out."""
    model = load_model(name)
    columns = space.transform(uniforms)
    n = len(uniforms)
    rows = np.stack(
        [columns.get(item.name, np.full(n, item.nominal)) for item in model.inputs], axis=1
    )
    outputs = evaluator_of(model, {}).evaluate(rows).outputs
    values = {item.name: outputs[:, k] for k, item in enumerate(model.outputs)} | columns
    good = np.all([np.isfinite(values[key]) for key in EVIDENCE], axis=0)
    return Bank({key: column[good] for key, column in values.items()})


def _items(names: Sequence[str], relative: float) -> list[Item]:
    return [
        Item(name, 0.0, EVIDENCE[name], relative=relative if name == "throw_distance" else 0.0)
        for name in names
    ]


def _measured(hidden: Bank, names: Sequence[str]) -> Array:
    """Return what was measured of hidden crashes, (n, k)."""
    rng = np.random.default_rng(SEED + 1)
    noise = rng.standard_normal((hidden.size, len(names)))
    return np.stack(
        [hidden.values[name] + EVIDENCE[name] * noise[:, k] for k, name in enumerate(names)], axis=1
    )


def _find(bank: Bank, hidden: Bank, relative: float, names: Sequence[str] = ()) -> Found:
    """Return the speeds of hidden crashes by the kernel posterior."""
    chosen = tuple(names) or tuple(EVIDENCE)
    posterior = Posterior(bank, _items(chosen, relative), "impact_speed")
    rows = []
    for observed, true in zip(
        _measured(hidden, chosen), hidden.values["impact_speed"], strict=True
    ):
        draws = posterior.given(observed)
        low, middle, high = draws.quantile(np.array([0.05, 0.5, 0.95]))
        rows.append([true, low, middle, high, crps(draws.values, draws.weights, float(true))])
    return Found(*(3.6 * np.array(rows).T))


def _compare(bank: Bank, hidden: Bank, space: InputSpace) -> tuple[float, float]:
    """Return how far the medians of a second method lie (km/h), and the ratio of the widths."""
    names = tuple(EVIDENCE)
    chain = Chain(bank, space, names)
    posterior = Posterior(bank, _items(names, 0.0), "impact_speed")
    off, ratios = [], []
    for observed in _measured(hidden, names)[:COMPARED]:
        draws = posterior.given(observed)
        levels = np.array([0.05, 0.5, 0.95])
        ours, theirs = draws.quantile(levels), chain.quantiles(observed, levels)
        off.append(3.6 * (theirs[1] - ours[1]))
        ratios.append((theirs[2] - theirs[0]) / (ours[2] - ours[0]))
    return float(np.sqrt(np.mean(np.square(off)))), float(np.mean(ratios))


class Chain:
    """The second method: a quadratic emulator with its residuals, sampled by Markov chains.

    The likelihood of an output averages over residuals of the emulator at runs of about the same
    speed, so that they need not be normal.

    Parameters
    ----------
    bank : Bank
    space : InputSpace
        Priors.
    names : sequence of str
        Items of evidence.
    """

    def __init__(self, bank: Bank, space: InputSpace, names: Sequence[str]) -> None:
        self._space, self._names = space, names
        self._inputs = list(space.names)
        self._outputs = [name for name in names if name not in space.names]
        table = np.stack([bank.values[name] for name in self._inputs], axis=1)
        self._middle, self._size = table.mean(axis=0), table.std(axis=0)
        terms = self._terms(table)
        values = np.stack([np.log(bank.values[name]) for name in self._outputs], axis=1)
        self._coefficients = np.linalg.lstsq(terms, values, rcond=None)[0]
        residuals = values - terms @ self._coefficients
        order = np.argsort(bank.values["impact_speed"])
        parts = np.array_split(order, BINS)
        self._edges = np.array([bank.values["impact_speed"][part[0]] for part in parts[1:]])
        rng = np.random.default_rng(SEED + 2)
        self._residuals = np.stack([residuals[rng.choice(part, KEPT)] for part in parts])

    def _terms(self, table: Array) -> Array:
        z = (table - self._middle) / self._size
        d = z.shape[1]
        products = [z[:, i] * z[:, j] for i in range(d) for j in range(i, d)]
        cubes = [z[:, 0] ** 3]
        return np.stack([np.ones(len(z)), *z.T, *products, *cubes], axis=1)

    def log_density(self, scores: Array, observed: Array) -> Array:
        """Return the log posterior density (n,) at normal scores (n, d) of the inputs."""
        columns = self._space.from_normal(scores)
        table = np.stack([columns[name] for name in self._inputs], axis=1)
        means = self._terms(table) @ self._coefficients
        part = np.searchsorted(self._edges, columns["impact_speed"])
        simulated = np.exp(means[:, None] + self._residuals[part])
        total = -0.5 * np.sum(scores**2, axis=1)
        exponents = np.zeros(simulated.shape[:2])
        for name, value in zip(self._names, observed, strict=True):
            sd = EVIDENCE[name]
            if name in self._outputs:
                off = (value - simulated[..., self._outputs.index(name)]) / sd
                exponents -= 0.5 * off**2
            else:
                total -= 0.5 * ((value - columns[name]) / sd) ** 2
        return np.asarray(total + special.logsumexp(exponents, axis=1))

    def quantiles(self, observed: Array, levels: Array) -> Array:
        """Return quantiles of the impact speed (m/s) given evidence (k,)."""
        rng = np.random.default_rng(SEED + 3)
        pool = rng.standard_normal((4000, len(self._inputs)))
        best = np.argsort(-self.log_density(pool, observed))[:WALKERS]
        start = pool[best] + 0.05 * rng.standard_normal((WALKERS, len(self._inputs)))
        sampler = emcee.EnsembleSampler(
            WALKERS, len(self._inputs), partial(self.log_density, observed=observed),
            vectorize=True, moves=emcee.moves.DEMove(),
        )  # fmt: skip
        sampler.random_state = np.random.RandomState(SEED).get_state()
        sampler.run_mcmc(start, STEPS)
        chain = sampler.get_chain(discard=SKIPPED, flat=True)
        speeds = self._space.from_normal(chain)["impact_speed"]
        return weighted_quantile(speeds, np.full(speeds.size, 1.0 / speeds.size), levels)


def _panel(found: Found, title: str) -> Panel:
    order = np.argsort(found.true)
    true = found.true[order]
    inside = (found.low <= found.true) & (found.true <= found.high)
    curves = [Curve(np.array([15.0, 70.0]), np.array([15.0, 70.0]), None, style.GREY)]
    for k in order:
        colour = style.BLUE if inside[k] else style.RED
        ends = np.array([found.low[k], found.high[k]])
        curves.append(Curve(np.full(2, found.true[k]), ends, None, colour))
    curves.append(Curve(true, found.median[order], "median", "black", "", "."))
    return Panel("true speed [km/h]", "found speed [km/h]", curves, title=title)
