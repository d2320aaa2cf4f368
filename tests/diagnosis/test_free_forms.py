"""Free forms and trends of causes, against named forms, closed forms and importance sampling."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.special import logsumexp

from mcstudy.diagnosis.base_model import fit_base
from mcstudy.diagnosis.fit import Fit, fit
from mcstudy.diagnosis.jacobian import expand_tests, observe_tests
from mcstudy.diagnosis.layout import Layout
from mcstudy.diagnosis.model_selection import DISTINCT
from mcstudy.diagnosis.normal_equations import NormalEquations, Scores
from mcstudy.diagnosis.problem import Cause, Form, Problem
from mcstudy.diagnosis.trends import add_trends
from mcstudy.measurement.measured_data import load_measured
from studies.diagnosis.causes import causes_of
from studies.diagnosis.model_choice import choose_model
from studies.diagnosis.posterior import describe, describe_trends
from studies.diagnosis.problem import build_problem
from studies.diagnosis.study import simulation_of
from studies.validation.diagnosis.hidden_effects import make_tests
from studies.validation.diagnosis.laboratory import Hidden, Laboratory

Array = NDArray[np.float64]


def problem_of(folder: Path, hidden: list[Hidden], tests: int, seed: int = 3) -> Problem:
    make_tests(folder, hidden, seed, Laboratory(tests=tests))
    data = load_measured(folder)
    choice = choose_model(data, None)
    return build_problem(data, choice, simulation_of(data, choice))


def cause_of(name: str, problem: Problem) -> Cause:
    causes = [c for c in causes_of("headform") if c.name == name]
    return add_trends(causes, problem.tests)[0]


def form_of(name: str, form: str, problem: Problem) -> Form:
    return next(f for f in cause_of(name, problem).forms if f.name == form)


def fit_form(problem: Problem, form: Form) -> tuple[tuple[Layout, ...], Fit]:
    layouts, base = fit_base(problem)
    shared = np.concatenate([base.scores.shared, np.zeros(form.size)])
    start = Scores(shared, base.scores.own)
    fitted = fit(problem, layouts, (form,), start, base.scatter)
    # Latents of a table trade against each other: a fit takes more than one round of steps.
    for _ in range(3):
        fitted = fit(problem, layouts, (form,), fitted.scores, base.scatter)
    return layouts, fitted


def loss(problem: Problem, layouts: tuple[Layout, ...], fitted: Fit, shared: Array) -> float:
    """Return the negative log posterior of shared latents, nuisances integrated out."""
    own = fitted.scores.own
    for _ in range(3):
        scores = Scores(shared, own)
        seen = observe_tests(problem, fitted.forms, layouts, scores)
        assert seen is not None
        residuals, slopes = expand_tests(layouts, seen, scores, fitted.slopes, fitted.scatter)
        equations = NormalEquations(slopes, [np.zeros((r.size, 0)) for r in residuals])
        value = 0.5 * sum(float(r @ r) for r in residuals) + 0.5 * sum(float(z @ z) for z in own)
        step = equations.solve(residuals, Scores(np.zeros(0), own))
        own = tuple(z + d for z, d in zip(own, step.move.own, strict=True))
    return value + 0.5 * float(shared @ shared) + 0.5 * equations.log_determinant


@pytest.mark.parametrize(
    ("cause", "form", "hidden"),
    [
        ("rate_dependent_hood", "free_form", Hidden("rate_dependent_hood", "ramped",
                                                    {"damping": 60.0, "ramp": 0.006})),
        ("sensor_gain", "sensor_gain with order", Hidden("sensor_gain", "warming",
                                                         {"change": 0.06})),
    ],
)  # fmt: skip
def test_evidence_by_laplace_agrees_with_importance_sampling(
    cause: str, form: str, hidden: Hidden, tmp_path: Path
) -> None:
    problem = problem_of(tmp_path / "tests", [hidden], 6)
    layouts, fitted = fit_form(problem, form_of(cause, form, problem))
    # Heavier tails than the normal approximation.
    proposal = stats.multivariate_t(fitted.scores.shared, fitted.covariance, df=6.0)
    draws = proposal.rvs(400, random_state=1)
    logs = [-loss(problem, layouts, fitted, z) - proposal.logpdf(z) for z in draws]
    normaliser = 0.5 * fitted.scores.shared.size * np.log(2.0 * np.pi)
    sampled = logsumexp(logs) - np.log(len(logs)) - normaliser
    # Half of the difference from which causes count as distinct.
    assert sampled == pytest.approx(fitted.log_evidence, abs=0.5 * DISTINCT)


def test_a_drift_is_fitted_along_the_order_of_the_tests(tmp_path: Path) -> None:
    hidden = Hidden("sensor_gain", "warming", {"change": 0.06})
    problem = problem_of(tmp_path / "tests", [hidden], 8)
    form = form_of("sensor_gain", "sensor_gain with order", problem)
    _, fitted = fit_form(problem, form)
    trend = describe_trends(problem, fitted)["sensor_gain"]
    # From 1 to 1.057, the larger part of it over the first tests.
    assert trend["covariate"] == "order"
    assert 0.03 < trend["last"] - trend["first"] < 0.075
    # Of a single test the change counts as spread.
    (row,) = describe(problem, fitted)["sensor_gain"]
    assert row["high"] - row["low"] > trend["last"] - trend["first"]


def test_trends_follow_what_varies(tmp_path: Path) -> None:
    problem = problem_of(tmp_path / "tests", [], 4)
    assert {f.name for f in cause_of("speed_bias", problem).forms} == {
        "factor", "offset", "factor with order", "factor with impact_speed",
    }  # fmt: skip
    form = form_of("speed_bias", "factor with impact_speed", problem)
    slow, fast = sorted(problem.tests, key=lambda test: test.inputs["impact_speed"])[::3]
    assert form.values([0.0, 1.0], slow)["factor"] < 1.0 < form.values([0.0, 1.0], fast)["factor"]
    assert form.values([0.0, 1.0]) == form.values([0.0, 0.0], slow)
    assert form.values([0.0, 0.0], slow) == {"factor": 1.0, "offset": 0.0}
    same = [t for t in problem.tests[:1] for _ in range(3)]
    (cause,) = add_trends([c for c in causes_of("headform") if c.name == "speed_bias"], same)
    assert len(cause.forms) == 2
