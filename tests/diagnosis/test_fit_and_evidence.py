"""The fit and its evidence against dense linear algebra, on a model that is linear."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from linear_tests import BUMP, Linear, make_problem
from numpy.typing import NDArray
from scipy import optimize, stats

from mcstudy.diagnosis.base_model import fit_base
from mcstudy.diagnosis.fit import Fit, fit, start_scores
from mcstudy.diagnosis.layout import Layout, Scatter, lay_out
from mcstudy.diagnosis.marginal import Marginal, log_bayes_factor, quadratic_form
from mcstudy.diagnosis.model_selection import examine, rank_causes
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.diagnosis.problem import Observation, Problem, Scalar, Signal, Test
from mcstudy.diagnosis.repeatability import settle
from mcstudy.diagnosis.search import UNEXPLAINED, search

SCATTER = Scatter(0.01, 0.003)


def layouts_of(problem: Problem) -> list[Layout]:
    found = []
    for test in problem.tests:
        seen = problem.simulate({**test.inputs, "scale": 0.0}, {})
        assert seen is not None
        found.append(lay_out(test, seen))
    return found


def dense(fitted: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Return the slopes of all scores (own ones first) and the residual at scores of zero."""
    own = [a.shape[1] for a in fitted.own_slopes]
    rows = [r.size for r in fitted.residuals]
    shared = fitted.scores.shared.size
    table = np.zeros((sum(rows), sum(own) + shared))
    whole = []
    top = left = 0
    for r, a, b, z in zip(fitted.residuals, fitted.own_slopes, fitted.shared_slopes,
                          fitted.scores.own, strict=True):  # fmt: skip
        table[top : top + r.size, left : left + a.shape[1]] = a
        table[top : top + r.size, sum(own) :] = b
        whole.append(r + a @ z + b @ fitted.scores.shared)
        top, left = top + r.size, left + a.shape[1]
    return table, np.concatenate(whole)


@pytest.fixture(scope="module")
def fitted() -> Fit:
    problem = make_problem(3)
    layouts = layouts_of(problem)
    return fit(problem, layouts, (), start_scores(layouts, 1), SCATTER)


def test_the_most_probable_scores_are_those_of_regularised_least_squares(fitted: Fit) -> None:
    table, whole = dense(fitted)
    best = np.linalg.solve(np.eye(table.shape[1]) + table.T @ table, table.T @ whole)
    found = np.concatenate([*fitted.scores.own, fitted.scores.shared])
    # The fit ends 0.05 log units from the top, along speed against level a tenth of a score.
    np.testing.assert_allclose(found, best, atol=0.15)


def test_covariance_of_shared_values_is_that_of_the_whole_system(fitted: Fit) -> None:
    table, _ = dense(fitted)
    whole = np.linalg.inv(np.eye(table.shape[1]) + table.T @ table)
    np.testing.assert_allclose(fitted.covariance, whole[-1:, -1:], rtol=1e-8)


def test_evidence_is_the_density_of_the_data_with_all_scores_integrated_out(fitted: Fit) -> None:
    table, whole = dense(fitted)
    covariance = np.eye(whole.size) + table @ table.T
    exact = stats.multivariate_normal(cov=covariance).logpdf(whole)
    # Noise is common to all models and left out.
    ours = fitted.log_evidence - 0.5 * whole.size * np.log(2.0 * np.pi)
    assert ours == pytest.approx(exact, abs=0.3)


def test_scores_and_information_of_shapes_are_those_of_the_whole_covariance(fitted: Fit) -> None:
    layouts = layouts_of(make_problem(3))
    rng = np.random.default_rng(0)
    shapes = [rng.standard_normal((r.size, 3)) for r in fitted.residuals]
    marginal = Marginal(fitted, layouts, shapes)
    reduced = marginal.reduce(marginal.measured(), SCATTER)
    table, whole = dense(fitted)
    inverse = np.linalg.inv(np.eye(whole.size) + table @ table.T)
    columns = np.concatenate(shapes)
    np.testing.assert_allclose(reduced.information, columns.T @ inverse @ columns, rtol=1e-6)
    np.testing.assert_allclose(reduced.score[0], columns.T @ inverse @ whole, rtol=1e-6, atol=1e-6)
    determinant = np.linalg.slogdet(np.eye(whole.size) + table @ table.T)[1]
    exact = -0.5 * (whole @ inverse @ whole + determinant)
    assert reduced.log_likelihood[0] - 0.5 * whole @ whole == pytest.approx(exact, abs=1e-6)


class Curved(Linear):
    """The linear model with a pulse that goes with the square of the speed."""

    def __call__(
        self, inputs: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]
    ) -> Observation | None:
        squared = inputs["impact_speed"] ** 2
        return super().__call__({**inputs, "impact_speed": squared}, effects)


