"""Sobol' indices: closed forms, coverage of the intervals, SALib and SciPy on equal samples."""

import functools
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcstudy_tools import (
    Array,
    generator,
    global_generator_left_alone,
    ishigami,
    ishigami_parts,
    quiet,
)
from numpy.testing import assert_allclose, assert_array_equal
from SALib.analyze import sobol as salib_sobol
from scipy import special, stats

from mcstudy.sampling.saltelli import Saltelli, draw_saltelli
from mcstudy.sensitivity.sobol import Blocks, Indices, estimate_indices, split_blocks

SEEDS = [24, pytest.param(200, marks=pytest.mark.slow)]
BASE_POINTS = 256
INPUTS = tuple(f"x{k}" for k in range(8))
THREE = INPUTS[:3]
UPPER = np.triu(np.ones((3, 3), dtype=bool), k=1)

G_WEIGHTS = np.array([0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0])
SLOPES = np.array([1.0, 2.0, 3.0, 0.5, 0.0, 1.5, 2.5, 0.1])


def outputs_of(u: Array) -> Array:
    """Return Ishigami's function, the G function and a sum of normal inputs (n, 3)."""
    g = ((np.abs(4.0 * u - 2.0) + G_WEIGHTS) / (1.0 + G_WEIGHTS)).prod(axis=1)
    return np.column_stack([ishigami(u), g, special.ndtri(u) @ SLOPES])


def known_indices() -> Array:
    """Return first and total indices (2, 8 inputs, 3 functions) of the functions above.

    G: V_i = 1 / (3 (1 + a_i)^2), V = prod(1 + V_i) - 1, T_i V = V_i prod_{j not i}(1 + V_j)
    (G. Archer, A. Saltelli, I. Sobol', Journal of Statistical Computation and Simulation 58, 1997;
    Saltelli et al., CPC 181, 2010, section 6). Of a sum S_i = T_i = a_i^2 / sum a^2.
    """
    known = np.zeros((2, 8, 3))
    v, v1, v2, v13 = ishigami_parts()
    known[0, :3, 0] = v1 / v, v2 / v, 0.0
    known[1, :3, 0] = (v1 + v13) / v, v2 / v, v13 / v
    single = 1.0 / (3.0 * (1.0 + G_WEIGHTS) ** 2)
    whole = np.prod(1.0 + single)
    known[0, :, 1] = single / (whole - 1.0)
    known[1, :, 1] = single * whole / (1.0 + single) / (whole - 1.0)
    known[:, :, 2] = SLOPES**2 / (SLOPES @ SLOPES)
    return known


ACTIVE = known_indices()[1] > 0.0
"""(8, 3) inputs that a function reads."""


def test_known_indices_are_the_published_ones() -> None:
    # Ishigami: the values of Saltelli et al., Global Sensitivity Analysis: The Primer, 2008, and of
    # SciPy's documentation of sobol_indices (total index 0.244 of x3). G: Saltelli et al. 2010.
    first, total = known_indices()
    assert first[:3, 0] == pytest.approx([0.3139, 0.4424, 0.0], abs=1e-4)
    assert total[:3, 0] == pytest.approx([0.5576, 0.4424, 0.2437], abs=1e-4)
    assert first[:4, 1] == pytest.approx([0.7162, 0.1790, 0.0237, 0.0072], abs=1e-4)
    assert total[:4, 1] == pytest.approx([0.7871, 0.2422, 0.0343, 0.0105], abs=1e-4)


@functools.cache
def design(seed: int) -> Saltelli:
    return draw_saltelli(INPUTS, {}, BASE_POINTS, seed)


@functools.cache
def estimates(seeds: int) -> Array:
    """Return first and total indices of every seed (2, seeds, 3, 9 factors, 3 functions)."""
    found = [
        estimate_indices(
            split_blocks(outputs_of(design(seed).uniforms), 9, second_order=False),
            design(seed).scramble[:: design(seed).block],
            resamples=200,
        )
        for seed in range(seeds)
    ]
    return np.stack([[f.first for f in found], [f.total for f in found]])


