"""Data of a diagnosis's figures: measured and simulated values, and residuals."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.jacobian import observe_tests
from mcstudy.diagnosis.layout import Layout
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.diagnosis.problem import Problem
from mcstudy.statistics import REACH

Array = NDArray[np.float64]

SHOWN = 3
"""Tests whose pulses are shown: the lowest, the middle and the highest speed."""
POINTS = 240
"""Points of a curve in a figure."""


def collect(
    problem: Problem, layouts: Sequence[Layout], base: Fit, extended: Fit | None
) -> dict[str, Any]:
    """Return curves of chosen tests and residuals of all, as plain data.

    The simulated curves take every test as recorded; the band covers the test's own nuisances and
    the shared unknowns.

    Parameters
    ----------
    problem : Problem
        Problem of the tests.
    layouts : sequence of Layout
        Measured values of each test.
    base : Fit
        Of the base model.
    extended : Fit, optional
        Of the model with the named causes.
    """
    predicted = {"base": _predicted(problem, layouts, base)}
    if extended is not None:
        predicted["extended"] = _predicted(problem, layouts, extended)
    signals = [signal.name for signal in layouts[0].test.signals]
    return {
        "signals": {
            name: [_curves(layouts, base, predicted, i, name) for i in _chosen(layouts)]
            for name in signals
        },
        "scalars": _scalars(layouts, predicted),
    }


Predicted = list[tuple[Array, Array]]
"""Mean and standard deviation of the prediction by test, whitened."""


def _predicted(problem: Problem, layouts: Sequence[Layout], fitted: Fit) -> Predicted:
    own = tuple(np.zeros(len(layout.names)) for layout in layouts)
    seen = observe_tests(problem, fitted.forms, layouts, Scores(fitted.scores.shared, own))
    found = []
    for i, (layout, zero) in enumerate(zip(layouts, own, strict=True)):
        observation = fitted.observations[i] if seen is None else seen[i]
        widths = layout.widths(fitted.observations[i])[:, None]
        spread = np.sum((widths * fitted.own_slopes[i]) ** 2, axis=1)
        slopes = widths * fitted.shared_slopes[i]
        spread += np.einsum("np,pq,nq->n", slopes, fitted.covariance, slopes)
        found.append((layout.whitened(observation, zero), np.sqrt(spread)))
    return found


def _chosen(layouts: Sequence[Layout]) -> list[int]:
    speeds = [layout.test.inputs.get("impact_speed", 0.0) for layout in layouts]
    order = np.argsort(speeds, kind="stable")
    places = np.linspace(0, len(order) - 1, min(SHOWN, len(order)))
    return [int(order[round(p)]) for p in places]


def _curves(
    layouts: Sequence[Layout],
    base: Fit,
    predicted: dict[str, Predicted],
    row: int,
    name: str,
) -> dict[str, Any]:
    layout = layouts[row]
    signal = next(s for s in layout.test.signals if s.name == name)
    own = base.scores.own[row]
    measured = base.residuals[row] + layout.simulated(base.observations[row], own, base.scatter)
    step = max(1, signal.time.size // POINTS)
    curves: dict[str, Any] = {
        "test": layout.test.name,
        "impact_speed": layout.test.inputs.get("impact_speed"),
        "time": signal.time[::step],
        "measured": layout.unwhiten(measured)[name][::step],
    }
    for key, rows in predicted.items():
        mean, spread = rows[row]
        middle = layout.unwhiten(mean)[name]
        # The band leaves out the sample noise, which the measured curve shows.
        width = REACH * signal.sd * spread[_part(layout, name)]
        curves[key] = {
            "mean": middle[::step],
            "low": (middle - width)[::step],
            "high": (middle + width)[::step],
        }
    return curves


def _part(layout: Layout, name: str) -> slice:
    start = 0
    for signal in layout.test.signals:
        if signal.name == name:
            return slice(start, start + signal.time.size)
        start += signal.time.size
    raise KeyError(name)


def _scalars(layouts: Sequence[Layout], predicted: dict[str, Predicted]) -> dict[str, Any]:
    """Return measured and predicted scalars of every test."""
    found: dict[str, Any] = {}
    for k, scalar in enumerate(layouts[0].test.scalars):
        rows = []
        for i, layout in enumerate(layouts):
            own = layout.test.scalars[k]
            if not np.isfinite(own.sd):
                continue
            place = -len(layout.test.scalars) + k
            entry = {"test": layout.test.name, "measured": own.value, "sd": own.sd}
            entry["impact_speed"] = layout.test.inputs.get("impact_speed", 0.0)
            for key, tests in predicted.items():
                mean, spread = tests[i]
                entry[key] = float(mean[place] * own.sd)
                entry[f"{key}_sd"] = float(own.sd * np.hypot(spread[place], 1.0))
            rows.append(entry)
        found[scalar.name] = rows
    return found
