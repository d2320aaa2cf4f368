"""Designs: what a larger one shares with a smaller one, how even they are, what that gains."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from mcstudy.sampling import designs

Array = NDArray[np.float64]

SIZES = [("monte-carlo", 1), ("latin-hypercube", 25), ("sobol", 32)]
STRATIFIED = [("latin-hypercube", 128), ("sobol", 128)]


def replicates(method: str, size: int, count: int, dimensions: int, seed: int = 1) -> Array:
    """Return a design as (replicates, size, dimensions)."""
    found = designs.draw(method, size * count, size, dimensions, seed)
    return found.reshape(count, size, dimensions)


def test_every_method_is_tried_here() -> None:
    assert {method for method, _ in SIZES} == set(designs.METHODS)
    assert set(designs.DEFAULT_REPLICATE_SIZE) == set(designs.METHODS)


@pytest.mark.parametrize(("method", "size"), SIZES)
def test_designs_have_their_shape_and_lie_inside_the_unit_cube(method: str, size: int) -> None:
    found = designs.draw(method, 8 * size, size, 5, seed=3)
    assert found.shape == (8 * size, 5)
    assert found.dtype == np.float64
    assert np.all((found > 0.0) & (found < 1.0))


@pytest.mark.parametrize(("method", "size"), SIZES)
def test_a_larger_design_begins_with_the_smaller_one(method: str, size: int) -> None:
    small = designs.draw(method, 3 * size, size, 4, seed=3)
    large = designs.draw(method, 8 * size, size, 4, seed=3)
    np.testing.assert_array_equal(large[: 3 * size], small)


@pytest.mark.parametrize(("method", "size"), SIZES)
def test_designs_repeat_by_seed_and_differ_between_seeds(method: str, size: int) -> None:
    first = designs.draw(method, 4 * size, size, 3, seed=5)
    np.testing.assert_array_equal(first, designs.draw(method, 4 * size, size, 3, seed=5))
    other = designs.draw(method, 4 * size, size, 3, seed=6)
    assert np.all(first != other)


@pytest.mark.parametrize(("method", "size"), SIZES)
def test_replicates_differ(method: str, size: int) -> None:
    parts = replicates(method, size, 6, 3)
    for k in range(6):
        for j in range(k):
            assert not np.array_equal(np.sort(parts[k], axis=0), np.sort(parts[j], axis=0))


@pytest.mark.parametrize(("method", "size"), STRATIFIED)
def test_each_replicate_has_one_sample_in_each_stratum(method: str, size: int) -> None:
    # McKay, Beckman and Conover 1979; a Sobol' net of 2^m points has the same margins.
    parts = replicates(method, size, 5, 17)
    strata = np.sort(np.floor(parts * size).astype(int), axis=1)
    assert np.all(strata == np.arange(size)[None, :, None])


@pytest.mark.parametrize(("method", "size"), SIZES)
def test_samples_are_uniform_in_every_dimension(method: str, size: int) -> None:
    n = 3200
    found = designs.draw(method, n, size, 4, seed=8)
    # Mean and variance of the unit uniform within three standard errors of independent samples.
    assert np.all(np.abs(found.mean(axis=0) - 0.5) < 3.0 * math.sqrt(1.0 / 12.0 / n))
    assert np.all(np.abs(found.var(axis=0) - 1.0 / 12.0) < 3.0 * math.sqrt(1.0 / 180.0 / n))


def ishigami(u: Array, a: float = 7.0, b: float = 0.1) -> Array:
    """Return Ishigami and Homma's function (1990) of (..., 3) uniforms."""
    x = math.pi * (2.0 * u - 1.0)
    sine = np.sin(x)
    return np.asarray(sine[..., 0] * (1.0 + b * x[..., 2] ** 4) + a * sine[..., 1] ** 2)


@pytest.mark.parametrize(
    ("method", "low", "high"),
    [
        # Independent samples: 1. Latin hypercube: the share of variance that is not additive,
        # 1 - S1 - S2 = 0.244 (Stein 1987). Each with three standard errors, sqrt(2 / 199).
        ("monte-carlo", 0.7, 1.3),
        ("latin-hypercube", 0.7 * 0.2436, 1.3 * 0.2436),
        ("sobol", 0.0, 0.15),
    ],
)
def test_variance_of_a_mean_of_ishigami_against_independent_samples(
    method: str, low: float, high: float
) -> None:
    size, count, a, b = 128, 200, 7.0, 0.1
    variance = a**2 / 8.0 + b * math.pi**4 / 5.0 + b**2 * math.pi**8 / 18.0 + 0.5
    if method == "monte-carlo":
        points = designs.draw(method, size * count, 1, 3, seed=1).reshape(count, size, 3)
    else:
        points = replicates(method, size, count, 3)
    means = ishigami(points).mean(axis=1)
    assert low <= means.var(ddof=1) / (variance / size) <= high
    assert abs(means.mean() - a / 2.0) < 3.0 * means.std(ddof=1) / math.sqrt(count)
