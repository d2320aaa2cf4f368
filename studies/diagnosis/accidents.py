"""Accident collections: scalars of many accidents without repetition.

Unrecorded conditions (posture, gait) scatter accidents more than any model error does. The crash
core is therefore run over the whole collection with all unknowns sampled in each run: a quadratic
response surface in the recorded variables gives the mean, and its residuals are the scatter of
single accidents. Every cause is run on the same draws, so that its effect is a response surface
too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.problem import Cause, Form, Problem, Scalar, Test, Unknown
from mcstudy.errors import StudyError, UserError
from mcstudy.execution.progress import follow
from mcstudy.execution.workers import parallel_backend
from mcstudy.injury.ais import Mechanism, draw_ais, mix
from mcstudy.injury.functions import risk_function
from mcstudy.measurement.measured_data import HEADER, Measured
from mcstudy.sampling import seeds
from mcstudy.studyfile.input_space import value_at
from mcstudy.studyfile.study_inputs import map_inputs
from models.protocol import Model
from models.registry import load_model
from studies.diagnosis.emulator import (
    Change,
    Emulator,
    Scaling,
    Surface,
    change_terms,
    fit_terms,
    fit_widening,
    quadratic_terms,
    widening_terms,
)
from studies.diagnosis.model_choice import ModelChoice
from studies.monte_carlo.schema import MonteCarloStudy
from studies.runs import evaluator_of

Array = NDArray[np.float64]

POOL, PAIRED = 1920, 240
"""Runs of the base model, and of each form of a cause: the surfaces err by a tenth of the scatter
of single accidents, which sixty of them do not see."""
MAX_SCORE = 3.0
"""Largest standard-normal latent of the sampled sizes of causes."""
MAX_FAILED = 0.2
"""Maximum share of failed runs."""
WIDER = 1.5
"""Factor on the recorded uncertainties for the draws, so that the surface reaches beyond them."""
LOGARITHMIC = (
    "hic15", "hic36", "ground_hic15", "clip_3ms", "peak_head_acceleration", "throw_distance",
    "wad", "head_impact_time", "car_stopping_distance",
)  # fmt: skip
"""Outputs whose logarithm is taken, as their scatter grows with their level."""
OUTLYING = 4.0
"""Robust standard deviations from the median beyond which an accident is of another kind, e.g. a
head that struck the bumper: it is left out, in the runs as in the data."""
ROUNDS = 10
"""Largest number of fits until the outlying runs stay the same."""
NORMAL_MAD = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
TINY = 1e-9
"""Least standard deviation of an output, for those that never change."""
AIS = "ais"
MECHANISM = Mechanism(
    "impact", ((risk_function("nhtsa_lognormal"), 1.0), (risk_function("prasad_mertz"), 1.0))
)
"""Risk functions by which an AIS of the head is simulated, as in the injury study of the case."""
ADULT = 40.0
"""Age (year) for risk functions if the model has none."""


@dataclass(frozen=True)
class _Draws:
    """Runs over a collection: values of all inputs by name (n,), and uniforms for outcomes."""

    columns: dict[str, Array]
    uniforms: Array


def is_collection(data: Measured) -> bool:
    """Return whether measured data are accidents: scalars only, of a model of whole accidents."""
    return load_model(data.header.model).accidents and not data.header.signals


@dataclass(frozen=True)
class Surfaces:
    """The crash core over a collection: the emulator, and the scatter of single accidents.

    Scalars of outlying accidents get no weight.
    """

    emulator: Emulator
    scatter: Mapping[str, float]

    def problem_of(self, problem: Problem) -> Problem:
        """Return the problem of accidents on the surfaces.

        Parameters
        ----------
        problem : Problem
            Of the data, with measured scalars as they are.
        """
        tests = tuple(_rescaled(test, self.scatter) for test in problem.tests)
        left_out = self.outlying(problem)
        tests = tuple(
            replace(
                test,
                scalars=tuple(
                    replace(scalar, sd=np.inf)
                    if test.name in left_out.get(scalar.name, ())
                    else scalar
                    for scalar in test.scalars
                ),
            )
            for test in tests
        )
        return Problem(tests, problem.unknowns, self.emulator, dict(problem.ranges))

    def outlying(self, problem: Problem) -> dict[str, tuple[str, ...]]:
        """Return the accidents that are left out, by scalar.

        A shift that all accidents share makes none of them outlying.

        Parameters
        ----------
        problem : Problem
            Of the data, with measured scalars as they are.
        """
        usual = {unknown.name: _value(unknown, 0.0) for unknown in problem.unknowns}
        tests = [_rescaled(test, self.scatter) for test in problem.tests]
        means = [self.emulator({**test.inputs, **usual}, {}) for test in tests]
        found = {}
        for k, scalar in enumerate(tests[0].scalars):
            off = np.array(
                [
                    (test.scalars[k].value - mean.scalars[scalar.name]) / test.scalars[k].sd
                    for test, mean in zip(tests, means, strict=True)
                    if mean is not None
                ]
            )
            known = np.array([np.isfinite(test.scalars[k].sd) for test in tests])
            far = known & _is_outlying(np.where(known, off, np.nan))
            if far.any():
                found[scalar.name] = tuple(tests[i].name for i in np.flatnonzero(far))
        return found


def fit_surfaces(
    problem: Problem,
    data: Measured,
    choice: ModelChoice,
    causes: Sequence[Cause],
    *,
    seed: int,
    workers: int,
    quiet: bool,
) -> Surfaces:
    """Return the surfaces of the crash core over an accident collection.

    Parameters
    ----------
    problem : Problem
        Of the data, with measured scalars as they are.
    data : Measured
        Recorded accidents.
    choice : ModelChoice
        The model that is diagnosed.
    causes : sequence of Cause
        Causes whose effects are simulated.
    seed : int
        Seed of the draws.
    workers : int
        Processes, -1 for one per core.
    quiet : bool
        No progress line.

    Raises
    ------
    UserError
        If a scalar is none that accidents have.
    StudyError
        If too many runs fail.
    """
    model = load_model(choice.name, choice.options, choice.effects)
    outputs = _outputs_of(data, model)
    draws = _draw(problem, choice, model, seed)
    with parallel_backend(workers):
        raw = _run(choice, {}, draws.columns, POOL)
        base = _outcomes(model, raw, outputs, draws, POOL)
        names = _variables(problem)
        scaling = Scaling.of(draws.columns, names)
        points = scaling.points(draws.columns)
        coefficients, scatter = _robust_fit(quadratic_terms(points), base)
        surface = Surface(scaling, coefficients)
        changes = []
        forms = [form for cause in causes for form in cause.forms]
        for k, form in enumerate(follow(forms, "forms of causes", quiet=quiet)):
            change = _change_of(choice, form, draws, base, surface, outputs, seed + k, model)
            if change is not None:
                changes.append(change)
    spread = dict(zip(outputs, scatter.tolist(), strict=True))
    wanted = [_key(name) for name in data.header.scalars]
    return Surfaces(Emulator(choice.name, outputs, surface, changes, wanted), spread)


def _robust_fit(terms: Array, outputs: Array) -> tuple[Array, Array]:
    """Return coefficients (terms, m) and scatter (m,) of outputs (n, m) without outlying runs."""
    kept = outputs.copy()
    for _ in range(ROUNDS):
        coefficients, left = fit_terms(terms, kept)
        everything = outputs - terms @ coefficients
        far = np.stack([_is_outlying(column) for column in everything.T], axis=1)
        new = np.where(far, np.nan, outputs)
        if np.array_equal(np.isnan(new), np.isnan(kept)):
            break
        kept = new
    count = np.isfinite(kept).sum(axis=0)
    return coefficients, np.sqrt(np.nansum(left**2, axis=0) / np.maximum(count - len(terms.T), 1))


def _is_outlying(values: Array) -> NDArray[np.bool_]:
    """Return which values lie far from the median; NaN does not."""
    off = np.abs(values - np.nanmedian(values))
    with np.errstate(invalid="ignore"):
        return np.asarray(off > OUTLYING * max(NORMAL_MAD * float(np.nanmedian(off)), TINY))


def _key(name: str) -> str:
    return f"log_{name}" if name in LOGARITHMIC else name


def _outputs_of(data: Measured, model: Model) -> tuple[str, ...]:
    """Return the outputs of the surfaces: the measured ones, then the default ones."""
    known = [item.name for item in model.outputs]
    usual = ("throw_distance", "wad", "hic15", "head_impact_time", "car_stopping_distance", AIS)
    names = dict.fromkeys([*data.header.scalars, *usual])
    for name in names:
        if name not in known and name != AIS:
            raise UserError(f"{data.source / HEADER}: scalars.{name}: the model has no such output")
    return tuple(_key(name) for name in names)


def _variables(problem: Problem) -> tuple[str, ...]:
    """Return the variables of the surfaces: recorded inputs that vary, and shared unknowns."""
    tests = problem.tests
    moving = [
        name
        for name in tests[0].inputs
        if np.ptp([test.inputs[name] for test in tests]) > 0.0 or name in tests[0].doubtful
    ]
    return tuple(dict.fromkeys([*moving, *(u.name for u in problem.unknowns)]))


def _draw(problem: Problem, choice: ModelChoice, model: Model, seed: int) -> _Draws:
    """Return draws over a collection: recorded inputs as recorded, the others from priors."""
    rng = seeds.generator(seed, seeds.DESIGN)
    tests = problem.tests
    columns = {item.name: np.full(POOL, item.nominal) for item in model.inputs}
    study = choice.study
    if isinstance(study, MonteCarloStudy):
        recorded = {*tests[0].inputs, *(u.name for u in problem.unknowns)}
        sampled = map_inputs(study, model, rng.random((POOL, len(study.inputs))))
        columns |= {name: values for name, values in sampled.items() if name not in recorded}
    rows = rng.permutation(np.arange(POOL) % len(tests))
    for name in tests[0].inputs:
        values = np.array([tests[i].inputs[name] for i in rows])
        sd = tests[0].doubtful.get(name, 0.0)
        low, high = problem.ranges[name]
        columns[name] = np.clip(values + WIDER * sd * rng.standard_normal(POOL), low, high)
    for unknown in problem.unknowns:
        scores = np.clip(WIDER * rng.standard_normal(POOL), -3.0, 3.0)
        columns[unknown.name] = np.array([_value(unknown, z) for z in scores])
    return _Draws(columns, rng.random(POOL))


def _value(unknown: Unknown, score: float) -> float:
    return value_at(unknown.prior, float(score))


def _run(
    choice: ModelChoice,
    effects: Mapping[str, Mapping[str, float]],
    columns: Mapping[str, Array],
    count: int,
) -> Array:
    """Return the model's outputs (count, m) of the first draws, NaN where a run failed."""
    switched = {**choice.effects, **effects}
    model = load_model(choice.name, choice.options, switched)
    rows = np.stack([columns[item.name][:count] for item in model.inputs], axis=1)
    table = evaluator_of(model, choice.options, switched).evaluate(rows).outputs
    failed = float(np.isnan(table).all(axis=1).mean())
    if failed > MAX_FAILED:
        raise StudyError(f"{100.0 * failed:.0f} % of the runs over the accidents failed")
    return table


