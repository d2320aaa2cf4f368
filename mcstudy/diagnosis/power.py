"""Minimum detectable effect of each cause, and value of information of extra measurements."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.fit import Fit, FitError, fit
from mcstudy.diagnosis.jacobian import observe_tests
from mcstudy.diagnosis.layout import Layout
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.diagnosis.problem import (
    Cause,
    Form,
    Observation,
    Problem,
    Scalar,
    Signal,
    Simulate,
    Test,
)
from mcstudy.diagnosis.screening import POWER, score_templates
from mcstudy.diagnosis.templates import Template, change_of
from mcstudy.studyfile.input_space import value_at

Array = NDArray[np.float64]

SIZES = np.array([-4.0, -2.5, -1.7, -1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0, 1.7, 2.5, 4.0])
"""Latents of a cause's size at which its detectability is computed."""


@dataclass(frozen=True)
class Visible:
    """The minimum detectable effect of a cause at 80 % power.

    Attributes
    ----------
    cause, form, parameter, unit : names of cause, form and size parameter, and its unit.
    value : minimum detectable value; NaN if no size within the prior is detectable.
    none : null value, at which there is no effect.
    """

    cause: str
    form: str
    parameter: str
    unit: str
    value: float
    none: float


def minimum_detectable_effects(
    problem: Problem,
    layouts: Sequence[Layout],
    fitted: Fit,
    causes: Sequence[Cause],
    threshold: float,
) -> list[Visible]:
    """Return the minimum detectable effect of each cause.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    fitted : Fit
        Fit of the base model.
    causes : sequence of Cause
    threshold : float
        Score, in standard errors, from which a template raises an alarm.
    """
    found = []
    for cause in causes:
        form = _sized_form(cause)
        parameter = next(p for p in form.free if p.name == cause.size)
        k = form.free.index(parameter)
        values, strengths = [], []
        for z in SIZES:
            scores = np.zeros(len(form.free))
            scores[k] = z
            columns = change_of(problem, layouts, fitted, form, scores)
            if columns is None:
                continue
            template = Template(form, scores, columns)
            information = score_templates(fitted, layouts, [template])[1][0]
            values.append(value_at(parameter.prior, float(z)))
            strengths.append(float(np.sqrt(information)))
        value = _crossing(np.array(values), np.array(strengths), parameter.none, threshold + POWER)
        found.append(
            Visible(cause.name, form.name, parameter.name, parameter.unit, value, parameter.none)
        )
    return found


def _sized_form(cause: Cause) -> Form:
    return next(form for form in cause.forms if any(p.name == cause.size for p in form.free))


def _crossing(values: Array, strengths: Array, none: float, needed: float) -> float:
    """Return the value nearest to the null value at which the strength reaches ``needed``.

    An effect that weakens away from the null value, as a filter's class does towards the stated
    one, is followed from its weakest point.
    """
    away = np.abs(values - none)
    # One side of the null value: of a prior on both sides the one above it is used.
    side = values > none if np.any(values > none) and np.any(values < none) else away > 0.0
    away, strengths, values = away[side], strengths[side], values[side]
    order = np.argsort(away)
    away, strengths, values = away[order], strengths[order], values[order]
    faintest = int(np.argmin(strengths))
    if strengths[faintest] < strengths[0]:
        back = slice(faintest, None, -1)
        away, strengths, values = away[back], strengths[back], values[back]
    reached = np.flatnonzero(strengths >= needed)
    if reached.size == 0:
        return float("nan")
    first = int(reached[0])
    sign = 1.0 if values[0] > none else -1.0
    if first == 0:
        # Small effects are proportional to their size.
        return float(none + sign * away[0] * needed / strengths[0])
    share = (needed - strengths[first - 1]) / (strengths[first] - strengths[first - 1])
    return float(none + sign * (away[first - 1] + share * (away[first] - away[first - 1])))


@dataclass(frozen=True)
class Extra:
    """A measurement that could be added.

    Attributes
    ----------
    title : in words.
    signals : standard uncertainty of each added signal.
    scalars : standard uncertainty of each added scalar.
    inputs : new standard uncertainty of inputs that are recorded better.
    """

    title: str
    signals: dict[str, float]
    scalars: dict[str, float]
    inputs: dict[str, float]


@dataclass(frozen=True)
class Worth:
    """Value of information of an extra measurement.

    Attributes
    ----------
    title : of the measurement.
    separation : log evidence of the best cause over its nearest rival; NaN if it has none.
    visibility : factor on the detectability of the catalogue's causes, geometric mean.
    """

    title: str
    separation: float
    visibility: float


