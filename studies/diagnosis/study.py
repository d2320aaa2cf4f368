"""Diagnosis of a model against measured tests, from a folder of data to a report."""

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.gain import Gain, Quantities, Quantity, measure_gain
from mcstudy.diagnosis.model_selection import Candidate
from mcstudy.diagnosis.power import minimum_detectable_effects, value_of_information
from mcstudy.diagnosis.problem import Cause, Problem
from mcstudy.diagnosis.regions import locate_misfit
from mcstudy.diagnosis.repeatability import with_given_scatter
from mcstudy.diagnosis.screening import is_at_bound
from mcstudy.diagnosis.search import Finding, search
from mcstudy.errors import UserError
from mcstudy.execution.progress import say
from mcstudy.execution.results import ResultsFolder
from mcstudy.measurement.measured_data import Measured, load_measured
from models.criteria import head_injury_criterion
from studies.diagnosis import conclusions, extension, pictures
from studies.diagnosis.accidents import fit_surfaces, is_collection
from studies.diagnosis.causes import accident_causes_of, causes_of
from studies.diagnosis.emulator import Emulator
from studies.diagnosis.extras import extras_of
from studies.diagnosis.model_choice import ModelChoice, choose_model
from studies.diagnosis.posterior import describe, describe_trends
from studies.diagnosis.problem import build_problem
from studies.diagnosis.report import draw, sections_of, subtitle_of
from studies.diagnosis.simulation import Simulation
from studies.headform_records import keep_first_impacts, note_lines
from studies.publishing import publish

Array = NDArray[np.float64]

ANSWER = "diagnosis.json"
EXTENDED = "extended.toml"
BASE = "base.toml"
RIVALS = 3
"""Rivals of the best cause from which extra measurements should separate it."""


def diagnose(
    source: Path | str,
    folder: ResultsFolder,
    *,
    model_config: Path | None = None,
    channels: Sequence[str] = (),
    seed: int = 0,
    workers: int = -1,
    quiet: bool = True,
) -> dict[str, Any]:
    """Diagnose a model against measured tests and write a folder with the answer and a report.

    Parameters
    ----------
    source : path or str
        Folder of measured data or of ISO-MME tests.
    folder : ResultsFolder
        Folder of the diagnosis.
    model_config : path, optional
        Study file whose model is diagnosed; by default the model that the data name.
    channels : sequence of str
        Channels to take from ISO-MME tests; see ``mcstudy.measurement.isomme.head_acceleration``.
    seed : int
        Seed of the simulated data sets.
    workers : int
        Processes, -1 for one per core.
    quiet : bool
        No progress line.

    Returns
    -------
    dict
        The answer, as in ``diagnosis.json``.

    Raises
    ------
    UserError
        If the data or the model are wrong, or do not fit each other.
    """
    data = keep_first_impacts(load_measured(source, channels))
    if folder.path.resolve() == data.source.resolve():
        raise UserError(f"{folder.path}: holds the measured data; choose another --out")
    choice = choose_model(data, model_config)
    simulation = simulation_of(data, choice)
    problem = build_problem(data, choice, simulation)
    accidents = is_collection(data)
    catalogue = (accident_causes_of if accidents else causes_of)(choice.name, choice.options)
    causes = tuple(cause for cause in catalogue if cause.name not in choice.effects)
    say(f"{len(problem.tests)} tests, {len(causes)} causes", quiet=quiet)
    source_of_extras: Simulation | Emulator = simulation
    notes = list(note_lines(data))
    if accidents:
        surfaces = fit_surfaces(
            problem, data, choice, causes, seed=seed, workers=workers, quiet=quiet
        )
        for name, left_out in surfaces.outlying(problem).items():
            notes.append(f"{name} left out as outlying: {', '.join(left_out)}")
        problem, source_of_extras = surfaces.problem_of(problem), surfaces.emulator
    finding = search(problem, causes, seed=seed, workers=workers, tell=partial(say, quiet=quiet))
    say(finding.why, quiet=quiet)
    with folder.open_for_writing():
        return _write(
            data, notes, choice, problem, source_of_extras, causes, finding, folder, seed, quiet
        )  # fmt: skip


def simulation_of(data: Measured, choice: ModelChoice) -> Simulation:
    """Return the simulation of the measured channels and scalars."""
    filters = {name: entry.channel_class for name, entry in data.header.signals.items()}
    return Simulation(
        choice.name, choice.options, filters, list(data.header.scalars), choice.effects
    )


