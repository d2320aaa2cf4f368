"""Split of the difference of two models into the things that they do differently.

Between the two stands a set of models, each with some of these things changed. The order in which
they are changed is arbitrary, so the share of each is its mean over all orders that the models
allow: the Shapley value (L. S. Shapley, 1953), of a game with precedence constraints where not
every combination makes a model (U. Faigle and W. Kern, 1992).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.sampling import seeds
from mcstudy.statistics import Estimate
from mcstudy.typed_json import Real

Array = NDArray[np.float64]

RESAMPLES = 2000
"""Bootstrap resamples of the draws."""
LEVELS = (0.025, 0.975)
"""Probabilities of the ends of an interval."""


@dataclass(frozen=True)
class Step:
    """A step between two models that differ in one thing.

    Attributes
    ----------
    change : what they do differently.
    start, end : numbers of the models.
    weight : share of the orders that take this step.
    """

    change: str
    start: int
    end: int
    weight: float


@dataclass(frozen=True)
class StepDifference:
    """Differences of an output over one step, run by run.

    Attributes
    ----------
    change : what the two models do differently.
    start, end : labels of the models.
    weight : share of the orders that take this step.
    pairs : runs with a value of both.
    mean : mean difference.
    spread : standard deviation of the differences.
    """

    change: str
    start: str
    end: str
    weight: Real
    pairs: int
    mean: Estimate
    spread: Real


@dataclass(frozen=True)
class Split:
    """Split of a mean difference; the shares sum to the whole.

    Attributes
    ----------
    base : mean of the model that nothing is changed in.
    whole : mean difference of the model that everything is changed in.
    shares : by change.
    steps : differences between neighbours.
    """

    base: Estimate
    whole: Estimate
    shares: Mapping[str, Estimate]
    steps: Sequence[StepDifference]


def find_steps(changes: Sequence[frozenset[str]]) -> list[Step]:
    """Return the steps between models, weighted by the share of the orders that take them.

    Parameters
    ----------
    changes : sequence of frozenset of str
        What each model does differently from the first.

    Raises
    ------
    ValueError
        If two models have the same changes, none has no change, none has all, or a model lies on
        no way of single changes from the first to the last.
    """
    place = {held: k for k, held in enumerate(changes)}
    if len(place) < len(changes):
        raise ValueError("two models have the same changes")
    nothing, everything = frozenset[str](), frozenset[str]().union(*changes)
    if nothing not in place:
        raise ValueError("no model is without changes")
    if everything not in place:
        missing = ", ".join(sorted(everything))
        raise ValueError(f"no model has all the changes: {missing}")
    by_size = sorted(changes, key=len)
    links = [
        (held, held | {change}, change)
        for held in by_size
        for change in sorted(everything - held)
        if held | {change} in place
    ]
    # Ways from the model without changes to each, and from each to the one with all.
    before = {held: float(held == nothing) for held in changes}
    for held, larger, _ in links:
        before[larger] += before[held]
    after = {held: float(held == everything) for held in changes}
    for held, larger, _ in reversed(links):
        after[held] += after[larger]
    for held in changes:
        if before[held] * after[held] == 0.0:
            named = ", ".join(sorted(held)) or "nothing"
            raise ValueError(
                f"the model that changes {named} lies on no way of single changes from the model "
                "without changes to the one with all"
            )
    orders = before[everything]
    return [
        Step(change, place[held], place[larger], before[held] * after[larger] / orders)
        for held, larger, change in links
        if before[held] * after[larger] > 0.0
    ]


def split_difference(
    values: Array, labels: Sequence[str], steps: Sequence[Step], seed: int
) -> Split:
    """Return the split of the mean difference of the last model from the first.

    Each step is measured on the draws that both its models have; intervals come from resampled
    draws, the same ones for all steps.

    Parameters
    ----------
    values : (models, n) array
        Output by model and draw, NaN where a model has no value.
    labels : sequence of str
        Of the models.
    steps : sequence of Step
        From ``find_steps``.
    seed : int
        Of the resamples.

    Raises
    ------
    ValueError
        If two neighbours have fewer than two draws in common.
    """
    rng = seeds.generator(seed, seeds.BOOTSTRAP)
    n = values.shape[1]
    counts = rng.multinomial(n, np.full(n, 1.0 / n), RESAMPLES).astype(float)
    differences = np.stack([values[step.end] - values[step.start] for step in steps])
    for step, row in zip(steps, differences, strict=True):
        if np.isfinite(row).sum() < 2:
            pair = f"{labels[step.start]} and {labels[step.end]}"
            raise ValueError(f"{pair} have fewer than two runs in common")
    weights = np.array([step.weight for step in steps])
    means, drawn = _means(differences, counts)
    first = next(step.start for step in steps if _is_first(step, steps))
    base, base_drawn = _means(values[first][None], counts)
    shares = {}
    for change in dict.fromkeys(step.change for step in steps):
        own = np.array([step.change == change for step in steps])
        shares[change] = _estimate(float(weights[own] @ means[own]), weights[own] @ drawn[own])
    return Split(
        base=_estimate(float(base[0]), base_drawn[0]),
        whole=_estimate(float(weights @ means), weights @ drawn),
        shares=shares,
        steps=[
            StepDifference(
                step.change, labels[step.start], labels[step.end], step.weight,
                int(np.isfinite(row).sum()), _estimate(mean, resampled),
                float(np.nanstd(row, ddof=1)),
            )
            for step, row, mean, resampled in zip(steps, differences, means, drawn, strict=True)
        ],
    )  # fmt: skip


def _is_first(step: Step, steps: Sequence[Step]) -> bool:
    return all(step.start != other.end for other in steps)


def _means(rows: Array, counts: Array) -> tuple[Array, Array]:
    """Return means (k,) over the known values of rows (k, n), and of resamples (k, resamples)."""
    known = np.isfinite(rows)
    filled = np.where(known, rows, 0.0)
    drawn = (filled @ counts.T) / np.maximum(known.astype(float) @ counts.T, 1.0)
    return filled.sum(axis=1) / known.sum(axis=1), drawn


def _estimate(value: float, drawn: Array) -> Estimate:
    low, high = np.quantile(drawn, LEVELS)
    return Estimate(float(value), float(low), float(high))
