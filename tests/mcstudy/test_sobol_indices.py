"""Sobol' indices: closed forms, coverage of the intervals, SALib and SciPy on equal samples."""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from SALib.analyze import sobol as salib_sobol
from scipy import special, stats

from mcstudy.sampling.saltelli import Saltelli, draw_saltelli
from mcstudy.sensitivity.sobol import Blocks, Indices, estimate_indices, split_blocks

Array = NDArray[np.float64]

QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=40)
SEEDS = 200
BASE_POINTS = 256
INPUTS = tuple(f"x{k}" for k in range(8))
THREE = INPUTS[:3]

# -- functions with known indices ------------------------------------------------------------

G_WEIGHTS = np.array([0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0])
SLOPES = np.array([1.0, 2.0, 3.0, 0.5, 0.0, 1.5, 2.5, 0.1])


def ishigami(u: Array) -> Array:
    """Return sin x1 + 7 sin^2 x2 + 0.1 x3^4 sin x1 with x in [-pi, pi]."""
    x = np.pi * (2.0 * u[:, :3] - 1.0)
    wave = np.sin(x[:, 0])
    return np.asarray(wave + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * wave)


def sobol_g(u: Array) -> Array:
    """Return the product of (|4 u_i - 2| + a_i) / (1 + a_i)."""
    return np.asarray(((np.abs(4.0 * u - 2.0) + G_WEIGHTS) / (1.0 + G_WEIGHTS)).prod(axis=1))


def linear(u: Array) -> Array:
    """Return a weighted sum of standard normal inputs."""
    return np.asarray(special.ndtri(u) @ SLOPES)


def ishigami_parts() -> tuple[float, float, float, float]:
    """Return V, V1, V2 and V13 of Ishigami's function; all others are zero.

    T. Ishigami, T. Homma, ISUMA 1990; B. Sudret, Reliability Engineering and System Safety 93,
    2008, section 5.1: V = a^2/8 + b pi^4/5 + b^2 pi^8/18 + 1/2, V1 = (1 + b pi^4/5)^2 / 2,
    V2 = a^2/8, V13 = 8 b^2 pi^8/225.
    """
    a, b, pi4 = 7.0, 0.1, np.pi**4
    v = a**2 / 8.0 + b * pi4 / 5.0 + b**2 * pi4**2 / 18.0 + 0.5
    return v, 0.5 * (1.0 + b * pi4 / 5.0) ** 2, a**2 / 8.0, 8.0 * b**2 * pi4**2 / 225.0


def known_indices() -> Array:
    """Return first and total indices (2, 8 inputs, 3 functions) of the functions above.

    Ishigami: see ``ishigami_parts``. G: V_i = 1 / (3 (1 + a_i)^2), V = prod(1 + V_i) - 1,
    T_i V = V_i prod_{j not i}(1 + V_j) (G. Archer, A. Saltelli, I. Sobol', Journal of Statistical
    Computation and Simulation 58, 1997; Saltelli et al., CPC 181, 2010, section 6). Linear: of
    independent inputs the variances a_i^2 add, S_i = T_i = a_i^2 / sum a^2.
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


def test_known_indices_are_the_published_ones() -> None:
    # Ishigami: the values of Saltelli et al., Global Sensitivity Analysis: The Primer, 2008, and of
    # SciPy's documentation of sobol_indices (total index 0.244 of x3). G: Saltelli et al. 2010.
    known = known_indices()
    assert known[0, :3, 0] == pytest.approx([0.3139, 0.4424, 0.0], abs=1e-4)
    assert known[1, :3, 0] == pytest.approx([0.5576, 0.4424, 0.2437], abs=1e-4)
    assert known[0, :4, 1] == pytest.approx([0.7162, 0.1790, 0.0237, 0.0072], abs=1e-4)
    assert known[1, :4, 1] == pytest.approx([0.7871, 0.2422, 0.0343, 0.0105], abs=1e-4)


@functools.cache
def designs() -> tuple[Saltelli, ...]:
    """Return one design of eight inputs a seed."""
    return tuple(draw_saltelli(INPUTS, {}, BASE_POINTS, seed) for seed in range(SEEDS))


def outputs_of(u: Array) -> Array:
    """Return the three functions' outputs (n, 3)."""
    return np.column_stack([ishigami(u), sobol_g(u), linear(u)])


