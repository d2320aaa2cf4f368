"""Contours of an output over an input, from the runs of any sampled results folder."""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.figures import style
from mcstudy.figures.posterior import draw_contours
from mcstudy.posterior.contours import Family, find_families
from mcstudy.report import Section, Table
from mcstudy.studyfile.schema import SampledStudy
from mcstudy.text import capital, number, quantity
from models.protocol import Model
from studies.inference.evidence import load_bank
from studies.posterior.evidence import bank_of, units_of
from studies.publishing import publish

ROWS = 8
"""Rows of the table of a contour."""


@dataclass(frozen=True)
class Contours:
    """Families of curves: names and units of both axes and of the grouping quantity."""

    over: str
    over_unit: str
    output: str
    output_unit: str
    by: str
    families: list[Family]


def write_contours(
    source: ResultsFolder, out: ResultsFolder, *, output: str, over: str, by: str, groups: int
) -> tuple[Contours, list[Table]]:
    """Write the report of a family of curves and return its numbers and tables.

    Parameters
    ----------
    source : ResultsFolder
        Of a posterior, Monte Carlo or Sobol' study.
    out : ResultsFolder
        Folder of the report.
    output, over, by : str
        Output of the vertical axis, input of the horizontal one, quantity that curves are grouped
        by.
    groups : int
        Number of curves, each of as many runs.

    Raises
    ------
    UserError
        If a name is unknown, or a group has too few runs.
    """
    study, model, runs = load_bank(source)
    known = units_of(model)
    for name in (output, over, by):
        if name not in known:
            raise UserError(f"{name}: the model has no such input or output; it has "
                            f"{', '.join(known)}")  # fmt: skip
    bank = bank_of(runs, model)
    x, x_unit = _shown(over, study, model, bank.values[over])
    z, z_unit = _shown(by, study, model, bank.values[by])
    edges = np.nanquantile(z, np.linspace(0.0, 1.0, groups + 1))
    words = style.words(by)
    labels = [
        f"{words} {number(low)} to {quantity(high, z_unit)}"
        for low, high in itertools.pairwise(edges)
    ]
    try:
        families = find_families(x, bank.values[output], z, labels, edges)
    except ValueError as error:
        raise UserError(f"{source.path}: {error}; take fewer --groups") from None
    contours = Contours(over, x_unit, output, known[output], by, families)
    tables = [_table(contours, family) for family in families]
    with out.open_for_writing():
        found = publish(
            out,
            f"{capital(style.words(output))} over {style.words(over)}, by {words}",
            f"From {len(runs):,} runs of the {study.kind} study {study.name}",
            contours,
            lambda held: {"contours": _draw(held)},
            lambda held, figures: [_section(held, figures)],
        )  # fmt: skip
    return found, tables


def _shown(
    name: str, study: SampledStudy, model: Model, values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], str]:
    """Return values in the unit of the study file, and that unit."""
    unit = units_of(model)[name]
    if name not in study.inputs:
        return values, unit
    given = study.inputs[name].unit
    return values * units.factor(unit, given), given


def _draw(contours: Contours) -> Any:
    return draw_contours(
        contours.families,
        style.label(contours.over, contours.over_unit),
        style.label(contours.output, contours.output_unit),
    )


def _section(contours: Contours, figures: Any) -> Section:
    said = (
        "Each curve is the median of the runs of one group about a point of the axis, its band "
        "holds 90 % of them; all other inputs vary as in the study."
    )
    return Section(
        "Curves",
        [said],
        [_table(contours, family) for family in contours.families],
        {"Median and 90 % band by group.": figures["contours"]},
    )


def _table(contours: Contours, family: Family) -> Table:
    places = np.linspace(0, len(family.x) - 1, ROWS).round().astype(int)
    rows = [
        [number(family.x[k]), number(family.low[k]), number(family.middle[k]),
         number(family.high[k])]
        for k in places
    ]  # fmt: skip
    head = [style.label(contours.over, contours.over_unit), "5 %", "50 %", "95 %"]
    unit = style.label(contours.output, contours.output_unit)
    return Table(f"{capital(family.label)}: {unit}.", head, rows)
