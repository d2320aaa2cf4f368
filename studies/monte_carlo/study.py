"""The Monte Carlo study: sample the inputs, run the model, describe the outputs."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from mcstudy import statistics, units
from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.figures import distributions, relations
from mcstudy.report import Section, Table
from mcstudy.studyfile.identity import numbers_digest
from mcstudy.studyfile.study_outputs import check_outputs, report_outputs
from models.protocol import Model, complete_status
from studies.failure_report import failure_map
from studies.kind import Finished, StudyKind
from studies.monte_carlo.design import sample_inputs
from studies.monte_carlo.report import sections_of, summarise
from studies.monte_carlo.schema import MonteCarloStudy
from studies.runs import ModelRuns, RunPlan, columns_of, describe_runs, load_study_model, run_rows


class MonteCarlo(StudyKind[MonteCarloStudy, RunPlan, ModelRuns]):
    """Independent or stratified samples of the inputs of one model."""

    schema = MonteCarloStudy

    def plan(self, study: MonteCarloStudy, folder: ResultsFolder) -> RunPlan:
        """Return the model and the sampled values of its inputs."""
        model = load_study_model(study)
        report_outputs(study, model)
        marks_of(study, model)
        columns = sample_inputs(study, model)
        folder.check_same_study(numbers_digest(study, model))
        return RunPlan(model, columns, np.arange(study.design.n) // study.design.size)

    def execute(
        self,
        study: MonteCarloStudy,
        plan: RunPlan,
        folder: ResultsFolder,
        *,
        workers: Workers,
        quiet: bool,
    ) -> None:
        """Run the missing runs and keep the histories of the first runs.

        Parameters
        ----------
        study : MonteCarloStudy
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
        runs = run_rows(
            study, plan.model, plan.columns, folder,
            design={"method": design.method, "n": design.n, "replicate_size": design.size},
            replicate=plan.replicate, workers=workers, quiet=quiet,
        )  # fmt: skip
        _keep_histories(study, plan.model, runs, folder)

    def results(self, study: MonteCarloStudy, folder: ResultsFolder) -> ModelRuns:
        """Return the model and the runs of the design."""
        model = load_study_model(study)
        runs = folder.runs(columns_of(model))
        return ModelRuns(model, runs[runs["run"] < study.design.n])

    def analyse(self, study: MonteCarloStudy, results: ModelRuns) -> dict[str, Any]:
        """Return every number that the report prints."""
        return analyse(study, results.model, results.runs)

    def subtitle(self, done: Finished[MonteCarloStudy, ModelRuns]) -> str:
        """Return the line below the report's title."""
        return (
            f"Monte Carlo study of {len(done.results.runs):,} runs of the "
            f"{done.results.model.name} model, {done.study.design.method} design, "
            f"seed {done.study.seed}"
        )

    def draw(self, done: Finished[MonteCarloStudy, ModelRuns]) -> dict[str, Any]:
        """Return the figures by file name."""
        return draw(done.study, done.results.model, done.results.runs, done.analysis)

    def sections(
        self, done: Finished[MonteCarloStudy, ModelRuns], figures: Mapping[str, Any]
    ) -> Sequence[Section]:
        """Return the sections of the report."""
        return sections_of(
            done.study, done.results.model, done.results.runs, done.analysis, figures
        )

    def summarise(self, analysis: Mapping[str, Any]) -> list[Table]:
        """Return the distributions of the reported outputs."""
        return summarise(analysis)

    def independent_rows(self, runs: pd.DataFrame, folder: ResultsFolder) -> pd.DataFrame:
        """Return all runs: each is an independent draw."""
        return runs


def marks_of(study: MonteCarloStudy, model: Model) -> dict[str, list[distributions.Mark]]:
    """Return the study's references by output, in the model's units.

    Raises
    ------
    UserError
        If an output or a unit does not fit the model.
    """
    known = {item.name: item for item in model.outputs}
    marks: dict[str, list[distributions.Mark]] = {}
    for k, entry in enumerate(study.report.references):
        place = f"report.references[{k}]"
        check_outputs([entry.output], model, place)
        try:
            value = entry.value * units.factor(entry.unit, known[entry.output].unit)
        except ValueError as error:
            raise UserError(f"{place}: {error}") from None
        marks.setdefault(entry.output, []).append(
            distributions.Mark(value, entry.label, entry.kind)
        )
    return marks


