"""What differs from test to test: recorded inputs and covariates, as factors of a discrepancy."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.layout import Layout

Array = NDArray[np.float64]

APART = 5.0
"""Ratio of a factor's part of its own to what errors of recorded inputs make of it. A factor that
is little else than an error is correlated with the residual that this very error leaves, and would
make a right model look wrong: with 40 tests, the square of a score at this ratio is 2.5, not 1."""
LEAST = 1e-6
"""Least mean square of a factor's part of its own."""


def covariates_of(layouts: Sequence[Layout]) -> dict[str, Array]:
    """Return the covariates of slow changes, centred and scaled to unit standard deviation."""
    found = {}
    for name in layouts[0].test.covariates:
        values = np.array([layout.test.covariates[name] for layout in layouts])
        if np.all(np.isfinite(values)) and values.std() > 0.0:
            found[name] = (values - values.mean()) / values.std()
    return found


def regimes_of(layouts: Sequence[Layout]) -> dict[str, Array]:
    """Return the recorded inputs that differ from test to test, centred and scaled."""
    found = {}
    for name in layouts[0].test.inputs:
        values = np.array([layout.test.inputs[name] for layout in layouts])
        if values.std() > 1e-9 * abs(values.mean()):
            found[name] = (values - values.mean()) / values.std()
    return found


def separate_factors(layouts: Sequence[Layout]) -> Mapping[str, Array]:
    """Return recorded inputs and covariates, each with a part of its own beside those before it.

    Left out is what differs from the others by little more than errors of recorded inputs: the
    speed of tests at one nominal speed, the order of tests whose speed rises from test to test.

    Parameters
    ----------
    layouts : sequence of Layout
        Of the tests.
    """
    count = len(layouts)
    kept: dict[str, Array] = {}
    variances: list[float] = []
    for name, factor in {**regimes_of(layouts), **covariates_of(layouts)}.items():
        table = np.stack([np.ones(count), *kept.values()], axis=1)
        weights = np.linalg.lstsq(table, factor, rcond=None)[0]
        own = float(np.mean((factor - table @ weights) ** 2))
        variance = _error_variance(layouts, name)
        errors = variance + float(weights[1:] ** 2 @ np.array(variances))
        if own > max(APART**2 * errors, LEAST):
            kept[name] = factor
            variances.append(variance)
    return kept


def _error_variance(layouts: Sequence[Layout], name: str) -> float:
    """Return the mean square of the error of a factor, whose own variance is 1."""
    if name not in layouts[0].test.inputs:
        return 0.0
    values = np.array([layout.test.inputs[name] for layout in layouts])
    errors = np.array([layout.test.doubtful.get(name, 0.0) for layout in layouts])
    return float(np.mean(errors**2) / values.var())