def second_order_of_ishigami(seed: int) -> Array:
    """Return second-order indices (3, 3, 3) of a design, its rows of B with one of A made here."""
    cube = design(seed).uniforms.reshape(BASE_POINTS, design(seed).block, -1)[..., :3]
    a, b = cube[:, 0], cube[:, -1]
    crossed = [np.where(np.arange(3) == i, a, b) for i in range(3)]
    rows = np.stack([a, *(cube[:, 1 + i] for i in range(3)), *crossed, b], axis=1)
    blocks = split_blocks(ishigami(rows.reshape(-1, 3))[:, None], 3, second_order=True)
    found = estimate_indices(blocks, design(seed).scramble[:: design(seed).block], resamples=200)
    return found.second[..., 0]


def check_coverage(tables: Array, truth: Array) -> None:
    """Check how often intervals (seeds, 3: value, low, high, ...) hold a truth.

    99.9 % of binomial rates at 0.95 lie within the bounds of a single one.
    """
    seeds = len(tables)
    rates = ((tables[:, 1] <= truth) & (truth <= tables[:, 2])).mean(axis=0)
    low, high = stats.binom.interval(0.999, seeds, 0.95)
    assert np.all((rates >= low / seeds) & (rates <= high / seeds)), rates
    more = np.sqrt(200 / seeds)
    assert -0.05 * more <= rates.mean() - 0.95 <= 0.03 * more


def random_blocks(seed: int, n: int = 64, d: int = 3, m: int = 2) -> Blocks:
    """Return blocks of unrelated numbers, with second order."""
    rng = generator(seed)
    return Blocks(*(rng.normal(size=shape) for shape in ((n, m), (n, m), (n, d, m), (n, d, m))))


def mapped(blocks: Blocks, change: Callable[[Array], Array]) -> Blocks:
    """Return blocks of second order with all values changed."""
    return Blocks(*(change(part) for part in (blocks.A, blocks.B, blocks.AB, blocks.BA)))


def first_order(blocks: Blocks) -> Blocks:
    return Blocks(blocks.A, blocks.B, blocks.AB)


def check_equal(a: Indices, b: Indices, tolerance: float = 0.0) -> None:
    for name in ("first", "total", "first_sum", "second", "variance"):
        one, other = getattr(a, name), getattr(b, name)
        assert (one is None) == (other is None)
        if one is not None:
            assert_allclose(one, other, rtol=tolerance, atol=tolerance)
    assert a.blocks == b.blocks


@pytest.mark.parametrize("seeds", SEEDS)
def test_indices_are_right_on_average_and_their_intervals_cover(seeds: int) -> None:
    # The mean over seeds scatters by sd / sqrt(seeds); a ratio of means over n = 256 base points
    # has a bias of order 1 / n (W. Cochran, Sampling Techniques, 1977, section 6.8).
    for tables, truth in zip(estimates(seeds)[:, :, :, :8], known_indices(), strict=True):
        best = tables[:, 0]
        error = np.abs(best.mean(axis=0) - truth)
        assert np.all(error <= 4.0 * best.std(axis=0, ddof=1) / np.sqrt(seeds) + 0.5 / BASE_POINTS)
        assert np.all(error <= 0.01 * np.sqrt(200.0 / seeds))
        check_coverage(tables[..., ACTIVE], truth[ACTIVE])
        # An input that is not read has exactly no index.
        assert_array_equal(tables[..., ~ACTIVE], 0.0)


def test_dummy_of_smooth_functions_is_below_what_its_nudge_explains() -> None:
    # The nudge moves an input by 1e-4 of its range: its share of the variance is of order 1e-8. The
    # estimate of the first index scatters by the root of that share over sqrt(n), of order 1e-4;
    # in the tails of a normal input the slope is a hundred times larger.
    first, total = np.abs(estimates(24)[:, :, 0, 8])
    assert np.median(first) < 1e-3 and np.median(total) < 1e-5
    assert max(first.max(), total.max()) < 1e-2


@pytest.mark.parametrize("seeds", SEEDS)
def test_intervals_of_second_order_cover(seeds: int) -> None:
    found = np.stack([second_order_of_ishigami(seed) for seed in range(seeds)])[..., UPPER]
    v, _, _, v13 = ishigami_parts()
    truth = np.array([0.0, v13 / v, 0.0])
    check_coverage(found, truth)
    assert_allclose(found[:, 0].mean(axis=0), truth, atol=0.02 * np.sqrt(200 / seeds))


