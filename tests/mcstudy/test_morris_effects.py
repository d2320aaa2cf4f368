"""Morris screening: the design, effects of functions with known ones, SALib on equal samples."""

from itertools import pairwise

import numpy as np
import pytest
from mcstudy_tools import Array, global_generator_left_alone
from numpy.testing import assert_allclose, assert_array_equal
from SALib.analyze import morris as salib_morris
from SALib.sample import morris as salib_sample
from scipy import integrate

from mcstudy.sampling import seeds
from mcstudy.sampling.factors import DUMMY, PERTURBATION
from mcstudy.sampling.morris import TAIL, Trajectories, draw_trajectories
from mcstudy.sensitivity.morris import ElementaryEffects, estimate_effects

INPUTS = ("a", "b", "c", "d")
GROUPS = {"pair": ["b", "d"]}
SLOPES = np.array([1.0, -2.0, 0.5, 3.0])
SPAN = 1.0 - 2.0 * TAIL
"""Range of the uniforms: the levels 0 to 1 are the probabilities 0.025 to 0.975."""


def curved(u: Array) -> Array:
    """Return an output with curvature and interaction, all effects non-zero."""
    return np.asarray(np.exp(u[:, 0]) + u[:, 1] * u[:, 2] + (u[:, 3] - 0.3) ** 2)


def effects_of(
    design: Trajectories,
    outputs: Array,
    groups: dict[str, list[str]] | None = None,
    levels: int = 4,
    **more: int,
) -> ElementaryEffects:
    """Return the effects of an output of a design of the four inputs."""
    more = {"resamples": 200} | more
    return estimate_effects(INPUTS, groups or {}, design.levels, outputs, levels, **more)


@pytest.mark.parametrize("levels", [2, 4, 6, 10])
@pytest.mark.parametrize("groups", [{}, GROUPS])
def test_a_trajectory_changes_every_factor_once_by_one_large_step(
    groups: dict[str, list[str]], levels: int
) -> None:
    # Morris 1991: steps of p / (2 (p - 1)) on p levels; here of half of it up to all of it.
    design = draw_trajectories(INPUTS, groups, 12, levels, 3)
    names = np.array([*INPUTS, DUMMY])
    assert design.factors == (("a", "pair", "c", DUMMY) if groups else (*INPUTS, DUMMY))
    assert design.block == len(design.factors) + 1
    assert design.levels.shape == (12 * design.block, 5)
    assert_array_equal(design.trajectory, np.repeat(np.arange(12), design.block))
    assert 0.0 <= design.levels.min() <= design.levels.max() <= 1.0 + 1e-12
    largest = levels / (2.0 * (levels - 1))
    sizes = []
    cubes = design.levels.reshape(12, design.block, 5)
    assert len(np.unique(cubes.reshape(12, -1), axis=0)) == 12
    for rows in cubes:
        steps = np.abs(np.diff(rows, axis=0))
        changed = steps > 1e-9
        sizes.append(float(steps[changed].mean()))
        assert_allclose(steps[changed], sizes[-1])
        seen = [sorted(names[row]) for row in changed]
        assert sorted(seen) == sorted(sorted(groups.get(f, [f])) for f in design.factors)
    assert 0.5 * largest <= min(sizes) < 0.6 * largest
    assert 0.85 * largest < max(sizes) <= largest


def test_uniforms_span_the_middle_of_the_probabilities() -> None:
    design = draw_trajectories(INPUTS, {}, 200, 4, 1)
    assert TAIL == 0.025
    assert np.abs(design.uniforms - (TAIL + SPAN * design.levels[:, :4])).max() <= PERTURBATION
    assert 0.02 < design.uniforms.min() < design.uniforms.max() < 0.98
    # The inputs of a trajectory lie on grids of their own.
    starts = design.levels[:: design.block, :4]
    assert len(np.unique(np.round(starts, 6))) == starts.size
    assert starts.min() < 0.02 and starts.max() > 0.98


@pytest.mark.parametrize("levels", [4, 6, 10, 20])
@pytest.mark.parametrize("period", [1.0 / 3.0, 0.5, 10.0 / 19.0, 2.0 / 3.0])
def test_no_periodic_input_hides_behind_the_step(levels: int, period: float) -> None:
    # A sine repeats itself after one Morris step, 10/19 of 20 levels or 2/3 of 4; with steps of
    # any size its mean size is that of a sine's differences, never near nothing.
    design = draw_trajectories(INPUTS, {}, 200, levels, 1)
    found = effects_of(design, np.sin(2.0 * np.pi * design.levels[:, 0] / period), levels=levels)
    # Of points at random the mean of |sin - sin| is 8 / pi^2, over steps of at most 2/3.
    assert found.mu_star[0, 0] > 0.8 * (8.0 / np.pi**2) / (2.0 / 3.0)


