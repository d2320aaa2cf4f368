"""Failed runs: counted, and found where they were planted."""

import json

import numpy as np
import pandas as pd
import pytest
from mcstudy_tools import generator
from numpy.testing import assert_allclose, assert_array_equal

from mcstudy.execution.failures import PARTS, Failures, endings, locate_failures
from mcstudy.execution.results import to_json
from mcstudy.typed_json import from_plain

TEN = "abcdefghij"
SEEDS = [20, pytest.param(100, marks=pytest.mark.slow)]


def table(n: int, seed: int = 0, columns: str = "abc") -> pd.DataFrame:
    """Return uniform inputs."""
    return pd.DataFrame(generator(seed).random((n, len(columns))), columns=list(columns))


@pytest.mark.parametrize("n", [0, 1, 50])
def test_without_failures_there_is_nothing_to_locate(n: int) -> None:
    found = locate_failures(table(n), np.zeros(n, dtype=bool))
    assert found == Failures(runs=0, share=0.0, blocks=0, where={}, map={})


@pytest.mark.parametrize(("block", "hit"), [(1, 5), (4, 3), (10, 2), (40, 1)])
def test_failures_are_counted_by_run_and_by_block(block: int, hit: int) -> None:
    found = locate_failures(table(40), np.isin(np.arange(40), [0, 1, 3, 4, 17]), block)
    assert (found.runs, found.blocks) == (5, hit)
    assert found.share == pytest.approx(5 / 40)
    assert from_plain(Failures, json.loads(to_json(found))) == found


def test_if_all_runs_or_one_fail_no_place_is_worse_than_another() -> None:
    found = locate_failures(table(200), np.ones(200, dtype=bool))
    assert (found.share, found.where) == (1.0, {})
    assert_array_equal(list(found.map.values()), np.ones((3, PARTS)))
    for row in range(50):
        assert locate_failures(table(50), np.arange(50) == row).where == {}


def test_the_map_shows_a_planted_corner() -> None:
    inputs = table(5000, seed=1)
    failed = ((inputs["a"] > 0.9) & (inputs["b"] < 0.5)).to_numpy()
    a, b, c = (np.array(shares) for shares in locate_failures(inputs, failed).map.values())
    # Half of the last tenth of a, none before; a tenth of each lower tenth of b; a twentieth of c.
    # Shares of 500 runs scatter by up to 0.022.
    assert_allclose(a[:8], 0.0)
    assert a[8] < 0.05
    assert a[9] == pytest.approx(0.5, abs=0.07)
    assert_allclose(b[:4], 0.1, atol=0.055)
    assert_allclose(b[6:], 0.0)
    assert_allclose(c, 0.05, atol=0.045)
    assert c.shape == (PARTS,)


@pytest.mark.parametrize("n", [10, 100, 1000])
def test_the_map_of_a_planted_tenth_is_that_tenth(n: int) -> None:
    # Parts of equal counts: the lowest tenth of the runs is the first part and no other.
    inputs = pd.DataFrame({"a": np.arange(float(n))})
    for part in range(PARTS):
        found = locate_failures(inputs, np.arange(n) * PARTS // n == part)
        assert_allclose(found.map["a"], np.arange(PARTS) == part)


def test_what_is_found_depends_on_ranks_and_not_on_units() -> None:
    inputs = table(300)
    failed = (inputs["a"] > 0.8).to_numpy()
    assert locate_failures(inputs, failed) == locate_failures(np.exp(5.0 * inputs), failed)


@pytest.mark.parametrize("block", [1, 7])
def test_failures_at_an_end_in_the_middle_or_in_a_corner_are_located(block: int) -> None:
    inputs = table(2100, seed=2)
    b, from_middle = inputs["b"].to_numpy(), np.abs(inputs["a"] - 0.5).to_numpy()
    # The mean rank of the outer twentieth is 0.025 or 0.975.
    for failed, place, rank in ((b < 0.05, "low", 0.025), (b > 0.95, "high", 0.975)):
        entry = locate_failures(inputs, failed, block).where["b"]
        assert (entry.place, entry.mean_rank) == (place, pytest.approx(rank, abs=0.005))
    if block == 1:
        assert locate_failures(inputs, from_middle > 0.45).where["a"].place == "ends"
        assert locate_failures(inputs, from_middle < 0.45).where["a"].place == "middle"
        # Uniform over the outer three tenths of two inputs: mean ranks 0.85 and 0.15.
        corner = ((inputs["a"] > 0.7) & (inputs["c"] < 0.3)).to_numpy()
        where = locate_failures(inputs, corner).where
        ranks = [where[name].mean_rank for name in "ac"]
        assert ranks == pytest.approx([0.85, 0.15], abs=0.02)


@pytest.mark.parametrize("seeds", SEEDS)
@pytest.mark.parametrize("share", [0.01, 0.1, 0.5])
def test_evenly_spread_failures_are_rarely_located(share: float, seeds: int) -> None:
    # Two tests at 2.5 standard errors: 1 in 40 inputs by chance. 1,000 of them scatter by 0.005.
    flagged = [
        len(locate_failures(table(300, seed, TEN), generator(900 + seed).random(300) < share).where)
        for seed in range(seeds)
    ]
    more = np.sqrt(100 / seeds)
    assert np.mean(flagged) / 10.0 <= 0.025 + 4.0 * 0.005 * more
    if share <= 0.1:
        # Where few fail, ranks of failed runs are nearly independent.
        assert np.mean(flagged) / 10.0 >= 0.025 - 4.0 * 0.005 * more


@pytest.mark.parametrize("seeds", SEEDS)
def test_failures_of_whole_blocks_count_once(seeds: int) -> None:
    # Rows of a block are copies of one point: ten failed rows of it say no more than one.
    flagged, naive = 0, 0
    for seed in range(seeds):
        rng = generator(seed)
        inputs = pd.DataFrame(np.repeat(rng.random((60, 10)), 10, axis=0), columns=list(TEN))
        failed = np.repeat(rng.random(60) < 0.2, 10)
        found = locate_failures(inputs, failed, 10)
        assert (found.blocks, found.runs) == (failed[::10].sum(), failed.sum())
        flagged += len(found.where)
        naive += len(locate_failures(inputs, failed).where)
    # 1,000 inputs at 1 in 22 scatter by 7 about 46.
    assert flagged <= 0.46 * seeds + 28 * np.sqrt(seeds / 100)
    assert naive > 3 * flagged


def test_an_input_of_one_value_is_not_located() -> None:
    inputs = pd.DataFrame({"a": np.full(100, 3.0), "b": np.arange(100.0)})
    assert list(locate_failures(inputs, np.arange(100) < 10).where) == ["b"]


def test_runs_without_a_reason_beside_runs_with_one_are_counted() -> None:
    # Two tables joined, of which one has no column of reasons.
    runs = pd.DataFrame({"status": ["failed", "failed", "ok"], "reason": [None, None, ""]})
    found = endings(runs, {"ok"})
    assert [(row.status, row.runs, row.reason) for row in found] == [
        ("failed", 2, ""), ("ok", 1, ""),
    ]  # fmt: skip
