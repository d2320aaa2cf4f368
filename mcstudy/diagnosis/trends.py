"""Causes whose size changes from test to test along a covariate: a drift, or a wrong scale."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mcstudy.diagnosis.problem import Cause, Form, Test, Trend

ANY_COVARIATE = "order"
"""Word of a cause for every covariate of the tests, their order among them."""


def add_trends(causes: Sequence[Cause], tests: Sequence[Test]) -> tuple[Cause, ...]:
    """Return causes with a form for each covariate along which their size may change.

    Parameters
    ----------
    causes : sequence of Cause
    tests : sequence of Test
        Covariates that are the same in all of them, or missing, give no form.
    """
    return tuple(replace(cause, forms=(*cause.forms, *_trending(cause, tests))) for cause in causes)


def _trending(cause: Cause, tests: Sequence[Test]) -> list[Form]:
    names: list[str] = []
    for word in cause.varies_with:
        names += list(tests[0].covariates) if word == ANY_COVARIATE else [word]
    form = next((f for f in cause.forms if any(p.name == cause.size for p in f.free)), None)
    if form is None:
        return []
    parameter = [p.name for p in form.free].index(cause.size)
    found = []
    for name in dict.fromkeys(names):
        values = np.array([test.covariates.get(name, test.inputs.get(name)) for test in tests])
        if values.dtype == object or not np.all(np.isfinite(values)):
            continue
        centre, scale = float(values.mean()), float(values.std())
        if scale > 1e-9 * abs(centre):
            trend = Trend(name, parameter, centre, scale)
            found.append(replace(form, name=f"{form.name} with {name}", trend=trend, named=False))
    return found