@pytest.mark.parametrize("seeds", SEEDS)
def test_intervals_of_independent_base_points_cover(seeds: int) -> None:
    # Plain Monte Carlo: every base point is independent, each is a replicate of its own.
    tables = []
    for seed in range(seeds):
        a, b = generator(seed).random((2, 300, 3))
        mixed = np.stack([np.where(np.arange(3) == i, b, a) for i in range(3)], axis=1)
        blocks = Blocks(ishigami(a)[:, None], ishigami(b)[:, None], ishigami(mixed)[..., None])
        found = estimate_indices(blocks, resamples=200)
        tables.append(np.stack([found.first[..., 0], found.total[..., 0]], axis=1))
    check_coverage(np.stack(tables), known_indices()[:, :3, 0])


def design_outputs(*, second_order: bool) -> Blocks:
    """Return blocks of three outputs of one design of three inputs and the dummy."""
    u = draw_saltelli(THREE, {}, 128, 11, second_order=second_order).uniforms
    rows = np.column_stack([ishigami(u), 1e3 + u @ [1.0, 2.0, 3.0], u[:, 0] * u[:, 1] - u[:, 2]])
    return split_blocks(rows, 4, second_order=second_order)


def salibs(blocks: Blocks, output: int, resamples: int = 2) -> dict[str, Array]:
    """Return SALib's analysis of equal numbers."""
    d = blocks.AB.shape[1]
    parts = [blocks.A[:, None], blocks.AB, blocks.B[:, None]]
    if blocks.BA is not None:
        parts.insert(2, blocks.BA)
    return salib_sobol.analyze(
        {"num_vars": d, "names": [f"x{k}" for k in range(d)], "bounds": [[0.0, 1.0]] * d},
        np.concatenate(parts, axis=1)[..., output].ravel(),
        calc_second_order=blocks.BA is not None, num_resamples=resamples, seed=1,
    )  # fmt: skip


@pytest.mark.parametrize("blocks", [
    design_outputs(second_order=False), design_outputs(second_order=True), random_blocks(3),
], ids=["first", "second", "without structure"])  # fmt: skip
def test_values_equal_salibs_and_scipys_on_equal_samples(blocks: Blocks) -> None:
    found = estimate_indices(blocks, resamples=0, centre="all")
    for k in range(blocks.A.shape[1]):
        theirs = salibs(blocks, k)
        for key, ours in (("S1", found.first), ("ST", found.total), ("S2", found.second)):
            if ours is not None:
                assert_allclose(ours[0, ..., k], theirs[key], rtol=0, atol=1e-10)
    found = estimate_indices(blocks, resamples=0, centre="base")
    values = stats.sobol_indices(
        func={"f_A": blocks.A.T, "f_B": blocks.B.T, "f_AB": blocks.AB.transpose(1, 2, 0)},
        n=blocks.size,
    )
    assert_allclose(found.first[0].T, values.first_order, rtol=0, atol=1e-10)
    assert_allclose(found.total[0].T, values.total_order, rtol=0, atol=1e-10)


def test_intervals_are_as_wide_as_salibs_bootstrap() -> None:
    # SALib: 1.96 standard deviations of resamples of points. Ours: t instead of z and the factor
    # sqrt(n / (n - 1)), both within 1 % for 128 points. 4,000 resamples scatter by about 1 %.
    blocks = design_outputs(second_order=False)
    found, theirs = estimate_indices(blocks, resamples=4000), salibs(blocks, 0, 4000)
    for table, key in ((found.first, "S1_conf"), (found.total, "ST_conf")):
        assert_allclose((table[2] - table[0])[:3, 0], theirs[key][:3], rtol=0.08)


