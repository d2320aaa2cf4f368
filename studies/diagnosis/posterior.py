"""What a fit says of the parameters of its causes and of the shared unknowns."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.problem import Form, Parameter, Problem, value_at
from mcstudy.statistics import REACH, Estimate


@dataclass(frozen=True)
class Posterior:
    """A fitted parameter: its cause, itself, and its value with a 95 % interval."""

    cause: str
    parameter: Parameter
    estimate: Estimate
    median: float
    spread: float

    def distribution(self) -> dict[str, Any]:
        """Return the distribution as a table of a study file.

        A positive parameter is lognormal (``spread`` of the logarithm), any other one normal.
        """
        if self.parameter.family == "lognormal":
            return {"distribution": "lognormal", "median": self.median, "sigma": self.spread}
        table = {"distribution": "normal", "mean": self.median, "sd": self.spread}
        if self.parameter.family == "uniform":
            low, high = (float(self.parameter.quantile(p)) for p in (0.0, 1.0))
            table |= {"low": low, "high": high}
        return table


def posteriors(problem: Problem, fitted: Fit) -> list[Posterior]:
    """Return the fitted parameters of a fit's causes."""
    found = []
    k = len(problem.unknowns)
    for form in fitted.forms:
        for parameter in form.free:
            centre = float(fitted.scores.shared[k])
            error = float(np.sqrt(fitted.covariance[k, k]))
            found.append(_posterior(form, parameter, centre, error))
            k += 1
    return found


def _posterior(form: Form, parameter: Parameter, centre: float, error: float) -> Posterior:
    def at(z: float) -> float:
        return value_at(parameter.quantile, z)

    value, below, above = at(centre), at(centre - error), at(centre + error)
    ends = sorted((at(centre - REACH * error), at(centre + REACH * error)))
    if parameter.family == "lognormal":
        spread = 0.5 * float(np.log(above / below))
    else:
        spread = 0.5 * (above - below)
    return Posterior(
        form.cause, parameter, Estimate(value, *ends), value, max(abs(spread), 1e-6 * abs(value))
    )


def describe(problem: Problem, fitted: Fit, cause: str) -> list[dict[str, Any]]:
    """Return the parameters of one cause as plain data, the fixed ones of its form included."""
    form = next(form for form in fitted.forms if form.cause == cause)
    rows: list[dict[str, Any]] = [
        {
            "name": entry.parameter.name,
            "unit": entry.parameter.unit,
            "meaning": entry.parameter.meaning,
            **asdict(entry.estimate),
        }
        for entry in posteriors(problem, fitted)
        if entry.cause == cause
    ]
    return rows + [
        {"name": name, "value": value, "low": value, "high": value, "fixed": True}
        for name, value in form.fixed.items()
    ]


def names_of(forms: Sequence[Form]) -> list[str]:
    """Return the causes of forms."""
    return [form.cause for form in forms]
