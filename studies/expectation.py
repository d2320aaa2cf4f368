"""What a study will take, before it runs: runs, computing time, memory."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.report import Table
from mcstudy.studyfile.schema import AnyStudy
from mcstudy.text import number
from models.protocol import Model
from studies.kinds import KINDS
from studies.paired_runs import cell_folder

NUMBER = 8
"""Bytes of a number in a table of runs."""


@dataclass(frozen=True)
class Expected:
    """What a model's runs take: runs in all and done, CPU time (s) of a run, size of the table."""

    runs: int
    done: int
    cost: float
    table: int

    @property
    def left(self) -> int:
        """Runs that are still to be done."""
        return max(self.runs - self.done, 0)


def expect_study(study: AnyStudy, folder: ResultsFolder) -> dict[str, Expected]:
    """Return what each model or cell of a study takes, by label.

    Parameters
    ----------
    study : AnyStudy
        Checked study file.
    folder : ResultsFolder
        Where it would run.

    Raises
    ------
    UserError
        If the study does not fit its model or the folder, or its kind has no runs to count.
    """
    kind = KINDS.get(study.kind)
    if kind is None:
        raise UserError(f"a {study.kind} has one run a model")
    plan = kind.plan(study, folder)
    if not isinstance(plan, list):
        return {plan.model.name: _expected(plan.model, plan.columns, folder)}
    return {
        cell.name: _expected(cell.model, cell.columns, cell_folder(folder, cell.name))
        for cell in plan
    }


def _expected(model: Model, columns: Mapping[str, np.ndarray], folder: ResultsFolder) -> Expected:
    runs = len(next(iter(columns.values())))
    held = folder.done() if folder.path.exists() else None
    width = len(model.inputs) + len(model.outputs)
    return Expected(runs, 0 if held is None else len(held), model.cost, NUMBER * runs * width)


def expectation_table(expected: Mapping[str, Expected], workers: int) -> Table:
    """Return a table of what a study takes.

    Parameters
    ----------
    expected : mapping
        From ``expect_study``.
    workers : int
        Processes, -1 for one a core.
    """
    cores = (os.cpu_count() or 1) if workers < 0 else workers
    rows = [
        [label, f"{e.runs:,}", f"{e.done:,}", f"{number(e.cost)} s",
         duration(e.left * e.cost / cores), f"{number(e.table / 1e6, 2)} MB"]
        for label, e in expected.items()
    ]  # fmt: skip
    total = list(expected.values())
    if len(total) > 1:
        seconds = sum(e.left * e.cost for e in total) / cores
        rows.append(
            ["all", f"{sum(e.runs for e in total):,}", f"{sum(e.done for e in total):,}", "",
             duration(seconds), f"{number(sum(e.table for e in total) / 1e6, 2)} MB"]
        )  # fmt: skip
    head = ["model", "runs", "done", "a run", f"time on {cores} cores", "table"]
    return Table("Expected; code that is not compiled yet adds one to four minutes.", head, rows)


def duration(seconds: float) -> str:
    """Return a time in words, in the largest units that matter."""
    if seconds < 90.0:
        return f"{math.ceil(seconds)} s"
    if seconds < 5400.0:
        return f"{math.ceil(seconds / 60.0)} min"
    return f"{seconds / 3600.0:.1f} h"


def expectation_notes(study: AnyStudy) -> Sequence[str]:
    """Return what the table leaves out."""
    if study.kind == "multi-fidelity":
        return ["Pilot runs only: the budget of the study is allotted after them."]
    return []