def analyse(study: MonteCarloStudy, model: Model, runs: pd.DataFrame) -> dict[str, Any]:
    """Return every number that the report prints.

    Parameters
    ----------
    study : MonteCarloStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Table of the runs.
    """
    ended, held = describe_runs(study, model, runs)
    complete = runs[held]
    groups = None if study.design.method == "monte-carlo" else complete["replicate"].to_numpy()
    marks = marks_of(study, model)
    sampled = list(study.inputs)
    wanted = report_outputs(study, model)
    analysis: dict[str, Any] = ended | {
        "outputs": {},
        "exceedance": {},
        "observed": {},
        "convergence": {},
    }
    for item in model.outputs:
        values = complete[item.name].to_numpy(dtype=float)
        analysis["outputs"][item.name] = {"unit": item.unit} | statistics.describe(values, groups)
    for name in wanted:
        values = complete[name].to_numpy(dtype=float)
        finite = np.isfinite(values)
        part, parts = values[finite], None if groups is None else groups[finite]
        if part.size < 2:
            continue
        analysis["convergence"][name] = statistics.convergence(
            values, lambda v: float(np.median(v))
        )
        for mark in marks.get(name, ()):
            above = statistics.probability(part > mark.value, parts).as_dict()
            entry = {"value": mark.value, "label": mark.label, "probability_above": above}
            if mark.kind == "observed":
                low, high = np.quantile(part, [0.05, 0.95])
                entry["inside_central_90"] = bool(low <= mark.value <= high)
                entry["percentile"] = float(np.mean(part <= mark.value))
                analysis["observed"].setdefault(name, []).append(entry)
            else:
                analysis["exceedance"].setdefault(name, []).append(entry)
    columns = complete[[*sampled, *wanted]].astype(float)
    # Ranks of a column that differs by rounding alone are meaningless.
    varying = columns.apply(lambda column: statistics.varies(column.to_numpy()))
    ranks = columns.where(varying, axis="columns").corr("spearman")
    table = ranks.loc[sampled, wanted]
    analysis["rank_correlation"] = {
        name: {k: float(v) for k, v in table[name].items()} for name in wanted
    }
    # |rho| of unrelated ranks stays below this in 95 of 100 cases.
    analysis["rank_correlation_noise"] = float(1.96 / np.sqrt(max(len(complete) - 1, 1)))
    return analysis


def draw(
    study: MonteCarloStudy, model: Model, runs: pd.DataFrame, analysis: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the study's figures by file name.

    Parameters
    ----------
    study : MonteCarloStudy
        Checked study file.
    model : Model
        Model of the runs.
    runs : DataFrame
        Table of the runs.
    analysis : mapping
        As in ``analysis.json``.
    """
    complete = runs[runs["status"].isin(complete_status(model))]
    unit_of = {item.name: item.unit for item in model.outputs}
    # An output without a value in any run is not drawn.
    wanted = {name: unit_of[name] for name in analysis["convergence"]}
    marks = marks_of(study, model)
    figures = failure_map(analysis)
    if not wanted:
        return figures
    figures |= {
        "distributions": distributions.draw_distributions(
            complete, wanted, marks, analysis["outputs"]
        ),
        "rank_correlation": relations.draw_correlations(
            pd.DataFrame(analysis["rank_correlation"]), analysis["rank_correlation_noise"]
        ),
    }
    steps = {name: table for name, table in analysis["convergence"].items() if table}
    if steps:
        figures["convergence"] = relations.draw_convergence(steps, wanted)
    speed = complete["impact_speed"].to_numpy() if "impact_speed" in study.inputs else np.zeros(0)
    if statistics.varies(speed):
        shown = complete.assign(impact_speed=3.6 * complete["impact_speed"])
        figures["impact_speed"] = relations.draw_against_input(
            shown, "impact_speed", "impact speed [km/h]", wanted, marks
        )
    if {"throw_distance", "wad"} <= set(wanted):
        point = {
            name: mark.value for name, items in marks.items() for mark in items
            if mark.kind == "observed"
        }  # fmt: skip
        figures["throw_and_wad"] = relations.draw_joint(
            complete, ("throw_distance", "m"), ("wad", "m"), point
        )
    return figures


def _keep_histories(
    study: MonteCarloStudy, model: Model, runs: pd.DataFrame, folder: ResultsFolder
) -> None:
    """Write the time histories of the study's first runs."""
    names = [item.name for item in model.inputs]
    for k in range(min(study.report.histories, len(runs))):
        row = runs.iloc[k]
        run = model.run({name: float(row[name]) for name in names})
        folder.add_histories(int(row["run"]), run.histories)