@functools.cache
def estimates() -> tuple[Array, Array]:
    """Return first and total indices of every seed (seeds, 3, 9 factors, 3 functions)."""
    found = [
        estimate_indices(
            split_blocks(outputs_of(design.uniforms), len(design.factors), second_order=False),
            design.scramble[:: design.block],
            resamples=200,
        )
        for design in designs()
    ]
    return np.stack([f.first for f in found]), np.stack([f.total for f in found])


@functools.cache
def second_order_of_ishigami() -> Array:
    """Return second-order indices of every seed (seeds, 3, 3, 3).

    The rows of B with an input from A are made of the base points of the first-order designs.
    """
    found = []
    for design in designs():
        cube = design.uniforms.reshape(BASE_POINTS, design.block, -1)[..., :3]
        a, b = cube[:, 0], cube[:, -1]
        crossed = [np.where(np.arange(3) == i, a, b) for i in range(3)]
        rows = [a, *(cube[:, 1 + i] for i in range(3)), *crossed, b]
        outputs = ishigami(np.stack(rows, axis=1).reshape(-1, 3))
        blocks = split_blocks(outputs[:, None], 3, second_order=True)
        indices = estimate_indices(blocks, design.scramble[:: design.block], resamples=200)
        assert indices.second is not None
        found.append(indices.second[..., 0])
    return np.stack(found)


def covered(table: Array, truth: Array) -> Array:
    """Return the share of seeds (axis 0) whose interval (axis 1: value, low, high) holds a truth.

    An index that is zero and found as zero without scatter is held.
    """
    low, high = table[:, 1], table[:, 2]
    return np.asarray(((low <= truth) & (truth <= high)).mean(axis=0))


@functools.cache
def random_blocks(seed: int, n: int = 64, d: int = 3, m: int = 2) -> Blocks:
    """Return blocks of unrelated numbers, with second order."""
    rng = np.random.default_rng(seed)
    return Blocks(
        A=rng.normal(size=(n, m)),
        B=rng.normal(size=(n, m)),
        AB=rng.normal(size=(n, d, m)),
        BA=rng.normal(size=(n, d, m)),
    )


def equal(a: Indices, b: Indices, tolerance: float = 0.0) -> None:
    """Check that two results are equal in every number."""
    assert a.blocks == b.blocks
    pairs = [(a.first, b.first), (a.total, b.total), (a.variance, b.variance)]
    if a.second is not None or b.second is not None:
        assert a.second is not None
        assert b.second is not None
        pairs.append((a.second, b.second))
    for one, other in pairs:
        np.testing.assert_allclose(one, other, rtol=tolerance, atol=tolerance)


# -- closed forms and coverage ---------------------------------------------------------------

ACTIVE = known_indices()[1] > 0.0
"""(8, 3) inputs that a function reads."""


@pytest.mark.parametrize("kind", ["first", "total"])
def test_indices_are_right_on_average(kind: str) -> None:
    # The mean over seeds scatters by sd / sqrt(200); a ratio of means over n = 256 base points has
    # a bias of order 1 / n (W. Cochran, Sampling Techniques, 1977, section 6.8).
    which = 0 if kind == "first" else 1
    found = estimates()[which][:, 0, :8]
    error = np.abs(found.mean(axis=0) - known_indices()[which])
    noise = found.std(axis=0, ddof=1) / np.sqrt(SEEDS)
    assert np.all(error <= 4.0 * noise + 0.5 / BASE_POINTS)
    assert np.all(error <= 0.01)


@pytest.mark.parametrize("kind", ["first", "total"])
def test_intervals_between_scrambles_cover(kind: str) -> None:
    which = 0 if kind == "first" else 1
    rates = covered(estimates()[which][:, :, :8], known_indices()[which])[ACTIVE]
    # 99.9 % of binomial rates of 200 seeds at 0.95 lie within these.
    low, high = stats.binom.interval(0.999, SEEDS, 0.95)
    assert np.all(rates >= low / SEEDS), rates
    assert np.all(rates <= high / SEEDS), rates
    assert 0.90 <= rates.mean() <= 0.98


