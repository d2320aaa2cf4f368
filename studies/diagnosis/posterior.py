"""Posterior of the parameters of the fitted causes."""

from dataclasses import asdict
from typing import Any

import numpy as np

from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.jacobian import form_latents
from mcstudy.diagnosis.problem import Problem
from mcstudy.statistics import REACH, Estimate
from mcstudy.studyfile.input_space import value_at


def describe(problem: Problem, fitted: Fit) -> dict[str, list[dict[str, Any]]]:
    """Return by cause the parameters of a fit as plain data, with 95 % intervals.

    A parameter that the form fixes has a value only, and ``fixed`` is true.

    Parameters
    ----------
    problem : Problem
    fitted : Fit
    """
    found: dict[str, list[dict[str, Any]]] = {}
    for form, place in form_latents(problem, fitted.forms):
        latents = fitted.scores.shared[place]
        errors = np.sqrt(np.diag(fitted.covariance)[place])
        if form.trend is not None:
            # Of a single test, the change along the covariate counts as spread.
            errors[form.trend.parameter] = np.hypot(errors[form.trend.parameter], latents[-1])
        rows: list[dict[str, Any]] = []
        for parameter, centre, error in zip(form.free, latents, errors, strict=False):
            value, *ends = (
                value_at(parameter.prior, float(centre + side * REACH * error))
                for side in (0.0, -1.0, 1.0)
            )
            rows.append(
                {
                    "name": parameter.name,
                    "unit": parameter.unit,
                    "meaning": parameter.meaning,
                    "fixed": False,
                    "family": parameter.family,
                    **asdict(Estimate(value, min(ends), max(ends))),
                }
            )
        rows += [
            {"name": name, "unit": "1", "fixed": True, **asdict(Estimate(value, value, value))}
            for name, value in form.fixed.items()
        ]
        found[form.cause] = rows
    return found


def describe_trends(problem: Problem, fitted: Fit) -> dict[str, dict[str, Any]]:
    """Return by cause how a parameter of a fit changes along a covariate, as plain data.

    Parameters
    ----------
    problem : Problem
    fitted : Fit
        Whose forms may have a trend.
    """
    found = {}
    for form, place in form_latents(problem, fitted.forms):
        if form.trend is not None:
            scores = fitted.scores.shared[place]
            parameter = form.free[form.trend.parameter]
            ends = [
                form.values(scores, chosen(problem.tests, key=form.trend.place))[parameter.name]
                for chosen in (min, max)
            ]
            found[form.cause] = {
                "covariate": form.trend.covariate,
                "parameter": parameter.name,
                "unit": parameter.unit,
                "first": ends[0],
                "last": ends[1],
            }
    return found
