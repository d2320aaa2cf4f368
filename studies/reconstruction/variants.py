"""Variants of a reconstruction: the same inputs through models that differ in one thing.

A crash is partly chaotic, so every variant is run with slightly perturbed inputs too: a difference
counts where it is larger than the scatter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.errors import StudyError, UserError
from mcstudy.execution.progress import follow
from mcstudy.figures import style
from mcstudy.figures.ranges import Range
from mcstudy.report import Table
from mcstudy.sampling import seeds
from mcstudy.studyfile.study_inputs import fixed_values
from mcstudy.studyfile.study_outputs import check_outputs
from mcstudy.text import number
from models.protocol import Model, complete_status
from studies.reconstruction.schema import Reconstruction
from studies.runs import evaluator_of, load_study_model

PERTURBED = 24
"""Runs of a variant with perturbed inputs."""
SIZE = 0.003
"""Largest perturbation of an input over its value (assumed: beyond what a case can state)."""


@dataclass(frozen=True)
class VariantOutcome:
    """Outputs of a variant by name, and the number of its perturbed runs that are complete."""

    label: str
    runs: int
    outputs: Mapping[str, Range]


def run_variants(study: Reconstruction, *, quiet: bool = True) -> list[VariantOutcome]:
    """Run the variants of a reconstruction.

    Parameters
    ----------
    study : Reconstruction
        Checked study file.
    quiet : bool
        No progress line.

    Raises
    ------
    UserError
        If a variant's model does not fit the study.
    StudyError
        If a variant's nominal run failed.
    """
    names = outputs_of(study)
    models = [_load(study, k) for k in range(len(study.variants))]
    for k, model in enumerate(models):
        check_outputs(names, model, f"variants[{k}]")
    found = []
    for variant, model in zip(study.variants, follow(models, "variants", quiet=quiet), strict=True):
        evaluator = evaluator_of(model, variant.model.options, study.effects)
        batch = evaluator.evaluate(_rows(study, model))
        complete = np.isin(batch.status, list(complete_status(model)))
        if not complete[0]:
            raise StudyError(f"variant {variant.label!r} ended with status {batch.status[0]!r}")
        place = [item.name for item in model.outputs]
        ranges = {name: _range(batch.outputs[complete, place.index(name)]) for name in names}
        found.append(VariantOutcome(variant.label, int(complete[1:].sum()), ranges))
    return found


def outputs_of(study: Reconstruction) -> list[str]:
    """Return the outputs of the published tables, in order."""
    return list(dict.fromkeys(name for table in study.tables for name in table.units))


def _load(study: Reconstruction, k: int) -> Model:
    """Return the model of a variant, with the study's effects."""
    try:
        model = load_study_model(study.model_copy(update={"model": study.variants[k].model}))
        fixed_values(study.fixed, model)
    except UserError as error:
        raise UserError(f"variants[{k}]: {error}") from None
    return model


def _rows(study: Reconstruction, model: Model) -> NDArray[np.float64]:
    """Return the nominal row of inputs and perturbed ones, the same for every variant."""
    fixed = fixed_values(study.fixed, model)
    nominal = np.array([fixed.get(item.name, item.nominal) for item in model.inputs])
    rng = seeds.generator(study.seed, seeds.PERTURBATION)
    factors = 1.0 + SIZE * rng.uniform(-1.0, 1.0, (PERTURBED, nominal.size))
    low, high = (np.array([getattr(item, end) for item in model.inputs]) for end in ("low", "high"))
    return np.concatenate([nominal[None], np.clip(factors * nominal, low, high)])


def _range(values: NDArray[np.float64]) -> Range:
    known = values[1:][np.isfinite(values[1:])]
    if not known.size:
        return Range(float(values[0]), np.nan, np.nan, np.nan)
    return Range(float(values[0]), float(known.min()), float(np.median(known)), float(known.max()))


def variant_table(study: Reconstruction, found: Sequence[VariantOutcome], model: Model) -> Table:
    """Return median and range of every output by variant, in the units of the tables.

    Parameters
    ----------
    study : Reconstruction
        Checked study file.
    found : sequence of VariantOutcome
        From ``run_variants``.
    model : Model
        Model of the study, which states the units of the outputs.
    """
    rows = []
    for label, ranges in variant_ranges(study, found, model).items():
        cells = [
            f"{number(r.median)} ({number(r.low)} to {number(r.high)})" for r in ranges.values()
        ]
        rows.append([label, *cells])
    caption = (
        f"Median and range of {PERTURBED} runs with inputs perturbed by up to {100.0 * SIZE:g} %, "
        "the same ones in every variant."
    )
    return Table(caption, ["output", *(outcome.label for outcome in found)], rows)


def variant_ranges(
    study: Reconstruction, found: Sequence[VariantOutcome], model: Model
) -> dict[str, dict[str, Range]]:
    """Return the range by variant, by label of the output, in the units of the tables.

    Parameters
    ----------
    study : Reconstruction
        Checked study file.
    found : sequence of VariantOutcome
        From ``run_variants``.
    model : Model
        Model of the study.
    """
    si = {item.name: item.unit for item in model.outputs}
    given = {name: unit for table in study.tables for name, unit in table.units.items()}
    ranges = {}
    for name in outputs_of(study):
        scale = units.factor(si[name], given[name])
        ranges[style.label(name, given[name])] = {
            outcome.label: outcome.outputs[name].times(scale) for outcome in found
        }
    return ranges
