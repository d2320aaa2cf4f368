"""Given-data sensitivity from the runs of a results folder."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mcstudy.errors import UserError
from mcstudy.execution.progress import follow
from mcstudy.execution.results import ResultsFolder
from mcstudy.figures.screening import Ranked
from mcstudy.sensitivity.given_data import measure_given_data
from mcstudy.studyfile.schema import SampledStudy
from mcstudy.studyfile.study_inputs import dependent_pairs
from mcstudy.studyfile.study_outputs import check_outputs, report_outputs
from models.protocol import complete_status
from studies.kinds import KINDS, load_study
from studies.main_effects import main_effects_of
from studies.publishing import publish
from studies.runs import columns_of, load_study_model
from studies.sensitivity.analysis import GivenDataAnalysis, Measure, MeasuredOutput
from studies.sensitivity.report import draw, sections_of


def measure_sensitivity(
    source: ResultsFolder,
    out: ResultsFolder | None = None,
    *,
    outputs: Sequence[str] = (),
    quiet: bool = False,
) -> GivenDataAnalysis:
    """Estimate sensitivities of outputs from the runs of a results folder and write a report.

    Parameters
    ----------
    source : ResultsFolder
        Of a Monte Carlo or Sobol' study.
    out : ResultsFolder, optional
        Folder of the report, by default ``sensitivity`` in the folder.
    outputs : sequence of str
        Names of outputs, by default those that the study reports.
    quiet : bool
        No progress line.

    Raises
    ------
    UserError
        If the folder's design is no sample of the inputs, an output is unknown, a run lacks an
        input, or too few runs have a value.
    """
    study = load_study(source.path / "study.toml")
    kind = KINDS.get(study.kind)
    if kind is None or not isinstance(study, SampledStudy):
        raise UserError(
            f"{source.path}: is the folder of a study of kind {study.kind}; sensitivity is "
            "measured in those of Monte Carlo and Sobol' studies"
        )
    folder = out or ResultsFolder(Path(source.path) / "sensitivity")
    if folder.path.resolve() == source.path.resolve():
        raise UserError(f"{folder.path}: holds the study itself; choose another --out")
    model = load_study_model(study)
    if outputs:
        check_outputs(outputs, model, "--output")
    wanted = list(outputs or report_outputs(study, model))
    runs = kind.independent_rows(source.runs(columns_of(model)), source)
    complete = runs[runs["status"].isin(complete_status(model))]
    inputs = list(study.inputs)
    measured: dict[str, MeasuredOutput] = {}
    main_effects = {}
    values = complete[inputs].to_numpy(dtype=float)
    for name, column in zip(inputs, values.T, strict=True):
        if not np.isfinite(column).all():
            raise UserError(f"{source.path}: a run has no finite value of its input {name}")
    unit_of = {item.name: item.unit for item in model.outputs}
    for name in follow(wanted, "outputs", quiet=quiet):
        column = complete[name].to_numpy(dtype=float)
        try:
            found = measure_given_data(values, column, study.seed)
        except ValueError as error:
            raise UserError(f"{source.path}: {name}: {error}") from None
        measures = {
            measure: Measure(
                found.noise[measure],
                {
                    key: Ranked(value, low, high, clear=bool(value > found.noise[measure]))
                    for key, (value, low, high) in zip(inputs, table.T.tolist(), strict=True)
                },
            )
            for measure, table in found.values.items()
        }
        measured[name] = MeasuredOutput(unit_of[name], found.runs, measures)
        main_effects[name] = main_effects_of(study, model, complete, name)
    analysis = GivenDataAnalysis(
        source=str(source.path),
        kind=study.kind,
        title=study.title,
        runs=len(complete),
        dependent=sorted({name for pair in dependent_pairs(study) for name in pair}),
        outputs=measured,
        main_effects=main_effects,
    )
    with folder.open_for_writing():
        subtitle = f"Sensitivity from {len(complete):,} runs of the {study.kind} study {study.name}"
        return publish(folder, study.title, subtitle, analysis, draw, sections_of)
