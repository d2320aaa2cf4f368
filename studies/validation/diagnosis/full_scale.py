"""Trials of full-scale tests and of accident collections: a hidden effect and the answer."""

import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mcstudy.diagnosis.problem import Cause, Observation, Problem, Simulate
from mcstudy.diagnosis.search import Finding, names_of, search
from mcstudy.execution.progress import say
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import run_jobs
from mcstudy.report import Section, Table
from mcstudy.text import number
from studies.diagnosis.accidents import Surfaces, fit_surfaces
from studies.diagnosis.causes import accident_causes_of, causes_of
from studies.diagnosis.posterior import describe
from studies.diagnosis.simulation import Simulation
from studies.publishing import publish
from studies.validation.diagnosis.drawing import ACCIDENTS, CRASHES, draw_of
from studies.validation.diagnosis.hidden_accidents import make_accidents
from studies.validation.diagnosis.hidden_crashes import make_crashes
from studies.validation.diagnosis.laboratory import Hidden
from studies.validation.diagnosis.outcomes import run_trials
from studies.validation.diagnosis.trial import read_tests

FIRST = 20_000
"""First seed."""
REALITIES = ("multibody", "planar")
"""Models that stand for reality, each diagnosed with itself: two that share no solver."""
HEADS = ("hidden", "right", "size within 95 %", "runs", "s on one core", "answers")
GROUPS = 2
"""Groups of collections, each with surfaces of its own."""


@dataclass(frozen=True)
class FullScaleTrial:
    """A trial.

    Attributes
    ----------
    seed : int
        Of effect and noise.
    cause : str
        Hidden cause, a key of ``drawing.CRASHES`` or ``drawing.ACCIDENTS``.
    reality : str
        Model that stands for reality, of full-scale tests.
    """

    seed: int
    cause: str
    reality: str = "multibody"


@dataclass(frozen=True)
class FullScaleOutcome:
    """Outcome of a trial.

    Attributes
    ----------
    trial : FullScaleTrial
    hidden : str
        Effect, form and numbers.
    cause : str or None
        Cause of the answer, ``unexplained``, or None if the model is adequate.
    named : tuple of str
        All names that the answer gives.
    flagged : bool
        Whether structure remains.
    p_value : float
        Of the adequacy test.
    covered : bool or None
        Whether the 95 % intervals of the named cause hold the true numbers, if the hidden cause was
        named first.
    runs : int
        Crashes that the search stepped; of surfaces for accidents, their evaluations.
    seconds : float
        Of the search.
    why : str
        Reason in words.
    """

    trial: FullScaleTrial
    hidden: str
    cause: str | None
    named: tuple[str, ...]
    flagged: bool
    p_value: float
    covered: bool | None
    runs: int
    seconds: float
    why: str

    @property
    def right(self) -> bool:
        """Whether the hidden cause is among the names, or none is given where none is hidden."""
        if self.trial.cause == "none":
            return self.cause is None
        return self.trial.cause in self.named


class _Counter:
    """A simulation with a counter of its tests."""

    def __init__(self, simulate: Simulate) -> None:
        self._simulate, self.runs = simulate, 0

    def __call__(
        self, inputs: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]
    ) -> Observation | None:
        """Return a simulated test."""
        self.runs += 1
        return self._simulate(inputs, effects)


def run_crashes(trial: FullScaleTrial) -> FullScaleOutcome:
    """Hide an effect in full-scale tests, diagnose them with the model of reality and assess it.

    Parameters
    ----------
    trial : FullScaleTrial
    """
    hidden = draw_of(trial.seed, trial.cause, CRASHES)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "tests"
        make_crashes(folder, hidden, trial.seed, model=trial.reality)
        problem, _, choice = read_tests(folder)
        causes = causes_of(choice.name, choice.options)
        simulation = problem.simulate
        assert isinstance(simulation, Simulation)
        outcome = _assess(trial, hidden, problem, causes)
        return replace(outcome, runs=simulation.stepped)


def run_accidents(trials: Sequence[FullScaleTrial], study_file: Path) -> list[FullScaleOutcome]:
    """Hide effects in accident collections of one study, diagnose them and assess the answers.

    All the collections are drawn from one study, so one set of surfaces, over the first of them,
    serves them all.

    Parameters
    ----------
    trials : sequence of FullScaleTrial
    study_file : path
        Monte Carlo study that the accidents are drawn from.
    """
    outcomes = []
    surfaces: Surfaces | None = None
    for trial in trials:
        hidden = draw_of(trial.seed, trial.cause, ACCIDENTS)
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch) / "tests"
            make_accidents(folder, study_file, hidden, trial.seed)
            problem, data, choice = read_tests(folder, study_file)
            causes = accident_causes_of(choice.name, choice.options)
            if surfaces is None:
                surfaces = fit_surfaces(
                    problem, data, choice, causes, seed=trial.seed, workers=1, quiet=True
                )
            outcomes.append(_assess(trial, hidden, surfaces.problem_of(problem), causes))
    return outcomes