def value_of_information(
    problem: Problem,
    layouts: Sequence[Layout],
    best: Fit,
    rivals: Sequence[Fit],
    causes: Sequence[Cause],
    extras: Sequence[tuple[Extra, Simulate]],
) -> list[Worth]:
    """Return the value of information of extra measurements, largest first.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    best : Fit
        Fit of the selected model.
    rivals : sequence of Fit
        Fits that the data cannot distinguish from it.
    causes : sequence of Cause
        Causes whose detectability is computed.
    extras : sequence of (Extra, Simulate)
        Measurements, each with a simulation that provides them.
    """
    nothing = Extra("as it was measured", {}, {}, {})
    seen_now = _visibility(*_with(problem, layouts, best, nothing, problem.simulate), causes)
    found = []
    for extra, simulate in extras:
        try:
            other, places, fitted = _with(problem, layouts, best, extra, simulate)
        except FitError:
            continue
        seen = _visibility(other, places, fitted, causes)
        both = (seen_now > 0.0) & (seen > 0.0)
        gain = float(np.exp(np.mean(np.log(seen[both] / seen_now[both])))) if both.any() else 1.0
        apart = [_distance(other, places, fitted, rival) for rival in rivals]
        found.append(Worth(extra.title, min(apart, default=float("nan")), gain))
    return sorted(found, key=lambda w: (-w.separation if rivals else 0.0, -w.visibility))


def _with(
    problem: Problem, layouts: Sequence[Layout], best: Fit, extra: Extra, simulate: Simulate
) -> tuple[Problem, list[Layout], Fit]:
    """Return the problem with noise-free data of the best fit and an extra measurement.

    Raises
    ------
    FitError
        If a run fails.
    """
    known = replace(problem, simulate=simulate)
    seen = observe_tests(known, best.forms, layouts, best.scores)
    if seen is None:
        raise FitError("a run fails")
    places = []
    for layout, observation, own in zip(layouts, seen, best.scores.own, strict=True):
        inputs = layout.inputs(own, problem.ranges)
        test = _noise_free(layout.test, observation, inputs, extra, layout.shift)
        places.append(Layout(test, layout.shift, layout.window))
    other = replace(known, tests=tuple(place.test for place in places))
    zero = tuple(np.zeros(len(place.names)) for place in places)
    centred = fit(other, places, best.forms, Scores(best.scores.shared, zero), best.scatter)
    return other, places, centred


def _noise_free(
    test: Test, seen: Observation, inputs: dict[str, float], extra: Extra, shift: float
) -> Test:
    grid = test.signals[0].time if test.signals else np.zeros(0)
    signals = [
        replace(s, values=np.interp(s.time - shift, *seen.signals[s.name])) for s in test.signals
    ]
    for name, sd in extra.signals.items():
        time = grid if grid.size else seen.signals[name][0]
        signals.append(Signal(name, time, np.interp(time - shift, *seen.signals[name]), sd))
    scalars = [replace(s, value=seen.scalars[s.name]) for s in test.scalars]
    for name, sd in extra.scalars.items():
        scalars.append(Scalar(name, seen.scalars[name], sd))
    doubtful = {k: min(extra.inputs.get(k, sd), sd) for k, sd in test.doubtful.items()}
    return replace(
        test, inputs=inputs, signals=tuple(signals), scalars=tuple(scalars), doubtful=doubtful
    )


def _visibility(
    problem: Problem, layouts: Sequence[Layout], fitted: Fit, causes: Sequence[Cause]
) -> Array:
    """Return the detectability of each cause at one prior sd of its size, in standard errors."""
    taken = {form.cause for form in fitted.forms}
    strengths = []
    for cause in causes:
        form = _sized_form(cause)
        scores = np.array([1.0 if p.name == cause.size else 0.0 for p in form.free])
        if cause.name in taken:
            strengths.append(0.0)
            continue
        columns = change_of(problem, layouts, fitted, form, scores)
        if columns is None:
            strengths.append(0.0)
            continue
        template = Template(form, scores, columns)
        strengths.append(float(np.sqrt(score_templates(fitted, layouts, [template])[1][0])))
    return np.array(strengths)


def _distance(problem: Problem, layouts: Sequence[Layout], best: Fit, rival: Fit) -> float:
    """Return a rival's excess negative log posterior on noise-free data of the best cause."""
    own = tuple(np.zeros(len(layout.names)) for layout in layouts)
    start = Scores(rival.scores.shared, own)
    if observe_tests(problem, rival.forms, layouts, start) is None:
        return float("nan")
    return fit(problem, layouts, rival.forms, start, best.scatter).misfit - best.misfit