def test_slopes_of_an_exact_fit_are_those_at_the_most_probable_speeds() -> None:
    """One-sided differences over half a latent stop a fit of confounded values halfway."""
    problem = replace(make_problem(3, speed_sd=1.0), simulate=Curved())
    layouts = layouts_of(problem)
    found = fit(problem, layouts, (), start_scores(layouts, 1), SCATTER)
    for k, (layout, own) in enumerate(zip(layouts, found.scores.own, strict=True)):
        speed = layout.test.inputs["impact_speed"] + float(own[0])
        height = 10.0 * speed**2 + 3.0 * found.scores.shared[0]
        time, values = found.observations[k].signals["head_acceleration"]
        one, none = (
            layout.whitened(Observation({"head_acceleration": (time, values * share)}, {}), own)
            for share in (1.0 / height, 0.0)
        )
        pulse = one - none
        slope = found.slopes.doubtful[k][:, 0] @ pulse / (pulse @ pulse)
        assert slope == pytest.approx(20.0 * speed, rel=0.02)


def test_another_repeatability_is_another_covariance(fitted: Fit) -> None:
    layouts = layouts_of(make_problem(3))
    other = Scatter(0.03, 0.001)
    shapes = [np.ones((r.size, 1)) for r in fitted.residuals]
    marginal = Marginal(fitted, layouts, shapes)
    ours = marginal.reduce(marginal.measured(), other).information
    table, whole = dense(fitted)
    scale = np.ones(table.shape[1])
    left = 0
    for layout in layouts:
        part = slice(left, left + layout.scattering.size)
        ratio = layout.scatter_sizes(other) / layout.scatter_sizes(SCATTER)
        scale[part][layout.scattering] = ratio
        left += layout.scattering.size
    inverse = np.linalg.inv(np.eye(whole.size) + (table * scale) @ (table * scale).T)
    columns = np.concatenate(shapes)
    np.testing.assert_allclose(ours, columns.T @ inverse @ columns, rtol=1e-6)


def test_drawn_data_have_the_mean_squares_of_the_model(fitted: Fit) -> None:
    layouts = layouts_of(make_problem(3))
    rng = np.random.default_rng(1)
    shapes = [rng.standard_normal((r.size, 2)) for r in fitted.residuals]
    marginal = Marginal(fitted, layouts, shapes)
    reduced = marginal.reduce(marginal.draw(4000, SCATTER, rng), SCATTER)
    np.testing.assert_allclose(np.cov(reduced.score.T), reduced.information, rtol=0.15)


def test_log_bayes_factor_of_one_shape() -> None:
    # Score s with information i under a coefficient N(0, 1): N(s; 0, i + i^2) over N(s; 0, i).
    s, i = 3.0, 2.0
    exact = stats.norm(0, np.sqrt(i + i * i)).logpdf(s) - stats.norm(0, np.sqrt(i)).logpdf(s)
    ours = log_bayes_factor(np.array([[i]]), np.array([[s]]))[0]
    assert ours == pytest.approx(exact, rel=1e-12)


def test_explained_sum_of_squares_counts_equal_shapes_once() -> None:
    information = np.array([[2.0, 2.0], [2.0, 2.0]])
    value, rank = quadratic_form(information, np.array([[3.0, 3.0]]))
    assert rank == 1
    assert value[0] == pytest.approx(3.0**2 / 2.0)


def test_a_cause_is_found_with_its_size_within_its_interval() -> None:
    problem = make_problem(5, bump=0.7)
    layouts, base = fit_base(problem)
    best = rank_causes(problem, layouts, settle(problem, layouts, base), [BUMP], 1, 5)[0]
    size, error = best.fitted.scores.shared[1], np.sqrt(best.fitted.covariance[1, 1])
    assert best.log_evidence > 10.0
    assert abs(size - 0.7) < 4.0 * error < 0.4


def test_no_cause_no_alarm_and_a_cause_is_named() -> None:
    assert search(make_problem(6), [BUMP]).adequate
    found = search(make_problem(7, bump=1.0), [BUMP])
    assert (found.cause, found.ambiguous, found.second) == ("bump", (), None)
    assert search(make_problem(7, bump=1.0), []).cause == UNEXPLAINED


@pytest.mark.slow
def test_p_values_of_data_that_the_model_makes_are_uniform() -> None:
    p = np.array([search(make_problem(100 + k), []).screening.p_value for k in range(40)])
    assert stats.kstest(p, "uniform").pvalue > 0.01
    assert np.mean(p <= 0.05) <= 0.15