@quiet(40)
@given(
    scale=st.floats(1e-6, 1e6).flatmap(lambda s: st.sampled_from([s, -s])),
    shift=st.floats(-1e3, 1e3),
    outputs=st.permutations(range(4)),
    factors=st.permutations(range(3)),
    seed=st.integers(0, 20),
    centre=st.sampled_from(["all", "base"]),
)
def test_indices_go_with_outputs_and_factors_and_feel_neither_scale_nor_shift(
    scale: float, shift: float, outputs: list[int], factors: list[int], seed: int, centre: str
) -> None:
    blocks = random_blocks(seed, n=32, m=4)
    one = estimate_indices(blocks, resamples=20, centre=centre)
    moved = mapped(blocks, lambda part: scale * (part + shift)[..., outputs])
    two = estimate_indices(moved, resamples=20, centre=centre)
    expected = Indices(
        *(table[..., outputs] for table in (one.first, one.total, one.first_sum, one.second)),
        scale**2 * one.variance[outputs], 32,
    )  # fmt: skip
    assert_allclose(two.variance, expected.variance, rtol=1e-7)
    for name in ("first", "total", "first_sum", "second"):
        assert_allclose(getattr(two, name), getattr(expected, name), rtol=1e-7, atol=1e-7)
    swapped = estimate_indices(
        Blocks(blocks.A, blocks.B, blocks.AB[:, factors]), resamples=20, centre="base"
    )
    plain = estimate_indices(first_order(blocks), resamples=20, centre="base")
    assert_allclose(plain.first[:, factors], swapped.first, rtol=1e-10, atol=1e-10)
    assert_allclose(plain.total[:, factors], swapped.total, rtol=1e-10, atol=1e-10)


def test_the_sum_of_first_order_indices_has_an_interval_of_its_own() -> None:
    found = estimate_indices(random_blocks(3), resamples=200)
    assert_allclose(found.first_sum[0], found.first[0].sum(axis=0), rtol=1e-12)
    # Not the sum of the intervals: the indices of one sample go together.
    half = found.first_sum[2] - found.first_sum[0]
    assert np.all((half > 0.0) & (half < (found.first[2] - found.first[0]).sum(axis=0)))


def test_intervals_are_reproducible_and_leave_the_global_generator_alone() -> None:
    blocks = random_blocks(2)
    with global_generator_left_alone():
        check_equal(estimate_indices(blocks), estimate_indices(blocks))
        seeded, same, other = (estimate_indices(blocks, rng=generator(s)) for s in (5, 5, 6))
    check_equal(seeded, same)
    assert_array_equal(seeded.first[0], other.first[0])
    assert not np.array_equal(seeded.first[1:], other.first[1:])


def test_intervals_are_symmetric_and_shrink_towards_the_law_of_large_numbers() -> None:
    # Four times the base points, half the interval.
    small, large = (estimate_indices(random_blocks(4, n=n), resamples=1000) for n in (100, 400))
    for found in (small, large):
        assert_allclose(found.first[1:].mean(axis=0), found.first[0], atol=1e-12)
        assert_allclose(found.total[1:].mean(axis=0), found.total[0], atol=1e-12)
    ratio = (small.first[2] - small.first[1]) / (large.first[2] - large.first[1])
    assert 1.6 < ratio.mean() < 2.4


def test_replicates_are_told_apart_whatever_their_names() -> None:
    blocks, replicate = random_blocks(6), np.arange(64) % 16
    check_equal(estimate_indices(blocks, replicate), estimate_indices(blocks, 7 * replicate + 1000))
    # Of one base point each they are base points.
    check_equal(estimate_indices(blocks), estimate_indices(blocks, np.arange(64)))


def test_repeated_base_points_of_a_replicate_add_no_certainty() -> None:
    # Every base point four times: as replicates of four the interval is that of single points.
    blocks = random_blocks(7)
    repeated = first_order(mapped(blocks, lambda part: np.repeat(part, 4, axis=0)))
    single, naive = estimate_indices(first_order(blocks)), estimate_indices(repeated)
    together = estimate_indices(repeated, np.repeat(np.arange(64), 4))
    assert_allclose(together.first, single.first, rtol=1e-10)
    assert_allclose(together.total, single.total, rtol=1e-10)
    assert np.all(naive.total[2] - naive.total[1] < 0.7 * (single.total[2] - single.total[1]))


@pytest.mark.parametrize("more", [{"resamples": 0}, {"replicate": np.zeros(64, dtype=np.int64)}])
def test_without_a_spread_there_is_a_value_and_no_interval(more: dict[str, object]) -> None:
    found = estimate_indices(random_blocks(8), **more)
    for table in (found.first, found.total):
        assert np.isfinite(table[0]).all() and np.isnan(table[1:]).all()


