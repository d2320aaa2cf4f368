"""Evidence of a study file in the units of a model, and other priors as weights."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.errors import UserError
from mcstudy.posterior.evidence import Bank, Item
from mcstudy.posterior.ratio import Proposition
from mcstudy.posterior.weights import combine, reweight
from mcstudy.studyfile.distributions import Distribution
from mcstudy.studyfile.schema import SampledStudy
from models.protocol import Model, complete_status
from studies.posterior.schema import EvidenceTables

Array = NDArray[np.float64]


def units_of(model: Model) -> dict[str, str]:
    """Return the unit of every input and output of a model."""
    inputs = {item.name: item.unit for item in model.inputs}
    return inputs | {item.name: item.unit for item in model.outputs}


def bank_of(runs: pd.DataFrame, model: Model) -> Bank:
    """Return the bank of the complete runs of a model, partial ones included.

    Parameters
    ----------
    runs : DataFrame
        One row a run.
    model : Model
    """
    held = runs[runs["status"].isin(complete_status(model))]
    return Bank({name: held[name].to_numpy(dtype=float) for name in units_of(model)})


def check_tables(tables: EvidenceTables, study: SampledStudy, model: Model) -> None:
    """Check that evidence, propositions and priors fit a model and its study.

    Parameters
    ----------
    tables : EvidenceTables
    study : SampledStudy
        Study of the bank.
    model : Model

    Raises
    ------
    UserError
        Naming the place and the cure.
    """
    items_of(tables, model)
    propositions_of(tables, model)
    known = units_of(model)
    if tables.target not in study.inputs:
        raise UserError(
            f"target: {tables.target!r} is not sampled by the study; it samples "
            f"{', '.join(study.inputs)}"
        )
    for name in tables.discrepancy:
        if name not in tables.evidence:
            raise UserError(f"discrepancy.{name}: there is no evidence on {name}")
    for name in (*tables.also, *tables.measurements):
        if name not in known:
            raise UserError(f"{name}: {_unknown(name, model)}")
    for name, entry in tables.measurements.items():
        _factor(entry.unit, known[name], f"measurements.{name}")
    for name, prior in tables.priors.items():
        if name not in study.inputs:
            raise UserError(f"priors.{name}: the study does not sample it")
        if prior.parents or study.inputs[name].parents:
            raise UserError(f"priors.{name}: may not depend on another input")
        _factor(prior.unit, study.inputs[name].unit, f"priors.{name}")
    if tables.avoidability is not None:
        other = tables.avoidability
        _factor(other.unit, "m/s", "avoidability")
        _factor(other.braking_distance.unit, "m", "avoidability.braking_distance")
        _factor(other.reaction_time.unit, "s", "avoidability.reaction_time")
        if other.friction not in known:
            raise UserError(f"avoidability.friction: {_unknown(other.friction, model)}")
        if tables.target != "impact_speed":
            raise UserError("avoidability: needs target = 'impact_speed'")
    if tables.injury is not None and "hic15" not in known:
        raise UserError("injury: the model has no output 'hic15'")


def items_of(tables: EvidenceTables, model: Model, *, discrepancy: float = 1.0) -> dict[str, Item]:
    """Return the items of evidence by name, in the model's units.

    Parameters
    ----------
    tables : EvidenceTables
    model : Model
    discrepancy : float
        Factor on the stated errors of the model; 0 leaves them out.

    Raises
    ------
    UserError
        If a name or a unit does not fit the model.
    """
    known = units_of(model)
    found = {}
    for name, entry in tables.evidence.items():
        place = f"evidence.{name}"
        if name not in known:
            raise UserError(f"{place}: {_unknown(name, model)}")
        scale = _factor(entry.unit, known[name], place) if entry.happened is None else 1.0
        stated = tables.discrepancy.get(name)
        absolute = relative = 0.0
        if stated is not None:
            if stated.sd:
                absolute = stated.sd * _factor(stated.unit, known[name], f"discrepancy.{name}")
            relative = stated.relative
        found[name] = Item(
            name=name,
            value=None if entry.value is None else entry.value * scale,
            sd=(entry.sd or 0.0) * abs(scale),
            absolute=discrepancy * absolute,
            relative=discrepancy * relative,
            low=-np.inf if entry.at_least is None else entry.at_least * scale,
            high=np.inf if entry.at_most is None else entry.at_most * scale,
            happened=entry.happened,
        )
    return found


def propositions_of(tables: EvidenceTables, model: Model) -> list[Proposition]:
    """Return the propositions in the model's units.

    Parameters
    ----------
    tables : EvidenceTables
    model : Model

    Raises
    ------
    UserError
        If a name or a unit does not fit the model.
    """
    known = units_of(model)
    found = []
    for label, entry in tables.propositions.items():
        place = f"propositions.{label}"
        if entry.of not in known:
            raise UserError(f"{place}.of: {_unknown(entry.of, model)}")
        scale = _factor(entry.unit, known[entry.of], place)
        found.append(
            Proposition(
                label,
                entry.of,
                -np.inf if entry.above is None else entry.above * scale,
                np.inf if entry.below is None else entry.below * scale,
            )
        )
    return found


def prior_weights(tables: EvidenceTables, study: SampledStudy, bank: Bank, model: Model) -> Array:
    """Return the weight (n,) of each run under the priors of the evidence.

    Parameters
    ----------
    tables : EvidenceTables
    study : SampledStudy
        Study of the bank, whose priors its runs were drawn from.
    bank : Bank
    model : Model

    Raises
    ------
    UserError
        If a prior reaches beyond that of the bank.
    """
    known = units_of(model)
    weights = {}
    for name, prior in tables.priors.items():
        old, new = (_quantile(entry, known[name]) for entry in (study.inputs[name], prior))
        try:
            weights[name] = reweight(bank.values[name], old, new)
        except ValueError as error:
            raise UserError(f"priors.{name}: {error}") from None
    return combine(weights, bank.size)


def _quantile(distribution: Distribution, unit: str) -> "_Quantile":
    return _Quantile(distribution, units.factor(distribution.unit, unit))


class _Quantile:
    """Quantile function of a distribution in another unit."""

    def __init__(self, distribution: Distribution, scale: float) -> None:
        self._distribution, self._scale = distribution, scale

    def __call__(self, levels: Array) -> Array:
        return np.asarray(self._scale * self._distribution.quantile(levels, _NOTHING))


_NOTHING: Mapping[str, Array] = {}


def _factor(given: str, wanted: str, place: str) -> float:
    try:
        return units.factor(given, wanted)
    except ValueError as error:
        raise UserError(f"{place}.unit: {error}") from None


def _unknown(name: str, model: Model) -> str:
    known = ", ".join(units_of(model))
    return f"model {model.name!r} has no input or output {name!r}; it has {known}"
