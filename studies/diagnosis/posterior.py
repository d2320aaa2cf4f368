"""Posterior of the parameters of the fitted causes."""

from dataclasses import asdict
from typing import Any

import numpy as np

from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.problem import Problem
from mcstudy.statistics import REACH, Estimate
from mcstudy.studyfile.input_space import value_at


def describe(problem: Problem, fitted: Fit) -> dict[str, list[dict[str, Any]]]:
    """Return by cause the parameters of a fit as plain data, with 95 % intervals.

    A parameter that the form fixes has a value only, and ``fixed`` is true.
    """
    found: dict[str, list[dict[str, Any]]] = {}
    k = len(problem.unknowns)
    for form in fitted.forms:
        rows: list[dict[str, Any]] = []
        for parameter in form.free:
            centre = float(fitted.scores.shared[k])
            reach = REACH * float(np.sqrt(fitted.covariance[k, k]))
            value, *ends = (
                value_at(parameter.prior, z) for z in (centre, centre - reach, centre + reach)
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
            k += 1
        rows += [
            {"name": name, "unit": "1", "fixed": True, **asdict(Estimate(value, value, value))}
            for name, value in form.fixed.items()
        ]
        found[form.cause] = rows
    return found