@pytest.mark.parametrize("second_order", [False, True])
def test_rows_are_split_in_the_order_of_the_design(second_order: bool) -> None:
    d, n = 3, 5
    rows = 2 * d + 2 if second_order else d + 2
    numbers = np.arange(n * rows, dtype=float)[:, None] + np.array([0.0, 1000.0])
    blocks = split_blocks(numbers, d, second_order=second_order)
    starts = rows * np.arange(n)
    assert_array_equal(blocks.A[:, 0], starts)
    assert_array_equal(blocks.B[:, 0], starts + rows - 1)
    assert_array_equal(blocks.AB[:, 1, 1], starts + 2 + 1000)
    assert (blocks.AB.shape, blocks.size) == ((n, d, 2), n)
    assert (blocks.BA is not None) == second_order
    if second_order:
        assert_array_equal(blocks.BA[:, 2, 0], starts + d + 3)


@pytest.mark.parametrize("shape", [(0, 1), (7, 1), (9, 2), (10,), (5, 2, 1)])
def test_rows_that_are_no_blocks_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="shape"):
        split_blocks(np.zeros(shape), 3, second_order=False)


@pytest.mark.parametrize("place", ["A", "B", "AB", "BA"])
def test_values_that_are_not_finite_and_single_base_points_are_refused(place: str) -> None:
    for bad in (np.nan, np.inf, -np.inf):
        blocks = random_blocks(1)
        getattr(blocks, place).flat[-1] = bad
        with pytest.raises(ValueError, match="finite"):
            estimate_indices(blocks)
    with pytest.raises(ValueError, match="two base points"):
        estimate_indices(random_blocks(1, n=1))


@pytest.mark.parametrize("n", [2, 16, 100, 1000])
@pytest.mark.parametrize("constant", [0.0, -0.5, 0.1, 1.0 / 3.0, 1e9 + 0.1, -7.3e-5])
def test_a_constant_output_has_no_indices_if_its_mean_rounds_or_not(
    constant: float, n: int
) -> None:
    blocks = random_blocks(2, n=n, m=1)
    both = mapped(
        blocks, lambda part: np.concatenate([part, np.full_like(part, constant)], axis=-1)
    )
    found = estimate_indices(both, resamples=50)
    for table in (found.first, found.total, found.second[:, UPPER]):
        assert np.isnan(table[..., 1]).all() and np.isfinite(table[..., 0]).all()
    assert np.isnan(found.second[:, ~UPPER]).all()


def test_an_output_that_varies_little_about_a_large_mean_keeps_its_indices() -> None:
    # Doubles about 1e6 are 1.2e-10 apart: a variation of 1 keeps ten digits.
    blocks = random_blocks(3)
    far = mapped(blocks, lambda part: part + 1e6)
    a, b = (estimate_indices(part, resamples=0) for part in (blocks, far))
    assert_allclose(a.first[0], b.first[0], rtol=1e-6, atol=1e-8)
    assert_allclose(a.total[0], b.total[0], rtol=1e-6, atol=1e-8)


def of_rows(rows: Array) -> Indices:
    """Return the indices of an output of two inputs."""
    return estimate_indices(split_blocks(rows[:, None], 2, second_order=False), resamples=20)


@pytest.mark.filterwarnings("error")
def test_an_output_that_rounding_alone_moves_does_not_vary() -> None:
    found = of_rows(700.1 * (1.0 + 1e-15 * generator(1).integers(0, 5, 256)))
    assert found.variance.tolist() == [0.0]
    assert np.isnan(found.total).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("exponent", [-900, 900])
def test_indices_do_not_feel_a_power_of_two(exponent: int) -> None:
    rows = generator(2).normal(size=256)
    one, two = of_rows(rows), of_rows(np.ldexp(rows, exponent))
    assert_array_equal(one.total, two.total)
    assert two.variance[0] > 0.0


def test_an_output_that_moves_outside_the_base_points_alone_has_no_index() -> None:
    found = of_rows(np.where(np.arange(256) == 9, 5.0, 1.0))
    assert np.isnan(found.variance).all() and np.isnan(found.total).all()
