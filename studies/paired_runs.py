"""Studies of several cells: the same draws through every cell, each in its own folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.progress import say
from mcstudy.execution.results import ResultsFolder, digest
from mcstudy.execution.workers import Workers
from mcstudy.studyfile.schema import Design
from models.protocol import Model
from studies.monte_carlo.schema import MonteCarloStudy
from studies.runs import columns_of, run_rows

Array = NDArray[np.float64]

BATCHES = 20
"""Batches of an independent sample for intervals between batches (assumed)."""


class CellStudy(Protocol):
    """A study of several cells."""

    @property
    def name(self) -> str:
        """Name of the study."""

    @property
    def kind(self) -> str:
        """Name of the kind."""

    @property
    def seed(self) -> int:
        """Seed of the draws."""


class PairedStudy(CellStudy, Protocol):
    """A study whose cells share their draws."""

    @property
    def design(self) -> Design:
        """Design of each cell."""


@dataclass(frozen=True)
class PreparedCell:
    """A cell ready to run: its name, which is its folder's, study, model and input values."""

    name: str
    study: MonteCarloStudy
    model: Model
    columns: dict[str, Array]


def cell_folder(folder: ResultsFolder, name: str) -> ResultsFolder:
    """Return the folder of a cell."""
    return ResultsFolder(folder.path / "cells" / name)


def run_cells(
    study: PairedStudy,
    folder: ResultsFolder,
    cells: Sequence[PreparedCell],
    *,
    workers: Workers,
    quiet: bool,
) -> None:
    """Run the missing runs of all cells and write the study's manifest.

    Parameters
    ----------
    study : PairedStudy
        Checked study file.
    folder : ResultsFolder
        Open for writing.
    cells : sequence of PreparedCell
        In the order in which they are run.
    workers : int or str
        Processes, -1 for one per core, or the address of a dask scheduler.
    quiet : bool
        No progress line.

    Raises
    ------
    StudyError
        If too many runs of a cell failed, or the workers are lost.
    """
    n, size = study.design.n, study.design.size
    manifest = start_manifest(study, folder, study.design.method, n * len(cells), cells)
    tables = {}
    for cell in cells:
        say(f"{cell.name.replace('/', ', ')}:", quiet=quiet)
        inner = cell_folder(folder, cell.name)
        try:
            with inner.open_for_writing():
                tables[cell.name] = run_rows(
                    cell.study, cell.model, cell.columns, inner,
                    design={"method": study.design.method, "n": n, "replicate_size": size},
                    replicate=np.arange(n) // size, workers=workers, quiet=quiet,
                )  # fmt: skip
        except StudyError as error:
            raise StudyError(f"{cell.name}: {error}") from None
    finish_manifest(manifest, folder, tables)


def start_manifest(
    study: CellStudy, folder: ResultsFolder, method: str, n: int, cells: Sequence[PreparedCell]
) -> dict[str, Any]:
    """Write the manifest of a study of several cells that is not finished, and return it.

    Parameters
    ----------
    study : CellStudy
        Checked study file.
    folder : ResultsFolder
        Open for writing.
    method : str
        Method of the design.
    n : int
        Runs of all cells.
    cells : sequence of PreparedCell
        In the order in which they are run.
    """
    manifest: dict[str, Any] = {
        "format": "mcstudy-results/1",
        "study": study.name,
        "kind": study.kind,
        "seed": study.seed,
        "design": {"method": method, "n": n, "cells": [cell.name for cell in cells]},
        "finished": False,
    }
    folder.write_json("manifest.json", manifest)
    return manifest


def finish_manifest(
    manifest: dict[str, Any], folder: ResultsFolder, tables: Mapping[str, pd.DataFrame]
) -> None:
    """Write the manifest of a study of several cells whose runs are done.

    Parameters
    ----------
    manifest : dict
        From ``start_manifest``.
    folder : ResultsFolder
        Open for writing.
    tables : mapping
        Table of runs by cell.
    """
    counts = pd.Series(dtype=int)
    for runs in tables.values():
        counts = counts.add(runs["status"].value_counts(), fill_value=0)
    manifest = manifest | {
        "counts": {str(k): int(v) for k, v in counts.items()},
        "digests": {name: digest(runs) for name, runs in tables.items()},
        "finished": True,
    }
    folder.write_json("manifest.json", manifest)


def cell_runs(folder: ResultsFolder, name: str, n: int, model: Model) -> pd.DataFrame:
    """Return the first n runs of a cell of a model.

    Parameters
    ----------
    folder : ResultsFolder
        Of the study.
    name : str
        Name of the cell.
    n : int
        Number of runs.
    model : Model
        Model of the cell.

    Raises
    ------
    UserError
        If not all of them are done.
    """
    inner = cell_folder(folder, name)
    runs = inner.runs(columns_of(model))
    runs = runs[runs["run"] < n]
    if len(runs) < n:
        raise UserError(
            f"{inner.path}: {len(runs)} of {n} runs are done; run the study again to resume"
        )
    return runs


def batch_of(study: PairedStudy, runs: pd.DataFrame) -> NDArray[np.int64]:
    """Return the independent part of the design that each run belongs to, (n,).

    Replicates are such parts; independent runs are cut into twenty batches.
    """
    size = study.design.size if study.design.size > 1 else max(1, study.design.n // BATCHES)
    return runs["run"].to_numpy(dtype=np.int64) // size