@pytest.mark.parametrize("groups", [{}, GROUPS])
def test_designs_go_by_their_seed_and_begin_with_the_smaller(groups: dict[str, list[str]]) -> None:
    with global_generator_left_alone():
        few, many, other = (
            draw_trajectories(INPUTS, groups, n, 4, seed) for n, seed in ((7, 8), (31, 8), (7, 9))
        )
        effects_of(few, curved(few.uniforms), groups)
    assert_array_equal(many.levels[: len(few.levels)], few.levels)
    assert_array_equal(many.uniforms[: len(few.uniforms)], few.uniforms)
    assert not np.array_equal(other.levels, few.levels)


@pytest.mark.parametrize("levels", [4, 6, 10])
def test_effects_of_a_linear_function_are_its_slopes_over_the_span(levels: int) -> None:
    # f = c u and u = 0.025 + 0.95 level: every effect is 0.95 c, the same everywhere.
    design = draw_trajectories(INPUTS, {}, 20, levels, 2)
    found = effects_of(design, 7.0 + design.uniforms @ SLOPES, levels=levels)
    assert_allclose(found.mean[:4], SPAN * SLOPES, rtol=1e-9)
    assert_allclose(found.mu_star[:, :4], [SPAN * np.abs(SLOPES)] * 3, rtol=1e-9)
    assert_allclose(found.sigma[:4], 0.0, atol=1e-9)
    assert found.trajectories == 20
    # The dummy moves every input by two nudges of 1e-4 at most, over half a step.
    limit = 2.0 * PERTURBATION * np.abs(SLOPES).sum() / (0.5 * levels / (2.0 * (levels - 1)))
    assert 0.0 < found.mu_star[0, -1] <= limit < 0.01 * found.mu_star[0, :4].min()


def test_effects_of_a_product_have_their_known_mean_and_spread() -> None:
    # f = a b: the effect of a is 0.95 u_b of mean 0.95 * 0.5. u_b is a place w + s l of a grid of
    # size s, uniform from 1/2 to 1, that begins at w, uniform up to 1 - s, and has four levels l
    # of variance 5/36: its variance is E (1 - s)^2 / 12 + E s^2 5/36 with E (1 - s)^2 = 1/12 and
    # E s^2 = 7/12. 1,000 trajectories scatter about the mean by 0.28 / sqrt(1000) = 0.009.
    design = draw_trajectories(INPUTS, {}, 1000, 4, 2)
    found = effects_of(design, design.uniforms[:, 0] * design.uniforms[:, 1], resamples=10)
    assert found.mean[:2] == pytest.approx([0.475, 0.475], abs=0.04)
    assert found.mu_star[0, :2] == pytest.approx(found.mean[:2], rel=1e-12)
    spread = SPAN**2 * np.sqrt(1.0 / 144.0 + 7.0 / 12.0 * 5.0 / 36.0)
    assert found.sigma[:2] == pytest.approx([spread] * 2, rel=0.06)
    assert_array_equal(found.mu_star[:, 2:4], 0.0)


def test_effects_of_a_bowl_have_a_mean_of_nought_and_a_size() -> None:
    # f = (u - 1/2)^2: a step between places x1 and x2 has the effect 0.95^2 (x1 + x2 - 1). On a
    # grid of size s from w, levels 0 to 2/3 or 1/3 to 1: |2 w - (1 - s) -+ s/3| on average.
    def size(w: float, s: float) -> float:
        return abs(2.0 * w - (1.0 - s) + s / 3.0) / (1.0 - s)

    expected = SPAN**2 * 2.0 * integrate.dblquad(size, 0.5, 1.0, 0.0, lambda s: 1.0 - s)[0]
    design = draw_trajectories(INPUTS, {}, 2000, 4, 2)
    bowl = (design.levels[:, 2] * SPAN + TAIL - 0.5) ** 2
    found = effects_of(design, bowl, resamples=10)
    assert found.mu_star[0, 2] == pytest.approx(expected, rel=0.03)
    assert abs(found.mean[2]) < 4.0 * found.sigma[2] / np.sqrt(2000)


@pytest.mark.parametrize("levels", [4, 8])
def test_effects_are_those_computed_step_by_step(levels: int) -> None:
    # Morris 1991, equation 1: the change of the output over that of the level that changed.
    design = draw_trajectories(INPUTS, {}, 25, levels, 6)
    outputs = curved(design.uniforms)
    effects = np.full((25, 5), np.nan)
    for r in range(25):
        for one, other in pairwise(range(r * design.block, (r + 1) * design.block)):
            step = design.levels[other] - design.levels[one]
            changed = int(np.argmax(np.abs(step)))
            effects[r, changed] = (outputs[other] - outputs[one]) / step[changed]
    found = effects_of(design, outputs, levels=levels)
    assert_allclose(found.mean, effects.mean(axis=0), rtol=1e-9, atol=1e-12)
    assert_allclose(found.mu_star[0], np.abs(effects).mean(axis=0), rtol=1e-9)
    assert_allclose(found.sigma, effects.std(axis=0, ddof=1), rtol=1e-9, atol=1e-12)


