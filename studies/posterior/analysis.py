"""Every number of a posterior study, from a bank of runs and evidence."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import ndimage

from mcstudy import units
from mcstudy.injury.functions import risk_function
from mcstudy.posterior.calibration import (
    BINS,
    Calibration,
    calibrate,
    calibrate_thirds,
    leave_out,
)
from mcstudy.posterior.evidence import Item
from mcstudy.posterior.inference import SETS, Draws, Posterior
from mcstudy.posterior.joint_coverage import measure_joint_coverage
from mcstudy.posterior.kernel import effective_size
from mcstudy.posterior.prior_check import PriorCheck, check_prior
from mcstudy.posterior.ratio import Proposition, Ratio
from mcstudy.posterior.weights import tilt
from mcstudy.sampling import seeds
from mcstudy.studyfile.schema import SampledStudy
from mcstudy.text import quantity
from models.protocol import Model
from studies.posterior.avoidability import measure_avoidability
from studies.posterior.case import Case, spread_of
from studies.posterior.evidence import (
    items_of,
    propositions_of,
    units_of,
)
from studies.posterior.formulae import HandSpeed, hand_speeds
from studies.posterior.numbers import (
    Assumption,
    Further,
    InjuryResult,
    ItemResult,
    OtherQuantity,
    PosteriorAnalysis,
    RatioResult,
    Spread,
)
from studies.posterior.schema import EvidenceTables
from studies.posterior.verbal import in_words
from studies.runs import describe_runs

Array = NDArray[np.float64]

LEAST_RUNS = 100.0
"""Effective runs below which a posterior is refused."""
FAILED = 0.001
"""p-value of the ranks below which the calibration has failed."""
OFF = 0.05
"""Largest difference of the coverage of 90 % intervals."""
FUTURES = 60
"""Draws of the posterior over which a further measurement is averaged."""
JOINT = ("running_speed", "lateral_offset")
"""Inputs whose joint coverage with the target is measured, of those that are sampled."""
GRID = 400
"""Points of the drawn densities."""


def _equal(values: Array, factor: float = 1.0) -> Spread:
    weights = np.full(values.size, 1.0 / values.size)
    return spread_of(values, weights, float(values.size), factor)


def analyse(
    tables: EvidenceTables, study: SampledStudy, model: Model, runs: pd.DataFrame
) -> PosteriorAnalysis:
    """Return every number that the report prints.

    Parameters
    ----------
    tables : EvidenceTables
        Checked evidence.
    study : SampledStudy
        Study of the bank.
    model : Model
    runs : DataFrame
        Runs of the bank.

    Raises
    ------
    UserError
        If too few runs are complete.
    StudyError
        If no run agrees with the evidence.
    """
    case = Case(tables, study, model, runs)
    ended, _ = describe_runs(study, model, runs)
    main = case.posterior(case.items, sets=SETS)
    draws = main.given()
    check = check_prior(main.simulated, main.prior)
    left = leave_out(main, seed=study.seed)
    calibration = [calibrate(left, "all"), *calibrate_thirds(left)]
    together = [n for n in JOINT if n in study.inputs and n != tables.target]
    joint = measure_joint_coverage(main, together, seed=study.seed)
    refused = _refusal(check, calibration, draws)
    propositions = propositions_of(tables, model)
    plain = case.posterior(case.plain)
    bare = plain.given()
    assumptions = _assumptions(case, propositions)
    before = main.bank.values[tables.target]
    return PosteriorAnalysis(
        **vars(ended),
        target=tables.target,
        unit=case.unit,
        seed=study.seed,
        before=spread_of(
            before, case.weights / case.weights.sum(), effective_size(case.weights), case.factor
        ),
        after=case.spread(draws),
        plain=case.spread(bare),
        curves=_curves(case, draws, bare),
        ranks=np.histogram(left.ranks, BINS, (0.0, 1.0))[0].tolist(),
        check=check,
        refused=refused,
        calibration=[_in_unit(entry, case.factor) for entry in calibration],
        joint=joint,
        items=_item_results(case, check),
        ratios=[]
        if refused
        else [
            _ratio_result(case, proposition, main, draws, plain, assumptions)
            for proposition in propositions
        ],
        assumptions=assumptions,
        formulae=_formulae(case),
        avoidability=[]
        if tables.avoidability is None
        else measure_avoidability(
            tables.avoidability, case.bank, draws, study.seed, _equal, case.factor
        ),
        injury=_injury(case),
        others=_others(case),
        further=_further(case, draws),
    )


def _curves(case: Case, draws: Draws, plain: Draws) -> dict[str, list[float]]:
    """Return the densities of prior and posteriors on a grid of the target, in its unit."""
    values = case.factor * case.bank.values[case.tables.target]
    grid = np.linspace(values.min(), values.max(), GRID)
    parts = {
        "prior": (values, case.weights / case.weights.sum()),
        "posterior": (case.factor * draws.values, draws.weights),
        "plain": (case.factor * plain.values, plain.weights),
    }
    found = {"grid": grid.tolist()}
    for name, (own, weights) in parts.items():
        counts, edges = np.histogram(own, GRID, (values.min(), values.max()), weights=weights)
        width = float(edges[1] - edges[0])
        sd = float(np.sqrt(weights @ (own - weights @ own) ** 2))
        # Silverman's rule, on the effective number of draws.
        smooth = 0.9 * sd * effective_size(weights) ** -0.2 / width
        found[name] = (ndimage.gaussian_filter1d(counts, smooth, mode="reflect") / width).tolist()
    return found


def _refusal(check: PriorCheck, calibration: Sequence[Calibration], draws: Draws) -> str:
    """Return why no likelihood ratio is given; empty if they are."""
    if check.impossible:
        return (
            "by model and prior the evidence is impossible (prior predictive p below 0.001); "
            f"to blame is {check.blamed.replace('_', ' ')}"
        )
    for entry in calibration:
        worst = min(entry.chi_square[1], entry.kolmogorov[1])
        if worst < FAILED or abs(entry.coverage["0.9"] - 0.9) > OFF:
            part = "" if entry.label == "all" else f" in the {entry.label} third"
            return (
                f"the calibration has failed{part}: 90 % intervals hold "
                f"{100.0 * entry.coverage['0.9']:.0f} % of the runs left out (p of their ranks "
                f"{worst:.2g}); a larger bank may mend it"
            )
    if draws.effective < LEAST_RUNS:
        return (
            f"only {draws.effective:.0f} effective runs lie near the evidence, fewer than "
            f"{LEAST_RUNS:.0f}; a larger bank, or a prior nearer to the case, mends it"
        )
    return ""


def _in_unit(entry: Calibration, factor: float) -> Calibration:
    return replace(
        entry, bias=entry.bias * factor, width=entry.width * factor, score=entry.score * factor
    )


def _item_results(case: Case, check: PriorCheck) -> list[ItemResult]:
    """Return each item: by itself, left out, and predicted by the others."""
    found = []
    for name, item in case.items.items():
        others = {key: other for key, other in case.items.items() if key != name}
        measured = any(other.value is not None for other in others.values())
        events = {k: o for k, o in case.items.items() if o.value is None and k != name}
        alone = None
        if item.value is not None:
            alone = case.spread(case.posterior({**events, name: item}).given())
        predicted = np.nan
        if item.value is not None and measured:
            predicted = _predicted(case, item, others)
        found.append(
            ItemResult(
                name,
                _said(case, name),
                check.items.get(name, check.possible),
                predicted,
                alone,
                case.spread(case.posterior(others).given()) if measured else None,
            )
        )
    return found


def _predicted(case: Case, item: Item, others: Mapping[str, Item]) -> float:
    """Return the two-sided p-value of an item given the others."""
    draws = case.draws_of(item.name, others)
    rng = seeds.generator(case.study.seed, seeds.EVIDENCE, 4)
    noisy = draws.values + item.noise(draws.values) * rng.standard_normal(draws.values.size)
    below = draws.share(noisy <= float(item.value or 0.0))
    return float(min(1.0, 2.0 * min(below, 1.0 - below)))


def _said(case: Case, name: str) -> str:
    """Return an item in words."""
    entry = case.tables.evidence[name]
    if entry.happened is not None:
        return "happened" if entry.happened else "did not happen"
    if entry.value is not None:
        said = f"{quantity(entry.value, entry.unit)}, sd {quantity(entry.sd, entry.unit)}"
        item = case.items[name]
        if item.relative:
            said += f", model {100.0 * item.relative:g} %"
        if item.absolute:
            stated = case.tables.discrepancy[name]
            said += f", model {quantity(stated.sd, stated.unit)}"
        return said
    ends = [
        f"at least {quantity(entry.at_least, entry.unit)}" if entry.at_least is not None else "",
        f"at most {quantity(entry.at_most, entry.unit)}" if entry.at_most is not None else "",
    ]
    return ", ".join(end for end in ends if end)


def _assumptions(case: Case, propositions: Sequence[Proposition]) -> list[Assumption]:
    """Return target and ratios under other assumptions, one changed at a time."""
    target = case.tables.target
    varied: list[tuple[str, Mapping[str, Item], Array]] = []
    doubled = items_of(case.tables, case.model, discrepancy=2.0)
    if doubled != case.items:
        varied.append(("model errors doubled", doubled, case.weights))
    shifted = [target, *(name for name in case.study.inputs if name.startswith("friction"))]
    for name in shifted:
        words = f"prior of {name.replace('_', ' ')}"
        for sign, side in ((-1.0, "lower"), (1.0, "higher")):
            moved = case.weights * tilt(case.bank.values[name], sign)
            varied.append((f"{words} one sd {side}", case.items, moved / moved.mean()))
    found = []
    for label, items, weights in varied:
        posterior = case.posterior(items, weights=weights)
        draws = posterior.given()
        ratios = {}
        for proposition in propositions:
            own, its = posterior, draws
            if proposition.name != target:
                own = case.posterior(items, proposition.name, weights)
                its = own.given()
            ratios[proposition.label] = case.ratio(own, proposition, its)
        found.append(Assumption(label, case.spread(draws), ratios))
    return found


def _ratio_result(
    case: Case,
    proposition: Proposition,
    main: Posterior,
    draws: Draws,
    plain: Posterior,
    assumptions: Sequence[Assumption],
) -> RatioResult:
    if proposition.name != case.tables.target:
        main = case.posterior(case.items, proposition.name, sets=SETS)
        draws = main.given()
        plain = case.posterior(case.plain, proposition.name)
    given = case.ratio(main, proposition, draws)
    without = case.ratio(plain, proposition, plain.given())
    others: list[Ratio] = [given, *(entry.ratios[proposition.label] for entry in assumptions)]
    values = [ratio.ratio.value if ratio.resolved else np.nan for ratio in others]
    return RatioResult(
        proposition.label, given, without, in_words(given), float(min(values)), float(max(values))
    )


def _formulae(case: Case) -> list[HandSpeed]:
    item = case.items.get("throw_distance")
    if item is None or item.value is None or case.tables.target != "impact_speed":
        return []
    return hand_speeds(item.value)


def _injury(case: Case) -> InjuryResult | None:
    """Return HIC15 and the probabilities of each AIS or worse, given the evidence."""
    entry = case.tables.injury
    if entry is None:
        return None
    draws = case.draws_of("hic15", case.items)
    exceeding = {}
    for name in entry.functions:
        function = risk_function(name)
        exceeding[name] = {
            str(level): float(draws.weights @ function.risk(level, draws.values, entry.age))
            for level in sorted(function.levels)
        }
    return InjuryResult(case.spread(draws, 1.0), exceeding, entry.recorded)


def _others(case: Case) -> list[OtherQuantity]:
    """Return the other quantities that the evidence file asks for, before and after."""
    found = []
    for name in case.tables.also:
        unit = units_of(case.model)[name]
        factor = 1.0
        if name in case.study.inputs:
            factor = units.factor(unit, case.study.inputs[name].unit)
            unit = case.study.inputs[name].unit
        values = case.bank.values[name]
        known = np.isfinite(values)
        weights = case.weights[known] / case.weights[known].sum()
        before = spread_of(values[known], weights, effective_size(weights), factor)
        after = case.spread(case.draws_of(name, case.items), factor)
        found.append(OtherQuantity(name, unit, before, after))
    return found


def _further(case: Case, draws: Draws) -> list[Further]:
    """Return the expected width of the 90 % interval after each further measurement."""
    found = []
    rng = seeds.generator(case.study.seed, seeds.EVIDENCE, 5)
    for name, entry in case.tables.measurements.items():
        sd = entry.sd * abs(units.factor(entry.unit, units_of(case.model)[name]))
        item = Item(name, value=0.0, sd=sd)
        posterior = case.posterior({**case.items, name: item})
        values = case.bank.values[name][draws.runs]
        known = np.isfinite(values)
        weights = draws.weights[known] / draws.weights[known].sum()
        widths = []
        for place in rng.choice(int(known.sum()), FUTURES, p=weights):
            observed = posterior.simulated.observed.copy()
            column = [own.name for own in posterior.simulated.items].index(name)
            observed[column] = values[known][place] + sd * rng.standard_normal()
            low, high = posterior.given(observed).quantile(np.array([0.05, 0.95]))
            widths.append(high - low)
        said = f"sd {quantity(entry.sd, entry.unit)}"
        found.append(Further(name, said, case.factor * float(np.mean(widths))))
    return sorted(found, key=lambda entry: entry.width)