def test_scores_stay_where_a_quantile_can_follow() -> None:
    problem = make_problem(8, bump=30.0)
    layouts, base = fit_base(problem)
    assert np.all(np.abs(base.scores.shared) <= 8.0)
    assert isinstance(base.scores, Scores)
    assert len(layouts) == len(problem.tests)


class Scattered:
    """One throw a test, N(0, 1); the effect ``loose`` scatters it, ``shifted`` moves it."""

    def __init__(self, widen: bool) -> None:
        self.widen = widen

    def __call__(
        self, _inputs: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]
    ) -> Observation:
        size = effects["bump"]["size"] if "bump" in effects else 0.0
        return Observation({}, {"throw": size}, {"throw": np.exp(size)} if self.widen else {})


@pytest.mark.parametrize("widen", [True, False])
def test_a_cause_may_widen_the_scatter_of_scalars(widen: bool) -> None:
    """Sixty values N(1, e): the cause that widens explains them, the mere shift leaves structure.

    The most probable size minimises the sum of squares over exp(2 s), with 60 s and s^2 / 2 added.
    """
    values = 1.0 + np.e * stats.norm.ppf((np.arange(60) + 0.5) / 60)
    np.random.default_rng(2).shuffle(values)
    tests = tuple(
        Test(f"t{k}", {}, {}, (), (Scalar("throw", v, 1.0, scatters=False),), (),
             {"order": float(k)})
        for k, v in enumerate(values)
    )  # fmt: skip
    problem = Problem(tests, (), Scattered(widen), {})
    layouts, base = fit_base(problem)
    best = rank_causes(problem, layouts, base, [BUMP], 1, 5)[0]
    if widen:

        def cost(s: float) -> float:
            return 0.5 * float(np.sum((values - s) ** 2)) * np.exp(-2 * s) + 60 * s + s * s / 2

        exact = optimize.minimize_scalar(cost, bounds=(-1.0, 3.0), method="bounded")
        assert best.fitted.misfit == pytest.approx(exact.fun, abs=0.5)
        assert best.fitted.scores.shared[0] == pytest.approx(exact.x, abs=0.1)
    p_value = examine(problem, layouts, best.fitted, best.log_evidence).p_value
    assert (p_value > 0.05) == widen


class Counted(Linear):
    """The linear model with a counter, and causes that change nothing like the bump."""

    runs = 0

    def __call__(
        self, inputs: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]
    ) -> Observation | None:
        Counted.runs += 1
        found = super().__call__(inputs, effects)
        assert found is not None
        time, values = found.signals["head_acceleration"]
        for name, parameters in effects.items():
            if name.startswith("other"):
                place = -0.002 + 0.001 * int(name[5:])
                early = np.exp(-0.5 * ((time - place) / 0.0004) ** 2)
                values = values + parameters["size"] * early
        return Observation({"head_acceleration": (time, values)}, {})


def test_a_dear_model_takes_fewer_runs_to_the_same_answer() -> None:
    others = [
        replace(BUMP, name=f"other{k}", forms=(replace(BUMP.forms[0], cause=f"other{k}"),))
        for k in range(10)
    ]
    whole = replace(make_problem(7, bump=1.0), simulate=Counted())
    runs, answers = [], []
    for dear in (False, True):
        Counted.runs = 0
        found = search(replace(whole, dear=dear), [*others, BUMP])
        runs.append(Counted.runs)
        answers.append((found.cause, found.ambiguous, found.second))
    assert answers == [("bump", (), None)] * 2
    assert runs[1] < 0.9 * runs[0]


@pytest.mark.parametrize(
    ("late", "peak", "shift"), [(4e-3, 0.07, 0.0), (4e-3, 0.007, 4e-3), (30e-3, 0.07, 30e-3)]
)
def test_a_peak_that_comes_late_by_a_share_of_its_time_is_no_time_origin(
    late: float, peak: float, shift: float
) -> None:
    """A wrong speed moves the head's impact in a crash, long after first contact."""

    def felt(time: NDArray[np.float64]) -> NDArray[np.float64]:
        # The body is pushed from the beginning; the head strikes at the peak.
        pushed = 10.0 * np.clip(time / 1e-3, 0.0, 1.0) * (time < peak + 0.01)
        return pushed + 90.0 * np.exp(-0.5 * ((time - peak) / 1e-3) ** 2)

    time = np.arange(0.0, 0.15, 1e-4)
    test = Test(
        "c1", {}, {}, (Signal("head_acceleration", time, felt(time - late), 1.0),), (), (), {}
    )
    found = lay_out(test, Observation({"head_acceleration": (time, felt(time))}, {}))
    assert found.shift == pytest.approx(shift, abs=2e-4)
