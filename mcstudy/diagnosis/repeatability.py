"""Fits with their repeatability estimated again, or given."""

from collections.abc import Sequence

import numpy as np

from mcstudy.diagnosis.fit import Fit, fit
from mcstudy.diagnosis.layout import Layout, Scatter
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.diagnosis.problem import Problem
from mcstudy.diagnosis.screening import estimate_scatter
from mcstudy.diagnosis.templates import smooth_discrepancy


def settle(
    problem: Problem, layouts: Sequence[Layout], fitted: Fit, *, absorbing: bool = False
) -> Fit:
    """Return a fit with its repeatability re-estimated.

    A discrepancy that all tests share, or that changes with their regime or order, stays free
    meanwhile: the repeatability has mean zero and may not absorb what is common.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    fitted : Fit
        Fit to start from.
    absorbing : bool
        Leave no discrepancy free, so that what the model gets wrong widens its predictions.
    """
    shapes = None if absorbing else smooth_discrepancy(layouts, fitted)
    scatter = estimate_scatter(fitted, layouts, shapes)
    start = rescale(layouts, fitted, scatter)
    return fit(problem, layouts, fitted.forms, start, scatter, fitted.slopes, exact=False)


def with_given_scatter(
    problem: Problem,
    layouts: Sequence[Layout],
    scatter: Scatter,
    fitted: Fit,
    *,
    exact: bool = False,
) -> Fit:
    """Return a fit with a given repeatability, so that it does not absorb a misfit.

    Parameters
    ----------
    problem : Problem
    layouts : sequence of Layout
        Of the tests.
    scatter : Scatter
        Repeatability to use.
    fitted : Fit
        Fit to start from.
    exact : bool
        Whether the final Jacobian must be that of the most probable latents.
    """
    if scatter == fitted.scatter and not exact:
        return fitted
    start = rescale(layouts, fitted, scatter)
    return fit(problem, layouts, fitted.forms, start, scatter, fitted.slopes, exact=exact)


def rescale(layouts: Sequence[Layout], fitted: Fit, scatter: Scatter) -> Scores:
    """Return a fit's latents for another repeatability; the pulses stay the same within +-3.

    Parameters
    ----------
    layouts : sequence of Layout
        Of the tests.
    fitted : Fit
    scatter : Scatter
        Repeatability to rescale to.
    """
    own = []
    for layout, scores in zip(layouts, fitted.scores.own, strict=True):
        moved = scores.copy()
        ratio = layout.scatter_sizes(fitted.scatter) / layout.scatter_sizes(scatter)
        moved[layout.scattering] = np.clip(scores[layout.scattering] * ratio, -3.0, 3.0)
        own.append(moved)
    return Scores(fitted.scores.shared, tuple(own))