def plan_full_scale(
    causes: Sequence[str], sets: int, first: int, realities: Sequence[str] = REALITIES[:1]
) -> list[FullScaleTrial]:
    """Return trials of each cause, with seeds of their own.

    Parameters
    ----------
    causes : sequence of str
    sets : int
        Number of sets of each cause and reality.
    first : int
        First seed.
    realities : sequence of str
        Models that stand for reality.
    """
    return [
        FullScaleTrial(first + sets * i + k, cause, reality)
        for reality in realities
        for i, cause in enumerate(causes)
        for k in range(sets)
    ]


def _assess(
    trial: FullScaleTrial, hidden: Sequence[Hidden], problem: Problem, causes: Sequence[Cause]
) -> FullScaleOutcome:
    counter = _Counter(problem.simulate)
    problem = replace(problem, simulate=counter)
    start = time.perf_counter()
    finding = search(problem, causes)
    seconds = time.perf_counter() - start
    return FullScaleOutcome(
        trial=trial,
        hidden="; ".join(f"{h.name} ({h.form}): {dict(h.numbers)}" for h in hidden),
        cause=finding.cause,
        named=names_of(
            finding.cause,
            finding.ambiguous,
            finding.second.cause.name if finding.second else None,
            finding.second_ambiguous,
        ),
        flagged=finding.flagged,
        p_value=finding.screening.p_value,
        covered=_covered(problem, finding, hidden),
        runs=counter.runs,
        seconds=seconds,
        why=finding.why,
    )


def _covered(problem: Problem, finding: Finding, hidden: Sequence[Hidden]) -> bool | None:
    """Return whether 95 % intervals hold the true numbers of an effect of the catalogue's form."""
    if finding.best is None or not hidden or finding.cause != hidden[0].name:
        return None
    if hidden[0].form != "catalogue":
        return None
    rows = {row["name"]: row for row in describe(problem, finding.best)[hidden[0].name]}
    known = [(rows[name], true) for name, true in hidden[0].numbers.items() if name in rows]
    return all(row["low"] <= true <= row["high"] for row, true in known) if known else None


def validate_full_scale(
    folder: ResultsFolder, study_file: Path, *, sets: int, workers: int, quiet: bool = False
) -> dict[str, Any]:
    """Hide effects in full-scale tests and accident collections, diagnose them, write the report.

    Full-scale tests that an interrupted validation of the same code left in the folder are not
    diagnosed again.

    Parameters
    ----------
    folder : ResultsFolder
        Folder of the report.
    study_file : path
        Monte Carlo study that the accidents are drawn from.
    sets : int
        Sets of each cause.
    workers : int
        Processes, -1 for one a core.
    quiet : bool
        No progress line.
    """
    trials = plan_full_scale(list(CRASHES), sets, FIRST, REALITIES)
    accidents = plan_full_scale(list(ACCIDENTS), sets, FIRST)
    with folder.open_for_writing():
        crashes = run_trials(
            folder.path, trials, run_crashes, FullScaleOutcome, workers, quiet=quiet
        )
        say(f"{len(accidents)} collections of accidents", quiet=quiet)
        parts = [accidents[k::GROUPS] for k in range(GROUPS)]
        found = run_jobs(partial(run_accidents, study_file=study_file), parts, workers)
        analysis = {
            "crashes": [asdict(o) | {"right": o.right} for o in crashes],
            "accidents": [asdict(o) | {"right": o.right} for part in found for o in part],
        }
        return publish(
            folder, "Diagnosis of full-scale tests and accidents",
            f"sets of each cause: {sets}, from seed {FIRST} on", analysis, lambda _: {},
            lambda held, _: [Section("Answers", [], summarise(held))],
        )  # fmt: skip


def summarise(analysis: Mapping[str, Any]) -> list[Table]:
    """Return the answers by hidden cause, of full-scale tests and of accidents.

    Parameters
    ----------
    analysis : mapping
        From ``validate_full_scale``.
    """
    parts = {
        f"Full-scale tests: {reality} crashes, five tests a set.": [
            row for row in analysis["crashes"] if row["trial"]["reality"] == reality
        ]
        for reality in REALITIES
    }
    parts["Collections of sixty accidents."] = analysis["accidents"]
    return [Table(title, HEADS, _answers(part)) for title, part in parts.items()]


def _answers(rows: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Return the rows of the table of answers, one a hidden cause."""
    found = []
    for cause in dict.fromkeys(row["trial"]["cause"] for row in rows):
        part = [row for row in rows if row["trial"]["cause"] == cause]
        covered = [row["covered"] for row in part if row["covered"] is not None]
        answers = Counter(
            "adequate" if row["cause"] is None else " + ".join(row["named"]) or row["cause"]
            for row in part
        )
        found.append(
            [
                cause,
                f"{sum(row['right'] for row in part)} of {len(part)}",
                f"{sum(covered)} of {len(covered)}" if covered else "–",
                number(float(np.median([row["runs"] for row in part]))),
                number(float(np.median([row["seconds"] for row in part]))),
                ", ".join(f"{name} ({count})" for name, count in answers.most_common()),
            ]
        )
    return found
