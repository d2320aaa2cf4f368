"""Jumps of a model's scalars between neighbouring inputs.

A body that tumbles over the road lands on another limb for a slightly higher speed, and its throw
distance jumps. A fit cannot follow that: the jumps count as an uncertainty of the scalar.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mcstudy.diagnosis.problem import Observation, Problem, Test
from mcstudy.studyfile.input_space import value_at

STEP = 0.5
"""Latents between the three runs of which the second difference is taken."""
NEGLIGIBLE = 0.1
"""Roughness over the stated deviation below which it is left out."""


def measure_roughness(problem: Problem, nominal: Mapping[str, Observation]) -> dict[str, float]:
    """Return the standard deviation of the jumps of each scalar, by name.

    The second difference of a smooth output over half a standard deviation of what is uncertain is
    small; of independent jumps its variance is six times theirs.

    Parameters
    ----------
    problem : Problem
    nominal : mapping of str to Observation
        Simulated tests at the recorded inputs and the prior medians, by test.
    """
    squares: dict[str, list[float]] = {}
    for test in problem.tests:
        middle = nominal[test.name]
        for pair in _neighbours(problem, test):
            seen = [problem.simulate(inputs, {}) for inputs in pair]
            if any(entry is None for entry in seen):
                continue
            for scalar in test.scalars:
                outer = sum(entry.scalars[scalar.name] for entry in seen if entry is not None)
                second = outer - 2.0 * middle.scalars[scalar.name]
                squares.setdefault(scalar.name, []).append(second**2 / 6.0)
    return {name: float(np.sqrt(np.mean(values))) for name, values in squares.items()}


def _neighbours(problem: Problem, test: Test) -> list[list[dict[str, float]]]:
    """Return pairs of inputs on both sides of a test's, one for each value that is uncertain."""
    inputs = problem.nominal_inputs(test)
    pairs = []
    for name, sd in test.doubtful.items():
        low, high = problem.ranges[name]
        ends = (min(max(inputs[name] + side * STEP * sd, low), high) for side in (1.0, -1.0))
        pairs.append([inputs | {name: end} for end in ends])
    for unknown in problem.unknowns:
        ends = (value_at(unknown.prior, side * STEP) for side in (1.0, -1.0))
        pairs.append([inputs | {unknown.name: end} for end in ends])
    return pairs


def widen(test: Test, roughness: Mapping[str, float]) -> Test:
    """Return a test whose scalars are as uncertain as measurement and model together.

    Parameters
    ----------
    test : Test
    roughness : mapping of str to float
        From ``measure_roughness``.
    """
    scalars = []
    for scalar in test.scalars:
        own = roughness.get(scalar.name, 0.0)
        if own <= NEGLIGIBLE * scalar.sd:
            scalars.append(scalar)
        else:
            scalars.append(replace(scalar, sd=float(np.hypot(scalar.sd, own)), roughness=own))
    return replace(test, scalars=tuple(scalars))
