"""Speed of the Sobol' estimator beside SALib's on equal samples; run with ``make benchmark``.

No assertion here is timed. The ratio of the two is printed at the end of the module.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from SALib.analyze import sobol as salib_sobol

from mcstudy.sensitivity.sobol import estimate_indices, split_blocks

INPUTS, POINTS, OUTPUTS, RESAMPLES = 14, 1024, 24, 1000
medians: dict[str, float] = {}


@pytest.fixture(scope="module", autouse=True)
def ratio() -> Iterator[None]:
    yield
    if {"points", "scrambles", "salib"} <= set(medians):
        theirs = OUTPUTS * medians["salib"]
        for name in ("points", "scrambles"):
            print(
                f"\n{OUTPUTS} outputs, {INPUTS} inputs, {POINTS} base points, {RESAMPLES} "
                f"resamples of {name}: ours {medians[name]:.3f} s, SALib {theirs:.1f} s "
                f"({OUTPUTS} times one output), ratio {theirs / medians[name]:.0f}"
            )


@pytest.fixture(scope="module")
def outputs() -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.random.default_rng(0).normal(size=(POINTS * (INPUTS + 2), OUTPUTS))


@pytest.mark.parametrize("name", ["points", "scrambles"])
def test_all_outputs_at_once(
    benchmark: Any, outputs: np.ndarray[Any, np.dtype[np.float64]], name: str
) -> None:
    blocks = split_blocks(outputs, INPUTS, second_order=False)
    replicate = np.arange(POINTS) % 16 if name == "scrambles" else None
    found = benchmark(estimate_indices, blocks, replicate, resamples=RESAMPLES)
    assert found.total.shape == (3, INPUTS, OUTPUTS)
    if benchmark.stats:
        medians[name] = float(benchmark.stats.stats.median)


def test_one_output_by_salib(
    benchmark: Any, outputs: np.ndarray[Any, np.dtype[np.float64]]
) -> None:
    problem = {
        "num_vars": INPUTS,
        "names": [f"x{k}" for k in range(INPUTS)],
        "bounds": [[0.0, 1.0]] * INPUTS,
    }
    found = benchmark(
        salib_sobol.analyze, problem, outputs[:, 0], calc_second_order=False,
        num_resamples=RESAMPLES,
    )  # fmt: skip
    assert found["ST"].shape == (INPUTS,)
    if benchmark.stats:
        medians["salib"] = float(benchmark.stats.stats.median)
