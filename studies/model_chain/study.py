"""The model chain: models that differ in one thing at a time, on the same draws.

Every model has a cell of its own; run k of every cell has the same inputs. A dear model has fewer
runs, the first ones of the design.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from mcstudy.execution.progress import say
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.report import Section, Table
from mcstudy.studyfile.schema import Design
from models.protocol import Model
from studies.kind import Finished, StudyKind
from studies.model_cells import (
    prepare_model,
    run_model,
    shared_outputs,
    study_of_model,
    take_over,
)
from studies.model_chain.analysis import ChainAnalysis, analyse
from studies.model_chain.report import draw, sections_of, summarise
from studies.model_chain.schema import ModelChain
from studies.paired_runs import PreparedCell, cell_runs, finish_manifest, start_manifest
from studies.runs import load_study_model


@dataclass(frozen=True)
class ChainResults:
    """Input of the analysis: models and tables of runs, by label."""

    models: dict[str, Model]
    runs: dict[str, pd.DataFrame]


Done = Finished[ModelChain, ChainResults, ChainAnalysis]


class Chain(StudyKind[ModelChain, list[PreparedCell], ChainResults, ChainAnalysis]):
    """The difference of two models, split over what lies between."""

    schema = ModelChain
    analysis = ChainAnalysis

    def plan(self, study: ModelChain, folder: ResultsFolder) -> list[PreparedCell]:
        """Return the cells, each with its model and the values of every input."""
        cells = [
            prepare_model(study, label, design_of(study, label), folder) for label in study.models
        ]
        shared_outputs(study, {cell.name: cell.model for cell in cells})
        return cells

    def execute(
        self,
        study: ModelChain,
        plan: list[PreparedCell],
        folder: ResultsFolder,
        *,
        workers: Workers,
        quiet: bool,
    ) -> None:
        """Run the missing runs of all cells.

        Parameters
        ----------
        study : ModelChain
            Checked study file.
        plan : list of PreparedCell
            From ``plan``.
        folder : ResultsFolder
            Open for writing.
        workers : int or str
            Processes, -1 for one per core, or the address of a dask scheduler.
        quiet : bool
            No progress line.
        """
        n_all = sum(cell.study.design.n for cell in plan)
        manifest = start_manifest(study, folder, study.design.method, n_all, plan)
        tables = {}
        for cell in plan:
            say(f"{cell.name}:", quiet=quiet)
            take_over(cell, study.models[cell.name].reuse, folder)
            replicate = np.arange(cell.study.design.n) // study.design.size
            tables[cell.name] = run_model(cell, folder, replicate, workers=workers, quiet=quiet)
        finish_manifest(manifest, folder, tables)

    def results(self, study: ModelChain, folder: ResultsFolder) -> ChainResults:
        """Return models and runs."""
        models = {
            label: load_study_model(study_of_model(study, label, design_of(study, label)))
            for label in study.models
        }
        runs = {
            label: cell_runs(folder, label, design_of(study, label).n, model)
            for label, model in models.items()
        }
        return ChainResults(models, runs)

    def analyse(self, study: ModelChain, results: ChainResults) -> ChainAnalysis:
        """Return every number that the report prints."""
        outputs = shared_outputs(study, results.models)
        return analyse(study, results.models, results.runs, outputs)

    def subtitle(self, done: Done) -> str:
        """Return the line below the report's title."""
        analysis = done.analysis
        return (
            f"From {analysis.first} to {analysis.last} over {len(analysis.counts)} models, "
            f"{done.study.design.n:,} draws, seed {done.study.seed}"
        )

    def draw(self, done: Done) -> dict[str, Any]:
        """Return the figures by file name."""
        return draw(done.analysis)

    def sections(self, done: Done, figures: Mapping[str, Any]) -> Sequence[Section]:
        """Return the sections of the report."""
        return sections_of(done.study, done.analysis, figures)

    def summarise(self, analysis: ChainAnalysis) -> list[Table]:
        """Return the splits."""
        return summarise(analysis)


def design_of(study: ModelChain, label: str) -> Design:
    """Return the design of a model: that of the study, or the first runs of it."""
    n = study.models[label].n
    return study.design if n is None else study.design.model_copy(update={"n": n})