@pytest.mark.parametrize("kind", ["first", "total"])
def test_an_input_that_is_not_read_has_exactly_no_index(kind: str) -> None:
    table = estimates()[0 if kind == "first" else 1][:, :, :8]
    np.testing.assert_array_equal(table[:, :, ~ACTIVE], 0.0)


def test_dummy_of_smooth_functions_is_below_what_its_nudge_explains() -> None:
    # The nudge moves an input by 1e-4 of its range: its share of the variance is of order 1e-8. The
    # estimate of the first index scatters by the root of that share over sqrt(n), of order 1e-4;
    # in the tails of a normal input the slope is a hundred times larger.
    first, total = estimates()
    assert np.median(np.abs(first[:, 0, 8])) < 1e-3
    assert np.median(total[:, 0, 8]) < 1e-5
    assert np.abs(first[:, 0, 8]).max() < 1e-2
    assert total[:, 0, 8].max() < 1e-2


def test_intervals_of_second_order_cover() -> None:
    v, _, _, v13 = ishigami_parts()
    found = second_order_of_ishigami()
    pairs = {(0, 2): v13 / v, (0, 1): 0.0, (1, 2): 0.0}
    rates = np.array([covered(found[:, :, i, j], np.array(t)) for (i, j), t in pairs.items()])
    low, high = stats.binom.interval(0.999, SEEDS, 0.95)
    assert np.all((rates >= low / SEEDS) & (rates <= high / SEEDS)), rates
    assert 0.90 <= rates.mean() <= 0.98
    means = [found[:, 0, i, j].mean() for i, j in pairs]
    assert means == pytest.approx(list(pairs.values()), abs=0.02)


def test_intervals_of_independent_base_points_cover() -> None:
    # Plain Monte Carlo: every base point is independent, each is a replicate of its own.
    truth = known_indices()[:, :3, 0]
    tables = []
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        a, b = rng.random((2, 300, 3))
        mixed = np.stack([np.where(np.arange(3) == i, b, a) for i in range(3)], axis=1)
        blocks = Blocks(
            A=ishigami(a)[:, None],
            B=ishigami(b)[:, None],
            AB=ishigami(mixed.reshape(-1, 3)).reshape(300, 3, 1),
        )
        found = estimate_indices(blocks, resamples=200)
        tables.append(np.stack([found.first[..., 0], found.total[..., 0]], axis=1))
    rates = covered(np.stack(tables), truth)
    low, high = stats.binom.interval(0.999, SEEDS, 0.95)
    assert np.all((rates >= low / SEEDS) & (rates <= high / SEEDS)), rates
    assert 0.90 <= rates.mean() <= 0.98


def test_points_of_a_scramble_taken_as_independent_give_intervals_far_too_wide() -> None:
    # Of a sum of uniforms; 64 points of a scramble are already spread so well that the indices
    # scatter several times less than those of independent points (A. Owen, Annals of Statistics
    # 25, 1997: variance of order n^-3 for smooth functions instead of n^-1).
    ratios = []
    for seed in range(4):
        design = draw_saltelli(THREE, {}, 1024, seed)
        outputs = design.uniforms @ np.array([1.0, 2.0, 3.0])
        blocks = split_blocks(outputs[:, None], 4, second_order=False)
        between = estimate_indices(blocks, design.scramble[:: design.block], resamples=200)
        points = estimate_indices(blocks, resamples=200)
        for wide, narrow in ((points.first, between.first), (points.total, between.total)):
            ratios.append((wide[2] - wide[1])[:3] / (narrow[2] - narrow[1])[:3])
    assert np.mean(ratios) > 2.0


# -- SALib and SciPy -------------------------------------------------------------------------


def design_outputs(*, second_order: bool, n: int = 128) -> tuple[Blocks, Array]:
    """Return blocks and rows of three outputs of one design of three inputs and the dummy."""
    design = draw_saltelli(THREE, {}, n, 11, second_order=second_order)
    u = design.uniforms
    rows = np.column_stack([ishigami(u), 1e3 + u @ [1.0, 2.0, 3.0], u[:, 0] * u[:, 1] - u[:, 2]])
    return split_blocks(rows, 4, second_order=second_order), rows


