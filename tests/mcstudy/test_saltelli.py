"""Saltelli's design: what is exchanged, what a larger design keeps, what the dummy feels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from mcstudy_tools import Array, generator, global_generator_left_alone, quiet
from numpy.testing import assert_array_equal
from scipy import special

from mcstudy.sampling.factors import DUMMY, PERTURBATION, factors_of, perturbed
from mcstudy.sampling.saltelli import SCRAMBLES, Saltelli, block_size, draw_saltelli
from mcstudy.sensitivity.sobol import estimate_indices, split_blocks

INPUTS = ("a", "b", "c", "d", "e")
GROUPS = {"pair": ["b", "d"]}


def blocks_of(design: Saltelli) -> Array:
    """Return the design by block, (n, block, d)."""
    return design.uniforms.reshape(-1, design.block, design.uniforms.shape[1])


def indices_of(design: Saltelli, outputs: Array) -> tuple[Array, Array]:
    """Return first and total indices of one output of a first-order design."""
    blocks = split_blocks(outputs[:, None], len(design.factors), second_order=False)
    found = estimate_indices(blocks, design.scramble[:: design.block], resamples=0)
    return found.first[0, :, 0], found.total[0, :, 0]


@pytest.mark.parametrize(("second_order", "block"), [(False, 7), (True, 12)])
def test_a_design_has_a_block_a_base_point(second_order: bool, block: int) -> None:
    # Saltelli 2002: d + 2 rows a base point for first and total, 2 d + 2 for second order.
    design = draw_saltelli(INPUTS, GROUPS, 64, 3, second_order=second_order)
    assert design.factors == ("a", "pair", "c", "e", DUMMY)
    assert design.block == block_size(design.factors, second_order=second_order) == block
    assert design.uniforms.shape == (64 * block, 5)
    assert_array_equal(design.scramble, np.repeat(np.arange(64) % 16, block))


def test_factors_stand_where_their_first_input_stands() -> None:
    assert factors_of(INPUTS, {}) == (*INPUTS, DUMMY)
    assert factors_of(INPUTS, {"all": list(INPUTS)}) == ("all", DUMMY)
    assert factors_of(INPUTS, {"late": ["e", "a"], "b2": ["b"]}) == ("late", "b2", "c", "d", DUMMY)


@pytest.mark.parametrize("groups", [{}, GROUPS, {"first": ["e", "a", "c"], "single": ["d"]}])
@pytest.mark.parametrize("second_order", [False, True])
def test_rows_of_a_block_differ_by_a_factor(
    groups: dict[str, list[str]], second_order: bool
) -> None:
    design = draw_saltelli(INPUTS, groups, 64, 5, second_order=second_order)
    cube, d = blocks_of(design), len(design.factors)
    a, b = cube[:, 0], cube[:, -1]
    for start, base, donor in [(1, a, b), (1 + d, b, a)][: 1 + second_order]:
        for k, factor in enumerate(design.factors):
            row = cube[:, start + k]
            moved, from_donor = np.abs(row - base), np.abs(row - donor)
            if factor == DUMMY:
                # Two nudges of at most 1e-4 each, of every input its own.
                assert np.all(
                    (moved.max(axis=0) > PERTURBATION) & (moved.max(axis=0) <= 2.0 * PERTURBATION)
                )
                assert len(np.unique(np.round(moved[0], 12))) == 5
                continue
            members = np.isin(INPUTS, groups.get(factor, [factor]))
            # The value comes from the other base point, its nudge from this one.
            assert from_donor[:, members].max() <= 2.0 * PERTURBATION
            assert (moved[:, members] > 2.0 * PERTURBATION).mean() > 0.99
            assert_array_equal(row[:, ~members], base[:, ~members])


@pytest.mark.parametrize("groups", [{}, GROUPS])
@pytest.mark.parametrize("second_order", [False, True])
def test_a_design_begins_with_the_smaller(groups: dict[str, list[str]], second_order: bool) -> None:
    small, large = (
        draw_saltelli(INPUTS, groups, n, 9, second_order=second_order) for n in (64, 256)
    )
    assert_array_equal(large.uniforms[: len(small.uniforms)], small.uniforms)
    assert_array_equal(large.scramble[: len(small.scramble)], small.scramble)


def test_designs_are_a_function_of_the_seed_alone() -> None:
    with global_generator_left_alone():
        one, two, other = (draw_saltelli(INPUTS, {}, 64, seed).uniforms for seed in (4, 4, 5))
    assert_array_equal(one, two)
    assert not np.isin(other, one).any()


def test_scrambles_share_no_value() -> None:
    cube = blocks_of(draw_saltelli(INPUTS, {}, 128, 4))[:, [0, -1]].reshape(8, SCRAMBLES, -1)
    for k in range(1, SCRAMBLES):
        assert not np.isin(cube[:, k], cube[:, :k]).any()


def test_every_row_of_a_block_is_uniform_inside_the_cube() -> None:
    # The 64 points of a scramble are a net: one in each 64th of every column (H. Niederreiter,
    # Random Number Generation and Quasi-Monte Carlo Methods, 1992, section 4.1), moved by a nudge.
    points = np.sort(blocks_of(draw_saltelli(INPUTS, {}, 1024, 2)), axis=0)
    middles = (np.arange(1024) + 0.5) / 1024
    assert np.abs(points - middles[:, None, None]).max() <= 1.0 / 64.0 + PERTURBATION
    assert 0.0 < points.min() < points.max() < 1.0


def test_base_points_and_their_donors_are_unrelated() -> None:
    # Two columns of a scramble of few points may correlate by up to about 0.4, with either sign (a
    # poor projection of Sobol's sequence): a mean over 16 scrambles and 16 designs scatters by at
    # most 0.4 / 16, four of these. Nearly all pairs correlate less than independent points do.
    tables = []
    for seed in range(16):
        cube = blocks_of(draw_saltelli(INPUTS, {}, 256, seed))
        tables.append(np.corrcoef(np.concatenate([cube[:, 0], cube[:, -1]], axis=1).T))
    off = ~np.eye(10, dtype=bool)
    assert np.abs(np.mean(tables, axis=0)[off]).max() < 0.1
    assert np.median(np.abs(np.array(tables)[:, off])) < 1.0 / 16.0


@quiet(50)
@given(
    hnp.arrays(float, (5, 3), elements=st.floats(0.0, 1.0)),
    hnp.arrays(float, 5, elements=st.floats(0.0, 1.0)),
)
def test_a_nudge_is_small_and_stays_in_the_cube(uniforms: Array, dummy: Array) -> None:
    moved = perturbed(uniforms, dummy)
    assert np.abs(moved - uniforms).max() <= PERTURBATION * (1.0 + 1e-9)
    assert 0.0 <= moved.min() <= moved.max() <= 1.0


def test_a_nudge_keeps_a_uniform_uniform() -> None:
    # Reflection keeps the uniform law; about a border as anywhere. 1,000 of 1e5 are expected below
    # 0.01 and above 0.99, with a standard deviation of 31.
    rng = generator(3)
    moved = perturbed(rng.random((100_000, 1)), rng.random(100_000))
    assert abs((moved < 0.01).sum() - 1000) < 130
    assert abs((moved > 0.99).sum() - 1000) < 130
    assert abs((moved < PERTURBATION).sum() - 10) <= 13


def test_the_dummy_of_a_chaotic_function_has_all_of_it() -> None:
    # sin(1e6 u) turns by up to 100 rad within a nudge: outputs that differ in the dummy correlate
    # by J0(100)^2 = 4e-4 (mean of exp(i z sin t) over a turn: Abramowitz and Stegun, 9.1.21).
    design = draw_saltelli(INPUTS, {}, 1024, 1)
    first, total = indices_of(design, np.sin(1e6 * design.uniforms[:, 0]))
    assert total[-1] == pytest.approx(1.0 - special.j0(1e6 * PERTURBATION) ** 2, abs=0.1)
    assert total[0] == pytest.approx(1.0, abs=0.1)
    assert abs(first[-1]) < 0.15
    assert_array_equal(total[1:5], 0.0)


def test_the_dummys_total_is_the_share_of_the_noise() -> None:
    # u has variance 1/12, 0.2 sin(1e6 v) has 0.02.
    design = draw_saltelli(INPUTS, {}, 1024, 6)
    u = design.uniforms
    first, total = indices_of(design, u[:, 0] + 0.2 * np.sin(1e6 * u[:, 1]))
    assert total[-1] == pytest.approx(0.02 / (0.02 + 1.0 / 12.0), rel=0.1)
    assert first[0] == pytest.approx((1.0 / 12.0) / (0.02 + 1.0 / 12.0), rel=0.1)


def test_a_group_explains_what_its_members_explain_together() -> None:
    # f = b d + a, uniforms: V(b d) = 1/9 - 1/16 = 7/144, V(a) = 12/144. The product's interaction
    # lies within the group, so its first and total index are both 7/19. The product scatters them
    # by about 0.016 (intervals of 0.03 either way).
    design = draw_saltelli(INPUTS, GROUPS, 1024, 8)
    u = design.uniforms
    first, total = indices_of(design, u[:, 1] * u[:, 3] + u[:, 0])
    place = design.factors.index("pair")
    assert [first[place], total[place], first[0]] == pytest.approx(
        [7 / 19, 7 / 19, 12 / 19], abs=0.06
    )
