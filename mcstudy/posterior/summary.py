"""A learned scalar summary of evidence: its regression on the quantity that is asked for.

The regression is a cubic ridge of the items' normal scores, by folds of runs, so that the summary
of a run is never learned from that run.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]
Index = NDArray[np.int64]

FOLDS = 5
RIDGE = 1e-3
"""Ridge penalty on a coefficient of a standardised feature, as a share of the rows."""
DEGREE = 3
MOST_FEATURES = 400
"""Largest number of features; with more items the products of three are left out."""
POINTS = 2001
"""Points of the table of an item's distribution."""


@dataclass(frozen=True)
class NormalScores:
    """Normal scores of items by their distribution in the bank, straight beyond its ends.

    Attributes
    ----------
    values, scores : (k, points) arrays
        Table of each item.
    """

    values: Array
    scores: Array

    @classmethod
    def of(cls, noisy: Array) -> "NormalScores":
        """Return the scores of items (m, k) that are simulated."""
        levels = np.clip(np.linspace(0.0, 1.0, POINTS), 0.5 / len(noisy), 1.0 - 0.5 / len(noisy))
        levels = np.unique(levels)
        return cls(
            np.quantile(noisy, levels, axis=0).T,
            np.tile(special.ndtri(levels), (noisy.shape[1], 1)),
        )

    def __call__(self, noisy: Array) -> Array:
        """Return the scores (m, k) of items."""
        found = np.empty_like(noisy)
        for k, (values, scores) in enumerate(zip(self.values, self.scores, strict=True)):
            found[:, k] = np.interp(noisy[:, k], values, scores)
        return found


@dataclass(frozen=True)
class Summary:
    """A learned summary.

    Attributes
    ----------
    known : (m,) array
        Summary of each simulated set of evidence, learned from the other folds.
    models : (folds, features) array
        Coefficients by fold.
    scores : NormalScores
        Of the items.
    """

    known: Array
    models: Array
    scores: NormalScores

    def of(self, observed: Array) -> Array:
        """Return the summaries (j,) of evidence (j, k), the mean over the folds' models."""
        return np.asarray((features(self.scores(observed)) @ self.models.T).mean(axis=1))


def features(scores: Array) -> Array:
    """Return one, the scores, and their products of two and three, (m, features)."""
    m, k = scores.shape
    found = [np.ones(m)]
    for degree in range(1, DEGREE + 1):
        places = list(itertools.combinations_with_replacement(range(k), degree))
        if len(found) + len(places) > MOST_FEATURES:
            break
        found += [scores[:, list(place)].prod(axis=1) for place in places]
    return np.stack(found, axis=1)


def learn_summary(noisy: Array, target: Array, rows: Index, weights: Array) -> Summary:
    """Return the summary of simulated evidence for a target.

    Parameters
    ----------
    noisy : (m, k) array
        Simulated evidence.
    target : (m,) array
        What is asked for, on an unbounded scale.
    rows : (m,) int array
        Run of each.
    weights : (m,) array
        Of each.
    """
    scores = NormalScores.of(noisy)
    table = features(scores(noisy))
    size = np.sqrt(np.maximum(np.average(table**2, axis=0, weights=weights), 1e-12))
    scaled = table / size
    fold = rows % FOLDS
    known = np.empty(len(target))
    models = []
    grams, sides = [], []
    for k in range(FOLDS):
        part = scaled[fold == k]
        weighted = part * weights[fold == k][:, None]
        grams.append(weighted.T @ part)
        sides.append(weighted.T @ target[fold == k])
    whole, side = sum(grams), sum(sides)
    penalty = np.full(table.shape[1], RIDGE * float(weights.sum()))
    penalty[0] = 0.0
    for k in range(FOLDS):
        system = whole - grams[k] + np.diag(penalty)
        coefficients = np.linalg.solve(system, side - sides[k])
        known[fold == k] = scaled[fold == k] @ coefficients
        models.append(coefficients / size)
    return Summary(known, np.stack(models), scores)