def _outcomes(
    model: Model, table: Array, outputs: Sequence[str], draws: _Draws, count: int
) -> Array:
    """Return the observables (count, m): outputs, logarithms, an AIS drawn from the risk."""
    by_name = {item.name: table[:, k] for k, item in enumerate(model.outputs)}
    found = []
    for key in outputs:
        if key == AIS:
            age = draws.columns.get("age", np.full(POOL, ADULT))[:count]
            exceeding = mix(MECHANISM, {"hic15": by_name["hic15"]}, age)
            drawn = draw_ais(exceeding, draws.uniforms[:count]).astype(float)
            found.append(np.where(np.isfinite(by_name["throw_distance"]), drawn, np.nan))
        elif key.startswith("log_"):
            values = by_name[key.removeprefix("log_")]
            with np.errstate(invalid="ignore", divide="ignore"):
                found.append(np.where(values > 0.0, np.log(values), np.nan))
        else:
            found.append(by_name[key])
    return np.stack(found, axis=1)


def _change_of(
    choice: ModelChoice,
    form: Form,
    draws: _Draws,
    base: Array,
    surface: Surface,
    outputs: Sequence[str],
    seed: int,
    model: Model,
) -> Change | None:
    """Return the change by a form, from runs of the same draws with and without it."""
    rng = seeds.generator(seed, seeds.OUTCOME)
    scores = rng.uniform(-MAX_SCORE, MAX_SCORE, (PAIRED, len(form.free)))
    columns = dict(draws.columns)
    for k, parameter in enumerate(form.free):
        values = np.full(POOL, value_at(parameter.prior, 0.0))
        values[:PAIRED] = [value_at(parameter.prior, float(z)) for z in scores[:, k]]
        columns[f"{form.cause}_{parameter.name}"] = values
    for name, value in form.fixed.items():
        columns[f"{form.cause}_{name}"] = np.full(POOL, value)
    raw = _run(choice, {form.cause: {}}, columns, PAIRED)
    changed = _outcomes(model, raw, outputs, draws, PAIRED) - base[:PAIRED]
    if not np.any(np.abs(np.nan_to_num(changed)) > 0.0):
        return None
    centred = all(
        np.isclose(value_at(p.prior, 0.0), p.none, rtol=1e-9, atol=1e-12) for p in form.free
    )
    points = surface.scaling.points({name: v[:PAIRED] for name, v in draws.columns.items()})
    terms = change_terms(scores, points, centred=centred)
    coefficients, _ = fit_terms(terms, changed)
    # An output that never changes must get no change from the scatter of the fit.
    still = ~np.any(np.abs(np.nan_to_num(changed)) > 0.0, axis=0)
    coefficients[:, still] = 0.0
    before = base[:PAIRED] - quadratic_terms(points) @ surface.coefficients
    after = before + changed - terms @ coefficients
    widening = [
        fit_widening(widening_terms(scores), _without_outlying(own), _without_outlying(new))
        for own, new in zip(before.T, after.T, strict=True)
    ]
    return Change(form, centred, coefficients, np.stack(widening, axis=1))


def _without_outlying(values: Array) -> Array:
    """Return values with outlying ones as NaN."""
    return np.where(_is_outlying(values), np.nan, values)


def _rescaled(test: Test, scatter: Mapping[str, float]) -> Test:
    """Return an accident whose scalars carry the scatter of single accidents."""
    scalars = []
    for scalar in test.scalars:
        key = _key(scalar.name)
        value, sd = scalar.value, scalar.sd
        if key != scalar.name and np.isfinite(sd):
            positive = max(value, 1e-9)
            value, sd = float(np.log(positive)), sd / positive
        whole = float(np.hypot(sd, scatter[key]))
        scalars.append(Scalar(key, value, whole, scatters=False))
    return Test(
        test.name, test.inputs, test.doubtful, (), tuple(scalars), test.derived, test.covariates
    )
