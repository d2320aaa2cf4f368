"""Failed runs: counted, and found where they were planted."""

import json

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from mcstudy.execution.failures import PARTS, locate_failures

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def table(n: int, seed: int = 0, columns: str = "abc") -> pd.DataFrame:
    """Return uniform inputs."""
    return pd.DataFrame(
        np.random.default_rng(seed).random((n, len(columns))), columns=list(columns)
    )


# -- counting --------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 1, 50])
def test_without_failures_there_is_nothing_to_locate(n: int) -> None:
    found = locate_failures(table(n), np.zeros(n, dtype=bool))
    assert found == {"runs": 0, "share": 0.0, "blocks": 0, "where": {}, "map": {}}


@pytest.mark.parametrize(("block", "hit"), [(1, 5), (4, 3), (10, 2), (40, 1)])
def test_failures_are_counted_by_run_and_by_block(block: int, hit: int) -> None:
    failed = np.zeros(40, dtype=bool)
    failed[[0, 1, 3, 4, 17]] = True
    found = locate_failures(table(40), failed, block)
    assert found["runs"] == 5
    assert found["share"] == pytest.approx(5 / 40)
    assert found["blocks"] == hit


def test_if_all_runs_fail_no_place_is_worse_than_another() -> None:
    found = locate_failures(table(200), np.ones(200, dtype=bool))
    assert found["share"] == 1.0
    assert found["where"] == {}
    for shares in found["map"].values():
        np.testing.assert_array_equal(shares, 1.0)


# -- the map ---------------------------------------------------------------------------------


def test_the_map_shows_a_planted_corner() -> None:
    inputs = table(5000, seed=1)
    failed = ((inputs["a"] > 0.9) & (inputs["b"] < 0.5)).to_numpy()
    found = locate_failures(inputs, failed)
    a, b, c = (np.array(found["map"][name]) for name in "abc")
    assert a.shape == b.shape == c.shape == (PARTS,)
    # Half of the last tenth of a, none before; a tenth of each lower tenth of b; a twentieth of c.
    # Shares of 500 runs scatter by up to 0.022.
    np.testing.assert_allclose(a[:8], 0.0)
    assert a[8] < 0.05
    assert a[9] == pytest.approx(0.5, abs=0.07)
    np.testing.assert_allclose(b[:4], 0.1, atol=0.055)
    np.testing.assert_allclose(b[6:], 0.0)
    np.testing.assert_allclose(c, 0.05, atol=0.045)


@pytest.mark.parametrize("n", [10, 100, 1000])
def test_the_map_of_a_planted_tenth_is_that_tenth(n: int) -> None:
    # Parts of equal counts: the lowest tenth of the runs is the first part and no other.
    inputs = pd.DataFrame({"a": np.arange(float(n))})
    for part in range(PARTS):
        failed = np.arange(n) * PARTS // n == part
        found = locate_failures(inputs, failed)
        np.testing.assert_allclose(found["map"]["a"], np.arange(PARTS) == part)


def test_the_map_depends_on_ranks_and_not_on_units() -> None:
    inputs = table(300)
    failed = (inputs["a"] > 0.8).to_numpy()
    scaled = pd.DataFrame({name: np.exp(5.0 * inputs[name]) for name in inputs.columns})
    assert locate_failures(inputs, failed) == locate_failures(scaled, failed)


def test_shares_of_the_map_add_up_to_the_failures() -> None:
    # Over parts of 100 runs each the shares average to the share of all, within the border runs.
    inputs, failed = table(1000), np.random.default_rng(5).random(1000) < 0.2
    for shares in locate_failures(inputs, failed)["map"].values():
        assert np.mean(shares) == pytest.approx(failed.mean(), abs=0.005)


# -- where -----------------------------------------------------------------------------------


@pytest.mark.parametrize("block", [1, 7])
@pytest.mark.parametrize("end", ["low", "high"])
def test_failures_at_one_end_of_an_input_are_located(end: str, block: int) -> None:
    inputs = table(2100, seed=2)
    b = inputs["b"].to_numpy()
    failed = b < 0.05 if end == "low" else b > 0.95
    found = locate_failures(inputs, failed, block)
    # The mean rank of the outer twentieth is 0.025 or 0.975.
    assert found["where"]["b"]["place"] == end
    assert found["where"]["b"]["mean_rank"] == pytest.approx(
        0.025 if end == "low" else 0.975, abs=0.005
    )


def test_every_input_that_failures_follow_is_located() -> None:
    inputs = table(4000, seed=3)
    failed = ((inputs["a"] > 0.7) & (inputs["c"] < 0.3)).to_numpy()
    where = locate_failures(inputs, failed)["where"]
    # Uniform over the outer three tenths: mean ranks 0.85 and 0.15.
    assert where["a"]["mean_rank"] == pytest.approx(0.85, abs=0.02)
    assert where["c"]["mean_rank"] == pytest.approx(0.15, abs=0.02)


def test_failures_at_both_ends_are_not_spread_evenly() -> None:
    inputs = table(2000, seed=4)
    failed = (np.abs(inputs["a"] - 0.5) > 0.45).to_numpy()
    assert locate_failures(inputs, failed)["where"]["a"]["place"] == "ends"
    assert locate_failures(inputs, ~failed)["where"]["a"]["place"] == "middle"


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5])
def test_evenly_spread_failures_are_rarely_located(share: float) -> None:
    # Two tests at 2.5 standard errors: 1 in 40 inputs by chance. 1,000 of them scatter by 0.005.
    flagged = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        inputs = table(300, seed, "abcdefghij")
        failed = rng.random(300) < share
        flagged.append(len(locate_failures(inputs, failed)["where"]) / 10.0)
    assert np.mean(flagged) <= 0.025 + 4.0 * 0.005
    if share <= 0.1:
        # Where few fail, ranks of failed runs are nearly independent.
        assert np.mean(flagged) >= 0.005


def test_failures_of_whole_blocks_count_once() -> None:
    # Rows of a block are copies of one point: ten failed rows of it say no more than one.
    flagged, naive = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        points = rng.random((60, 10))
        inputs = pd.DataFrame(np.repeat(points, 10, axis=0), columns=list("abcdefghij"))
        failed = np.repeat(rng.random(60) < 0.2, 10)
        found = locate_failures(inputs, failed, 10)
        assert found["blocks"] == failed[::10].sum()
        assert found["runs"] == failed.sum()
        flagged.append(len(found["where"]))
        naive.append(len(locate_failures(inputs, failed)["where"]))
    # 1,000 inputs at 1 in 22 scatter by 7 about 46.
    assert sum(flagged) <= 46 + 28
    assert sum(naive) > 3 * sum(flagged)


def test_one_failure_is_no_pattern() -> None:
    for row in range(50):
        assert locate_failures(table(50), np.arange(50) == row)["where"] == {}


def test_an_input_of_one_value_is_not_located() -> None:
    inputs = pd.DataFrame({"a": np.full(100, 3.0), "b": np.arange(100.0)})
    found = locate_failures(inputs, np.arange(100) < 10)
    assert list(found["where"]) == ["b"]


def test_what_is_found_can_be_written_as_json() -> None:
    inputs = table(100)
    found = locate_failures(inputs, (inputs["a"] < 0.2).to_numpy(), 4)
    assert json.loads(json.dumps(found)) == found
