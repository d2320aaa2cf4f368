"""Measures from any sample: known values, coverage, SALib on equal samples, the noise line."""

import functools
import warnings
from itertools import pairwise

import numpy as np
import pytest
from mcstudy_tools import (
    Array,
    generator,
    global_generator_left_alone,
    ishigami,
    ishigami_parts,
)
from numpy.testing import assert_allclose, assert_array_equal
from SALib.analyze import delta as salib_delta
from SALib.analyze import pawn as salib_pawn
from scipy import integrate, stats

from mcstudy.sensitivity.delta import delta, density_shift
from mcstudy.sensitivity.given_data import (
    DUMMIES,
    MEASURES,
    MIN_RUNS,
    GivenData,
    measure_given_data,
)
from mcstudy.sensitivity.pawn import SLICES, pawn
from mcstudy.sensitivity.rank_based import rank_first_order

V, V1, V2, _ = ishigami_parts()
FIRST_ORDER = np.array([V1, V2, 0.0]) / V


@pytest.mark.parametrize("seed", range(3))
def test_rank_based_indices_of_ishigami(seed: int) -> None:
    u = generator(seed).random((4000, 3))
    found = rank_first_order(u, ishigami(u), generator())
    assert np.all((found[1] <= FIRST_ORDER) & (found[2] >= FIRST_ORDER))
    # The error is of order 1 / sqrt(n) (Gamboa et al. 2022, central limit theorem).
    assert_allclose(found[0], FIRST_ORDER, atol=4.0 / np.sqrt(4000.0))
    assert np.all(found[2] - found[1] < 10.0 / np.sqrt(4000.0))


