"""Designs: what a larger one shares with a smaller one, how even they are, what that gains."""

import math

import numpy as np
import pytest
from mcstudy_tools import ishigami, ishigami_parts
from numpy.testing import assert_array_equal

from mcstudy.sampling import designs

SIZES = {"monte-carlo": 1, "latin-hypercube": 25, "sobol": 32}
each_method = pytest.mark.parametrize("method", SIZES)


def test_every_method_is_tried_here() -> None:
    assert set(SIZES) == set(designs.METHODS) == set(designs.DEFAULT_REPLICATE_SIZE)


@each_method
def test_designs_repeat_by_seed_and_begin_with_the_smaller_one(method: str) -> None:
    size = SIZES[method]
    found = designs.draw(method, 8 * size, size, 5, seed=3)
    assert (found.shape, found.dtype) == ((8 * size, 5), np.float64)
    assert np.all((found > 0.0) & (found < 1.0))
    assert_array_equal(found[: 3 * size], designs.draw(method, 3 * size, size, 5, seed=3))
    assert np.all(found != designs.draw(method, 8 * size, size, 5, seed=6))
    replicates = np.sort(found.reshape(8, size, 5), axis=1)
    assert len(np.unique(replicates.reshape(8, -1), axis=0)) == 8


@pytest.mark.parametrize("method", ["latin-hypercube", "sobol"])
def test_each_replicate_has_one_sample_in_each_stratum(method: str) -> None:
    # McKay, Beckman and Conover 1979; a Sobol' net of 2^m points has the same margins.
    parts = designs.draw(method, 128 * 5, 128, 17, seed=1).reshape(5, 128, 17)
    strata = np.sort(np.floor(parts * 128).astype(int), axis=1)
    assert np.all(strata == np.arange(128)[None, :, None])


@each_method
def test_samples_are_uniform_in_every_dimension(method: str) -> None:
    n = 3200
    found = designs.draw(method, n, SIZES[method], 4, seed=8)
    # Mean and variance of the unit uniform within three standard errors of independent samples.
    assert np.all(np.abs(found.mean(axis=0) - 0.5) < 3.0 * math.sqrt(1.0 / 12.0 / n))
    assert np.all(np.abs(found.var(axis=0) - 1.0 / 12.0) < 3.0 * math.sqrt(1.0 / 180.0 / n))


@pytest.mark.parametrize(("method", "low", "high"), [
    # Independent samples: 1. Latin hypercube: the share of variance that is not additive,
    # 1 - S1 - S2 = 0.244 (Stein 1987). Each with three standard errors, sqrt(2 / 199).
    ("monte-carlo", 0.7, 1.3), ("latin-hypercube", 0.7 * 0.2436, 1.3 * 0.2436),
    ("sobol", 0.0, 0.15),
])  # fmt: skip
def test_variance_of_a_mean_against_independent_samples(
    method: str, low: float, high: float
) -> None:
    size, count = 128, 200
    replicate = 1 if method == "monte-carlo" else size
    points = designs.draw(method, size * count, replicate, 3, seed=1).reshape(count, size, 3)
    means = ishigami(points).mean(axis=1)
    assert low <= means.var(ddof=1) / (ishigami_parts()[0] / size) <= high
    assert abs(means.mean() - 3.5) < 3.0 * means.std(ddof=1) / math.sqrt(count)
