"""The map: outputs over two inputs of one model, at every point over draws of the other inputs.

All points have the same draws of the other inputs, so that they differ by their place alone.
"""

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.report import Section, Table
from mcstudy.sampling import designs
from mcstudy.studyfile.identity import numbers_digest
from mcstudy.studyfile.study_inputs import map_inputs
from mcstudy.studyfile.study_outputs import check_outputs, report_outputs
from studies.kind import Finished, StudyKind
from studies.response_map.analysis import MapAnalysis, analyse
from studies.response_map.grid import map_columns, map_points
from studies.response_map.report import draw, sections_of, summarise
from studies.response_map.schema import MapStudy
from studies.runs import ModelRuns, RunPlan, columns_of, load_study_model, run_rows

Done = Finished[MapStudy, ModelRuns, MapAnalysis]

TABLE = "map.csv"
"""File of the points of a map, in its results folder."""


class ResponseMap(StudyKind[MapStudy, RunPlan, ModelRuns, MapAnalysis]):
    """Outputs of one model over two of its inputs."""

    schema = MapStudy
    analysis = MapAnalysis

    def plan(self, study: MapStudy, folder: ResultsFolder) -> RunPlan:
        """Return the model and the values of its inputs at every point of every draw."""
        model = load_study_model(study)
        report_outputs(study, model)
        check_outputs(list(study.report.limits), model, "report.limits")
        draws = map_inputs(study, model, _uniforms(study))
        points = map_points(study, model)
        folder.check_same_study(numbers_digest(study, model))
        replicate = np.repeat(np.arange(study.design.n) // study.design.size, len(points))
        return RunPlan(model, map_columns(study, model, points, draws), replicate)

    def execute(
        self,
        study: MapStudy,
        plan: RunPlan,
        folder: ResultsFolder,
        *,
        workers: Workers,
        quiet: bool,
    ) -> None:
        """Run the missing runs.

        Parameters
        ----------
        study : MapStudy
            Checked study file.
        plan : RunPlan
            From ``plan``.
        folder : ResultsFolder
            Open for writing.
        workers : int or str
            Processes, -1 for one per core, or the address of a dask scheduler.
        quiet : bool
            No progress line.
        """
        design = study.design
        total = len(plan.replicate)
        run_rows(
            study, plan.model, plan.columns, folder,
            design={"method": design.method, "n": total, "points": total // design.n,
                    "draws": design.n},
            replicate=plan.replicate, workers=workers, quiet=quiet,
        )  # fmt: skip

    def results(self, study: MapStudy, folder: ResultsFolder) -> ModelRuns:
        """Return the model and the runs of the draws that are whole."""
        model = load_study_model(study)
        points = folder.design("points")["points"]
        runs = folder.runs(columns_of(model))
        runs = runs[runs["run"] < study.design.n * points]
        done = np.bincount(runs["run"] // points, minlength=study.design.n) == points
        if not done.any():
            raise UserError(
                f"{folder.path}: too few runs are done for a report; run the study again"
            )
        return ModelRuns(model, runs[done[runs["run"] // points]])

    def analyse(self, study: MapStudy, results: ModelRuns) -> MapAnalysis:
        """Return every number that the report prints."""
        return analyse(study, results.model, results.runs)

    def tables(self, analysis: MapAnalysis) -> dict[str, str]:
        """Return the points as a table of comma-separated values."""
        return {TABLE: table_of(analysis)}

    def subtitle(self, done: Done) -> str:
        """Return the line below the report's title."""
        points = len(done.analysis.points)
        return (
            f"Map of the {done.results.model.name} model: {points:,} points, "
            f"{len(done.results.runs) // points:,} runs each, seed {done.study.seed}"
        )

    def draw(self, done: Done) -> dict[str, Any]:
        """Return the figures by file name."""
        return draw(done.study, done.results.model, done.analysis)

    def sections(self, done: Done, figures: Mapping[str, Any]) -> Sequence[Section]:
        """Return the sections of the report."""
        return sections_of(done.study, done.results.model, done.analysis, figures)

    def summarise(self, analysis: MapAnalysis) -> list[Table]:
        """Return the shares of the points by band."""
        return summarise(analysis)


def _uniforms(study: MapStudy) -> Any:
    """Return the (n, d) design of the inputs that are sampled."""
    design = study.design
    if not study.inputs:
        return np.empty((design.n, 0))
    return designs.draw(design.method, design.n, design.size, len(study.inputs), study.seed)


def table_of(analysis: MapAnalysis) -> str:
    """Return the points of a map as comma-separated values, one row a point.

    Parameters
    ----------
    analysis : MapAnalysis
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    places = ["region", "x [m]", "y [m]", "z [m]"] if analysis.points[0].region else []
    head = [f"{name} [{unit}]" for name, unit in analysis.axes.items()] + places
    for name, output in analysis.outputs.items():
        label = f"{name} [{output.unit}]"
        head += [f"{label} median", f"{label} 5 %", f"{label} 95 %"]
        head += [f"share of {name} above {limit:g}" for limit in output.limits]
    writer.writerow(head)
    for k, point in enumerate(analysis.points):
        row: list[Any] = list(point.coordinates)
        if places:
            row += [point.region, *(f"{v:.4f}" for v in point.position)]
        for output in analysis.outputs.values():
            cell = output.cells[k]
            row += [_plain(cell.median.value), _plain(cell.low), _plain(cell.high)]
            row += [_plain(entry.value) for entry in cell.above]
        writer.writerow(row)
    return buffer.getvalue()


def _plain(value: float) -> str:
    """Return a number with six digits, or an empty text where there is none."""
    return f"{value:.6g}" if np.isfinite(value) else ""
