"""One trial: hide effects in a set of tests, diagnose the set and assess the answer.

The diagnosis reads the folder of tests only. The hidden effects are drawn from a seed that it never
gets, and are compared with its answer afterwards.
"""

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.base_model import fit_base
from mcstudy.diagnosis.fit import fit
from mcstudy.diagnosis.gain import Quantities, measure_gain
from mcstudy.diagnosis.layout import Scatter
from mcstudy.diagnosis.problem import Problem
from mcstudy.diagnosis.repeatability import rescale
from mcstudy.diagnosis.screening import POWER
from mcstudy.diagnosis.search import Finding, names_of, search
from mcstudy.measurement.measured_data import Measured, load_measured
from mcstudy.typed_json import Real
from studies.diagnosis.causes import causes_of
from studies.diagnosis.model_choice import ModelChoice, choose_model
from studies.diagnosis.problem import build_problem
from studies.diagnosis.study import quantities, simulation_of
from studies.validation.diagnosis.drawing import draw
from studies.validation.diagnosis.hidden_effects import make_tests
from studies.validation.diagnosis.laboratory import Hidden, Laboratory, draw_laboratory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trial:
    """A trial.

    Attributes
    ----------
    seed : int
        Of effect, laboratory and noise.
    kind : str
        Kind of set, one of ``drawing.KINDS``.
    force : bool
        Whether load cell and rebound speed were recorded.
    usual : bool
        Whether the laboratory is the usual one, else another one is drawn.
    """

    seed: int
    kind: str
    force: bool
    usual: bool = True


@dataclass(frozen=True)
class HeldOut:
    """Prediction of HIC15 in held-out tests.

    Attributes
    ----------
    crps : float
        Gain in CRPS against the base model, relative.
    against_process : float
        The same against a Gaussian-process discrepancy.
    coverage_base, coverage : float
        Share of the tests within 90 % intervals, of the base and the extended model.
    """

    crps: Real
    against_process: Real
    coverage_base: Real
    coverage: Real


@dataclass(frozen=True)
class Outcome:
    """Outcome of a trial.

    Attributes
    ----------
    trial : Trial
        What was tried.
    hidden : tuple of str
        Hidden effects, ``effect (form)``.
    names : tuple of str
        Names of the effects.
    size : float
        Size of the effect, the smaller one of two, alone over the minimum detectable one (80 %
        power).
    p_value : float
        Of the answer.
    cause, ambiguous, second, second_ambiguous : str or tuple of str
        Named causes of the answer.
    flagged : bool
        Whether a misfit remains.
    why : str
        Reason in words.
    seconds : float
        Time of the search.
    evidence : mapping of str to float
        Log evidence by cause.
    share, left : float
        Share of the misfit that the best cause explains, and what a free discrepancy would still
        explain, log units.
    flip_p_value : float
        Of the sign flips.
    gains : mapping of str to HeldOut
        By region, where a single effect was named rightly.
    """

    trial: Trial
    hidden: tuple[str, ...]
    names: tuple[str, ...]
    size: Real
    p_value: Real
    cause: str | None
    ambiguous: tuple[str, ...]
    second: str | None
    second_ambiguous: tuple[str, ...]
    flagged: bool
    why: str
    seconds: Real
    evidence: Mapping[str, Real] = field(default_factory=dict)
    share: Real = 1.0
    left: Real = 0.0
    flip_p_value: Real = 1.0
    gains: Mapping[str, HeldOut] = field(default_factory=dict)

    @property
    def detected(self) -> bool:
        """Whether the model was called inadequate."""
        return self.cause is not None

    @property
    def named(self) -> tuple[str, ...]:
        """The names that the answer gives, ambiguous ones included."""
        return names_of(self.cause, self.ambiguous, self.second, self.second_ambiguous)


