"""Blocks of a design: whole or lost, output by output."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from mcstudy.sensitivity.blocks import (
    FEWEST_BLOCKS,
    MOST_DROPPED,
    is_enough,
    outputs_alike,
    whole_blocks,
)

Flags = NDArray[np.bool_]

QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=50)


def test_runs_are_cut_into_blocks_in_their_order() -> None:
    outputs = np.arange(24.0).reshape(12, 2)
    cube, kept = whole_blocks(outputs, np.ones(12, dtype=bool), 4)
    assert cube.shape == (3, 4, 2)
    np.testing.assert_array_equal(cube[1], outputs[4:8])
    assert kept.shape == (3, 2)
    assert kept.all()


@pytest.mark.parametrize("row", range(12))
def test_a_failed_run_loses_its_block_for_every_output(row: int) -> None:
    complete = np.arange(12) != row
    # A failed run may leave a value behind: it counts no more than the others of its block.
    kept = whole_blocks(np.ones((12, 3)), complete, 4)[1]
    expected = np.arange(3) != row // 4
    np.testing.assert_array_equal(kept, np.tile(expected, (3, 1)).T)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("row", [0, 5, 11])
def test_a_missing_value_loses_its_block_for_its_output_alone(row: int, bad: float) -> None:
    outputs = np.ones((12, 3))
    outputs[row, 1] = bad
    kept = whole_blocks(outputs, np.ones(12, dtype=bool), 4)[1]
    np.testing.assert_array_equal(kept[:, 1], np.arange(3) != row // 4)
    assert kept[:, [0, 2]].all()


@QUIET
@given(st.data(), st.integers(1, 6), st.integers(1, 8), st.integers(1, 4))
def test_a_block_is_kept_if_all_its_rows_are_good(
    data: st.DataObject, n: int, block: int, m: int
) -> None:
    complete = data.draw(hnp.arrays(bool, n * block))
    outputs = data.draw(
        hnp.arrays(float, (n * block, m), elements=st.sampled_from([0.0, 1.0, 2.0, np.nan]))
    )
    cube, kept = whole_blocks(outputs, complete, block)
    for k in range(n):
        rows = slice(k * block, (k + 1) * block)
        np.testing.assert_array_equal(cube[k], outputs[rows])
        for j in range(m):
            assert kept[k, j] == (complete[rows].all() and np.isfinite(outputs[rows, j]).all())


# -- enough ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kept", "of", "enough"),
    [
        (8, 8, True),
        (7, 7, False),
        (7, 8, False),
        (8, 10, True),
        (8, 11, False),
        (80, 100, True),
        (79, 100, False),
        (820, 1024, True),
        (819, 1024, False),
        (0, 0, False),
        (0, 100, False),
    ],
)  # fmt: skip
def test_eight_blocks_and_four_fifths_are_enough(kept: int, of: int, enough: bool) -> None:
    # The two assumptions of the module: at most a fifth dropped, at least eight left.
    assert (MOST_DROPPED, FEWEST_BLOCKS) == (0.2, 8)
    assert is_enough(np.arange(of) < kept) is enough


def test_exactly_a_fifth_may_be_dropped_whatever_the_rounding() -> None:
    for n in range(10, 5000, 5):
        assert is_enough(np.arange(n) < n // 5 * 4)
        assert not is_enough(np.arange(n) < n // 5 * 4 - 1)


def test_which_blocks_are_lost_does_not_matter() -> None:
    kept = np.ones(50, dtype=bool)
    kept[np.random.default_rng(1).permutation(50)[:10]] = False
    assert is_enough(kept)


# -- outputs that share their blocks ---------------------------------------------------------


@QUIET
@given(hnp.arrays(bool, st.tuples(st.integers(1, 12), st.integers(1, 6)), elements=st.booleans()))
def test_every_output_comes_once_with_its_own_blocks(kept: Flags) -> None:
    seen: list[int] = []
    patterns = []
    for pattern, columns in outputs_alike(kept):
        assert columns.size > 0
        patterns.append(tuple(pattern.tolist()))
        for column in columns.tolist():
            np.testing.assert_array_equal(kept[:, column], pattern)
            seen.append(column)
    assert sorted(seen) == list(range(kept.shape[1]))
    assert len(set(patterns)) == len(patterns)


def test_outputs_with_equal_blocks_come_together() -> None:
    kept = np.array([[1, 1, 0, 1], [0, 1, 1, 0], [1, 1, 1, 1]], dtype=bool)
    found = sorted(columns.tolist() for _, columns in outputs_alike(kept))
    assert found == [[0, 3], [1], [2]]