def test_effects_equal_salibs_on_salibs_sample() -> None:
    problem = {"num_vars": 5, "names": [*INPUTS, DUMMY], "bounds": [[0.0, 1.0]] * 5}
    rows = salib_sample.sample(problem, 25, num_levels=4, seed=6)
    outputs = curved(rows)
    theirs = salib_morris.analyze(
        problem, rows, outputs, num_resamples=300, num_levels=4,
        seed=seeds.generator(5, seeds.BOOTSTRAP),
    )  # fmt: skip
    found = estimate_effects(INPUTS, {}, rows, outputs, 4, resamples=300, seed=5)
    assert_allclose(found.mean, theirs["mu"], rtol=1e-12)
    assert_allclose(found.mu_star[0], theirs["mu_star"], rtol=1e-12)
    assert_allclose(found.sigma, theirs["sigma"], rtol=1e-12)
    reach = np.asarray(theirs["mu_star_conf"], dtype=float)
    assert_allclose(found.mu_star[2] - found.mu_star[0], reach, rtol=1e-9)
    assert_allclose(found.mu_star[0] - found.mu_star[1], reach, rtol=1e-9)


def test_a_group_has_a_size_and_neither_sign_nor_spread() -> None:
    design = draw_trajectories(INPUTS, GROUPS, 40, 4, 6)
    outputs = curved(design.uniforms)
    found = effects_of(design, outputs, GROUPS)
    place = design.factors.index("pair")
    for table in (found.mean, found.sigma):
        assert_array_equal(np.isnan(table), np.arange(len(design.factors)) == place)
    # Campolongo et al. 2007, section 4.2: the size of the change when all members move a step.
    steps = np.abs(np.diff(design.levels[:, 1].reshape(40, -1), axis=1))
    moved = steps > 1e-9
    sizes = np.abs(np.diff(outputs.reshape(40, -1), axis=1))[moved] / steps[moved]
    assert sizes.shape == (40,)
    assert found.mu_star[0, place] == pytest.approx(sizes.mean(), rel=1e-9)
    # The interval is 1.96 standard errors of the mean; 200 resamples scatter by about 5 %.
    reach = 1.96 * sizes.std() / np.sqrt(40)
    assert found.mu_star[2, place] - sizes.mean() == pytest.approx(reach, rel=0.2)


@pytest.mark.parametrize("levels", [4, 6, 8])
def test_the_dummy_of_a_chaotic_function_is_as_large_as_its_input(levels: int) -> None:
    design = draw_trajectories(INPUTS, {}, 200, levels, 1)
    found = effects_of(design, np.sin(1e7 * design.uniforms[:, 1]), levels=levels)
    assert found.mu_star[0, -1] > 0.5 * found.mu_star[0, 1]


@pytest.mark.parametrize("trials", [20, pytest.param(120, marks=pytest.mark.slow)])
def test_intervals_of_the_mean_size_cover(trials: int) -> None:
    # f = a b c d: the effect of a is 0.95 u_b u_c u_d, three levels of mean 1/2: 0.95 / 8.
    truth, inside = SPAN / 8.0, []
    for seed in range(trials):
        design = draw_trajectories(INPUTS, {}, 30, 4, seed)
        u = TAIL + SPAN * design.levels[:, :4]
        found = effects_of(design, u.prod(axis=1)).mu_star[:, :4]
        inside.append((found[1] <= truth) & (truth <= found[2]))
    rates, more = np.mean(inside, axis=0), np.sqrt(120 / trials)
    # A normal interval of 30 skewed effects misses some more than it should.
    assert np.all((rates >= 0.95 - 0.11 * more) & (rates <= 0.95 + 0.04 * more)), rates
    assert 0.95 - 0.07 * more <= rates.mean() <= 0.95 + 0.03 * more


def test_intervals_are_reproducible() -> None:
    design = draw_trajectories(INPUTS, {}, 10, 4, 6)
    outputs = curved(design.uniforms)
    one, again, other = (effects_of(design, outputs, seed=s).mu_star for s in (3, 3, 4))
    assert_array_equal(one, again)
    assert_array_equal(one[0], other[0])
    assert not np.array_equal(one[1:], other[1:])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_outputs_that_are_not_finite_and_one_trajectory_are_refused(bad: float) -> None:
    design = draw_trajectories(INPUTS, {}, 10, 4, 6)
    outputs = np.where(np.arange(len(design.levels)) == 17, bad, curved(design.uniforms))
    with pytest.raises(ValueError, match="finite"):
        effects_of(design, outputs)
    design = draw_trajectories(INPUTS, {}, 1, 4, 6)
    with pytest.raises(ValueError, match="two trajectories"):
        effects_of(design, curved(design.uniforms))


def test_a_constant_output_has_no_effect() -> None:
    design = draw_trajectories(INPUTS, {}, 10, 4, 6)
    found = effects_of(design, np.full(len(design.levels), 0.1))
    for table in (found.mean, found.mu_star, found.sigma):
        assert_array_equal(table, 0.0)