@pytest.mark.parametrize("second_order", [False, True])
def test_values_equal_salibs_on_equal_samples(second_order: bool) -> None:
    blocks, rows = design_outputs(second_order=second_order)
    found = estimate_indices(blocks, resamples=0, centre="all")
    problem = {"num_vars": 4, "names": [*THREE, "dummy"], "bounds": [[0.0, 1.0]] * 4}
    for k in range(rows.shape[1]):
        theirs = salib_sobol.analyze(
            problem, rows[:, k], calc_second_order=second_order, num_resamples=2, seed=1
        )
        np.testing.assert_allclose(found.first[0, :, k], theirs["S1"], rtol=0, atol=1e-10)
        np.testing.assert_allclose(found.total[0, :, k], theirs["ST"], rtol=0, atol=1e-10)
        if second_order:
            assert found.second is not None
            np.testing.assert_allclose(found.second[0, ..., k], theirs["S2"], rtol=0, atol=1e-10)
        else:
            assert found.second is None


def test_values_equal_salibs_on_numbers_without_structure() -> None:
    blocks = random_blocks(3)
    assert blocks.BA is not None
    cube = np.concatenate([blocks.A[:, None], blocks.AB, blocks.BA, blocks.B[:, None]], axis=1)
    found = estimate_indices(blocks, resamples=0)
    assert found.second is not None
    problem = {"num_vars": 3, "names": list(THREE), "bounds": [[0.0, 1.0]] * 3}
    for k in range(2):
        theirs = salib_sobol.analyze(problem, cube[..., k].ravel(), num_resamples=2, seed=1)
        for ours, key in ((found.first, "S1"), (found.total, "ST"), (found.second, "S2")):
            np.testing.assert_allclose(ours[0, ..., k], theirs[key], rtol=0, atol=1e-10)


@pytest.mark.parametrize("second_order", [False, True])
def test_values_equal_scipys_on_equal_samples(second_order: bool) -> None:
    for blocks in (design_outputs(second_order=second_order)[0], random_blocks(5)):
        found = estimate_indices(blocks, resamples=0, centre="base")
        theirs = stats.sobol_indices(
            func={"f_A": blocks.A.T, "f_B": blocks.B.T, "f_AB": blocks.AB.transpose(1, 2, 0)},
            n=blocks.size,
        )
        np.testing.assert_allclose(found.first[0].T, theirs.first_order, rtol=0, atol=1e-10)
        np.testing.assert_allclose(found.total[0].T, theirs.total_order, rtol=0, atol=1e-10)


def test_the_two_centres_differ_by_less_than_the_interval() -> None:
    blocks, _ = design_outputs(second_order=True)
    centred = [estimate_indices(blocks, centre=centre, resamples=200) for centre in ("all", "base")]
    a, b = centred
    assert not np.array_equal(a.first[0], b.first[0])
    assert np.all(np.abs(a.first[0] - b.first[0]) <= a.first[2] - a.first[0] + 1e-12)
    np.testing.assert_allclose(a.total[0], b.total[0], rtol=1e-12)


def test_intervals_are_as_wide_as_salibs_bootstrap() -> None:
    # SALib: 1.96 standard deviations of resamples of points. Ours: t instead of z and the factor
    # sqrt(n / (n - 1)), both within 1 % for 128 points. 4,000 resamples scatter by about 1 %.
    blocks, rows = design_outputs(second_order=False)
    found = estimate_indices(blocks, resamples=4000)
    problem = {"num_vars": 4, "names": [*THREE, "dummy"], "bounds": [[0.0, 1.0]] * 4}
    theirs = salib_sobol.analyze(
        problem, rows[:, 0], calc_second_order=False, num_resamples=4000, seed=2
    )
    for table, key in ((found.first, "S1_conf"), (found.total, "ST_conf")):
        half = table[2, :3, 0] - table[0, :3, 0]
        np.testing.assert_allclose(half, theirs[key][:3], rtol=0.08)


# -- what does not change an index -----------------------------------------------------------


