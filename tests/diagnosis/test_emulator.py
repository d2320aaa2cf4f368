"""Quadratic surfaces of accidents, against functions that are quadratic."""

import numpy as np
import pytest
from linear_tests import BUMP

from mcstudy.diagnosis.problem import Problem, Scalar, Test
from studies.diagnosis.accidents import Surfaces
from studies.diagnosis.emulator import (
    Change,
    Emulator,
    Scaling,
    Surface,
    change_terms,
    fit_terms,
    fit_widening,
    quadratic_terms,
    widening_terms,
)


def points(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((n, 2))


def truth(x: np.ndarray) -> np.ndarray:
    return 3.0 + 2.0 * x[:, 0] - x[:, 1] + 0.5 * x[:, 0] ** 2 - 0.3 * x[:, 0] * x[:, 1]


def test_a_quadratic_function_is_recovered() -> None:
    x = points(400)
    coefficients, left = fit_terms(quadratic_terms(x), truth(x)[:, None])
    assert np.abs(left).max() < 0.02
    new = points(50, 1)
    assert quadratic_terms(new) @ coefficients[:, 0] == pytest.approx(truth(new), abs=0.03)


def test_the_mean_is_not_drawn_towards_nothing() -> None:
    x = points(300)
    coefficients, _ = fit_terms(quadratic_terms(x), np.full((300, 1), 1000.0))
    assert coefficients[0, 0] == pytest.approx(1000.0)
    assert np.abs(coefficients[1:]).max() < 1e-6


def test_failed_runs_are_left_out() -> None:
    x = points(400)
    values = truth(x)[:, None]
    values[::7] = np.nan
    coefficients, left = fit_terms(quadratic_terms(x), values)
    assert np.isnan(left[::7]).all()
    assert np.isfinite(coefficients).all()
    assert np.nanmax(np.abs(left)) < 0.02


@pytest.mark.parametrize("centred", [True, False])
def test_a_change_adds_to_the_surface(centred: bool) -> None:
    """The change 2 z + 0.1 z^2 + 0.5 z x0, and beside it 4 where it is something at z = 0."""
    x, rng = points(400), np.random.default_rng(3)
    z = rng.uniform(-2.5, 2.5, (400, 1))
    always = 0.0 if centred else 4.0
    changed = always + 2.0 * z[:, 0] + 0.1 * z[:, 0] ** 2 + 0.5 * z[:, 0] * x[:, 0]
    coefficients, _ = fit_terms(change_terms(z, x, centred=centred), changed[:, None])
    base, _ = fit_terms(quadratic_terms(x), truth(x)[:, None])
    form = BUMP.forms[0]
    emulator = Emulator(
        "multibody", ["throw_distance"],
        Surface(
            Scaling(("a", "b"), np.zeros(2, bool), np.array([10.0, 5.0]), np.array([2.0, 1.0])),
            base,
        ),
        [Change(form, centred, coefficients, np.zeros((3, 1)))], ["throw_distance"],
    )  # fmt: skip
    at = np.array([[0.5, -1.0]])
    inputs = {"a": 11.0, "b": 4.0}
    plain = emulator(inputs, {})
    assert plain is not None
    assert plain.scalars["throw_distance"] == pytest.approx(truth(at)[0], abs=0.05)
    name = form.free[0].name
    seen = emulator(inputs, {form.cause: {name: 1.5}})
    assert seen is not None
    difference = seen.scalars["throw_distance"] - plain.scalars["throw_distance"]
    assert difference == pytest.approx(always + 3.0 + 0.225 + 0.375, abs=0.1)
    # A cause that changes nothing of what is measured has no surface.
    unknown = emulator(inputs, {"another": {"size": 1.0}})
    assert unknown is not None
    assert unknown.scalars == plain.scalars


def test_a_power_law_of_positive_variables_is_straight() -> None:
    rng = np.random.default_rng(2)
    columns = {"speed": rng.uniform(7.0, 15.0, 300), "offset": rng.uniform(-0.5, 0.5, 300)}
    scaling = Scaling.of(columns, ("speed", "offset"))
    assert scaling.logarithmic.tolist() == [True, False]
    x = scaling.points(columns)
    assert x.mean(axis=0) == pytest.approx(0.0, abs=1e-12)
    assert x.std(axis=0) == pytest.approx(1.0)
    throw = 0.08 * columns["speed"] ** 1.9 * np.exp(0.2 * columns["offset"])
    coefficients, left = fit_terms(quadratic_terms(x), np.log(throw)[:, None])
    assert np.abs(left).max() < 1e-3
    assert np.abs(coefficients[3:]).max() < 1e-3


def test_few_parameters_have_a_cubic_change_and_many_a_quadratic_one() -> None:
    rng = np.random.default_rng(5)
    z, x = rng.standard_normal((120, 1)), rng.standard_normal((120, 2))
    bent = (0.3 * z[:, 0] ** 3 + z[:, 0] * x[:, 0] * x[:, 1])[:, None]
    _, left = fit_terms(change_terms(z, x, centred=True), bent)
    assert np.abs(left).max() < 0.05
    assert change_terms(rng.standard_normal((120, 4)), x, centred=True).shape[1] == 4 + 10 + 8


@pytest.mark.parametrize("growth", [0.0, 0.15])
def test_a_scatter_that_grows_with_a_cause_is_found(growth: float) -> None:
    """Deviations of the same runs, times exp(0.2 + growth z), beside deviations that stay."""
    rng = np.random.default_rng(11)
    z = rng.uniform(-3.0, 3.0, (240, 1))
    before = 0.06 * rng.standard_normal(240)
    before[::17] = np.nan
    level = 0.2 if growth else 0.0
    after = before * np.exp(level + growth * z[:, 0]) + 0.006 * rng.standard_normal(240)
    found = fit_widening(widening_terms(z), before, after)
    at = widening_terms(np.array([[-2.0], [0.0], [2.0]]))
    assert at @ found == pytest.approx(
        [level - 2.0 * growth, level, level + 2.0 * growth], abs=0.06
    )
    if not growth:
        assert not found.any()


def test_an_accident_of_another_kind_gets_no_weight_and_a_common_shift_takes_none() -> None:
    """Thirty wrap-around distances 20 % longer than the surface, and one of a third of it."""
    rng = np.random.default_rng(8)
    speed = rng.uniform(8.0, 14.0, 31)
    scaling = Scaling.of({"speed": speed}, ("speed",))
    surface = Surface(scaling, np.array([[np.log(1.5)], [0.02], [0.0]]))
    emulator = Emulator("multibody", ["log_wad"], surface, [], ["log_wad"])
    surfaces = Surfaces(emulator, {"log_wad": 0.03})
    tests = []
    for k, v in enumerate(speed):
        usual = np.exp(surface.coefficients[0, 0] + 0.02 * scaling.points({"speed": [v]})[0, 0])
        factor = 0.33 if k == 7 else 1.2 * np.exp(0.03 * rng.standard_normal())
        scalars = (Scalar("wad", usual * factor, 0.02),)
        tests.append(Test(f"a{k}", {"speed": v}, {}, (), scalars, (), {"order": float(k)}))
    problem = Problem(tuple(tests), (), emulator, {})
    assert surfaces.outlying(problem) == {"log_wad": ("a7",)}
    held = surfaces.problem_of(problem)
    assert [np.isfinite(t.scalars[0].sd) for t in held.tests] == [k != 7 for k in range(31)]
    assert held.tests[0].scalars[0].value == pytest.approx(np.log(tests[0].scalars[0].value))
