"""Published tables with rows of our results added."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mcstudy import units
from mcstudy.errors import UserError
from mcstudy.figures import style
from mcstudy.report import Table
from mcstudy.studyfile.schema import ComparisonTable
from mcstudy.text import number, unit


@dataclass(frozen=True)
class PublishedTable:
    """A published table with our rows: title, head, rows of numbers, the last ones ours."""

    title: str
    head: list[str]
    rows: list[tuple[str, list[float | None]]]


def compare_with_table(
    table: ComparisonTable, ours: Mapping[str, Mapping[str, float]], si: Mapping[str, str]
) -> PublishedTable:
    """Return a published table with rows of our results below it.

    Parameters
    ----------
    table : ComparisonTable
        As in a study file.
    ours : mapping
        Outputs in SI units by label of the row.
    si : mapping
        Unit of each output.

    Raises
    ------
    UserError
        If a unit does not fit.
    """
    names = list(table.units)
    try:
        scale = {name: units.factor(si[name], table.units[name]) for name in names}
    except ValueError as error:
        raise UserError(f"tables {table.title!r}: {error}") from None
    rows: list[tuple[str, list[float | None]]] = [
        (row.label, [row.values.get(name) for name in names]) for row in table.rows
    ]
    for label, outputs in ours.items():
        rows.append((label, [outputs[k] * scale[k] if k in outputs else None for k in names]))
    head = [f"{style.words(n)} [{unit(table.units[n]) or '–'}]" for n in names]
    return PublishedTable(table.title, head, rows)


def compare_methods_with_table(
    table: ComparisonTable, ours: Mapping[str, Mapping[str, float]], si: Mapping[str, str]
) -> PublishedTable:
    """Return a published table with rows of several methods of ours, and the means of both.

    A mean is given of outputs that all the methods, theirs or ours, have.

    Parameters
    ----------
    table : ComparisonTable
        As in a study file.
    ours : mapping
        Outputs in SI units by label of the row.
    si : mapping
        Unit of each output.

    Raises
    ------
    UserError
        If a unit does not fit.
    """
    whole = compare_with_table(table, ours, si)
    kinds = [row.kind for row in table.rows]
    published, own = whole.rows[: len(kinds)], whole.rows[len(kinds) :]
    simulated = [row for row, kind in zip(published, kinds, strict=True) if kind == "simulated"]
    observed = [row for row, kind in zip(published, kinds, strict=True) if kind == "observed"]
    rows = [*simulated, *_mean("published mean", simulated), *observed]
    return PublishedTable(whole.title, whole.head, [*rows, *own, *_mean("our mean", own)])


def _mean(
    label: str, rows: Sequence[tuple[str, list[float | None]]]
) -> list[tuple[str, list[float | None]]]:
    """Return the row of the means of rows, if it has any."""
    means: list[float | None] = []
    for column in zip(*(values for _, values in rows), strict=True):
        known = [value for value in column if value is not None and math.isfinite(value)]
        means.append(sum(known) / len(known) if len(known) == len(column) > 1 else None)
    return [(label, means)] if any(value is not None for value in means) else []


def as_table(published: PublishedTable) -> Table:
    """Return a published table as text: outputs as rows, sources as columns."""
    labels = [label for label, _ in published.rows]
    columns = [[number(value, 4) for value in values] for _, values in published.rows]
    rows = [list(row) for row in zip(published.head, *columns, strict=True)]
    return Table(published.title, ["", *labels], rows)
