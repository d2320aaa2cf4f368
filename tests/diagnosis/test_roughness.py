"""A scalar that jumps between neighbouring inputs: measured, and no obstacle to a fit."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from linear_tests import Linear, make_problem

from mcstudy.diagnosis.base_model import fit_base
from mcstudy.diagnosis.problem import Observation, Problem, Scalar
from mcstudy.diagnosis.roughness import measure_roughness, widen

JUMPS = 0.4


class Jumping(Linear):
    """The linear model with a throw of 2 m per scale that jumps, and a smooth height."""

    def __call__(
        self, inputs: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]
    ) -> Observation | None:
        found = super().__call__(inputs, effects)
        assert found is not None
        speed, scale = inputs["impact_speed"], inputs["scale"]
        # Independent of the jump of any other input, and the same again for the same one.
        place = float(np.sin(12.9898 * speed + 78.233 * scale) * 43758.5453)
        jump = np.sqrt(12.0) * JUMPS * (place % 1.0 - 0.5)
        return replace(found, scalars={"throw": 2.0 * scale + jump, "height": speed})


def jumping_problem(seed: int) -> Problem:
    problem = replace(make_problem(seed), simulate=Jumping(), dear=True)
    true = float(np.random.default_rng(seed).standard_normal())
    rng = np.random.default_rng([seed, 1])
    tests = tuple(
        replace(
            test,
            scalars=(
                Scalar("throw", 2.0 * true + np.hypot(0.3, JUMPS) * rng.standard_normal(), 0.3),
                Scalar("height", test.inputs["impact_speed"], 0.1),
            ),
        )
        for test in problem.tests
    )
    return replace(problem, tests=tests)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_jumps_are_measured_and_a_smooth_scalar_has_none(seed: int) -> None:
    problem = jumping_problem(seed)
    nominal = {}
    for test in problem.tests:
        seen = problem.simulate(dict(test.inputs) | {"scale": 0.0}, {})
        assert seen is not None
        nominal[test.name] = seen
    found = measure_roughness(problem, nominal)
    # From 24 second differences, of which pairs share their middle.
    assert found["throw"] == pytest.approx(JUMPS, rel=0.35)
    assert found["height"] < 1e-6
    throw, height = widen(problem.tests[0], found).scalars
    assert throw.sd == pytest.approx(np.hypot(0.3, found["throw"]))
    assert (height.sd, height.roughness) == (0.1, 0.0)


def test_fits_of_jumping_scalars_are_as_far_from_the_truth_as_they_say() -> None:
    """Eight fits; taken at face value the jumps lead them two standard deviations astray."""
    distances = []
    for seed in range(1, 9):
        layouts, base = fit_base(jumping_problem(seed))
        true = float(np.random.default_rng(seed).standard_normal())
        distances.append((base.scores.shared[0] - true) / np.sqrt(base.covariance[0, 0]))
        assert all(layout.test.scalars[0].roughness > 0.0 for layout in layouts)
    assert np.sqrt(np.mean(np.square(distances))) < 1.5