def _write(
    data: Measured,
    notes: list[str],
    choice: ModelChoice,
    problem: Problem,
    simulation: Simulation | Emulator,
    causes: tuple[Cause, ...],
    finding: Finding,
    folder: ResultsFolder,
    seed: int,
    quiet: bool,
) -> dict[str, Any]:
    """Write the folder of a finding and return the answer."""
    layouts = finding.layouts
    where = locate_misfit(finding.base, layouts)
    believed = finding.best or finding.base
    calm = with_given_scatter(problem, layouts, believed.scatter, finding.base)
    visible = minimum_detectable_effects(
        problem, layouts, calm, causes, finding.screening.threshold
    )
    near = [c for c in finding.candidates[1:] if c.cause.name in finding.ambiguous][:RIVALS]
    worth = value_of_information(
        problem, layouts, believed, [c.fitted for c in near], causes, extras_of(problem, simulation)
    )
    gains: list[Gain] = []
    text = extension.base_study(data, choice, problem, folder.path.name)
    folder.write_text(BASE, text)
    before = after = None
    parameters = {} if finding.best is None else describe(problem, finding.best)
    ranges = extension.ranges_of(text, parameters)
    if finding.best is not None:
        say("measuring the gain", quiet=quiet)
        gains = measure_gain(problem, layouts, finding.base, finding.best, quantities(data), seed)
        longer = extension.checked(extension.extend(text, parameters))
        folder.write_text(EXTENDED, longer)
        before, after = conclusions.conclude(text), conclusions.conclude(longer)
    answer = {
        "format": "mcstudy-diagnosis/1",
        "data": {
            "title": data.header.title,
            "tests": len(problem.tests),
            "model": choice.name,
            "notes": notes,
        },
        "adequate": finding.adequate,
        "p_value": finding.screening.p_value,
        "flip_p_value": finding.screening.flip_p_value,
        "statistics": {
            s.name: {"value": s.value, "p_value": s.p_value} for s in finding.screening.statistics
        },
        "cause": finding.cause,
        "ambiguous": list(finding.ambiguous),
        "scatter": {
            "level": believed.scatter.level,
            "shape": believed.scatter.shape,
            "at_bound": is_at_bound(believed.scatter),
        },
        "trends": {} if finding.best is None else describe_trends(problem, finding.best),
        "second_cause": None if finding.second is None else finding.second.cause.name,
        "second_ambiguous": list(finding.second_ambiguous),
        "flagged": finding.flagged,
        "why": finding.why,
        "remainder": None if finding.remainder is None else asdict(finding.remainder),
        "drift": {"name": finding.screening.drift[0], "log_evidence": finding.screening.drift[1]},
        "repeatability": asdict(believed.scatter),
        "effects": [_effect(problem, c, finding) for c in finding.candidates],
        "titles": {cause.name: cause.title for cause in causes},
        "separated_by": {cause.name: cause.separated_by for cause in causes},
        "model": {"extended": EXTENDED if finding.best is not None else None, "base": BASE},
        "parameters": parameters,
        "cut": extension.cut_shares(parameters, ranges),
        "gain": [asdict(entry) for entry in gains],
        "conclusions": None
        if before is None or after is None
        else {"base": conclusions.as_dict(before), "extended": conclusions.as_dict(after)},
        "visible": [asdict(entry) for entry in visible],
        "worth": [asdict(entry) for entry in worth],
    }
    folder.write_json(ANSWER, answer)
    analysis = answer | {
        "where": asdict(where) | {"largest": asdict(where.largest)},
        "pictures": pictures.collect(problem, layouts, finding.base, finding.best),
    }
    publish(
        folder, f"Diagnosis: {data.header.title}", subtitle_of(answer), analysis, draw, sections_of
    )
    read: dict[str, Any] = folder.read_json(ANSWER)
    return read


def _effect(problem: Problem, candidate: Candidate, finding: Finding) -> dict[str, Any]:
    """Return a candidate as plain data."""
    return {
        "name": candidate.cause.name,
        "title": candidate.cause.title,
        "log_evidence": candidate.log_evidence,
        "form": candidate.form.name,
        "forms": candidate.forms,
        "parameters": describe(problem, candidate.fitted)[candidate.cause.name],
        "ambiguous": candidate.cause.name in finding.ambiguous,
    }


def quantities(data: Measured) -> Quantities:
    """Return the signal quantities that score predictions: unit, signal, function."""
    found: dict[str, tuple[str, str, Quantity]] = {}
    if "head_acceleration" in data.header.signals:
        found["hic15"] = ("1", "head_acceleration", _hic15)
        found["peak_head_acceleration"] = ("g", "head_acceleration", _peak)
    return found


def _hic15(time: Array, values: Array) -> float:
    return float(head_injury_criterion(time, np.maximum(values, 0.0), 0.015)[0])


def _peak(_time: Array, values: Array) -> float:
    return float(values.max())
