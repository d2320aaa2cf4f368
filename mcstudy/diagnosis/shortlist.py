"""Shortlist of the forms that are worth runs of a dear model, by templates known already."""

from collections.abc import Sequence

import numpy as np

from mcstudy.diagnosis.linear_model import Centre, solve
from mcstudy.diagnosis.problem import Form
from mcstudy.diagnosis.templates import Template

LEAST = 4
"""Causes that are listed whatever they promise."""
LESS = 4.0
"""Factor by which a cause may promise less gain than the best."""


def shortlist(
    centre: Centre,
    weight: float,
    bank: Sequence[Template],
    forms: Sequence[Form],
    floor: float = 0.0,
) -> list[Form]:
    """Return the forms whose templates promise most, in their order.

    A template is the change by a form about the same model, so its gain, with the nuisances solved
    for, takes no run. Tables and trends have no template: they are listed with the other forms of
    a cause.

    Parameters
    ----------
    centre : Centre
        The linearised model, with all tests.
    weight : float
        Weight of the data; the larger the misfit, the smaller.
    bank : sequence of Template
        Of the forms, about the model.
    forms : sequence of Form
        To choose from.
    floor : float
        Gain below which a cause is not listed at all.
    """
    without = solve(centre, centre.residuals, weight)[1]
    gains: dict[tuple[str, str], float] = {}
    for template in bank:
        moved = [r - c for r, c in zip(centre.residuals, template.columns, strict=True)]
        halfway = [r - 0.5 * c for r, c in zip(centre.residuals, template.columns, strict=True)]
        whole, half = (solve(centre, residuals, weight)[1] for residuals in (moved, halfway))
        gain = max(without - whole, drop_of_parabola(without, half, whole))
        key = (template.form.cause, template.form.name)
        gains[key] = max(gains.get(key, 0.0), gain)
    causes: dict[str, float] = {}
    for (cause, _), gain in gains.items():
        causes[cause] = max(causes.get(cause, 0.0), gain)
    ranked = sorted(causes, key=lambda cause: -causes[cause])
    if not ranked:
        return list(forms)
    limit = causes[ranked[0]] / LESS
    worth = [cause for cause in ranked if causes[cause] >= floor]
    kept = {cause for k, cause in enumerate(worth) if k < LEAST or causes[cause] > limit}
    return [
        form
        for form in forms
        if form.cause in kept
        and gains.get((form.cause, form.name), np.inf) > causes[form.cause] / LESS
    ]


def drop_of_parabola(none: float, half: float, whole: float) -> float:
    """Return the drop of a parabola through the loss at none, half and all of a change."""
    curvature = 2.0 * (none + whole - 2.0 * half)
    slope = whole - none - curvature
    return slope**2 / (4.0 * curvature) if slope < 0.0 < curvature else 0.0