def run_trial(trial: Trial, workers: int = 1) -> Outcome:
    """Run a trial and return its outcome."""
    laboratory = Laboratory(force=trial.force, rebound=trial.force)
    if not trial.usual:
        laboratory = draw_laboratory(np.random.default_rng([trial.seed, 78]), force=trial.force)
    hidden = draw(trial.seed, trial.kind)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "tests"
        make_tests(folder, hidden, trial.seed, laboratory)
        problem, data, _ = read_tests(folder)
        start = time.perf_counter()
        finding = search(problem, causes_of("headform"), workers=workers)
        seconds = time.perf_counter() - start
        judged = quantities(data)
        gains = _gains(problem, finding, judged, trial.seed) if _is_right(finding, hidden) else {}
        sizes = [
            _size(Path(scratch) / h.name, h, trial.seed, laboratory, problem, finding)
            for h in hidden
        ]
    return Outcome(
        trial=trial,
        hidden=tuple(f"{h.name} ({h.form or 'one form'})" for h in hidden),
        names=tuple(h.name for h in hidden),
        size=min(sizes, default=0.0),
        p_value=finding.screening.p_value,
        cause=finding.cause,
        ambiguous=finding.ambiguous,
        second=None if finding.second is None else finding.second.cause.name,
        second_ambiguous=finding.second_ambiguous,
        flagged=finding.flagged,
        why=finding.why,
        seconds=seconds,
        evidence={c.cause.name: c.log_evidence for c in finding.candidates},
        share=1.0 if finding.remainder is None else finding.remainder.share,
        left=0.0 if finding.remainder is None else finding.remainder.left,
        flip_p_value=finding.screening.flip_p_value,
        gains=gains,
    )


def _is_right(finding: Finding, hidden: Sequence[Hidden]) -> bool:
    """Return whether the only hidden effect was named, alone."""
    return len(hidden) == 1 and finding.cause == hidden[0].name and not finding.second


def _gains(problem: Problem, finding: Finding, judged: Quantities, seed: int) -> dict[str, HeldOut]:
    """Return the predictions of HIC15 in held-out tests by region."""
    assert finding.best is not None
    rows = {
        (gain.score, gain.region): gain
        for gain in measure_gain(problem, finding.layouts, finding.base, finding.best, judged, seed)
    }
    found = {}
    for (score, region), gain in rows.items():
        if score == "crps_hic15":
            covered = rows["coverage_hic15", region]
            against = 1.0 - gain.extended / gain.gaussian_process
            found[region] = HeldOut(gain.relative.value, against, covered.base, covered.extended)
    return found


def read_tests(
    folder: Path, study_file: Path | None = None
) -> tuple[Problem, Measured, ModelChoice]:
    """Return the problem of a folder of tests, its data and the model.

    Parameters
    ----------
    folder : path
    study_file : path, optional
        Study whose model is diagnosed, by default that which the data name.
    """
    data = load_measured(folder)
    choice = choose_model(data, study_file)
    return build_problem(data, choice, simulation_of(data, choice)), data, choice


def _size(
    scratch: Path,
    hidden: Hidden,
    seed: int,
    laboratory: Laboratory,
    problem: Problem,
    finding: Finding,
) -> float:
    """Return the size of an effect over the minimum detectable one.

    The tests are made again without noise, with and without the effect. The part of the effect that
    the base model cannot absorb after a refit of all uncertain values is the effect's strength in
    standard errors; its ratio to the standard errors needed is the size.
    """
    quiet = replace(
        laboratory, noise_sd=0.0, force_sd=0.0, rebound_sd=0.0, scatter=0.0, speed_sd=0.0
    )
    # The repeatability of the real set, not that of its noise-free copies.
    scatter = Scatter(laboratory.scatter, 0.5 * laboratory.scatter)
    misfits = []
    for name, effects in (("with", [hidden]), ("without", [])):
        make_tests(scratch / name, effects, seed, quiet)
        twin = _as_measured(problem, scratch / name)
        layouts, fitted = fit_base(twin)
        start = rescale(layouts, fitted, scatter)
        misfits.append(fit(twin, layouts, (), start, scatter, fitted.slopes).misfit)
    strength = float(np.sqrt(2.0 * max(misfits[0] - misfits[1], 0.0)))
    return strength / (finding.screening.threshold + POWER)


def _as_measured(problem: Problem, folder: Path) -> Problem:
    """Return a problem with the values of another folder and unchanged uncertainties."""
    data = load_measured(folder)
    tests = []
    for test in problem.tests:
        row = data.tests[data.tests["test"] == test.name]
        signals = []
        for signal in test.signals:
            time, values = data.signal(
                test.name, signal.name, data.header.signals[signal.name].unit
            )
            signals.append(replace(signal, time=time, values=values, correlation=0.0))
        tests.append(
            replace(
                test,
                inputs=dict(test.inputs)
                | {name: float(row[name].iloc[0]) for name in test.doubtful},
                signals=tuple(signals),
                scalars=tuple(replace(s, value=float(row[s.name].iloc[0])) for s in test.scalars),
            )
        )
    return replace(problem, tests=tuple(tests))