@pytest.mark.parametrize("samples", [20, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize("function", ["ishigami", "linear"])
def test_rank_based_intervals_cover_and_are_no_wider_than_needed(
    function: str, samples: int
) -> None:
    tables = []
    for seed in range(samples):
        u = generator(seed).random((500, 3))
        y = ishigami(u) if function == "ishigami" else u @ np.array([1.0, 2.0, 0.0])
        tables.append(rank_first_order(u, y, generator(seed)))
    found = np.stack(tables)
    # Of a sum the variances add: 1 / 5 and 4 / 5.
    truth = FIRST_ORDER if function == "ishigami" else np.array([0.2, 0.8, 0.0])
    away, reach = np.abs(found[:, 0] - truth), found[:, 2] - found[:, 0]
    assert_allclose(found[:, 0] - found[:, 1], reach, rtol=1e-9)
    rates = (away <= reach).mean(axis=0)
    # 99.9 % of binomial rates of 100 samples at 0.95 are 0.86 or more.
    assert np.all(rates >= stats.binom.ppf(0.0005, samples, 0.95) / samples), rates
    assert rates.mean() >= 0.95 - 0.05 * np.sqrt(100 / samples)
    # Half as wide they would hold the truth too rarely.
    assert (away <= 0.5 * reach).mean() < 0.90
    # The standard deviation of 100 estimates is known to 7 %.
    scatter = found[:, 0].std(axis=0, ddof=1)
    assert np.all(reach.mean(axis=0) / 1.96 < (1.0 + 1.5 / np.sqrt(samples)) * scatter)


def test_an_input_that_goes_with_another_gets_its_share() -> None:
    # Normal z and w with correlation r, y = z: Var(E[y | w]) / Var(y) = r^2.
    rng = generator(1)
    z = rng.normal(size=4000)
    w = 0.8 * z + 0.6 * rng.normal(size=4000)
    found = rank_first_order(np.column_stack([z, w, rng.random(4000)]), z, generator())
    assert found[0] == pytest.approx([1.0, 0.64, 0.0], abs=0.04)
    assert found[1, 2] < 0.0 < found[2, 2]


def test_rank_based_indices_and_delta_depend_on_ranks_and_not_on_units() -> None:
    u = generator(2).random((300, 3))
    y = ishigami(u)
    for measure in (rank_first_order, delta):
        found = measure(u, y, generator())
        assert_allclose(measure(np.exp(9.0 * u), y, generator()), found, rtol=1e-7)
        assert_allclose(measure(u, 1e4 - 3.0 * y, generator()), found, atol=1e-9)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("constant", [0.0, 1.0, 0.1, 1.0 / 3.0, -7.0, 1e9 + 0.1])
def test_a_constant_output_has_no_measure_whether_its_mean_rounds_or_not(constant: float) -> None:
    for n in (100, 150, 333):
        x, y = generator().random((n, 2)), np.full(n, constant)
        for measure in (rank_first_order, delta):
            found = measure(x, y, generator())
            assert found.shape == (3, 2) and np.isnan(found).all()
        values = measure_given_data(x, y, 1).values.values()
        assert all(np.isnan(table).all() for table in values)


@pytest.mark.parametrize("n", [100, 499, 1500, pytest.param(4000, marks=pytest.mark.slow)])
def test_delta_without_correction_equals_salibs(n: int) -> None:
    # Classes as SALib's analyze draws them (SALib 1.6, delta.py).
    exponent = 2.0 / (7.0 + np.tanh((1500.0 - n) / 500.0))
    classes = np.linspace(0.0, n, min(int(np.ceil(n**exponent)), 48) + 1)
    rng = generator(n)
    u = rng.random((n, 3))
    u[:, 1] = np.round(u[:, 1], 1)
    for y in (ishigami(u), np.exp(3.0 * u[:, 0]) + u[:, 1], rng.normal(size=n)):
        grid = np.linspace(y.min(), y.max(), 100)
        theirs = [salib_delta.calc_delta(y, grid, u[:, k], classes) for k in range(3)]
        assert_allclose(density_shift(u, y), theirs, rtol=0, atol=1e-12)


def known_delta(share: float) -> float:
    """Return delta of an input with a share of the variance of a normal sum of two.

    delta = E int |f(y) - f(y | x)| dy / 2 (Borgonovo 2007, equation 7), with y standard normal and
    y given x normal about sqrt(share) x with variance 1 - share; integrated numerically.
    """
    y, x = np.linspace(-6.0, 6.0, 2401), np.linspace(-6.0, 6.0, 241)
    given_x = stats.norm.pdf(y, np.sqrt(share) * x[:, None], np.sqrt(1.0 - share))
    moved = 0.5 * integrate.trapezoid(np.abs(stats.norm.pdf(y) - given_x), y, axis=1)
    return float(integrate.trapezoid(moved * stats.norm.pdf(x), x))


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_delta_of_a_normal_sum_is_the_known_one(share: float) -> None:
    deltas = []
    for seed in range(2):
        z = generator(seed).normal(size=(1500, 2))
        deltas.append(delta(z, z @ np.sqrt([share, 1.0 - share]), generator(seed))[0])
    # Kernels widen the densities: a bias of 0.03 is left at 2,000 runs.
    truth = [known_delta(share), known_delta(1.0 - share)]
    assert_allclose(np.mean(deltas, axis=0), truth, atol=0.045)
    # An input that fixes the output moves all of its density.
    assert known_delta(0.999) > 0.94


def test_delta_of_dummies_is_less_biased_than_salibs(monkeypatch: pytest.MonkeyPatch) -> None:
    # The truth is nought.
    rng = generator(4)
    x, y = rng.random((600, 4)), rng.normal(size=600)
    ours = delta(x, y, generator(1))
    problem = {"num_vars": 4, "names": list("pqrs"), "bounds": [[0.0, 1.0]] * 4}
    # SALib sets the format and the filters of warnings and NumPy's global generator: put them back.
    monkeypatch.setattr(warnings, "formatwarning", warnings.formatwarning)
    state = np.random.get_state()  # noqa: NPY002
    with warnings.catch_warnings():
        theirs = salib_delta.analyze(problem, x, y, num_resamples=2, seed=1, method="delta")
    np.random.set_state(state)  # noqa: NPY002
    assert abs(ours[0].mean()) < 0.6 * np.mean(theirs["delta_raw"])
    assert np.all(ours[1] < 0.05)


@pytest.mark.parametrize("sigma", [1.5, 2.0])
def test_delta_of_a_skewed_output_is_that_of_its_logarithm(sigma: float) -> None:
    # Delta is the same for any rising scale of the output (Borgonovo, S. Tarantola, E. Plischke,
    # M. Morris, Journal of the Royal Statistical Society B 76, 2014) and at most 1.
    z = generator(0).normal(size=(1000, 2))
    score = z @ np.array([1.0, 0.5])
    plain, skewed = (delta(z, y, generator()) for y in (score, np.exp(sigma * score)))
    assert_allclose(skewed, plain, atol=1e-9)


def test_delta_of_a_switch_is_half() -> None:
    # y = 1 if x > 1/2: given x the output is fixed, half of its probability moves (the integral of
    # Borgonovo's equation 7 is the total variation of the two laws).
    x = generator(3).random((1000, 2))
    found = delta(x, (x[:, 0] > 0.5).astype(float), generator())
    assert found[0, 0] > 0.3
    assert abs(found[0, 1]) < 0.1


def test_pawn_equals_salibs_and_the_median_distance_of_the_slices() -> None:
    u = generator(5).random((500, 3))
    y = ishigami(u)
    problem = {"num_vars": 3, "names": ["a", "b", "c"], "bounds": [[0.0, 1.0]] * 3}
    theirs = salib_pawn.analyze(problem, u, y, S=10)
    found = pawn(u, y, generator())
    assert_array_equal(found, [theirs[key] for key in ("median", "minimum", "maximum")])
    for column, values in zip(found.T, u.T, strict=True):
        borders = np.quantile(values, np.linspace(0.0, 1.0, SLICES + 1))
        slices = [(values >= low) & (values < high) for low, high in pairwise(borders)]
        distances = [stats.ks_2samp(y[part], y).statistic for part in slices]
        expected = [np.median(distances), min(distances), max(distances)]
        assert_allclose(column, expected, rtol=1e-12)


def test_pawn_of_the_output_itself_is_known() -> None:
    # y = x, uniform: slice s of ten lies s/10 above and (9 - s)/10 below the rest, so its distance
    # is the larger of the two: 0.9, 0.8, 0.7, 0.6, 0.5 and back; median 0.7.
    x = generator(7).random((5000, 1))
    found = pawn(x, x[:, 0], generator())
    assert found[:, 0] == pytest.approx([0.7, 0.5, 0.9], abs=0.005)


@functools.cache
def example(n: int = 120) -> tuple[Array, Array]:
    """Return two inputs, one of which the output follows, and the output."""
    rng = generator(8)
    x = rng.random((n, 2))
    return x, 3.0 * x[:, 0] + 0.3 * rng.normal(size=n)


def same(a: GivenData, b: GivenData) -> bool:
    equal = [np.array_equal(a.values[name], b.values[name]) for name in MEASURES]
    return a.runs == b.runs and a.noise == b.noise and all(equal)


def test_every_measure_finds_the_input_that_matters_and_nothing_else_changes() -> None:
    x, y = example()
    held = x.copy(), y.copy()
    before = warnings.formatwarning, warnings.showwarning, warnings.filters[:], np.geterr()
    with global_generator_left_alone():
        found = measure_given_data(x, y, 1)
    after = warnings.formatwarning, warnings.showwarning, warnings.filters[:], np.geterr()
    assert before == after
    assert_array_equal(x, held[0])
    assert_array_equal(y, held[1])
    assert list(found.values) == list(found.noise) == ["first_order", "delta", "pawn"]
    assert found.runs == 120
    for name, table in found.values.items():
        assert table.shape == (3, 2)
        assert np.all((table[1] <= table[0]) & (table[0] <= table[2]))
        assert table[0, 0] > max(found.noise[name], table[0, 1])
    assert same(found, measure_given_data(x, y, 1))
    other = measure_given_data(x, y, 2)
    assert not same(found, other)
    # PAWN has no chance in it but for its noise line.
    assert_array_equal(found.values["pawn"], other.values["pawn"])


def test_runs_without_a_value_are_left_out_and_a_hundred_must_be_left() -> None:
    assert MIN_RUNS == 100
    x, y = example(103)
    holed = y.copy()
    holed[[3, 50, 77]] = np.nan, np.inf, -np.inf
    gone = ~np.isfinite(holed)
    found = measure_given_data(x, holed, 1)
    assert found.runs == 100
    assert same(found, measure_given_data(x[~gone], y[~gone], 1))
    holed[0] = np.nan
    with pytest.raises(ValueError, match="99 runs have a value, 100 are needed"):
        measure_given_data(x, holed, 1)


@pytest.mark.slow
def test_an_unrelated_input_passes_the_noise_line_once_in_twenty_one() -> None:
    # One of 21 exchangeable values is the largest with probability 1 / 21 = 0.048. Of five inputs
    # the share above the line scatters by about 0.1, its mean over 16 outputs by 0.025.
    assert DUMMIES == 20
    passed = []
    for seed in range(16):
        rng = generator(1000 + seed)
        found = measure_given_data(rng.random((100, 5)), rng.normal(size=100), seed)
        passed.append([np.mean(found.values[name][0] > found.noise[name]) for name in MEASURES])
    rates = np.mean(passed, axis=0)
    assert np.all(rates <= 0.048 + 4.0 * 0.025), rates
    assert 0.005 < rates.mean() < 0.11