@QUIET
@given(
    scale=st.floats(1e-6, 1e6).flatmap(lambda s: st.sampled_from([s, -s])),
    shift=st.floats(-1e3, 1e3),
    seed=st.integers(0, 20),
    centre=st.sampled_from(["all", "base"]),
)
def test_scale_and_shift_of_an_output_change_only_its_variance(
    scale: float, shift: float, seed: int, centre: str
) -> None:
    blocks = random_blocks(seed, n=32)
    assert blocks.BA is not None

    def moved(values: Array) -> Array:
        return scale * (values + shift)

    assert centre in ("all", "base")
    other = Blocks(A=moved(blocks.A), B=moved(blocks.B), AB=moved(blocks.AB), BA=moved(blocks.BA))
    one, two = (
        estimate_indices(b, resamples=20, centre="all" if centre == "all" else "base")
        for b in (blocks, other)
    )
    assert one.second is not None
    assert two.second is not None
    for a, b in ((one.first, two.first), (one.total, two.total), (one.second, two.second)):
        np.testing.assert_allclose(a, b, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(two.variance, scale**2 * one.variance, rtol=1e-7)


@QUIET
@given(order=st.permutations(range(4)), seed=st.integers(0, 20))
def test_permuted_outputs_have_permuted_indices(order: list[int], seed: int) -> None:
    blocks = random_blocks(seed, n=32, m=4)
    assert blocks.BA is not None
    permuted = Blocks(
        A=blocks.A[:, order],
        B=blocks.B[:, order],
        AB=blocks.AB[..., order],
        BA=blocks.BA[..., order],
    )
    one, two = (estimate_indices(b, resamples=20) for b in (blocks, permuted))
    assert one.second is not None
    moved = Indices(
        one.first[..., order],
        one.total[..., order],
        one.first_sum[..., order],
        one.second[..., order],
        one.variance[order],
        one.blocks,
    )
    equal(moved, two, 1e-10)


def test_the_sum_of_first_order_indices_has_an_interval_of_its_own() -> None:
    found = estimate_indices(random_blocks(3, n=64, m=2), resamples=200)
    np.testing.assert_allclose(found.first_sum[0], found.first[0].sum(axis=0), rtol=1e-12)
    # Not the sum of the intervals: the indices of one sample go together.
    assert np.all(found.first_sum[1] < found.first_sum[0])
    half = found.first_sum[2] - found.first_sum[0]
    assert np.all(half < (found.first[2] - found.first[0]).sum(axis=0))


@QUIET
@given(order=st.permutations(range(3)), seed=st.integers(0, 20))
def test_permuted_factors_have_permuted_indices(order: list[int], seed: int) -> None:
    blocks = random_blocks(seed, n=32)
    assert blocks.BA is not None
    permuted = Blocks(A=blocks.A, B=blocks.B, AB=blocks.AB[:, order], BA=None)
    one = estimate_indices(Blocks(blocks.A, blocks.B, blocks.AB), resamples=20)
    two = estimate_indices(permuted, resamples=20)
    np.testing.assert_allclose(one.first[:, order], two.first, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(one.total[:, order], two.total, rtol=1e-10, atol=1e-10)


def test_an_output_has_the_same_indices_alone_and_among_others() -> None:
    blocks = random_blocks(1, m=5)
    assert blocks.BA is not None
    one = slice(2, 3)
    alone = Blocks(blocks.A[:, one], blocks.B[:, one], blocks.AB[..., one], blocks.BA[..., one])
    a, b = (estimate_indices(part, resamples=50) for part in (alone, blocks))
    np.testing.assert_allclose(a.first[..., 0], b.first[..., 2], rtol=1e-10)
    np.testing.assert_allclose(a.total[..., 0], b.total[..., 2], rtol=1e-10)


# -- seeds, replicates, layout ---------------------------------------------------------------


def test_intervals_are_reproducible_and_leave_the_global_generator_alone() -> None:
    blocks = random_blocks(2)
    np.random.seed(2)  # noqa: NPY002
    following = np.random.random(5)  # noqa: NPY002
    np.random.seed(2)  # noqa: NPY002
    equal(estimate_indices(blocks), estimate_indices(blocks))
    rng = np.random.default_rng
    seeded = estimate_indices(blocks, rng=rng(5))
    equal(seeded, estimate_indices(blocks, rng=rng(5)))
    other = estimate_indices(blocks, rng=rng(6))
    np.testing.assert_array_equal(seeded.first[0], other.first[0])
    assert not np.array_equal(seeded.first[1:], other.first[1:])
    np.testing.assert_array_equal(np.random.random(5), following)  # noqa: NPY002


def test_intervals_are_symmetric_and_shrink_towards_the_law_of_large_numbers() -> None:
    # Four times the base points, half the interval.
    small, large = (estimate_indices(random_blocks(4, n=n), resamples=1000) for n in (100, 400))
    for found in (small, large):
        np.testing.assert_allclose(found.first[1:].mean(axis=0), found.first[0], atol=1e-12)
        np.testing.assert_allclose(found.total[1:].mean(axis=0), found.total[0], atol=1e-12)
    ratio = (small.first[2] - small.first[1]) / (large.first[2] - large.first[1])
    assert 1.6 < ratio.mean() < 2.4


def test_names_of_replicates_do_not_matter() -> None:
    blocks = random_blocks(6)
    replicate = np.arange(64) % 16
    equal(estimate_indices(blocks, replicate), estimate_indices(blocks, 7 * replicate + 1000))


def test_replicates_of_one_base_point_are_base_points() -> None:
    blocks = random_blocks(6)
    equal(estimate_indices(blocks), estimate_indices(blocks, np.arange(64)))


def test_repeated_base_points_of_a_replicate_add_no_certainty() -> None:
    # Every base point four times: as replicates of four the interval is that of single points.
    blocks = random_blocks(7)
    repeated = Blocks(*(np.repeat(a, 4, axis=0) for a in (blocks.A, blocks.B, blocks.AB)))
    single = estimate_indices(Blocks(blocks.A, blocks.B, blocks.AB))
    together = estimate_indices(repeated, np.repeat(np.arange(64), 4))
    naive = estimate_indices(repeated)
    np.testing.assert_allclose(together.first, single.first, rtol=1e-10)
    np.testing.assert_allclose(together.total, single.total, rtol=1e-10)
    assert np.all(naive.total[2] - naive.total[1] < 0.7 * (single.total[2] - single.total[1]))


@pytest.mark.parametrize("case", ["no resamples", "one replicate"])
def test_without_a_spread_there_is_a_value_and_no_interval(case: str) -> None:
    blocks = random_blocks(8)
    if case == "no resamples":
        found = estimate_indices(blocks, resamples=0)
    else:
        found = estimate_indices(blocks, np.zeros(64, dtype=np.int64))
    for table in (found.first, found.total):
        assert np.isfinite(table[0]).all()
        assert np.isnan(table[1:]).all()


def test_second_order_fills_the_upper_triangle_alone() -> None:
    found = estimate_indices(random_blocks(9, d=4), resamples=10)
    assert found.second is not None
    assert found.second.shape == (3, 4, 4, 2)
    upper = np.triu(np.ones((4, 4), dtype=bool), k=1)
    assert np.isfinite(found.second[:, upper]).all()
    assert np.isnan(found.second[:, ~upper]).all()


@pytest.mark.parametrize("second_order", [False, True])
def test_rows_are_split_in_the_order_of_the_design(second_order: bool) -> None:
    d, n = 3, 5
    rows = 2 * d + 2 if second_order else d + 2
    numbers = np.arange(n * rows, dtype=float)[:, None] + np.array([0.0, 1000.0])
    blocks = split_blocks(numbers, d, second_order=second_order)
    starts = rows * np.arange(n)
    np.testing.assert_array_equal(blocks.A[:, 0], starts)
    np.testing.assert_array_equal(blocks.B[:, 0], starts + rows - 1)
    np.testing.assert_array_equal(blocks.AB[:, 1, 1], starts + 2 + 1000)
    assert blocks.AB.shape == (n, d, 2)
    assert blocks.size == n
    if second_order:
        assert blocks.BA is not None
        np.testing.assert_array_equal(blocks.BA[:, 2, 0], starts + d + 3)
    else:
        assert blocks.BA is None


@pytest.mark.parametrize("shape", [(0, 1), (7, 1), (9, 2), (10,), (5, 2, 1)])
def test_rows_that_are_no_blocks_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="shape"):
        split_blocks(np.zeros(shape), 3, second_order=False)


# -- what is refused and what has no index ---------------------------------------------------


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", ["A", "B", "AB", "BA"])
def test_values_that_are_not_finite_are_refused(place: str, bad: float) -> None:
    parts = {name: getattr(random_blocks(1), name).copy() for name in ("A", "B", "AB", "BA")}
    parts[place].flat[-1] = bad
    with pytest.raises(ValueError, match="finite"):
        estimate_indices(Blocks(**parts))


def test_one_base_point_is_refused() -> None:
    with pytest.raises(ValueError, match="two base points"):
        estimate_indices(random_blocks(1, n=1))


def beside_a_constant(constant: float, n: int) -> Indices:
    """Return the indices of a varying output and of one that is constant."""
    blocks = random_blocks(2, n=n, m=1)
    assert blocks.BA is not None

    def joined(values: Array) -> Array:
        return np.concatenate([values, np.full_like(values, constant)], axis=-1)

    return estimate_indices(
        Blocks(joined(blocks.A), joined(blocks.B), joined(blocks.AB), joined(blocks.BA)),
        resamples=50,
    )


def check_constant(found: Indices) -> None:
    assert found.second is not None
    upper = np.triu(np.ones((3, 3), dtype=bool), k=1)
    for table in (found.first, found.total, found.second[:, upper]):
        assert np.isnan(table[..., 1]).all()
        assert np.isfinite(table[..., 0]).all()


@pytest.mark.parametrize("n", [2, 16, 256])
@pytest.mark.parametrize("constant", [0.0, 1.0, -0.5, 1024.0])
def test_a_constant_output_has_no_indices(constant: float, n: int) -> None:
    check_constant(beside_a_constant(constant, n))


@pytest.mark.parametrize("n", [16, 100, 256, 1000])
@pytest.mark.parametrize("constant", [0.1, 1.0 / 3.0, 1e9 + 0.1, -7.3e-5])
def test_a_constant_output_whose_mean_rounds_has_no_indices(constant: float, n: int) -> None:
    check_constant(beside_a_constant(constant, n))


def test_an_output_that_varies_little_about_a_large_mean_keeps_its_indices() -> None:
    # Doubles about 1e6 are 1.2e-10 apart: a variation of 1 keeps ten digits.
    blocks = random_blocks(3)
    assert blocks.BA is not None
    far = Blocks(blocks.A + 1e6, blocks.B + 1e6, blocks.AB + 1e6, blocks.BA + 1e6)
    a, b = (estimate_indices(part, resamples=0) for part in (blocks, far))
    np.testing.assert_allclose(a.first[0], b.first[0], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(a.total[0], b.total[0], rtol=1e-6, atol=1e-8)


@pytest.mark.filterwarnings("error")
def test_an_output_that_rounding_alone_moves_does_not_vary() -> None:
    rng = np.random.default_rng(1)
    rows = 700.1 * (1.0 + 1e-15 * rng.integers(0, 5, (4 * 64, 1)))
    found = estimate_indices(split_blocks(rows, 2, second_order=False), resamples=20)
    assert found.variance.tolist() == [0.0]
    assert np.isnan(found.total).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("exponent", [-900, 900])
def test_indices_do_not_feel_a_power_of_two(exponent: int) -> None:
    rows = np.random.default_rng(2).normal(size=(4 * 64, 1))
    one, two = (
        estimate_indices(split_blocks(values, 2, second_order=False), resamples=20)
        for values in (rows, np.ldexp(rows, exponent))
    )
    np.testing.assert_array_equal(one.total, two.total)
    assert two.variance[0] > 0.0


def test_an_output_that_moves_outside_the_base_points_alone_has_no_index() -> None:
    rows = np.ones((4 * 64, 1))
    rows[9] = 5.0
    found = estimate_indices(split_blocks(rows, 2, second_order=False), resamples=20)
    assert np.isnan(found.variance).all()
    assert np.isnan(found.total).all()
